"""Rows of CSV or JSON lines from pieces of text of any length; what cannot be read is left out and counted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.recordings.columns import Heading, headings
from clutchid.recordings.formats.csv.dialect import Dialect, dialect
from clutchid.recordings.formats.csv.fast import by_numpy, by_polars, is_plain
from clutchid.recordings.formats.csv.lines import Block
from clutchid.recordings.formats.csv.text import Part, joined, read_text
from clutchid.recordings.live.json_lines import keys_of, read_objects
from clutchid.recordings.source import Raster
from clutchid.recordings.table import EXAMPLE, Table

Mask = NDArray[np.bool_]

#: Lines at the start that determine the columns and how they are written: the same ones however the text is cut.
HEAD = 120

#: Bytes of the longest line.
LONGEST = 1 << 20

#: What stands for a line that is longer: it cannot be read either.
_TOO_LONG = b"?\n"

#: Lines from which on polars reads faster than NumPy.
_MANY = 400

_MARK = b"\xef\xbb\xbf"
_WIDE = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, eq=False, slots=True)
class TextRows:
    """Rows that arrived together, which of them could be read only in part, and the number of lines left out."""

    table: Table
    spoiled: Mask
    left_out: int


@dataclass(frozen=True, eq=False, slots=True)
class TextFeed:
    """A text whose first lines have arrived: its columns, and the function that reads some of them, from the start.

    `unnamed` says why it needs a channel map if its columns have no names.
    """

    format: str
    raster: Raster
    rows: Callable[[Sequence[int]], Iterator[TextRows]]
    unnamed: str = ""


def text_feed(pieces: Iterator[bytes], name: str) -> TextFeed:
    """CSV or JSON lines from pieces of any length; waits for the first `HEAD` lines, or the end.

    The function that reads the rows can be called once.

    Raises
    ------
    DataError
        If it is no text, or empty; the iterator of the rows raises it as well.
    """
    lines = _whole_lines(pieces, name)
    first, rest = _head(lines)
    if not first.strip():
        raise DataError(f"{name}: ended before the first sample; {EXAMPLE}")
    if first.lstrip().startswith(b"{"):
        keys = keys_of(first, name)
        columns = headings(keys)
        objects = _filled(first + rest, lines)
        return TextFeed(
            "JSON lines", _raster(columns), lambda chosen: (_objects(text, keys, columns, chosen) for text in objects)
        )
    found = dialect(first.decode().split("\n"))
    if found is None:
        raise DataError(f"{name}: has only comments; {EXAMPLE}")
    below = _cut(first, found.samples - 1)[1]
    unnamed = "" if found.header else f"the first line contains numbers; {EXAMPLE}"
    cells = _filled(below + rest, lines)
    return TextFeed(
        "CSV", _raster(found.headings), lambda chosen: (_cells(text, found, chosen) for text in cells), unnamed
    )


def _raster(columns: tuple[Heading, ...]) -> Raster:
    return Raster(columns, 0, clock=next((column.index for column in columns if column.name == "time"), None))


def _head(lines: Iterator[bytes]) -> tuple[bytes, bytes]:
    """The first `HEAD` lines, and what came with them."""
    text = b""
    for piece in lines:
        text += piece
        if text.count(b"\n") >= HEAD:
            break
    return _cut(text, HEAD)


def _cut(text: bytes, lines: int) -> tuple[bytes, bytes]:
    """The first lines of a text, and the others."""
    end = 0
    for _ in range(min(lines, text.count(b"\n"))):
        end = text.find(b"\n", end) + 1
    return text[:end], text[end:]


def _filled(first: bytes, others: Iterator[bytes]) -> Iterator[bytes]:
    """Blocks of whole lines that hold more than blanks."""
    if first.strip():
        yield first
    yield from (text for text in others if text.strip())


def _whole_lines(pieces: Iterator[bytes], name: str) -> Iterator[bytes]:
    """Whole lines in UTF-8 with line feeds; an unfinished line waits for its rest, and is dropped at the end.

    A line that is too long is `_TOO_LONG` instead, unless it is the first one.
    """
    kept, begun, any_, cutting = b"", False, False, False
    for piece in pieces:
        text = kept + piece
        if cutting:  # the rest of a line that was too long
            _, ended, text = text.partition(b"\n")
            cutting = not ended
        if not begun and len(text) >= len(_MARK):
            if text.startswith(_WIDE):
                raise DataError(f"{name}: is no text in UTF-8; send CSV or JSON lines, a sample a line.")
            text, begun = text.removeprefix(_MARK), True
        end = text.rfind(b"\n") + 1 if begun else 0
        kept = text[end:]
        if end:
            any_ = True
            yield _as_utf8(text[:end]).replace(b"\r\n", b"\n")
        if len(kept) > LONGEST:
            if not any_:
                raise DataError(
                    f"{name}: a line is longer than {LONGEST:,} bytes; send CSV or JSON lines, a sample a line."
                )
            kept, cutting = b"", True
            yield _TOO_LONG


def _as_utf8(text: bytes) -> bytes:
    try:
        text.decode()
    except UnicodeDecodeError:
        return text.decode("cp1252", errors="replace").encode()
    return text


def _objects(text: bytes, keys: Sequence[str], columns: tuple[Heading, ...], chosen: Sequence[int]) -> TextRows:
    numbers, spoiled, left_out = read_objects(text, [keys[index] for index in chosen])
    return TextRows(Table(columns, dict(zip(chosen, numbers, strict=True)), spoiled.size), spoiled, left_out)


def _cells(text: bytes, found: Dialect, chosen: Sequence[int]) -> TextRows:
    """The rows of a block of lines of CSV."""
    text, selected = text.rstrip() + b"\n", [found.headings[index] for index in chosen]
    block = Block(1, text, text.count(b"\n"))
    parts = [_fast(block, found, selected)]
    if parts[0] is None:  # one by one: a spoiled line must not take others with it
        parts = [read_text(Block(1, line, 1), found, selected) for line in text.splitlines(keepends=True)]
    whole = [part for part in parts if part is not None]
    part = joined(whole)
    ragged = sum(one.ragged_count + bool(one.broken) for one in whole)
    spoiled = np.zeros(part.size, dtype=bool)
    for rows in part.unread.values():
        spoiled[rows] = True
    return TextRows(Table(found.headings, part.numbers, part.size), spoiled, ragged)


def _fast(block: Block, found: Dialect, selected: Sequence[Heading]) -> Part | None:
    """The numbers by a fast parser; None if that cannot be, as a line is spoiled or has cells in quotes."""
    if b'"' in block.text or b"\0" in block.text or not is_plain(block, found):
        return None
    read = by_polars if block.lines >= _MANY else by_numpy
    return read(block, found, selected)

"""A recording that arrives as CSV or JSON lines: rows from pieces of text, to blocks in SI."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.measurements.checks import in_si
from clutchid.measurements.columns import Heading, headings
from clutchid.measurements.conversion import picked_values
from clutchid.measurements.formats.csv.dialect import Dialect, dialect
from clutchid.measurements.formats.csv.rows import TextReading
from clutchid.measurements.formats.csv.text import BOMS_UTF16, TextBlock
from clutchid.measurements.formats.json_lines import keys_of, read_objects
from clutchid.measurements.grids import columns_of_times, increase
from clutchid.measurements.live.arrival import LiveBlock, live_blocks
from clutchid.measurements.live.order import ArrivedBatch, arrived, by_position, picked_streams
from clutchid.measurements.map.channel_map import PickedChannels
from clutchid.measurements.source import EXAMPLE, Raster, Table
from clutchid.measurements.sparse import by_presence
from clutchid.messages import listed

if TYPE_CHECKING:
    from clutchid.measurements.map.channel_map import ChannelMap

Mask: TypeAlias = NDArray[np.bool_]

#: Lines at the start that determine the columns and how they are written: the same ones however the text is cut.
HEAD_LINES = 120

#: Bytes of the longest line.
LONGEST = 1 << 20

#: What the end of a line that is longer begins with: no cell, and no object.
_TOO_LONG = b"?"


@dataclass(frozen=True, eq=False, slots=True)
class TextRows:
    """Rows that arrived together, which of them could be read only in part, and the number of lines left out."""

    table: Table
    spoiled: Mask
    left_out: int


@dataclass(frozen=True, eq=False, slots=True)
class TextFeed:
    """A text whose first lines `head` have arrived: its columns, and the function that reads some of them.

    `texts` are the lines with samples from the start, as they arrive. `unnamed` says why it needs a channel map if its
    columns have no names.
    """

    raster: Raster
    head: bytes
    texts: Iterator[bytes]
    read: Callable[[bytes, Sequence[int]], TextRows]
    unnamed: str = ""

    def rows(self, chosen: Sequence[int]) -> Iterator[TextRows]:
        """The rows of some columns as they arrive, once."""
        return (self.read(text, chosen) for text in self.texts)


def text_feed(pieces: Iterator[bytes], name: str) -> TextFeed:
    """CSV or JSON lines from pieces of any length; waits for the first `HEAD_LINES` lines, or the end.

    Raises
    ------
    DataError
        If it is no text, or empty; its `texts` raise it as well.
    """
    lines = _whole_lines(pieces, name)
    first, rest = _head(lines)
    if not first.strip():
        raise DataError(f"{name}: ended before the first sample; {EXAMPLE}")
    if first.lstrip().startswith(b"{"):
        keys = keys_of(first, name)
        columns = headings(keys)
        objects = filter(bytes.strip, chain([first + rest], lines))
        return TextFeed(_raster(columns), first, objects, partial(_objects, keys, columns))
    notation = dialect(first.decode().split("\n"))
    if notation is None:
        raise DataError(f"{name}: has no table; {EXAMPLE}")
    if notation.problems:
        raise DataError(f"{name}: {notation.problems[0]}")
    below = _cut(first, notation.samples - 1)[1]
    unnamed = "" if notation.header else f"the first line contains numbers; {EXAMPLE}"
    cells = filter(bytes.strip, chain([below + rest], lines))
    return TextFeed(_raster(notation.headings), below, cells, partial(_cells, notation), unnamed)


def _raster(columns: tuple[Heading, ...]) -> Raster:
    return Raster(columns, 0, clock=next((column.index for column in columns if column.name == "time"), None))


def _head(lines: Iterator[bytes]) -> tuple[bytes, bytes]:
    """The first `HEAD_LINES` lines, and what came with them."""
    text = b""
    for piece in lines:
        text += piece
        if text.count(b"\n") >= HEAD_LINES:
            break
    return _cut(text, HEAD_LINES)


def _cut(text: bytes, lines: int) -> tuple[bytes, bytes]:
    """The first lines of a text, and the others."""
    rest = b"".join(text.split(b"\n", lines)[lines:])
    return text[: len(text) - len(rest)], rest


def _whole_lines(pieces: Iterator[bytes], name: str) -> Iterator[bytes]:
    """Whole lines in UTF-8 with line feeds; an unfinished line waits for its rest, and is dropped at the end.

    A line that is too long is the last part of it, after `_TOO_LONG`.
    """
    rest, begun, any_ = b"", False, False
    for piece in pieces:
        text = rest + piece
        if not begun and len(text) >= len(BOM_UTF8):
            if text.startswith(BOMS_UTF16):
                raise DataError(f"{name}: is not UTF-8 text; send CSV or JSON lines, one sample per line.")
            text, begun = text.removeprefix(BOM_UTF8), True
        end = text.rfind(b"\n") + 1 if begun else 0
        rest = text[end:]
        if end:
            any_ = True
            yield _as_utf8(text[:end]).replace(b"\r\n", b"\n")
        if len(rest) > LONGEST and not any_:
            raise DataError(
                f"{name}: a line is longer than {LONGEST:,} bytes; send CSV or JSON lines, one sample per line."
            )
        rest = rest if len(rest) <= LONGEST else _TOO_LONG + rest[-LONGEST // 2 :]


def _as_utf8(text: bytes) -> bytes:
    try:
        text.decode()
    except UnicodeDecodeError:
        return text.decode("cp1252", errors="replace").encode()
    return text


def _objects(keys: Sequence[str], columns: tuple[Heading, ...], text: bytes, chosen: Sequence[int]) -> TextRows:
    numbers, spoiled, left_out = read_objects(text, [keys[index] for index in chosen])
    return TextRows(Table(columns, dict(zip(chosen, numbers, strict=True)), spoiled.size), spoiled, left_out)


def _cells(notation: Dialect, text: bytes, chosen: Sequence[int]) -> TextRows:
    """The rows of a block of lines of CSV."""
    reading = TextReading(notation, [notation.headings[index] for index in chosen], small=True, by_line=True)
    text = text.rstrip() + b"\n"
    reading.add(TextBlock(1, text, text.count(b"\n")))
    left_out = len(reading.ragged) + len(reading.left_out)
    table = reading.table()
    spoiled = np.zeros(table.size, dtype=bool)
    for rows in table.unread.values():
        spoiled[rows] = True
    return TextRows(table, spoiled, left_out)


def text_blocks(
    pieces: Iterator[bytes],
    name: str,
    channels: ChannelMap | None,
    ambient: float,
    required: Sequence[str],
    *,
    origin: float | None = None,
) -> Iterator[LiveBlock]:
    """Blocks of a recording from pieces of text of any length, see `clutchid.measurements.live.arrival.live_blocks`.

    Parameters
    ----------
    name
        Of the recording.
    channels
        The channel map; without it the columns must have standard names.
    ambient : Pa
        Absolute pressure that is added to gauge pressures.
    required
        Quantities that the recording must have.
    origin : s
        The stamp that is the time 0 of a recording that goes on, None for 0.

    Raises
    ------
    DataError
        If it is no text, its columns do not fit, or it has no sample.
    """
    feed = text_feed(pieces, name)
    if channels is None and feed.unnamed:
        raise DataError(f"{name}: {feed.unnamed}")
    picks = picked_streams(name, [feed.raster], channels, required)
    chosen = sorted({index for pick in picks for index in pick.indices})
    owned = columns_of_times(feed.raster.headings)
    times = [time for time, columns in owned.items() if not set(columns).isdisjoint(chosen)]
    if feed.head.strip():
        first = feed.read(feed.head, sorted({*chosen, *times})).table
        _check_one_time(name, feed.raster, first, times)
        picks = by_position(grid for pick in picks for grid in by_presence(pick, first, _TELLING, _FEW))
    metadata = {"source": name, "ambient_Pa": repr(float(ambient))}
    batches = _batches(feed.rows(chosen), picks, ambient)
    yield from live_blocks(batches, picks, name, metadata, shift=-(origin or 0.0))


def _check_one_time(name: str, raster: Raster, first: Table, times: Sequence[int]) -> None:
    """Check that the time columns of the channels are the same: the channels of a row that arrives have one time."""
    stamps = [first.numbers[time] for time in times]
    if increase(first, times) and any(not np.array_equal(other, stamps[0], equal_nan=True) for other in stamps[1:]):
        texts = listed([repr(heading.text) for heading in raster.headings if heading.index in times])
        raise DataError(
            f"{name}: has a time for each of several channels: {texts}. On line a row has one time, and the cells of "
            "channels without a sample at that time stay empty; in a file all times are read."
        )


#: Rows that show whether a channel is sparse, which are there however the text is cut, and samples that it has in them.
_TELLING, _FEW = 100, 2


def _batches(every: Iterator[TextRows], picks: Sequence[PickedChannels], ambient: float) -> Iterator[ArrivedBatch]:
    """The picked channels of the rows, in SI; a row without a time cannot be read."""
    count = 0
    for rows in every:
        time = in_si(picks[0].columns["time"][0], picked_values(rows.table, picks[0], count)["time"], ambient)
        timed = np.isfinite(time)
        table = rows.table if timed.all() else rows.table.take(np.flatnonzero(timed))
        streams = [arrived(i, chosen, table, ambient, np.arange(table.size)) for i, chosen in enumerate(picks)]
        yield ArrivedBatch(time[timed], streams, rows.left_out + int((rows.spoiled | ~timed).sum()))
        count += rows.table.size

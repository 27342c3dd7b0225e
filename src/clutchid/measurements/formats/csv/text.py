"""Text of a table in any encoding, as blocks of whole lines in UTF-8 with line feeds."""

from __future__ import annotations

import codecs
import io
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

#: Bytes that are read at a time, and most of a block; a quote beyond these is a character.
CHUNK = 1 << 20
_MOST = 1 << 26

BOMS_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
ENCODINGS = {"utf-8": "UTF-8", "utf-16": "UTF-16", "cp1252": "Windows-1252"}
ENCODINGS |= dict.fromkeys(("utf-16-le", "utf-16-be"), "UTF-16 without a mark")
_CONTROL = bytes({*range(32), 127} - {9, 10, 11, 12, 13, 26})


@dataclass(frozen=True, slots=True)
class TextBlock:
    """Whole lines, but for the end of the last line of a file: number of the first one, text in UTF-8, their number."""

    first: int
    text: bytes
    lines: int


@dataclass(frozen=True, slots=True)
class TextFile:
    """A file of text: its encoding, and the number of its last line that is not blank."""

    path: Path
    encoding: str
    last: int

    def head(self, lines: int, size: int) -> list[str]:
        """The first lines, at most `size` bytes in total; a single line may be truncated.

        Raises
        ------
        OSError
            If the file cannot be read.
        """
        text = b""
        for piece in _pieces(self.path, self.encoding):
            text += piece
            if len(text) > size:
                text = text[: text.rfind(b"\n", 0, size) + 1] or text
                break
        return [line.decode("utf-8", "replace") for line in text.removesuffix(b"\n").split(b"\n", lines)[:lines]]

    def blocks(self, first: int, rows: int) -> Iterator[TextBlock]:
        """The lines from line `first` on, in blocks of at least `rows` lines, or fewer if they are long.

        A block goes on where it would end in a quoted cell.

        Raises
        ------
        OSError
            If the file cannot be read.
        """
        skip, number, lacking = first - 1, first, rows
        pending: list[bytes] = []
        for piece in chain(_pieces(self.path, self.encoding), [None]):
            begin = 0
            while piece and skip and (end := piece.find(b"\n", begin) + 1):
                begin, skip = end, skip - 1
            pending.append(piece[begin:] if piece and not skip else b"")
            lacking -= pending[-1].count(b"\n")
            size = sum(map(len, pending))
            if piece is not None and lacking > 0 and size < _MOST:
                continue
            text = b"".join(pending)
            end = text.rfind(b"\n") + 1 or len(text)
            if piece is None:
                end = text.find(b"\n", len(text.rstrip())) + 1 or len(text)
            count = text.count(b"\n", 0, end) + (text[end - 1 : end] != b"\n")
            pending, lacking = [text], 1
            if text.count(b'"', 0, end) % 2 == 0 or size >= _MOST or piece is None:
                if text[:end].strip():
                    yield TextBlock(number, text[:end], count)
                number, pending, lacking = number + count, [text[end:]], rows


def text_file(path: Path) -> TextFile | None:
    """The text of a file; None if it is neither UTF-8, UTF-16 nor Windows-1252.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        mark = file.read(4)
    for encoding in _encodings(mark):
        with suppress(UnicodeError):
            before = last = 0
            for piece in _pieces(path, encoding, strict=True):
                filled, lines = len(piece.rstrip()), piece.count(b"\n")
                last = before + lines - piece.count(b"\n", filled) + 1 if filled else last
                before += lines
            return TextFile(path, encoding, last)
    return None


def _encodings(mark: bytes) -> tuple[str, ...]:
    """The encodings that the first bytes of a file allow, in the order in which they are tried."""
    if mark == codecs.BOM_UTF32_LE:
        return ()
    if mark.startswith(BOMS_UTF16):
        return ("utf-16",)
    if len(mark) == len(b"t\0i\0") and 0 in mark and any(mark):  # UTF-16 without its mark
        return ("utf-16-le",) if mark[1] == mark[3] == 0 else ("utf-16-be",) if mark[0] == mark[2] == 0 else ()
    return ("utf-8", "cp1252")


def _pieces(path: Path, encoding: str, *, strict: bool = False) -> Iterator[bytes]:
    """The text of a file in UTF-8 with line feeds, piece by piece; plain pieces as they are.

    Raises
    ------
    UnicodeError
        If it is not in this encoding, where that is checked (`strict`); text in Windows-1252 has no control characters.
    """
    errors = "strict" if strict and encoding != "cp1252" else "replace"
    decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(encoding)(errors), translate=True)
    with path.open("rb") as file:
        if file.read(3) != codecs.BOM_UTF8 or encoding != "utf-8":
            file.seek(0)
        start = decoder.getstate()
        while raw := file.read(CHUNK):
            if strict and encoding == "cp1252" and len(raw.translate(None, _CONTROL)) < len(raw):
                raise UnicodeError("a control character")
            plain = encoding == "utf-8" and raw.isascii() and b"\r" not in raw and decoder.getstate() == start
            yield raw if plain else decoder.decode(raw).encode()
    yield decoder.decode(b"", final=True).encode()

"""Lines of a CSV file in any encoding, as blocks of UTF-8, and the cells of its header with units and comments.

Lines are joined to records where a cell in quotes contains line breaks.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path

from clutchid.log.units import UNITS
from clutchid.measurements.columns import Heading, channel, channel_name, headings, quantity_named, unit_spelled
from clutchid.measurements.formats.csv.cells import NUMBER

#: Units of other quantities, to distinguish a unit from a remark.
# fmt: off
_OTHER = frozenset((
    "N", "kN", "µN", "uN", "Nm", "V", "mV", "A", "mA", "W", "kW", "J", "Ohm", "rpm", "1/min", "U/min",
    "rev/min", "Hz", "kHz", "km/h", "km", "deg", "°", "rad", "rad/s", "°/s", "kg", "g", "g/s", "kg/s", "kg/h",
    "l", "L", "l/min", "m/s²", "m/s2", "m/s^2", "cm/s", "%rH", "mm²", "cm²", "mm³", "cm³",
))
# fmt: on

_COMMENT = ("#", "%", "//")
_MARK = re.compile(r"\s*(?:#|%|//|;)+\s*")
_BLANKS = re.compile(r"[ \t]+")
_WIDE_BLANKS = re.compile(r"\t+| {2,}")


def is_unit(text: str | None) -> bool:
    """Whether a text is a known unit of any quantity."""
    unit = unit_spelled(text)
    return unit in UNITS or unit in _OTHER


def heading(index: int, text: str, unit: str | None = None) -> Heading:
    """Heading of one cell, with its unit in square or round brackets, after a slash, or from a row of units.

    Examples
    --------
    >>> [(h.name, h.unit) for h in map(heading, range(4), ("Position / mm", "m/s", "t/s", "pressure_a (bar (g))"))]
    [('position', 'mm'), (None, None), (None, 's'), ('pressure_a', 'bar(g)')]
    """
    text = text.strip()
    if "[" in text:
        column = replace(headings([text])[0], index=index)
        numbered = (column.unit or "").isdigit()  # an index, where a row of units stands below
        return replace(column, unit=unit_spelled(unit)) if unit and (numbered or not column.unit) else column
    for name, written in _parts(text):
        if is_unit(written):
            return Heading(index, channel_name(text), quantity_named(name), unit_spelled(written))
    return channel(index, text, unit)


def _parts(text: str) -> Iterator[tuple[str, str]]:
    """All ways to split a heading into name and unit."""
    for match in re.finditer("/", text):
        name, unit = text[: match.start()], text[match.end() :]
        if name.strip() and (name[-1:] == " " or not is_unit(name)):
            yield name, unit
    if text.endswith(")"):
        for match in re.finditer(r"\(", text):
            yield text[: match.start()], text[match.end() : -1]


def units_in(cells: Sequence[str]) -> list[str] | None:
    """The units in a row of units, without brackets; None if the row is not one.

    Examples
    --------
    >>> units_in(["s", "[mm]", "", "furlong"]), units_in(["Time", "Position"]), units_in(["0", "1"])
    (['s', 'mm', '', 'furlong'], None, None)
    """
    units = [re.sub(r"^\[(.*)\]$|^\((.*)\)$", r"\1\2", cell.strip()) for cell in cells]
    filled = [unit for unit in units if unit]
    spelled = [unit for unit in filled if is_unit(unit)]
    words = [unit for unit in spelled if unit not in ("-", "1")]
    if not words or 2 * len(spelled) < len(filled) or any(NUMBER.fullmatch(unit) for unit in filled if unit != "1"):
        return None
    return units if all(len(unit) <= 16 for unit in filled) else None


def is_comment(line: str, separator: str) -> bool:
    """Whether a line above the samples is a comment."""
    text = line.lstrip()
    marks = _COMMENT if separator == ";" else (*_COMMENT, ";")
    return text.startswith(marks) and not text[1:].lstrip(" ").startswith(separator.strip() or "\0")


def uncommented(line: str) -> str:
    """The text of a comment."""
    return _MARK.sub("", line, count=1)


def split(line: str, separator: str) -> list[str]:
    """Split a line into cells; a blank as separator means runs of blanks.

    Examples
    --------
    >>> split('0;"a;b";2', ";"), split("  0   1 ", " ")
    (['0', 'a;b', '2'], ['0', '1'])
    """
    if separator == " ":
        line = _BLANKS.sub(" ", line.strip(" \t"))
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [""])
    except csv.Error:
        return [line]


def split_header(line: str, separator: str, width: int) -> list[str]:
    """Split a header into cells; with runs of blanks as separator, a name may contain blanks or precede its unit.

    Examples
    --------
    >>> split_header("Time [s]  Piston travel [mm]", " ", 2), split_header("t [s] y [mm]", " ", 2)
    (['Time [s]', 'Piston travel [mm]'], ['t [s]', 'y [mm]'])
    """
    cells = split(line, separator)
    if separator == " " and len(cells) != width:
        joined = re.sub(r"[ \t]+(?=[\[(])", "\0", line.strip(" \t"))
        ways = ([way.strip() for way in _WIDE_BLANKS.split(line.strip(" \t"))], _BLANKS.split(joined))
        cells = next((way for way in ways if len(way) == width), cells)
        cells = [cell.replace("\0", " ") for cell in cells]
    while len(cells) > width and not cells[-1].strip():
        cells = cells[:-1]
    return cells


#: Numbers of bytes and lines at the start of a file that determine its dialect; also the longest line.
HEAD_BYTES = 1 << 20
_SAMPLE_LINES = 2000

#: Bytes that are read at a time, and largest number of bytes of a block; a quote beyond these is a character.
CHUNK = 1 << 20
_MOST_BYTES = 1 << 26

BOMS_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_CONTROL = bytes({*range(32), 127} - {9, 10, 11, 12, 13, 26})


#: The end of a line is in a quoted cell that is not closed there; a quote inside a cell is written twice.
_OPEN = re.compile(r'(?:^|[,;\t|]) *"(?:[^"]|"")*$')

#: Largest number of lines of a record above the samples; a quote beyond them is a character.
_MOST_LINES = 100


@dataclass(frozen=True, slots=True)
class TextLines:
    """A file of lines: its encoding, and the number of the last non-blank line."""

    path: Path
    encoding: str
    last: int


@dataclass(frozen=True, slots=True)
class LineBlock:
    """Complete lines of a file: number of the first one, text in UTF-8, and number of lines."""

    first: int
    text: bytes
    lines: int


def text_lines(path: Path) -> TextLines | None:
    """The lines of a file; None if it is neither UTF-8, UTF-16 with a byte order mark nor Windows-1252.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    for encoding in _encodings(path):
        with suppress(UnicodeDecodeError):
            before = last = 0
            for piece in _pieces(path, encoding, strict=True):
                before += piece.count(b"\n")
                blank = _blank_end(piece)
                if len(blank) < len(piece):
                    last = before - blank.count(b"\n") + 1
            return TextLines(path, encoding, last)
    return None


def sample(lines: TextLines) -> list[str]:
    """The first lines, at most `HEAD_BYTES` bytes in total; a single line may be truncated.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    text = b""
    for piece in _pieces(lines.path, lines.encoding):
        text += piece
        if len(text) > HEAD_BYTES:
            text = text[: text.rfind(b"\n", 0, HEAD_BYTES) + 1] or text
            break
    return [line.decode("utf-8", "replace").rstrip("\n") for line in islice(io.BytesIO(text), _SAMPLE_LINES)]


def line_blocks(lines: TextLines, skip: int, rows: int) -> Iterator[LineBlock]:
    """The lines after the first `skip`, in blocks of at least `rows` lines, or fewer if they are long.

    A block goes on where it would end in a quoted cell.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    number, lacking = skip + 1, skip + rows
    pending: list[bytes] = []
    for piece in chain(_pieces(lines.path, lines.encoding), [None]) if skip < lines.last else ():
        pending.append(piece or b"")
        lacking -= pending[-1].count(b"\n")
        size = sum(map(len, pending))
        if piece is not None and lacking > 0 and size < _MOST_BYTES:
            continue
        text, begin = b"".join(pending), 0
        for _ in range(skip):
            begin = text.find(b"\n", begin) + 1
        skip, text = 0, text[begin:]
        end = text.rfind(b"\n") + 1 or len(text)
        count = text.count(b"\n")
        if piece is None or number + count > lines.last:
            line = text.find(b"\n", len(text) - len(_blank_end(text))) + 1 or len(text)
            yield LineBlock(number, text[:line], lines.last - number + 1)
            return
        pending, lacking = [text], 1
        if text.count(b'"', 0, end) % 2 == 0 or size >= _MOST_BYTES:
            yield LineBlock(number, text[:end], max(count, 1))
            number, pending, lacking = number + count, [text[end:]], rows


def _blank_end(text: bytes) -> bytes:
    """The trailing whitespace of a text, without copying the rest."""
    length = 1 << 12
    while length < len(text) and text[-length:].isspace():
        length *= 4
    tail = text[-length:]
    return tail[len(tail.rstrip()) :]


def _encodings(path: Path) -> tuple[str, ...]:
    """The encodings that the first bytes of a file allow, in the order in which they are tried."""
    with path.open("rb") as file:
        mark = file.read(4)
    if mark == codecs.BOM_UTF32_LE:
        return ()
    if mark.startswith(BOMS_UTF16):
        return ("utf-16",)
    if len(mark) == len(b"t\0i\0") and 0 in mark and any(mark):  # UTF-16 without its mark
        return ("utf-16-le",) if mark[1] == mark[3] == 0 else ("utf-16-be",) if mark[0] == mark[2] == 0 else ()
    return ("utf-8", "cp1252")


def _pieces(path: Path, encoding: str, *, strict: bool = False) -> Iterator[bytes]:
    """The text of a file in UTF-8 with line feeds, piece by piece.

    Raises
    ------
    UnicodeDecodeError
        If it is not in this encoding, where that is checked (`strict`); text in Windows-1252 has no control characters.
    """
    plain = encoding == "utf-8"
    decoder = codecs.getincrementaldecoder(encoding)("strict" if strict and encoding != "cp1252" else "replace")
    carried = b""
    with path.open("rb") as file:
        if file.read(3) != codecs.BOM_UTF8 or not plain:
            file.seek(0)
        while raw := file.read(CHUNK):
            if strict and encoding == "cp1252" and len(raw.translate(None, _CONTROL)) < len(raw):
                raise UnicodeDecodeError(encoding, raw, 0, 1, "a control character")
            if not plain or (strict and (not raw.isascii() or decoder.getstate()[0])):
                decoded = decoder.decode(raw)
            text = carried + (raw if plain else decoded.encode())
            carried = b"\r" if text.endswith(b"\r") else b""
            text = text[: len(text) - len(carried)]
            if b"\r" in text:
                text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            yield text
    decoder.decode(b"", final=True)
    yield carried.replace(b"\r", b"\n")


def records(lines: Sequence[str]) -> list[tuple[int, str]]:
    """Number of the first line, and text, of every record.

    Examples
    --------
    >>> records(['t,"piston', 'travel [mm]"', '0,1', 'a 5" pipe'])
    [(1, 't,"piston\\ntravel [mm]"'), (3, '0,1'), (4, 'a 5" pipe')]
    """
    texts, at = [], 0
    while at < len(lines):
        end = _end(lines, at)
        texts.append((at + 1, "\n".join(lines[at:end])))
        at = end
    return texts


def _end(lines: Sequence[str], start: int) -> int:
    """Index after the last line of the record that begins at `start`."""
    line = lines[start]
    quotes = line.count('"')
    if quotes % 2 and not is_comment(line, ";") and _OPEN.search(line):
        for end in range(start + 1, min(start + _MOST_LINES, len(lines))):
            quotes += lines[end].count('"')
            if quotes % 2 == 0:
                return end + 1
    return start + 1

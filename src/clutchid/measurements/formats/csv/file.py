"""CSV: a header with units, then samples; separator, decimal mark and the rest are detected from the content."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from clutchid.log import Log
from clutchid.measurements.formats.csv.dialect import Dialect, dialect
from clutchid.measurements.formats.csv.lines import HEAD_BYTES, TextLines, line_blocks, sample, text_lines
from clutchid.measurements.formats.csv.rows import ParsedRows, joined_parts, part_table, read_rows
from clutchid.measurements.source import BLOCK, EXAMPLE, Raster, Source, Table, refused, to_frame

#: Bytes of a file that is read without polars where it is plain.
_SMALL = 8e6

_NOT_TEXT = "is not UTF-8, UTF-16 or Windows-1252 text; save it as 'CSV UTF-8', or as Parquet."
_LONG = (
    f"line 1 is longer than {HEAD_BYTES:,} bytes, so this is not a table; save the recording as CSV with line breaks."
)
_EMPTY = f"the file is empty; {EXAMPLE}"

_MONTHS = 12

#: Largest number of cells per line.
_WIDEST = 10_000

#: Cells with an unambiguous decimal mark, in any line.
_UNAMBIGUOUS = (
    rb"(?:^|[;|\t \"])[+-]?(?:(?P<point>\d*\.\d+)|0\d*,\d+|\d*,\d{1,2}|\d*,\d{4,}|\d{4,},\d+|\d*,\d+(?=[eE]))"
    rb"(?:[eE][+-]?\d+)?(?=$|[;|\t \"])"
)


def open_file(path: Path) -> Source:
    """A CSV file: one time grid, its dialect in the metadata under ``dialect``, the first time stamp under ``start``.

    A file without a header has columns ``column 1``, ``column 2`` and so on, and `Source.unnamed` says that it needs a
    channel map. The size of the time grid includes blank and invalid lines.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    OSError
        If the file cannot be read; problems inside it are in `Source.problems` and `Table.problems`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     _ = file.write_text("Rig 7\\nTime (s);Position / mm\\n0;0,25\\n1;0,5\\n")
    ...     source = open_file(file)
    ...     table = next(source.tables(0, [0, 1]))
    >>> source.metadata["dialect"], table.headings[1].unit, table.numbers[1].tolist()
    ('UTF-8, semicolon, decimal comma, names on line 2, samples from line 3', 'mm', [0.25, 0.5])
    """
    lines = text_lines(path)
    if lines is None:
        return refused(path, "CSV", _NOT_TEXT)
    first = sample(lines)
    if len(first) == 1 and len(first[0]) > HEAD_BYTES:
        return refused(path, "CSV", _LONG)
    wide = next((number for number, line in enumerate(first, start=1) if _is_wide(line)), 0)
    if wide:
        cells = f"line {wide} has more than {_WIDEST:,} cells"
        return refused(path, "CSV", f"{cells}; write one column per channel and one line per sample.")
    notation = dialect(first)
    if notation is None:
        return refused(path, "CSV", _EMPTY)
    notation = _with_decimal_mark(lines, notation)
    names = {"utf-8": "UTF-8", "utf-16": "UTF-16", "cp1252": "Windows-1252"}
    names |= dict.fromkeys(("utf-16-le", "utf-16-be"), "UTF-16 without a mark")
    metadata = {**notation.about, "dialect": f"{names[lines.encoding]}, {notation.text}"}
    if notation.start:
        metadata["start"] = notation.start
    unnamed = "" if notation.header else f"line {notation.samples}: the first line contains numbers; {EXAMPLE}"
    texts = [heading for heading in notation.headings if heading.text and notation.forms[heading.index].kind == "text"]
    size, others = max(0, lines.last - notation.samples + 1), tuple((heading.text, "text") for heading in texts)
    raster = Raster(notation.headings, size, clock=notation.clock, others=others)
    tables = partial(_tables, lines, notation)
    return Source(path, "CSV", (raster,), tables, notation.problems, _ambiguity(notation), metadata, unnamed)


def save(log: Log, path: Path) -> None:
    """Write `log` in SI; a missing sample becomes an empty cell, every other value is written exactly.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    import polars as pl

    with path.open("wb") as file:  # polars takes no name that is no text
        to_frame(log).with_columns(pl.all().fill_nan(None)).write_csv(file)


def _is_wide(line: str) -> bool:
    cells = (len(line.split()), *map(line.count, ",;\t|")) if len(line) > _WIDEST else (0,)
    return max(cells) > _WIDEST


def _ambiguity(notation: Dialect) -> tuple[str, ...]:
    """Warning about two columns that may be one with a decimal comma, or about a date that may be another."""
    if match := re.match(r"(\d{1,2})/(\d{1,2})/", notation.started):
        month, day = map(int, match.groups())
        if month <= _MONTHS and day <= _MONTHS and month != day:
            shown = notation.started.split()[0]
            return (
                f"the date {shown} is read as {notation.start[:10]}, month first; write it like that if it is not.",
            )
    if notation.header or (notation.separator, len(notation.headings), notation.decimal) != (",", 2, ""):
        return ()
    return ("two columns of integers without names were found; this may also be one column with a decimal comma.",)


def _with_decimal_mark(lines: TextLines, notation: Dialect) -> Dialect:
    """The dialect with the decimal mark of later lines, if the first ones are ambiguous."""
    if notation.decimal or notation.separator == ",":
        return notation
    for block in line_blocks(lines, notation.samples - 1, BLOCK):
        if (b"," in block.text or b"." in block.text) and (match := re.search(_UNAMBIGUOUS, block.text, re.MULTILINE)):
            return notation.with_decimal("." if match["point"] else ",")
    return notation


def _tables(
    lines: TextLines, notation: Dialect, _raster: int, columns: Sequence[int], rows: int | None = None
) -> Iterator[Table]:
    """The tables of the only time grid, see `Tables`."""
    selected = [notation.headings[index] for index in columns]
    if lines.last < notation.samples:
        problem = f"line {notation.header}: there is a header, but no samples below it."
        yield Table(notation.headings, problems=(problem,))
        return
    small, parts = lines.path.stat().st_size < _SMALL, list[ParsedRows]()
    for block in line_blocks(lines, notation.samples - 1, rows or (lines.last if small else BLOCK)):
        parts.append(read_rows(block, notation, selected, small=small))
        broken = parts[-1].broken
        if rows is not None:
            yield from part_table(parts.pop(), notation).parts(rows)
        if broken:
            break
    if rows is None:
        yield part_table(joined_parts(parts), notation)

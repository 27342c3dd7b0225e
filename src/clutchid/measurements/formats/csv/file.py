"""CSV: a header with units, then samples; separator, decimal mark and the rest are detected from the content."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from clutchid.log import Log
from clutchid.measurements.formats.csv.cells import decimal_mark
from clutchid.measurements.formats.csv.dialect import Dialect, dialect
from clutchid.measurements.formats.csv.rows import TextReading
from clutchid.measurements.formats.csv.text import ENCODINGS, TextFile, text_file
from clutchid.measurements.source import BLOCK, EXAMPLE, Raster, Source, Table, refused, to_frame
from clutchid.measurements.suffixes import binary_kind

#: Bytes of a file that is read without polars where it is plain.
_SMALL = 8e6

#: Lines and bytes at the start of a file that determine its dialect, and the most cells of a line.
_HEAD, _HEAD_BYTES, _WIDEST = 2000, 1 << 20, 10_000

_NOT_TEXT = "is not UTF-8, UTF-16 or Windows-1252 text; save it as 'CSV UTF-8', or as Parquet."

#: Cells with a point or a comma, in any line.
_MARKED = re.compile(r'[^;|\t "\n]*[.,][^;|\t "\n]*')


def open_file(path: Path) -> Source:
    """A CSV file: one time grid, its dialect in the metadata under ``dialect``, the first time stamp under ``start``.

    A file without a header has columns ``column 1``, ``column 2`` and so on, and `Source.unnamed` says that it needs a
    channel map. The size of the time grid includes blank and invalid lines.

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
    text, kind = text_file(path), binary_kind(path.name)
    if text is None:
        return refused(path, kind or "CSV", f"is not a readable {kind} file; copy it again." if kind else _NOT_TEXT)
    lines = text.head(_HEAD, _HEAD_BYTES)
    wide = (n for n, line in enumerate(lines, 1) if len(line) > _WIDEST and max(map(line.count, ",;\t| ")) >= _WIDEST)
    if number := next(wide, 0):
        cells = f"line {number} has more than {_WIDEST:,} cells"
        return refused(path, "CSV", f"{cells}; write one column per channel and one line per sample.")
    notation = dialect(lines)
    if notation is None:
        return refused(path, "CSV", f"the file {'has no table' if text.last else 'is empty'}; {EXAMPLE}")
    notation = _with_decimal_mark(text, notation)
    metadata = {"dialect": f"{ENCODINGS[text.encoding]}, {notation.text}"}
    if notation.start:
        metadata["start"] = notation.start
    unnamed = "" if notation.header else f"line {notation.samples}: the first line contains numbers; {EXAMPLE}"
    texts = [heading.text for heading in notation.headings if notation.forms[heading.index].kind == "text"]
    others = tuple((text, "text") for text in texts if text)
    raster = Raster(notation.headings, max(0, text.last - notation.samples + 1), clock=notation.clock, others=others)
    tables = partial(_tables, text, notation)
    return Source(path, "CSV", (raster,), tables, notation.problems, (), metadata, unnamed)


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


def _with_decimal_mark(text: TextFile, notation: Dialect) -> Dialect:
    """The dialect with the decimal mark of later lines, if the first ones are ambiguous."""
    if notation.decimal or notation.separator == ",":
        return notation
    for block in text.blocks(notation.samples, BLOCK):
        marked = b"," in block.text or b"." in block.text
        if marked and (mark := decimal_mark(_MARKED.findall(block.text.decode("utf-8", "replace")))):
            return replace(notation, decimal=mark)
    return notation


def _tables(
    text: TextFile, notation: Dialect, _raster: int, columns: Sequence[int], rows: int | None = None
) -> Iterator[Table]:
    """The tables of the only time grid, see `Tables`."""
    if text.last < notation.samples:
        problem = f"line {notation.header}: there is a header, but no samples below it."
        yield Table(notation.headings, problems=(problem,))
        return
    small = text.path.stat().st_size < _SMALL
    reading = TextReading(notation, [notation.headings[index] for index in columns], small=small)
    for block in text.blocks(notation.samples, rows or (text.last if small else BLOCK)):
        reading.add(block)
        if rows is not None:
            yield from reading.table().parts(rows)
        if reading.broken:
            break
    if rows is None:
        yield reading.table()

"""CSV: a header ``name [unit]``, samples below it; lines that start with ``#`` above the header are comments.

A file is read by a fast parser first. What that refuses, or reads with another number of cells than the text has, is
read again as text, slowly, and that finds the line and the column of each problem.
"""

from __future__ import annotations

import codecs
import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clutchid.io.columns import Heading, headings
from clutchid.io.csv_text import Head, read_text
from clutchid.io.files import CHUNK
from clutchid.io.table import EXAMPLE, Places, Table, to_frame, wanted
from clutchid.log import FloatArray, Log

#: Bytes up to which NumPy reads a file sooner than polars, which is faster but takes 80 ms to import.
_SMALL = 8e6

_TAIL = 1 << 16
_LONGEST_HEADER = 1 << 20
_NOT_UTF8 = "is not UTF-8 text; save it as 'CSV UTF-8', or as Parquet."

Numbers = Mapping[int, FloatArray]


@dataclass(frozen=True, slots=True)
class _Shape:
    """What the text below the header must give: so many lines that are not blank, so many separators."""

    lines: int
    separators: int


def load(path: Path, *, every: bool = False) -> Table:
    """The numbers of a CSV file; `every` column, or those whose name is known.

    Raises
    ------
    OSError
        If the file cannot be read; what is wrong inside it is in ``Table.problems``.
    """
    head = _head(path)
    if isinstance(head, str):
        return Table(problems=(head,))
    columns = headings(head.cells)
    if all(_is_number(cell) for cell in head.cells):
        return Table(problems=(f"line {head.line}: the first line holds numbers; {EXAMPLE}",))
    shape = _shape(path, head)
    if isinstance(shape, str):
        return Table(columns, problems=(shape,))
    if shape.lines == 0:
        return Table(columns, problems=(f"line {head.line}: there is a header, but no samples below it.",))
    selected = wanted(columns, every)
    numbers = _fast(path, head, columns, selected, shape)
    if numbers is not None:
        return Table(columns, numbers, shape.lines, Places("line", head.line + 1))
    return read_text(path, head, columns, selected)


def save(log: Log, path: Path) -> None:
    """Write `log` in SI; a missing sample becomes an empty cell, every other number is printed exactly.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    import polars as pl

    to_frame(log).with_columns(pl.all().fill_nan(None)).write_csv(path)


def _head(path: Path) -> Head | str:
    """The header, or the sentence that says why there is none."""
    number = 0
    with path.open("rb") as file:
        while line := file.readline(_LONGEST_HEADER):
            number += 1
            try:
                text = line.decode("utf-8-sig" if number == 1 else "utf-8")
            except UnicodeDecodeError:
                return _NOT_UTF8
            if text.strip() and not text.startswith("#"):
                separator = max((",", ";", "\t"), key=text.count)
                try:
                    return Head(next(csv.reader([text], delimiter=separator)), separator, number, file.tell())
                except csv.Error:
                    return f"line {number}: cannot be split into cells; save the file as CSV with line feeds."
    return f"the file is empty; {EXAMPLE}"


def _shape(path: Path, head: Head) -> _Shape | str:
    """How much text there is below the header, or the sentence that says that it is no text."""
    lines = separators = 0
    decoder = codecs.getincrementaldecoder("utf-8")()
    separator = head.separator.encode()
    try:
        with path.open("rb") as file:
            file.seek(head.end)
            while chunk := file.read(CHUNK):
                decoder.decode(chunk)
                lines += chunk.count(b"\n")
                separators += chunk.count(separator)
            file.seek(max(head.end, file.tell() - _TAIL))
            tail = file.read()
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return _NOT_UTF8
    text = tail.rstrip()
    return _Shape(lines - tail[len(text) :].count(b"\n") + bool(text), separators)


def _fast(
    path: Path, head: Head, columns: tuple[Heading, ...], selected: tuple[Heading, ...], shape: _Shape
) -> Numbers | None:
    """The numbers by a fast parser, if it takes the whole text; None where the text has to be looked at."""
    if shape.separators != shape.lines * (len(columns) - 1):
        return None
    reader = _by_numpy if path.stat().st_size < _SMALL else _by_polars
    try:
        numbers = reader(path, head, selected)
    except ValueError:
        return None
    return numbers if all(values.size == shape.lines for values in numbers.values()) else None


def _by_numpy(path: Path, head: Head, selected: tuple[Heading, ...]) -> Numbers:
    with path.open(encoding="utf-8-sig") as file:
        try:
            table = np.loadtxt(file, delimiter=head.separator, skiprows=head.line, comments=None, ndmin=2)
        except ValueError:
            file.seek(0)
            for _ in range(head.line):
                file.readline()
            lines = _filled(file.read(), head.separator).split("\n")
            table = np.loadtxt(lines, delimiter=head.separator, comments=None, ndmin=2)
    return {column.index: np.ascontiguousarray(table[:, column.index]) for column in selected}


def _filled(text: str, separator: str) -> str:
    """`text` with ``nan`` in its empty cells, which NumPy does not know."""
    inner, start, end = f"{separator}nan{separator}", f"\nnan{separator}", f"{separator}nan\n"
    text = f"\n{text}\n".replace(separator * 2, inner).replace(separator * 2, inner)
    return text.replace(f"{separator}\n", end).replace(f"\n{separator}", start)


def _by_polars(path: Path, head: Head, selected: tuple[Heading, ...]) -> Numbers:
    import polars as pl

    types: dict[str, pl.DataType] = {str(index): pl.String() for index in range(len(head.cells))}
    types.update({str(column.index): pl.Float64() for column in selected if column.name is not None})
    try:
        frame = pl.read_csv(
            path,
            has_header=False,
            skip_lines=head.line,
            separator=head.separator,
            schema=types,
            columns=[column.index for column in selected],
            glob=False,
        )
    except pl.exceptions.PolarsError as error:
        raise ValueError(str(error)) from error
    return {column.index: frame[str(column.index)].cast(pl.Float64, strict=False).to_numpy() for column in selected}


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True

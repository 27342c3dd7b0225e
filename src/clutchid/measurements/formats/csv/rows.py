"""Rows of CSV: by NumPy or polars, or cell by cell with line and column of every problem."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.measurements.columns import Heading
from clutchid.measurements.formats.csv.cells import (
    AMBIGUOUS,
    COMMA,
    FIELDS,
    FRACTION,
    HALF,
    MISSING,
    NUMBER,
    STAMP,
    STAMPS_SHOWN,
    THOUSANDS,
    ZONE,
    CellForm,
    counted,
    half_hours,
    matches,
    reader,
    zone_minutes,
)
from clutchid.measurements.formats.csv.dialect import Dialect
from clutchid.measurements.formats.csv.lines import LineBlock, split
from clutchid.measurements.no_value import means_no_value
from clutchid.measurements.source import Places, Rows, Table
from clutchid.measurements.source import joined as joined_tables
from clutchid.messages import SHOWN, listed, shortened

if TYPE_CHECKING:
    import polars as pl

Cell = Callable[[str], float | None]


@dataclass(eq=False, slots=True)
class ParsedRows:
    """Samples of some lines, and invalid cells and lines; the table has no headings and no problems yet.

    `texts` and `ragged` are the first invalid cells and lines, for messages; after `broken` nothing could be read.
    `none` counts, by column, the cells that say that there is no value.
    """

    table: Table
    texts: dict[int, list[str]] = field(default_factory=dict)
    ragged: list[str] = field(default_factory=list)
    ragged_count: int = 0
    broken: str = ""
    none: Counter[int] = field(default_factory=Counter)


def must_be_numeric(column: Heading, dialect: Dialect) -> bool:
    """Whether a cell that is not a number is a problem; in an unknown column of text it is not."""
    return column.name is not None or dialect.forms[column.index].kind != "text"


def read_text(block: LineBlock, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows:
    """Read lines whose text is not a plain table of numbers.

    Lines with another number of cells than the header are dropped; cells that are not numbers are NaN.
    """
    part = ParsedRows(Table())
    lines: array[int] = array("q")
    numbers: dict[int, array[float]] = defaultdict(lambda: array("d"))
    unread: dict[int, array[int]] = defaultdict(lambda: array("q"))
    columns = [
        (column.index, reader(dialect.forms[column.index]), must_be_numeric(column, dialect)) for column in selected
    ]
    width = len(dialect.headings)
    for line, cells in _rows(block, dialect.separator, part):
        if len(cells) != width:
            _ragged(part, line, cells)
            continue
        for index, read, numeric in columns:
            value = read(cells[index])
            if value is None:
                value = np.nan
                if numeric and means_no_value(cells[index]):
                    part.none[index] += 1
                elif numeric:
                    unread[index].append(len(lines))
                    _text(part, index, cells[index])
            numbers[index].append(value)
        lines.append(line)
    part.table = Table(
        numbers={column.index: np.frombuffer(numbers[column.index], np.float64) for column in selected},
        size=len(lines),
        places=Places("line", numbers=np.frombuffer(lines, np.int64)),
        unread={index: np.frombuffer(rows, np.int64) for index, rows in unread.items()},
    )
    return part


def _rows(block: LineBlock, separator: str, part: ParsedRows) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each row; if a line cannot be split, `part.broken` gives the reason."""
    text = io.StringIO(block.text.decode("utf-8", "replace"), newline="\n")
    if separator == " ":
        yield from ((number, split(line.rstrip("\n"), separator)) for number, line in enumerate(text, block.first))
        return
    rows = csv.reader(text, delimiter=separator)
    line = block.first
    try:
        for cells in rows:
            yield line, cells
            line = block.first + rows.line_num
    except csv.Error as error:
        part.broken = f"line {line}: cannot be split into cells ({error}); is a quotation mark left open?"


def _ragged(part: ParsedRows, line: int, cells: Sequence[str]) -> None:
    """Record a line with another number of cells, unless it is blank."""
    if len(cells) > 1 or (cells and cells[0].strip()):
        part.ragged_count += 1
        if len(part.ragged) < SHOWN:
            part.ragged.append(f"line {line} has {len(cells)}")


def _text(part: ParsedRows, index: int, cell: str) -> None:
    texts = part.texts.setdefault(index, [])
    if len(texts) < SHOWN:
        texts.append(cell)


def joined(parts: Sequence[ParsedRows]) -> ParsedRows:
    """Join consecutive parts."""
    if len(parts) == 1:
        return parts[0]
    whole = ParsedRows(joined_tables([part.table for part in parts]))
    for part in parts:
        for index, cells in part.texts.items():
            for cell in cells:
                _text(whole, index, cell)
        whole.ragged += part.ragged[: SHOWN - len(whole.ragged)]
        whole.ragged_count += part.ragged_count
        whole.broken = whole.broken or part.broken
        whole.none += part.none
    return whole


def table(part: ParsedRows, dialect: Dialect) -> Table:
    """Table of a part, with messages about its problems."""
    columns = dialect.headings
    problems = [part.broken] if part.broken else []
    if part.ragged:
        lines = listed(part.ragged, total=part.ragged_count)
        problems.append(
            f"the {'header' if dialect.header else 'first line'} has {len(columns)} cells, but {lines}; "
            "give every line one cell for each column, empty where a sample is missing."
        )
    for index, texts in sorted(part.texts.items()):
        rows, places = part.table.unread[index], part.table.places
        shown = [f"line {places.number(row)} has '{shortened(text)}'" for row, text in zip(rows, texts, strict=False)]
        problems.append(
            f"column '{columns[index].text}' contains cells that are not numbers: "
            f"{listed(shown, total=len(rows))}; {_advice(texts, dialect, index)}, or leave the cell empty "
            "where the sample is missing."
        )
    metadata = {"start": dialect.start} if dialect.start else {}
    none = tuple(
        f"column '{columns[index].text}': {count:,} cells say that there is no value; these samples are missing."
        for index, count in sorted(part.none.items())
    )
    return replace(part.table, headings=columns, problems=tuple(problems), metadata=metadata, warnings=none)


def _advice(texts: Sequence[str], dialect: Dialect, index: int) -> str:
    """Advice on how to correct these cells."""
    cells = [text.strip() for text in texts]
    commas = [matches(COMMA, cell) for cell in cells]
    if dialect.forms[index].kind == "stamp" or all(":" in cell for cell in cells):
        as_others = "as in the other cells, for example 2024-05-01T12:00:00.001"
        return f"write date and time {as_others if dialect.forms[index].kind == 'stamp' else f'as {STAMPS_SHOWN}'}"
    if dialect.forms[index].kind == "truth":
        return "write 1 or 0"
    if not dialect.decimal and any(matches(AMBIGUOUS, cell) for cell in cells):
        return "the comma may be a decimal or a thousands separator: write a decimal point"
    if any(matches(THOUSANDS, cell) for cell in cells) and not all(commas):
        return "write a number without thousands separators"
    if dialect.decimal == "," and any(map(NUMBER.fullmatch, cells)):
        return "the decimal mark of this file is the comma: write a number without a point"
    return "write a number " + ("with a decimal point" if any(commas) else "like 0.0125")


#: Usual spellings of a missing sample.
_WORDS = sorted({"", *MISSING, *(word.upper() for word in MISSING), "NaN", "Null", "None", "n/A", "N/a"})


def read_fast(block: LineBlock, dialect: Dialect, selected: Sequence[Heading], *, large: bool) -> ParsedRows | None:
    """The samples of lines by NumPy, or by polars if they are a `large` text; None if only `read_text` reads them."""
    if not _is_plain(block, dialect):
        return None
    return _by_polars(block, dialect, selected) if large else _by_numpy(block, dialect, selected)


def _is_plain(block: LineBlock, dialect: Dialect) -> bool:
    """Whether the lines have as many separators as the header, and none in quotes."""
    width = len(dialect.headings)
    if dialect.separator == " ":
        return b'"' not in block.text
    if width == 1 and (b"\n\n" in block.text or block.text.startswith(b"\n")):
        return False
    return block.text.count(dialect.separator.encode()) == block.lines * (width - 1)


def _by_numpy(block: LineBlock, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows | None:
    """The values of a block with numbers and empty cells only; None if it contains anything else."""
    comma = dialect.decimal == "," and dialect.separator != ","
    if any(dialect.forms[column.index].kind == "stamp" for column in selected) or (comma and b"." in block.text):
        return None
    text = block.text.replace(b",", b".") if comma else block.text
    delimiter = None if dialect.separator == " " else dialect.separator
    if dialect.decimal == "," and not comma:
        return None
    try:
        numbers = _loaded(text, delimiter)
    except ValueError:
        return None
    if numbers.shape != (block.lines, len(dialect.headings)):
        return None
    columns = {column.index: np.ascontiguousarray(numbers[:, column.index]) for column in selected}
    return ParsedRows(Table(numbers=columns, size=block.lines, places=Places("line", block.first)))


def _loaded(text: bytes, delimiter: str | None) -> FloatArray:
    try:
        lines = io.TextIOWrapper(io.BytesIO(text), "utf-8", "replace", newline="\n")
        return np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        if delimiter is None:
            raise
        filled = _filled(text.decode("utf-8", "replace"), delimiter)
        return np.loadtxt(filled.split("\n"), delimiter=delimiter, comments=None, ndmin=2)


def _filled(text: str, separator: str) -> str:
    """Fill empty cells, which NumPy does not accept, with ``nan``."""
    inner, start, end = f"{separator}nan{separator}", f"\nnan{separator}", f"{separator}nan\n"
    text = f"\n{text}\n".replace(separator * 2, inner).replace(separator * 2, inner)
    return text.replace(f"{separator}\n", end).replace(f"\n{separator}", start)[1:-1]


def _by_polars(block: LineBlock, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows | None:
    """The samples of a block by polars; None if their number differs from the number of lines."""
    import polars as pl

    if dialect.separator == " ":
        lines = block.text.replace(b"\t", b" ")
        while b"  " in lines:
            lines = lines.replace(b"  ", b" ")
        lines = lines.replace(b" \n", b"\n").replace(b"\n ", b"\n").removeprefix(b" ")
        block = LineBlock(block.first, lines, block.lines)
        if lines.count(b" ") != block.lines * (len(dialect.headings) - 1):
            return None
    try:
        try:
            part = _numbers(block, dialect, selected)
        except pl.exceptions.PolarsError:
            part = _words(block, dialect, selected)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException):
        return None
    return part if part.table.size == block.lines else None


def _numbers(block: LineBlock, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows:
    """The samples if all selected columns are numeric; otherwise polars raises an error."""
    import polars as pl

    kinds = [dialect.forms[column.index].kind for column in selected]
    special = b'"' in block.text or (dialect.decimal == "," and (b"." in block.text or dialect.separator == ","))
    if special or any(kind in ("stamp", "truth", "text") for kind in kinds):
        raise pl.exceptions.ComputeError("not every column is numeric")
    text = block.text.replace(b",", b".") if dialect.decimal == "," else block.text
    frame = _frame(text, dialect, selected, pl.Float64())
    columns = {column.index: frame[str(column.index)].to_numpy() for column in selected}
    return ParsedRows(Table(numbers=columns, size=frame.height, places=Places("line", block.first)))


def _words(block: LineBlock, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows:
    """The samples if some cells are words, dates or times; each word is interpreted once."""
    import polars as pl

    frame = _frame(block.text, dialect, selected, pl.String())
    texts: dict[int, list[str]] = {}
    numbers: dict[int, FloatArray] = {}
    unread: dict[int, Rows] = {}
    none: Counter[int] = Counter()
    for column in selected:
        form, cells = dialect.forms[column.index], frame[str(column.index)]
        stripped = cells.str.strip_chars()
        values = _stamps(stripped, form) if form.kind == "stamp" else _plain(stripped, form)
        not_number = values.is_null() & stripped.is_not_null()
        if not_number.any():
            read = reader(form)
            meant = {word: read(word) for word in stripped.filter(not_number).unique().to_list()}
            known = {word: value for word, value in meant.items() if value is not None}
            if must_be_numeric(column, dialect) and (
                said := [w for w in meant if w not in known and means_no_value(w)]
            ):
                known |= dict.fromkeys(said, math.nan)
                none[column.index] = int(stripped.is_in(said).sum())
            words = stripped.replace_strict(known, default=None, return_dtype=pl.Float64)
            invalid = not_number & words.is_null()
            values = values.fill_null(words)
            if must_be_numeric(column, dialect) and invalid.any():
                unread[column.index] = rows = invalid.arg_true().to_numpy().astype(np.int64)
                texts[column.index] = cells.gather(rows[:SHOWN]).to_list()
        numbers[column.index] = values.to_numpy()
    table = Table(numbers=numbers, size=frame.height, places=Places("line", block.first), unread=unread)
    return ParsedRows(table, texts, none=none)


def _frame(text: bytes, dialect: Dialect, selected: Sequence[Heading], kind: pl.DataType) -> pl.DataFrame:
    import polars as pl

    types: dict[str, pl.DataType] = {str(index): pl.String() for index in range(len(dialect.headings))}
    types |= {str(column.index): kind for column in selected}
    return pl.read_csv(
        text,
        has_header=False,
        separator=dialect.separator,
        schema=types,
        columns=[column.index for column in selected],
        null_values=_WORDS if kind.is_float() else None,
    )


def _plain(cells: pl.Series, form: CellForm) -> pl.Series:
    """Cells as numbers, null if invalid."""
    import polars as pl

    if form.decimal == ",":
        pure = cells.set(cells.str.contains(".", literal=True).fill_null(value=False), None)
        cells = pure.str.replace_all(",", ".", literal=True)
    return cells.cast(pl.Float64, strict=False)


def _stamps(cells: pl.Series, form: CellForm) -> pl.Series:
    """Dates and times in seconds since the first one, null if invalid."""
    import polars as pl

    groups = cells.str.extract_groups(STAMP).struct.unnest()
    names = groups.columns
    fields = [groups[name].cast(pl.Int64, strict=False).fill_null(0).to_numpy() for name in names[:FIELDS]]
    fraction = groups[names[FRACTION]].fill_null("").str.pad_end(9, "0").cast(pl.Int64).to_numpy()

    def spelled(group: int, meaning: Callable[[str], int], none: int) -> NDArray[np.int64]:
        texts = groups[names[group]]
        known = {text: meaning(text) for text in texts.drop_nulls().unique().to_list()}
        return texts.replace_strict(known, default=none, return_dtype=pl.Int64).fill_null(none).to_numpy()

    stamps, valid = counted(fields, fraction, spelled(HALF, half_hours, -1), spelled(ZONE, zone_minutes, 0))
    found = valid & groups[names[9]].is_not_null().to_numpy()
    return pl.Series(np.where(found, (stamps - form.origin) / 1e9, 0.0)).set(pl.Series(~found), None)

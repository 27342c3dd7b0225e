"""Fast parsers for blocks of CSV: NumPy for small files, polars (80 ms to import) for large ones."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from clutchid.log import FloatArray
from clutchid.recordings.columns import Heading
from clutchid.recordings.formats.csv.cells import MISSING, STAMP, Form, counted, reader, zone_minutes
from clutchid.recordings.formats.csv.dialect import Dialect
from clutchid.recordings.formats.csv.lines import Block
from clutchid.recordings.formats.csv.text import Part, must_be_numeric
from clutchid.recordings.table import SHOWN, Places

if TYPE_CHECKING:
    import polars as pl

#: Usual spellings of a missing sample.
_WORDS = sorted({"", *MISSING, *(word.upper() for word in MISSING), "NaN", "Null", "None", "n/A", "N/a"})


def is_plain(block: Block, dialect: Dialect) -> bool:
    """Whether the lines have as many separators as the header, and none in quotes."""
    width = len(dialect.headings)
    if dialect.separator == " ":
        return b'"' not in block.text
    if width == 1 and (b"\n\n" in block.text or block.text.startswith(b"\n")):
        return False
    return block.text.count(dialect.separator.encode()) == block.lines * (width - 1)


def by_numpy(block: Block, dialect: Dialect, selected: Sequence[Heading]) -> Part | None:
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
    return Part(block.lines, Places("line", block.first), columns)


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


def by_polars(block: Block, dialect: Dialect, selected: Sequence[Heading]) -> Part | None:
    """The samples of a block by polars; None if their number differs from the number of lines."""
    import polars as pl

    if dialect.separator == " ":
        lines = block.text.replace(b"\t", b" ")
        while b"  " in lines:
            lines = lines.replace(b"  ", b" ")
        lines = lines.replace(b" \n", b"\n").replace(b"\n ", b"\n").removeprefix(b" ")
        block = Block(block.first, lines, block.lines)
        if lines.count(b" ") != block.lines * (len(dialect.headings) - 1):
            return None
    try:
        try:
            part = _numbers(block, dialect, selected)
        except pl.exceptions.PolarsError:
            part = _words(block, dialect, selected)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException):
        return None
    return part if part.size == block.lines else None


def _numbers(block: Block, dialect: Dialect, selected: Sequence[Heading]) -> Part:
    """The samples if all selected columns are numeric; otherwise polars raises an error."""
    import polars as pl

    kinds = [dialect.forms[column.index].kind for column in selected]
    strange = b'"' in block.text or (dialect.decimal == "," and (b"." in block.text or dialect.separator == ","))
    if strange or any(kind in ("stamp", "truth", "text") for kind in kinds):
        raise pl.exceptions.ComputeError("not every column is numeric")
    text = block.text.replace(b",", b".") if dialect.decimal == "," else block.text
    frame = _frame(text, dialect, selected, pl.Float64())
    columns = {column.index: frame[str(column.index)].to_numpy() for column in selected}
    return Part(frame.height, Places("line", block.first), columns)


def _words(block: Block, dialect: Dialect, selected: Sequence[Heading]) -> Part:
    """The samples if some cells are words, dates or times; each word is interpreted once."""
    import polars as pl

    frame = _frame(block.text, dialect, selected, pl.String())
    part = Part(frame.height, Places("line", block.first), {})
    for column in selected:
        form, cells = dialect.forms[column.index], frame[str(column.index)]
        stripped = cells.str.strip_chars()
        numbers = _stamps(stripped, form) if form.kind == "stamp" else _plain(stripped, form)
        odd = numbers.is_null() & stripped.is_not_null()
        if odd.any():
            read = reader(form)
            meant = {word: read(word) for word in stripped.filter(odd).unique().to_list()}
            known = {word: value for word, value in meant.items() if value is not None}
            words = stripped.replace_strict(known, default=None, return_dtype=pl.Float64)
            unread = odd & words.is_null()
            numbers = numbers.fill_null(words)
            if must_be_numeric(column, dialect) and unread.any():
                part.unread[column.index] = rows = unread.arg_true().to_numpy().astype(np.int64)
                part.texts[column.index] = cells.gather(rows[:SHOWN]).to_list()
        part.numbers[column.index] = numbers.to_numpy()
    return part


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


def _plain(cells: pl.Series, form: Form) -> pl.Series:
    """Cells as numbers, null if invalid."""
    import polars as pl

    if form.decimal == ",":
        pure = cells.set(cells.str.contains(".", literal=True).fill_null(value=False), None)
        cells = pure.str.replace_all(",", ".", literal=True)
    return cells.cast(pl.Float64, strict=False)


def _stamps(cells: pl.Series, form: Form) -> pl.Series:
    """Dates and times in seconds since the first one, null if invalid."""
    import polars as pl

    groups = cells.str.extract_groups(STAMP).struct.unnest()
    names = groups.columns
    fields = [groups[name].cast(pl.Int64, strict=False).fill_null(0).to_numpy() for name in names[:9]]
    fraction = groups[names[9]].fill_null("").str.pad_end(9, "0").cast(pl.Int64).to_numpy()
    zones = groups[names[10]]
    minutes = {zone: zone_minutes(zone) for zone in zones.drop_nulls().unique().to_list()}
    zone = zones.replace_strict(minutes, default=0, return_dtype=pl.Int64).fill_null(0).to_numpy()
    stamps, valid = counted(fields, fraction, zone)
    found = valid & groups[names[6]].is_not_null().to_numpy()
    return pl.Series(np.where(found, (stamps - form.origin) / 1e9, 0.0)).set(pl.Series(~found), None)

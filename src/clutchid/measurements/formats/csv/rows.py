"""Rows of CSV, read by polars: lines that it does not cut into cells are cut by the library csv before.

Cells that are no plain numbers are interpreted word by word; the line and the column of every problem are kept.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.measurements.columns import Heading
from clutchid.measurements.formats.csv import cells as csv_cells
from clutchid.measurements.formats.csv.cells import CellForm, matches, value_of
from clutchid.measurements.formats.csv.dialect import Dialect, is_words
from clutchid.measurements.formats.csv.lines import LineBlock, is_comment, split
from clutchid.measurements.no_value import means_no_value
from clutchid.measurements.source import Places, Rows, Table, joined_tables
from clutchid.messages import SHOWN, listed, shortened

if TYPE_CHECKING:
    import polars as pl


@dataclass(eq=False, slots=True)
class ParsedRows:
    """Samples of some lines, and invalid cells and lines; the table has no headings and no problems yet.

    `texts` and `ragged` are the first invalid cells and lines, for messages; after `broken` nothing could be read.
    `none` counts, by column, the cells that say that there is no value; `left_out` are the numbers of lines that hold
    no sample.
    """

    table: Table
    texts: dict[int, list[str]] = field(default_factory=dict)
    ragged: list[str] = field(default_factory=list)
    ragged_count: int = 0
    broken: str = ""
    none: Counter[int] = field(default_factory=Counter)
    left_out: list[int] = field(default_factory=list)


def read_rows(
    block: LineBlock, dialect: Dialect, selected: Sequence[Heading], *, small: bool = False, by_line: bool = False
) -> ParsedRows:
    """The samples of some lines.

    Lines with another number of cells than the header are left out, and so are those that hold no sample: the names
    again, remarks, and what was not written to its end. Cells that are no numbers are NaN.

    Parameters
    ----------
    small
        Read plain numbers by NumPy: polars is faster, but takes 0.2 s to import.
    by_line
        A cell ends at the end of its line, so that a quote that is left open takes no other line with it.
    """
    if (text := plain_text(block, dialect, by_line)) is not None:
        numeric = _with_points(text, dialect, selected)
        part = _by_numpy(numeric, dialect, selected) if small and numeric is not None else None
        part = part or _by_polars(text, numeric, dialect, selected)
        if part and part.table.size == block.lines:
            part.table = replace(part.table, places=Places("line", block.first))
            return part
    return _cut(block, dialect, selected, by_line)


def plain_text(block: LineBlock, dialect: Dialect, by_line: bool) -> bytes | None:
    """Lines that have as many separators as the header, and none in quotes; None where they have not."""
    text, width = block.text, len(dialect.headings)
    special = b'"' in text
    if by_line and (special or b"\0" in text):
        return None
    if dialect.separator == " ":
        if special:
            return None
        text = text.replace(b"\t", b" ")
        while b"  " in text:
            text = text.replace(b"  ", b" ")
        text = text.replace(b" \n", b"\n").replace(b"\n ", b"\n").removeprefix(b" ")
    if width == 1 and (b"\n\n" in text or text.startswith(b"\n")):
        return None
    return text if text.count(dialect.separator.encode()) == block.lines * (width - 1) else None


def _cut(block: LineBlock, dialect: Dialect, selected: Sequence[Heading], by_line: bool) -> ParsedRows:
    """The samples of lines that are cut into cells one by one."""
    import polars as pl

    lines: list[int] = []
    rows: list[list[str]] = []
    ragged: list[str] = []
    left_out: list[int] = []
    count, broken = 0, ""
    last = block.first + block.lines - 1 if not block.text.endswith(b"\n") else 0
    again = [split(line, dialect.separator) for line in dialect.above]
    for line, cells in _rows(block, dialect.separator, by_line):
        if isinstance(cells, str):
            broken = cells
        elif _holds_none(cells, again, dialect, unfinished=line == last):
            left_out.append(line)
        elif len(cells) == len(dialect.headings):
            rows.append([cells[column.index] for column in selected])
            lines.append(line)
        elif len(cells) > 1 or (cells and cells[0].strip()):
            ragged += [f"line {line} has {len(cells)}"] if count < SHOWN else []
            count += 1
    columns = zip(*rows, strict=True) if rows else [()] * len(selected)
    texts = {str(column.index): cells for column, cells in zip(selected, columns, strict=True)}
    part = _interpreted(pl.DataFrame(texts, schema=dict.fromkeys(texts, pl.String)), dialect, selected)
    part.table = replace(part.table, size=len(lines), places=Places("line", numbers=np.array(lines, dtype=np.int64)))
    part.ragged, part.ragged_count, part.broken, part.left_out = ragged, count, broken, left_out
    return part


def _holds_none(cells: Sequence[str], again: Sequence[Sequence[str]], dialect: Dialect, *, unfinished: bool) -> bool:
    """Whether a line holds no sample: the names or units `again`, a remark, or what was not written to its end."""
    if not cells:
        return False
    if "\0" in "".join(cells) or [cells[0].lstrip("\ufeff"), *cells[1:]] in again:
        return True
    width, remark = len(dialect.headings), len(cells) == 1 or dialect.separator == " "
    return len(cells) != width and (
        is_comment(cells[0], "") or (remark and is_words(cells)) or (unfinished and len(cells) < width)
    )


def _rows(block: LineBlock, separator: str, by_line: bool) -> Iterator[tuple[int, list[str] | str]]:
    """Line number and cells of each row; at the first row that cannot be cut, the reason."""
    text = io.StringIO(block.text.decode("utf-8", "replace"), newline="\n")
    if by_line or separator == " ":
        yield from ((number, split(line.rstrip("\n"), separator)) for number, line in enumerate(text, block.first))
        return
    rows = csv.reader(text, delimiter=separator)
    line = block.first
    try:
        for cells in rows:
            yield line, cells
            line = block.first + rows.line_num
    except csv.Error as error:
        yield line, f"line {line}: cannot be split into cells ({error}); is a quotation mark left open?"


def _with_points(text: bytes, dialect: Dialect, selected: Sequence[Heading]) -> bytes | None:
    """Lines with decimal points, if all cells that are selected may be numbers."""
    kinds = {dialect.forms[column.index].kind for column in selected}
    if kinds != {"number"} or b'"' in text:
        return None
    if dialect.decimal != ",":
        return text
    return None if b"." in text or dialect.separator == "," else text.replace(b",", b".")


def _by_numpy(numeric: bytes, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows | None:
    """The samples of cells that are numbers or empty, all of them; None where others are among them."""
    text, mark = numeric.decode("utf-8", "replace").removesuffix("\n"), re.escape(dialect.separator)
    delimiter = None if dialect.separator == " " else dialect.separator
    for empty in (None, rf"(?m)(?:^|(?<={mark}))(?={mark}|$)"):
        with suppress(ValueError):
            lines = (re.sub(empty, "nan", text) if empty else text).split("\n")
            numbers = np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2)
            columns = {column.index: np.ascontiguousarray(numbers[:, column.index]) for column in selected}
            return ParsedRows(Table(numbers=columns, size=len(numbers)))
    return None


def _by_polars(text: bytes, numeric: bytes | None, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows | None:
    """The samples of lines that polars cuts, as numbers where they are `numeric`; None where it cuts none."""
    import polars as pl

    with suppress(pl.exceptions.PolarsError, pl.exceptions.PanicException):
        if numeric is not None:
            with suppress(pl.exceptions.PolarsError):
                frame = _frame(numeric, dialect, selected, pl.Float64())
                columns = {column.index: frame[str(column.index)].to_numpy() for column in selected}
                return ParsedRows(Table(numbers=columns, size=frame.height))
        if b"\0" in text or any(line.encode() in text for line in dialect.above):
            return None
        return _interpreted(_frame(text, dialect, selected, pl.String()), dialect, selected)
    return None


def _interpreted(frame: pl.DataFrame, dialect: Dialect, selected: Sequence[Heading]) -> ParsedRows:
    """The samples of cells, of which each word is interpreted once."""
    import polars as pl

    part = ParsedRows(Table())
    numbers: dict[int, FloatArray] = {}
    unread: dict[int, Rows] = {}
    for column in selected:
        form, cells = dialect.forms[column.index], frame[str(column.index)]
        stripped = cells.str.strip_chars()
        values = _stamps(stripped, form) if form.kind == "stamp" else _plain(stripped, form)
        not_number = values.is_null() & stripped.is_not_null()
        must_be_numeric = column.name is not None or form.kind != "text"
        if not_number.any():
            meanings = {word: value_of(word, form) for word in stripped.filter(not_number).unique().to_list()}
            none = [word for word, value in meanings.items() if value is None and means_no_value(word)]
            if must_be_numeric and none:
                meanings |= dict.fromkeys(none, math.nan)
                part.none[column.index] = int(stripped.is_in(none).sum())
            numbers_of = {word: value for word, value in meanings.items() if value is not None}
            words = stripped.replace_strict(numbers_of, default=None, return_dtype=pl.Float64)
            invalid = not_number & words.is_null()
            values = values.fill_null(words)
            if must_be_numeric and invalid.any():
                unread[column.index] = rows = invalid.arg_true().to_numpy().astype(np.int64)
                part.texts[column.index] = cells.gather(rows[:SHOWN]).to_list()
        numbers[column.index] = values.to_numpy()
    part.table = Table(numbers=numbers, size=frame.height, unread=unread)
    return part


def _frame(text: bytes, dialect: Dialect, selected: Sequence[Heading], kind: pl.DataType) -> pl.DataFrame:
    """The selected cells of each line, called by the index of their column."""
    import polars as pl

    places = [column.index for column in selected]
    return pl.read_csv(
        text,
        has_header=False,
        separator=dialect.separator,
        schema={str(i): kind if i in places else pl.String() for i in range(len(dialect.headings))},
        columns=places,
    )


def joined_parts(parts: Sequence[ParsedRows]) -> ParsedRows:
    """Join consecutive parts."""
    if len(parts) == 1:
        return parts[0]
    whole = ParsedRows(joined_tables([part.table for part in parts]))
    for part in parts:
        for index, cells in part.texts.items():
            texts = whole.texts.setdefault(index, [])
            texts += cells[: SHOWN - len(texts)]
        whole.ragged += part.ragged[: SHOWN - len(whole.ragged)]
        whole.ragged_count += part.ragged_count
        whole.broken = whole.broken or part.broken
        whole.none += part.none
        whole.left_out += part.left_out
    return whole


def part_table(part: ParsedRows, dialect: Dialect) -> Table:
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
    warnings = [
        f"column '{columns[index].text}': {count:,} cells say that there is no value; these samples are missing."
        for index, count in sorted(part.none.items())
    ]
    if part.left_out:
        lines = listed(map(str, part.left_out), total=len(part.left_out))
        warnings.append(
            f"line {lines} holds no sample: it repeats the names, is a remark, or was not written to the end."
            if len(part.left_out) == 1
            else f"lines {lines} hold no sample: they repeat the names, are remarks, or were not written to the end."
        )
    return replace(part.table, headings=columns, problems=tuple(problems), warnings=tuple(warnings))


def _advice(texts: Sequence[str], dialect: Dialect, index: int) -> str:
    """Advice on how to correct these cells."""
    cells = [text.strip() for text in texts]
    commas = [matches(csv_cells.COMMA, cell) for cell in cells]
    kind = dialect.forms[index].kind
    advice = (
        (kind == "stamp", "write date and time as in the other cells, for example 2024-05-01T12:00:00.001"),
        (all(":" in cell for cell in cells), f"write date and time as {csv_cells.STAMPS_SHOWN}"),
        (kind == "truth", "write 1 or 0"),
        (
            not dialect.decimal and any(matches(csv_cells.AMBIGUOUS, cell) for cell in cells),
            "the comma may be a decimal or a thousands separator: write a decimal point",
        ),
        (
            any(matches(csv_cells.THOUSANDS, cell) for cell in cells) and not all(commas),
            "write a number without thousands separators",
        ),
        (
            dialect.decimal == "," and any(map(csv_cells.NUMBER.fullmatch, cells)),
            "the decimal mark of this file is the comma: write a number without a point",
        ),
        (any(commas), "write a number with a decimal point"),
    )
    return next((text for holds, text in advice if holds), "write a number like 0.0125")


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

    for pattern, instead in csv_cells.SPELLED:
        cells = cells.str.replace(pattern, instead)
    groups = cells.str.extract_groups(csv_cells.STAMP).struct.unnest()
    names = groups.columns
    fields = [groups[name].cast(pl.Int64, strict=False).fill_null(0).to_numpy() for name in names[: csv_cells.FIELDS]]
    fraction = groups[names[csv_cells.FRACTION]].fill_null("").str.pad_end(9, "0").cast(pl.Int64).to_numpy()

    def meant(group: int, meaning: Callable[[str], int], none: int) -> NDArray[np.int64]:
        texts = groups[names[group]]
        meanings = {text: meaning(text) for text in texts.drop_nulls().unique().to_list()}
        return texts.replace_strict(meanings, default=none, return_dtype=pl.Int64).fill_null(none).to_numpy()

    fields[csv_cells.MONTH] = meant(csv_cells.MONTH, csv_cells.month_number, 0)
    stamps, valid = csv_cells.counted(
        fields,
        fraction,
        meant(csv_cells.HALF, csv_cells.half_hours, -1),
        meant(csv_cells.ZONE, csv_cells.zone_minutes, 0),
    )
    valid &= groups[names[12]].is_not_null().to_numpy()
    return pl.Series(np.where(valid, (stamps - form.origin) / 1e9, 0.0)).set(pl.Series(~valid), None)

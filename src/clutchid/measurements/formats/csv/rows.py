"""Rows of a text table as numbers: NumPy or polars cut plain lines, the library csv all others.

The line and the column of every problem are kept.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.columns import Heading
from clutchid.measurements.formats.csv.cells import AMBIGUOUS, STAMPS_SHOWN, is_words, numbers_of, split
from clutchid.measurements.formats.csv.dialect import Dialect
from clutchid.measurements.formats.csv.header import is_comment
from clutchid.measurements.formats.csv.text import TextBlock
from clutchid.measurements.source import Places, Rows, Table, joined_tables
from clutchid.messages import SHOWN, listed, shortened

if TYPE_CHECKING:
    import polars as pl


@dataclass(slots=True)
class TextReading:
    """The samples of some columns from the blocks so far, and what could not be read.

    A cell that is no number is NaN. A line with another number of cells than the header is left out: without a word
    where it is blank, with a warning where it repeats the header, is a remark or was not written to its end, else with
    a problem. Numbers of a `small` file are read by NumPy: polars is faster, but takes 0.2 s to import. A cell of
    `by_line` ends with its line, so that an open quote takes no other with it.
    """

    dialect: Dialect
    selected: Sequence[Heading]
    small: bool = False
    by_line: bool = False
    parts: list[Table] = field(default_factory=list)
    invalid: dict[int, list[str]] = field(default_factory=dict)
    none: Counter[int] = field(default_factory=Counter)
    ragged: list[str] = field(default_factory=list)
    left_out: list[int] = field(default_factory=list)
    broken: str = ""
    size: int = 0

    def add(self, block: TextBlock) -> None:
        """Read the next lines."""
        plain = plain_text(block, self.dialect, self.by_line)
        numbers = _numbers(plain, self.dialect, self.selected) if plain is not None and self.small else None
        unread: dict[int, Rows] = {}
        places = Places("line", block.first)
        if numbers is None:
            cells = _cells(plain, block.lines, self.dialect, self.selected) if plain is not None else {}
            read = {index: self._read(index, texts) for index, texts in cells.items()}
            if not cells or any(
                rows.size for _, rows, _ in read.values()
            ):  # lines that hold no sample may be the cause
                cells, places = self._cut(block)
                read = {index: self._read(index, texts) for index, texts in cells.items()}
            numbers = {index: values for index, (values, _, _) in read.items()}
            unread = {index: rows for index, (_, rows, _) in read.items() if rows.size}
            for index, rows in unread.items():
                shown = zip(rows[:SHOWN].tolist(), cells[index].gather(rows[:SHOWN]).to_list(), strict=True)
                texts = self.invalid.setdefault(index, [])
                texts += [f"line {places.number(row)} has '{shortened(text)}'" for row, text in shown]
            self.none += Counter({index: none for index, (_, _, none) in read.items()})
        height = max(map(len, numbers.values()), default=0)
        if self.dialect.even and self.dialect.clock in numbers:
            start, step = self.dialect.even
            numbers[self.dialect.clock] = start + step * np.arange(self.size, self.size + height, dtype=np.float64)
        self.size += height
        self.parts.append(Table(self.dialect.headings, numbers, height, places, unread=unread))

    def _read(self, index: int, cells: pl.Series) -> tuple[FloatArray, Rows, int]:
        """As `numbers_of`; of a column of words nothing is invalid."""
        if cells.dtype.is_numeric():
            return cells.to_numpy(), np.empty(0, dtype=np.int64), 0
        numbers, rows, none = numbers_of(cells, self.dialect.forms[index], self.dialect.decimal)
        is_words = self.dialect.headings[index].name is None and self.dialect.forms[index].kind == "text"
        return (numbers, rows[:0], 0) if is_words else (numbers, rows, none)

    def _cut(self, block: TextBlock) -> tuple[dict[int, pl.Series], Places]:
        """The cells of lines that are cut one by one, and where they are."""
        import polars as pl

        lines, rows, width = [], [], len(self.dialect.headings)
        unfinished = block.first + block.lines - 1 if not block.text.endswith(b"\n") else 0
        again = [split(line, self.dialect.separator) for line in self.dialect.above]
        for number, cells in self._rows(block):
            if not "".join(cells).strip() and (len(cells) < 2 or len(cells) != width):
                continue
            if "\0" in "".join(cells) or [cells[0].lstrip("\ufeff"), *cells[1:]] in again:
                self.left_out.append(number)
            elif len(cells) == width:
                lines.append(number)
                rows.append([cells[column.index] for column in self.selected])
            elif (
                is_comment(cells[0], "")
                or (number == unfinished and len(cells) < width)
                or ((len(cells) == 1 or self.dialect.separator == " ") and is_words(cells))
            ):
                self.left_out.append(number)
            else:
                self.ragged.append(f"line {number} has {len(cells)}")
        columns = zip(*rows, strict=True) if rows else [()] * len(self.selected)
        named = zip(self.selected, columns, strict=True)
        cells_of = {column.index: pl.Series(texts, dtype=pl.String) for column, texts in named}
        return cells_of, Places("line", numbers=np.array(lines, dtype=np.int64))

    def _rows(self, block: TextBlock) -> Iterator[tuple[int, list[str]]]:
        """Number and cells of each line."""
        text = io.StringIO(block.text.decode("utf-8", "replace"), newline="\n")
        if self.by_line or self.dialect.separator == " ":
            for number, line in enumerate(text, block.first):
                yield number, split(line.rstrip("\n"), self.dialect.separator)
            return
        rows, number = csv.reader(text, delimiter=self.dialect.separator, strict=True), block.first
        try:
            for cells in rows:
                yield number, cells or [""]
                number = block.first + rows.line_num
        except csv.Error as error:
            self.broken = f"line {number}: cannot be split into cells ({error}); is a quotation mark left open?"

    def table(self) -> Table:
        """The samples since the last call, with problems and warnings."""
        whole, notation = joined_tables(self.parts), self.dialect
        problems = [self.broken] if self.broken else []
        if self.ragged:
            problems.append(
                f"the {'header' if notation.header else 'first line'} has {len(notation.headings)} cells, but "
                f"{listed(self.ragged)}; give every line one cell for each column, empty where a sample is missing."
            )
        for index, shown in sorted(self.invalid.items()):
            problems.append(
                f"column '{notation.headings[index].text}' contains cells that are not numbers: "
                f"{listed(shown[:SHOWN], total=whole.unread[index].size)}; {_advice(shown[:SHOWN], notation, index)}, "
                "or leave the cell empty where the sample is missing."
            )
        warnings = [
            f"column '{notation.headings[index].text}': {count:,} {'cells say' if count != 1 else 'cell says'} that "
            "the value is not available; these samples are missing."
            for index, count in sorted(self.none.items())
        ]
        if self.left_out:
            where = listed(map(str, self.left_out))
            warnings.append(f"left out line {where}: repeated column names, a remark, or an incomplete line.")
        self.parts, self.invalid, self.none, self.ragged, self.left_out = [], {}, Counter(), [], []
        return replace(whole, problems=tuple(problems), warnings=tuple(warnings))


def plain_text(block: TextBlock, dialect: Dialect, by_line: bool) -> bytes | None:
    """Lines that have as many separators as the header, and none in quotes; None where they have not."""
    text, width = block.text, len(dialect.headings)
    if b"\0" in text or (b'"' in text and (by_line or dialect.separator == " ")):
        return None
    if dialect.separator == " ":
        text = text.replace(b"\t", b" ")
        while b"  " in text:
            text = text.replace(b"  ", b" ")
        text = text.replace(b" \n", b"\n").replace(b"\n ", b"\n").strip(b" ")
    if width == 1 and re.search(rb"(?:^|\n)\s*\n", text):
        return None
    return text if text.count(dialect.separator.encode()) == block.lines * (width - 1) else None


def _with_points(text: bytes, dialect: Dialect, selected: Sequence[Heading]) -> bytes | None:
    """Lines whose numbers have decimal points; None where another mark is among them, or words are selected."""
    if b'"' in text or not {dialect.forms[column.index].kind for column in selected} <= {"number", "stamp"}:
        return None
    if dialect.decimal != ",":
        return text
    return None if b"." in text or dialect.separator == "," else text.replace(b",", b".")


def _numbers(text: bytes, dialect: Dialect, selected: Sequence[Heading]) -> dict[int, FloatArray] | None:
    """The columns of cells that are numbers or empty, all of them; None where others are among them."""
    pointed, mark = _with_points(text, dialect, selected), re.escape(dialect.separator)
    if pointed is None or not selected or any(dialect.forms[column.index].kind != "number" for column in selected):
        return None
    lines, delimiter = pointed.decode("utf-8", "replace").removesuffix("\n"), dialect.separator.strip(" ") or None
    chosen = [column.index for column in selected]
    for empty in (None, rf"(?m)(?:^|(?<={mark}))(?={mark}|$)"):
        with suppress(ValueError):
            filled = re.sub(empty, "nan", lines) if empty else lines
            numbers = np.loadtxt(
                filled.split("\n"), delimiter=delimiter, comments=None, ndmin=2, usecols=chosen, unpack=True
            )
            return {index: np.ascontiguousarray(values) for index, values in zip(chosen, numbers, strict=True)}
    return None


def _cells(text: bytes, lines: int, dialect: Dialect, selected: Sequence[Heading]) -> Mapping[int, pl.Series]:
    """The columns of lines that polars cuts, as numbers where all are; none where it cuts other lines."""
    import polars as pl

    places = [column.index for column in selected]
    numeric = {str(index): pl.Float64() for index in places if dialect.forms[index].kind == "number"}
    for content, kinds in ((_with_points(text, dialect, selected), numeric), (text, {})):
        with suppress(pl.exceptions.PolarsError, pl.exceptions.PanicException):
            schema = {str(index): pl.String() for index in range(len(dialect.headings))} | kinds
            if content is not None:
                frame = pl.read_csv(
                    content, has_header=False, separator=dialect.separator, schema=schema, columns=places
                )
                return {index: frame[str(index)] for index in places} if frame.height == lines else {}
    return {}


def _advice(shown: Sequence[str], dialect: Dialect, index: int) -> str:
    """Advice on how to correct cells, of which a message shows the text in quotes."""
    cells = [text.partition("'")[2].removesuffix("'").strip() for text in shown]
    is_time = dialect.headings[index].name == "time" and all(":" in cell for cell in cells)
    if is_time or dialect.forms[index].kind == "stamp":
        return f"write date and time as {STAMPS_SHOWN}"
    if not dialect.decimal and any(map(AMBIGUOUS.fullmatch, cells)):
        return "the comma may be a decimal or a thousands separator: write a decimal point"
    return f"write a number such as {'0,0125' if dialect.decimal == ',' else '0.0125'}, without thousands separators"

"""Read CSV cell by cell, for text that the fast parsers refuse: reports every problem with line and column."""

from __future__ import annotations

import csv
import io
from array import array
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from clutchid.log import FloatArray
from clutchid.recordings.columns import Heading, shortened
from clutchid.recordings.formats.csv.cells import AMBIGUOUS, COMMA, NUMBER, THOUSANDS, matches, reader
from clutchid.recordings.formats.csv.dialect import Dialect
from clutchid.recordings.formats.csv.header import split
from clutchid.recordings.formats.csv.lines import Block
from clutchid.recordings.table import SHOWN, Places, Rows, Table, and_more, joined_samples

Cell = Callable[[str], float | None]


@dataclass(eq=False, slots=True)
class Part:
    """Samples of some lines: values by column, their line numbers, and invalid cells and lines.

    `unread` has all rows with an invalid cell; `texts` and `ragged` the first invalid cells and lines, for messages;
    after `broken` nothing could be read.
    """

    size: int
    places: Places
    numbers: dict[int, FloatArray]
    unread: dict[int, Rows] = field(default_factory=dict)
    texts: dict[int, list[str]] = field(default_factory=dict)
    ragged: list[str] = field(default_factory=list)
    ragged_count: int = 0
    broken: str = ""


def must_be_numeric(column: Heading, dialect: Dialect) -> bool:
    """Whether a cell that is not a number is a problem; in an unknown column of text it is not."""
    return column.name is not None or dialect.forms[column.index].kind != "text"


def read_text(block: Block, dialect: Dialect, selected: Sequence[Heading]) -> Part:
    """Read lines whose text is not a plain table of numbers.

    Lines with another number of cells than the header are dropped; cells that are not numbers are NaN.
    """
    part = Part(0, Places("line"), {})
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
                if numeric:
                    unread[index].append(len(lines))
                    _text(part, index, cells[index])
            numbers[index].append(value)
        lines.append(line)
    part.size = len(lines)
    part.places = Places("line", numbers=np.frombuffer(lines, np.int64))
    part.numbers = {column.index: np.frombuffer(numbers[column.index], np.float64) for column in selected}
    part.unread = {index: np.frombuffer(rows, np.int64) for index, rows in unread.items()}
    return part


def _rows(block: Block, separator: str, part: Part) -> Iterator[tuple[int, list[str]]]:
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


def _ragged(part: Part, line: int, cells: Sequence[str]) -> None:
    """Record a line with another number of cells, unless it is blank."""
    if len(cells) > 1 or (cells and cells[0].strip()):
        part.ragged_count += 1
        if len(part.ragged) < SHOWN:
            part.ragged.append(f"line {line} has {len(cells)}")


def _text(part: Part, index: int, cell: str) -> None:
    texts = part.texts.setdefault(index, [])
    if len(texts) < SHOWN:
        texts.append(cell)


def joined(parts: Sequence[Part]) -> Part:
    """Join consecutive parts."""
    if len(parts) == 1:
        return parts[0]
    numbers, size, places, unread = joined_samples(parts)
    whole = Part(size, places, numbers, unread)
    for part in parts:
        for index, cells in part.texts.items():
            for cell in cells:
                _text(whole, index, cell)
        whole.ragged += part.ragged[: SHOWN - len(whole.ragged)]
        whole.ragged_count += part.ragged_count
        whole.broken = whole.broken or part.broken
    return whole


def table(part: Part, dialect: Dialect) -> Table:
    """Table of a part, with messages about its problems."""
    columns = dialect.headings
    problems = [part.broken] if part.broken else []
    if part.ragged:
        lines = and_more(part.ragged, part.ragged_count - len(part.ragged))
        problems.append(
            f"the {'header' if dialect.header else 'first line'} has {len(columns)} cells, but {lines}; "
            "give every line one cell for each column, empty where a sample is missing."
        )
    for index, texts in sorted(part.texts.items()):
        rows = part.unread[index]
        shown = [
            f"line {part.places.number(row)} has '{shortened(text)}'" for row, text in zip(rows, texts, strict=False)
        ]
        problems.append(
            f"column '{columns[index].text}' contains cells that are not numbers: "
            f"{and_more(shown, len(rows) - len(shown))}; {_advice(texts, dialect, index)}, or leave the cell empty "
            "where the sample is missing."
        )
    metadata = {"start": dialect.start} if dialect.start else {}
    return Table(columns, part.numbers, part.size, part.places, tuple(problems), part.unread, metadata)


def _advice(texts: Sequence[str], dialect: Dialect, index: int) -> str:
    """Advice on how to correct these cells."""
    cells = [text.strip() for text in texts]
    commas = [matches(COMMA, cell) for cell in cells]
    if dialect.forms[index].kind == "stamp":
        return "write date and time as in the other cells, for example 2024-05-01T12:00:00.001"
    if dialect.forms[index].kind == "truth":
        return "write 1 or 0"
    if not dialect.decimal and any(matches(AMBIGUOUS, cell) for cell in cells):
        return "the comma may be a decimal or a thousands separator: write a decimal point"
    if any(matches(THOUSANDS, cell) for cell in cells) and not all(commas):
        return "write a number without thousands separators"
    if dialect.decimal == "," and any(map(NUMBER.fullmatch, cells)):
        return "the decimal mark of this file is the comma: write a number without a point"
    return "write a number " + ("with a decimal point" if any(commas) else "like 0.0125")

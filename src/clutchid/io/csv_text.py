"""CSV read cell by cell, for files that the fast parsers refuse: every problem with its line and column."""

from __future__ import annotations

import csv
import re
from array import array
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clutchid.io.columns import Heading, shortened
from clutchid.io.table import SHOWN, Places, Table, and_more

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+\s*")


@dataclass(frozen=True, slots=True)
class Head:
    """The header of a CSV file: its cells, the separator, its line and the byte where the samples begin."""

    cells: Sequence[str]
    separator: str
    line: int
    end: int


@dataclass(slots=True)
class _Found:
    """What was found so far: numbers, the lines they stand on, and what is no number or no sample."""

    lines: array[int] = field(default_factory=lambda: array("q"))
    numbers: dict[int, array[float]] = field(default_factory=lambda: defaultdict(lambda: array("d")))
    unread: dict[int, array[int]] = field(default_factory=lambda: defaultdict(lambda: array("q")))
    texts: dict[int, list[str]] = field(default_factory=lambda: defaultdict(list))
    ragged: list[str] = field(default_factory=list)
    ragged_count: int = 0


def read_text(path: Path, head: Head, columns: tuple[Heading, ...], selected: tuple[Heading, ...]) -> Table:
    """The numbers of a CSV file whose text is not a plain table of numbers.

    Lines with another number of cells than the header are left out, cells that are no number are NaN; both are in
    ``Table.problems``. Text in a column without a meaning is no problem.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    found = _Found()
    problems = []
    with path.open(encoding="utf-8-sig", newline="") as file:
        for _ in range(head.line):
            file.readline()
        reader = csv.reader(file, delimiter=head.separator)
        line = head.line + 1
        try:
            for cells in reader:
                _take(found, cells, line, len(columns), selected)
                line = head.line + reader.line_num + 1
        except csv.Error as error:
            problems.append(f"line {line}: cannot be split into cells ({error}); is a quotation mark left open?")
    problems += _problems(found, columns)
    numbers = {column.index: _floats(found.numbers[column.index]) for column in selected}
    unread = {index: _integers(rows) for index, rows in found.unread.items()}
    size = len(found.lines)
    return Table(columns, numbers, size, Places("line", numbers=_integers(found.lines)), tuple(problems), unread)


def _take(found: _Found, cells: list[str], line: int, width: int, selected: tuple[Heading, ...]) -> None:
    """Add one line of the file to what was found."""
    if len(cells) != width:
        if len(cells) > 1 or (cells and cells[0].strip()):
            found.ragged_count += 1
            if len(found.ragged) < SHOWN:
                found.ragged.append(f"line {line} has {len(cells)}")
        return
    row = len(found.lines)
    found.lines.append(line)
    for column in selected:
        value = _number(cells[column.index])
        if value is None:
            value = np.nan
            if column.name is not None:
                found.unread[column.index].append(row)
                if len(found.texts[column.index]) < SHOWN:
                    found.texts[column.index].append(cells[column.index])
        found.numbers[column.index].append(value)


def _number(text: str) -> float | None:
    """The number that `text` is; NaN for an empty cell, None for anything else."""
    try:
        value = float(text)
    except ValueError:
        return None if text.strip() else np.nan
    return value if text.isascii() and "_" not in text else None


def _problems(found: _Found, columns: tuple[Heading, ...]) -> list[str]:
    problems = []
    if found.ragged:
        lines = and_more(found.ragged, found.ragged_count - len(found.ragged))
        problems.append(
            f"the header has {len(columns)} cells, but {lines}; "
            "give every line one cell for each column, empty where a sample is missing."
        )
    for index, texts in sorted(found.texts.items()):
        rows = found.unread[index]
        shown = [f"line {found.lines[row]} has '{shortened(text)}'" for row, text in zip(rows, texts, strict=False)]
        hint = "with a decimal point" if any(map(_DECIMAL_COMMA.fullmatch, texts)) else "like 0.0125"
        problems.append(
            f"column '{columns[index].text}' holds what is no number: {and_more(shown, len(rows) - len(shown))}; "
            f"write a number {hint}, or leave the cell empty where the sample is missing."
        )
    return problems


def _floats(values: array[float]) -> NDArray[np.float64]:
    return np.frombuffer(values, dtype=np.float64)


def _integers(values: array[int]) -> NDArray[np.int64]:
    return np.frombuffer(values, dtype=np.int64)

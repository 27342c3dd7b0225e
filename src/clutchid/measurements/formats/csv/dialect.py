"""Dialect of a CSV file, detected from its first lines: separator, header, units, decimal mark, column types."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from clutchid.log.units import UNITS
from clutchid.measurements.columns import Heading, distinct, headings, unit_spelled
from clutchid.measurements.formats.csv.cells import (
    GROUPED,
    CellForm,
    decimal_mark,
    form,
    is_missing,
    matches,
    nanoseconds,
    numberlike,
    written,
)
from clutchid.measurements.formats.csv.lines import (
    heading,
    is_comment,
    records,
    split,
    split_header,
    uncommented,
    units_in,
)
from clutchid.messages import shortened

_SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}

#: Number of lines that are examined, and number of samples that determine the type of a column.
_EXAMINED = 1000
_TYPED = 100
_ABOVE = 12

#: Lines below a header that a separator should fit, and cells with points that show that these group thousands.
_BELOW, _POINTED = 20, 5
_BETWEEN = 3
_KEPT = 50

#: Names that LabVIEW gives to the time and to an empty column after the last one, and to the units above the names.
_TIME, _REMARK, _LABELS = "X_Value", "Comment", "Y_Unit_Label"

#: A time up to its fraction of a second, and that.
_FRACTION = r"(.*\d[.,:])(\d{1,3})"
_CLOCK = re.compile(r"time|zeit|stamp|^t\b", re.IGNORECASE)

#: What LabVIEW writes below lines of numbers that are no samples.
_END_OF_HEADER = "***End_of_Header***"

#: Types of numbers.
_TYPE = r"type|[fiu][1248]|u?int(?:8|16|32|64)?|double|single|float(?:32|64)?|real(?:32|64)?|bool(?:ean)?"

Filled = Sequence[tuple[int, str]]


@dataclass(frozen=True, slots=True)
class Dialect:
    """Notation of a CSV file.

    `separator` is a blank for runs of blanks; `decimal` is empty if it is ambiguous; `problems` say what must be
    written otherwise. `header`, `units`, `samples` are
    the lines of the names, of the units (0: there is none) and of the first sample; `above` are the texts of the first
    two. `clock` is the time column, `start` the first time stamp if it contains dates or times, and `started` as it
    is written; `about` is metadata
    above the header.
    """

    separator: str
    decimal: str
    headings: tuple[Heading, ...]
    forms: tuple[CellForm, ...]
    header: int
    units: int
    samples: int
    clock: int | None = None
    start: str = ""
    started: str = ""
    about: Mapping[str, str] = field(default_factory=dict)
    problems: tuple[str, ...] = ()
    above: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The dialect in words."""
        names = f"names on line {self.header}" if self.header else "no names"
        units = f", units on line {self.units}" if self.units else ""
        mark = {".": "decimal point", ",": "decimal comma", "": "whole numbers"}[self.decimal]
        return f"{_SEPARATORS[self.separator]}, {mark}, {names}{units}, samples from line {self.samples}"

    def with_decimal(self, mark: str) -> Dialect:
        """A copy with another decimal mark."""
        return replace(self, decimal=mark, forms=tuple(replace(form, decimal=mark) for form in self.forms))


@dataclass(frozen=True, slots=True)
class _Structure:
    """Indices of header, units and first sample among the non-blank lines (-1: none), and score of the separator."""

    separator: str
    names: tuple[str, ...]
    header: int
    units: int
    samples: int
    score: tuple[bool, float, int] = (True, 1.0, 1)


def dialect(lines: Sequence[str]) -> Dialect | None:
    """Dialect of a file from its first lines; None if there are only blank lines and comments.

    Examples
    --------
    >>> found = dialect(["Rig;7", "Zeit;Weg", "s;mm", "0;0,25"])
    >>> found.text, found.headings[1].text, found.headings[1].unit
    ('semicolon, decimal comma, names on line 2, units on line 3, samples from line 4', 'Weg', 'mm')
    """
    filled = [(number, line) for number, line in records(lines) if line.strip()][:_EXAMINED]
    first = next((at for at, (_, line) in enumerate(filled) if not is_comment(line, ";")), None)
    if first is None:
        return None
    structure = _by_contract(filled, first) or _by_numbers(filled) or _by_count(filled, first)
    return _dialect(filled, structure)


def _by_contract(filled: Filled, first: int) -> _Structure | None:
    """Structure if the first line that is not a comment has standard names, and therefore is the header."""
    line = filled[first][1]
    best: tuple[tuple[bool, int, int], str, list[str]] = ((False, 0, 0), "", [])
    for separator in _SEPARATORS:
        cells = (
            split_header(line, separator, _width(filled[first + 1 :], line))
            if separator == " "
            else split(line, separator)
        )
        standard = [column for column in headings(cells) if column.name is not None]
        with_unit = sum(column.si is not None for column in standard)
        score = _fits(filled[first + 1 :][:_BELOW], separator, len(cells)), len(standard), with_unit
        if score > best[0] and (len(standard) > 1 or with_unit):
            best = (score, separator, cells)
    if not best[1]:
        return None
    below = filled[first + 1] if first + 1 < len(filled) else (0, "")
    units = first + 1 if below[0] and units_in(split(below[1], best[1])) else -1
    rows = [split(line, best[1]) for _, line in filled[: first + _TYPED]]
    samples = max(first, units) + 1
    while 0 <= units < samples < min(len(rows) - 1, units + _BETWEEN) and is_words(rows[samples]):
        samples += 1
    return _Structure(best[1], tuple(_padded(best[2], rows[samples:])), first, units, samples)


def _width(below: Filled, header: str) -> int:
    """Number of columns of lines between blanks, without any below that of the brackets in the header."""
    sizes = Counter(len(split(line, " ")) for _, line in below[:_BELOW])
    return sizes.most_common(1)[0][0] if sizes else header.count("[")


def _fits(below: Filled, separator: str, width: int) -> bool:
    """Whether most lines below the header have as many cells as it, but for one at the end."""
    sizes = [len(split(line, separator)) for _, line in below]
    return not sizes or 2 * sum(abs(size - width) <= 1 for size in sizes) >= len(sizes)


def is_words(row: Sequence[str]) -> bool:
    """Whether a line contains words, but no sample."""
    words = any(character.isalpha() for cell in row if not is_missing(cell) for character in cell)
    return words and not any(map(numberlike, row))


def _padded(names: list[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Adjust `names` for a separator at the end of every line, or at the end of the header only."""
    longer = [row for row in rows if len(row) == len(names) + 1 and not row[-1].strip()]
    if len(longer) > 0.9 * len(rows):
        return [*names, ""]
    shorter = [row for row in rows if len(row) == len(names) - 1]
    return names[:-1] if not names[-1].strip() and len(shorter) > 0.9 * len(rows) else names


def _by_numbers(filled: Filled) -> _Structure | None:
    """Structure from the numbers: the header is the last text above them with as many cells."""
    structures = []
    for separator in _SEPARATORS:
        rows = [split(line, separator) for _, line in filled]
        tails = [rows[-max(1, len(rows) // part) :][-_TYPED:] for part in (4, 2, 1)]
        structures += [structure for tail in tails if (structure := _with_separator(filled, separator, rows, tail))]
    return max(structures, key=lambda structure: structure.score, default=None)


def _with_separator(
    filled: Filled, separator: str, rows: Sequence[list[str]], tail: Sequence[list[str]]
) -> _Structure | None:
    """Structure for this separator, if these are the last lines of the table."""
    width = Counter(map(len, tail)).most_common(1)[0][0]
    table = [row for row in tail if len(row) == width]
    columns = [column for column in range(width) if _is_numeric([row[column] for row in table])]
    if not columns:
        return None

    def sampled(row: Sequence[str]) -> bool:
        cells = [row[column] for column in columns] if len(row) == width else []
        filled = [cell for cell in cells if not is_missing(cell)]
        starts = bool(cells) and (numberlike(cells[0]) or is_missing(cells[0]))
        return starts and 2 * sum(map(numberlike, filled)) > len(filled)

    ended = max((at for at, (_, line) in enumerate(filled) if line.startswith(_END_OF_HEADER)), default=-1)
    samples = next((at for at, row in enumerate(rows) if at > ended and sampled(row)), -1)
    if samples < 0:
        return None
    while samples and len(rows[samples - 1]) == width and all(map(is_missing, rows[samples - 1])):
        samples -= 1
    above = _names_above(filled, separator, samples, width - all(not row[-1].strip() for row in table), width)
    cells = [cell for row in table for cell in row]
    fitting = len(table) / len(tail) * sum(numberlike(cell) or is_missing(cell) for cell in cells) / len(cells)
    if not above:
        names = tuple(f"column {index + 1}" for index in range(width))
        return _Structure(separator, names, -1, -1, samples, (samples == 0, fitting, width))
    header, units, names = above
    first = max(header, units) + 1
    if all(len(row) == width and _starts_with_number(row) for row in rows[first:samples]):
        samples = first
    return _Structure(separator, names, header, units, samples, (len(names) == width, fitting, width))


def _starts_with_number(row: Sequence[str]) -> bool:
    return bool(row) and numberlike(row[0])


def _is_numeric(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if not is_missing(cell)]
    return bool(filled) and sum(map(numberlike, filled)) >= 0.8 * len(filled)


def _names_above(
    filled: Filled, separator: str, samples: int, least: int, width: int
) -> tuple[int, int, tuple[str, ...]] | None:
    """Lines of the names and of the units, and the names; comments are used only if nothing else matches."""
    texts: dict[bool, list[tuple[int, list[str]]]] = {False: [], True: []}
    ragged = None
    for at in range(samples - 1, max(-1, samples - 1 - _ABOVE), -1):
        line = filled[at][1]
        comment = is_comment(line, separator)
        cells = split_header(uncommented(line) if comment else line, separator, width)
        if len(cells) == width + 1 and cells[-1].strip() == _REMARK:
            cells = cells[:-1]
        if not is_words([cell for cell in cells if not numberlike(cell)]) or _are_types(cells):
            continue
        if least <= len(cells) <= width:
            texts[comment].append((at, cells + [""] * (width - len(cells))))
        elif at == samples - 1 and not comment and len(cells) > 1:
            ragged = (at, -1, tuple(cells))
    fitting = texts[False] or [text for text in texts[True] if width > 1]
    if not fitting:
        return ragged
    while len(fitting) > 1 and fitting[1][0] == fitting[0][0] - 1 and _starts_with_number(fitting[0][1]):
        fitting = fitting[1:]
    for i, (at, cells) in enumerate(fitting[:-1][:2]):
        if units_in(cells):
            header, names = fitting[i + 1]
            return header, at, tuple(names)
    return fitting[0][0], -1, tuple(fitting[0][1])


def _are_types(cells: Sequence[str]) -> bool:
    """Whether these are types of numbers, as a line between names and units has them in exports of ETAS and dSPACE."""
    filled = [cell.strip().casefold() for cell in cells if cell.strip()]
    return len(filled) > 1 and all(matches(_TYPE, cell) for cell in filled)


def _by_count(filled: Filled, first: int) -> _Structure:
    """Structure as a last resort: the first line is the header, its most frequent separator the separator."""
    line = filled[first][1]
    separator = max((",", ";", "\t", "|"), key=line.count)
    return _Structure(separator, tuple(split(line, separator)), first, -1, first + 1)


def _dialect(filled: Filled, structure: _Structure) -> Dialect:
    """Dialect of a structure, with column types from the first and last samples."""
    width = len(structure.names)
    rows = [split(line, structure.separator) for _, line in filled[structure.samples :]]
    examined = [row for row in rows if len(row) == width]
    rows = [row for row in (*rows[:_TYPED], *rows[_TYPED:][-_TYPED:]) if len(row) == width]
    decimal = decimal_mark(cell for row in rows for cell in row)
    forms = tuple(form([row[column] for row in rows], decimal) for column in range(width))
    lines = [number for number, _ in filled]
    units = (units_in(_unit_cells(filled, structure)) or []) if structure.units >= 0 else []
    counted = structure.names[0] == _TIME and any(not is_missing(row[0]) for row in rows)
    if structure.names[0] == _TIME:
        above = (split(line, structure.separator) for _, line in filled[structure.header :: -1])
        units = ["s", *next((labels for name, *labels in above if name == _LABELS), [])]
    columns = distinct(
        _stamped(heading(index, name, units[index] if index < len(units) else None), forms[index])
        for index, name in enumerate(_every_name(structure.names, rows))
    )
    clock = next((column.index for column in columns if column.name == "time"), 0 if counted else None)
    if clock is None:
        clock = next((index for index, cell_form in enumerate(forms) if cell_form.kind == "stamp"), None)
    start = ""
    if clock is not None and forms[clock].kind == "stamp":
        start = next((row[clock] for row in rows if nanoseconds(row[clock]) is not None), "")
    header = lines[structure.header] if structure.header >= 0 else 0
    top = max(structure.header, structure.units)
    below = lines[top] + 1 + filled[top][1].count("\n")
    samples = lines[structure.samples] if top < structure.samples - 1 else below if top >= 0 else lines[0]
    return Dialect(
        structure.separator,
        decimal,
        columns,
        forms,
        header,
        lines[structure.units] if structure.units >= 0 else 0,
        samples,
        clock,
        written(start) if start else "",
        start.strip(),
        _about(filled[: max(structure.header, 0)], structure.separator),
        (
            *(_grouped(columns, [*zip(*rows, strict=True)]) if decimal != "," else ()),
            *_contradicted(columns, forms, units),
            *_unpadded(columns, examined),
        ),
        tuple(filled[at][1] for at in (structure.header, structure.units) if at >= 0),
    )


def _contradicted(columns: Sequence[Heading], forms: Sequence[CellForm], units: Sequence[str]) -> Iterator[str]:
    """Problems of columns whose names have another unit than the row of units below."""
    for column, cells, unit in zip(columns, forms, units, strict=False):
        if column.name is None:  # not read by itself
            continue
        below = unit_spelled(unit)
        named, rowed = UNITS.get(column.unit or ""), UNITS.get(below or "")
        if cells.kind == "number" and named and rowed and named != rowed:
            yield (
                f"column '{column.text}' has the unit {column.unit} in its name and {below} in the row of units; leave "
                "the one that holds."
            )


def _unpadded(columns: Sequence[Heading], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Problems of times whose fractions lack zeros: ``12:00:00.98`` is followed by ``12:00:00.100``.

    Fractions of any number of digits step back then, and as whole numbers they hardly do.
    """
    for column in filter(lambda column: _CLOCK.search(column.text), columns):
        cells = [row[column.index].strip() for row in rows]
        if len({len(cell.rpartition(".")[2]) for cell in cells}) < 2:  # of one length
            continue
        parts = [re.fullmatch(_FRACTION, cell) for cell in cells]
        texts = [part.groups() if part else ("", "") for part in parts]
        steps = [(a, b) for (head, a), (other, b) in pairwise(texts) if head == other and head]
        back = [(a, b) for a, b in steps if len(a) < len(b) and float(f"0.{b}") < float(f"0.{a}")]
        falls = sum(int(a) > int(b) for a, b in steps)
        if len(back) > falls and 3 * falls < len(steps):
            yield (
                f"column '{column.text}': the fraction {back[0][0]} is followed by {back[0][1]}, so they lack zeros; "
                "write milliseconds with three digits."
            )


def _grouped(columns: Sequence[Heading], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Problems of columns of whole numbers some of which have points between their thousands: ``996``, ``1.404``.

    Decimals would have their zeros, ``996.000``, or another number of digits.
    """
    for name, column in zip(columns, rows, strict=False):
        cells = [cell.strip() for cell in column if not is_missing(cell)]
        pointed = [cell for cell in cells if "." in cell]
        whole = [cell for cell in cells if cell.lstrip("+-").isdigit() and cell.lstrip("+-0")]
        plain = len(pointed) + len(whole) + cells.count("0") == len(cells) and max(map(len, whole), default=9) <= len(
            "-999"
        )
        if plain and len(pointed) >= _POINTED and all(matches(GROUPED, cell) for cell in pointed):
            yield (
                f"column '{name.text}' has '{whole[-1]}' and '{pointed[0]}': points that group thousands, where "
                "other tools read decimals; write the numbers without them."
            )


def _every_name(names: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The names, and the number of a column that has samples but no name."""
    used = [any(not is_missing(row[column]) for row in rows) for column in range(len(names))]
    return [name if name.strip() or not used[i] else f"column {i + 1}" for i, name in enumerate(names)]


def _unit_cells(filled: Filled, structure: _Structure) -> list[str]:
    line = filled[structure.units][1]
    text = uncommented(line) if is_comment(line, structure.separator) else line
    return split_header(text, structure.separator, len(structure.names))


def _stamped(column: Heading, form: CellForm) -> Heading:
    """A column of dates or times is read in seconds, whatever its heading says, and truth under % is all or nothing."""
    if form.kind == "truth" and column.unit == "%":
        return replace(column, unit="1")
    return replace(column, unit="s") if form.kind in ("stamp", "seconds") else column


def _about(above: Filled, separator: str) -> dict[str, str]:
    """Names and values above the header."""
    about: dict[str, str] = {}
    for _, line in above:
        text = uncommented(line) if is_comment(line, separator) else line
        cells = [cell.strip() for cell in split(text, separator) if cell.strip()]
        for mark in (":", "="):
            if len(cells) == 1:
                cells = [part.strip() for part in cells[0].split(mark, 1)]
        if len(cells) == 2 and all(cells) and len(about) < _KEPT:
            about.setdefault(shortened(cells[0]), shortened(cells[1], 200))
    return about

"""Dialect of a text table, from its first lines: a candidate for each separator and each header, and one score."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from clutchid.log.units import UNITS
from clutchid.measurements.columns import Heading, distinct, headings, is_unit_of, unit_spelled
from clutchid.measurements.formats.csv.cells import (
    CellForm,
    decimal_mark,
    form,
    is_missing,
    is_words,
    nanoseconds,
    numberlike,
    plain_number,
    split,
    written,
)
from clutchid.measurements.formats.csv.header import heading, is_comment, role, split_header, uncommented, units_in

_SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}

#: Lines that are split, that are scored, in which standard names are looked for, above the samples and below the names
#: in which something may be said of the columns.
_SPLIT, _SCORED, _TOP, _ABOVE, _BELOW = 1000, 200, 60, 12, 4

#: Largest number of lines of a record above the samples; a quote beyond them is a character. The end of a line is in a
#: quoted cell that is not closed there; a quote inside a cell is written twice.
_LONGEST, _OPEN = 100, re.compile(r'(?:^|[,;\t|]) *"(?:[^"]|"")*$')

#: Names that LabVIEW gives to times and to an empty column after the last one, and its line above lines of numbers.
_TIME, _REMARK, _END_OF_HEADER = "X_Value", "Comment", "***End_of_Header***"

#: Cells with a mark that show that it groups thousands; a time up to the fraction of its second, and that.
_GROUPED, _GROUP = 5, r"[+-]?[1-9]\d{{0,2}}(?:{}\d{{3}})+"
_CLOCK, _FRACTION = re.compile(r"time|zeit|stamp|^t\b", re.IGNORECASE), re.compile(r"(.*\d[.,:])(\d{1,3})")

#: Names of columns of which two belong together: signals and their values, seconds and milliseconds.
_SIGNAL = r"(signal|channel|variable|parameter|sensor|kanal|messgr\S+)([ _]?names?)?|name", r"values?|(mess)?wert"
_SECONDS = r"s|secs?|seconds?|sekunden?", r"ms|msecs?|millis?|milliseconds?|millisekunden?"

Lines = Sequence[tuple[int, str]]


@dataclass(frozen=True, slots=True)
class Dialect:
    """Notation of a text table.

    `separator` is a blank for runs of blanks; `decimal` is empty if it is ambiguous; `problems` say what must be
    written otherwise. `header`, `units` (0: there is none) and `samples` are numbers of lines, `above` the texts of the
    first two. `clock` is the time column, `start` its first stamp if that is a date or time; `even` are start and step
    in s of a time that only the header has.
    """

    separator: str
    decimal: str
    headings: tuple[Heading, ...]
    forms: tuple[CellForm, ...]
    header: int
    units: int
    samples: int
    above: tuple[str, ...] = ()
    clock: int | None = None
    start: str = ""
    even: tuple[float, float] | None = None
    problems: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The dialect in words."""
        names = f"names on line {self.header}" if self.header else "no names"
        units = f", units on line {self.units}" if self.units else ""
        mark = {".": "decimal point", ",": "decimal comma", "": "whole numbers"}[self.decimal]
        return f"{_SEPARATORS[self.separator]}, {mark}, {names}{units}, samples from line {self.samples}"


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A separator, the cells of every line, and of how many a row has: what the lines above the samples say.

    `said` has, by their role, the index of a line and its cells; `samples` is the index of the first sample.
    """

    separator: str
    rows: Sequence[list[str]]
    width: int
    samples: int
    said: Mapping[str, tuple[int, list[str]]]

    @property
    def names(self) -> tuple[int, list[str]]:
        """Index of the line of names, -1 without one, and the names."""
        numbered = [f"column {index + 1}" for index in range(self.width)]
        return self.said.get("names") or self.said.get("comment") or (-1, numbered)

    @property
    def score(self) -> tuple[float, ...]:
        """How well this explains the lines: a row for each, names that are known, cells that are samples."""
        rows = self.rows[self.samples :][:_SCORED]
        fitting = [cells for cells in rows if len(cells) == self.width]
        cells = [cell for row in fitting for cell in row]
        share = sum(numberlike(cell) or is_missing(cell) for cell in cells) / max(len(cells), 1)
        header, names = self.names
        standard = [heading for heading in headings(names) if heading.name]
        return (
            self.width > 1,
            2 * len(fitting) >= len(rows),
            len(standard) > 1,
            header >= 0 and len(names) == self.width,
            round(share * len(fitting) / max(len(rows), 1), 2),
            sum(heading.si is not None for heading in standard),
            self.width,
        )


def dialect(lines: Sequence[str]) -> Dialect | None:
    """Dialect of a table from its first lines; None if they hold no table.

    Examples
    --------
    >>> notation = dialect(["Rig;7", "Zeit;Weg", "s;mm", "0;0,25"])
    >>> notation.text, notation.headings[1].text, notation.headings[1].unit
    ('semicolon, decimal comma, names on line 2, units on line 3, samples from line 4', 'Weg', 'mm')
    """
    filled = [(number, text) for number, text in records(lines) if text.strip()][:_SPLIT]
    every = [candidate for separator in _SEPARATORS for candidate in _candidates(filled, separator)]
    return _described(filled, max(every, key=lambda candidate: candidate.score)) if every else None


def records(lines: Sequence[str]) -> list[tuple[int, str]]:
    """Number of the first line, and text, of every record: a cell in quotes may contain line breaks.

    Examples
    --------
    >>> records(['t,"piston', 'travel [mm]"', '0,1', 'a 5" pipe'])
    [(1, 't,"piston\\ntravel [mm]"'), (3, '0,1'), (4, 'a 5" pipe')]
    """
    texts, at = [], 0
    while at < len(lines):
        end, quotes = at + 1, lines[at].count('"')
        if quotes % 2 and not is_comment(lines[at], ";") and _OPEN.search(lines[at]):
            for last in range(at + 1, min(at + _LONGEST, len(lines))):
                quotes += lines[last].count('"')
                if quotes % 2 == 0:
                    end = last + 1
                    break
        texts.append((at + 1, "\n".join(lines[at:end])))
        at = end
    return texts


def _candidates(filled: Lines, separator: str) -> Iterator[_Candidate]:
    """Ways to read the lines with a separator: samples below a line of standard names, or where the numbers begin."""
    rows = [split(text, separator) for _, text in filled]
    for at, cells in enumerate(rows[:_TOP]):
        if is_comment(filled[at][1], separator) or not is_words(cells):
            continue
        width = _usual_width(rows[at + 1 :][:_SCORED] or [cells])
        standard = [heading for heading in headings(split_header(filled[at][1], separator, width)) if heading.name]
        if len(standard) > 1 or any(heading.si for heading in standard):
            yield _with_header(filled, separator, rows, width, at, at + 1)
            break
    ended = max((at for at, (_, text) in enumerate(filled) if text.startswith(_END_OF_HEADER)), default=-1)
    for part in (4, 2, 1):
        tail = rows[-max(1, len(rows) // part) :][-_SCORED:]
        width = _usual_width(tail)
        table = [row for row in tail if len(row) == width]
        columns = [index for index in range(width) if _is_numeric([row[index] for row in table])]
        starts = (at for at, row in enumerate(rows) if at > ended and len(row) == width and _is_sample(row, columns))
        first = next(starts, None) if columns else None
        if first is not None:
            while first and len(rows[first - 1]) == width and all(map(is_missing, rows[first - 1])):
                first -= 1
            yield _with_header(filled, separator, rows, width, None, first)


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    return Counter(map(len, rows)).most_common(1)[0][0] if rows else 0


def _is_numeric(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if not is_missing(cell)]
    return bool(filled) and sum(map(numberlike, filled)) >= 0.8 * len(filled)


def _is_sample(row: Sequence[str], columns: Sequence[int]) -> bool:
    """Whether a row has numbers in these columns, and one or none in the first of them."""
    filled = [row[index] for index in columns if not is_missing(row[index])]
    starts = numberlike(row[columns[0]]) or is_missing(row[columns[0]])
    return starts and 2 * sum(map(numberlike, filled)) > len(filled)


def _with_header(
    filled: Lines, separator: str, rows: Sequence[list[str]], width: int, header: int | None, samples: int
) -> _Candidate:
    """A candidate with the lines above its samples that say something of its columns; `header` are standard names."""
    data = [row for row in rows[samples:][:_SCORED] if len(row) == width]
    labelled = any(row[0].strip() == _TIME for row in rows[:samples]) or is_missing(rows[-1][0])

    def at_line(at: int) -> tuple[str, list[str]]:
        text, comment = filled[at][1], is_comment(filled[at][1], separator)
        cells = split_header(uncommented(text) if comment else text, separator, width)
        cells = cells[:-1] if len(cells) == width + 1 and cells[-1].strip() == _REMARK else cells
        return role(cells, comment=comment, labelled=labelled)

    last = min(header + 1 + _BELOW, len(rows) - 1) if header is not None else 0
    while samples < last and (is_words(rows[samples]) or at_line(samples)[0] in ("units", "types", "end")):
        samples += 1
    said: dict[str, tuple[int, list[str]]] = {}
    for at in range(samples - 1, max(-1, samples - 1 - _ABOVE), -1):
        role_of, cells = at_line(at)
        role_of = "names" if at == header or (role_of == "text" and header is None) else role_of
        ragged = len(cells) > width and at not in (header, samples - 1)
        if role_of in ("", "text", *said) or ragged or (role_of == "comment" and "names" in said):
            continue
        lacking = range(len(cells), width)  # without a name, and without samples
        empty = all(is_missing(row[index]) for row in data for index in lacking)
        remark = role_of == "names" and header is None and sum(map(bool, map(str.strip, cells))) < width - 1 > 1
        if not remark or at == samples - 1:
            said[role_of] = at, cells + [""] * len(lacking) * (empty or role_of != "names")
    candidate = _Candidate(separator, rows, width, samples, said)
    named = candidate.names[0] >= 0
    first = max([line for line, _ in said.values()], default=-1) + 1 if named else samples
    while first < samples and (is_comment(filled[first][1], separator) or _is_label(rows[first][0])):
        first += 1
    return replace(candidate, samples=first)


def _is_label(cell: str) -> bool:
    return re.match(r"\W*[^\W\d]", cell) is not None and not is_missing(cell)


def _described(filled: Lines, candidate: _Candidate) -> Dialect:
    """The dialect of a candidate, with the forms of the columns from the first and last samples."""
    header, names = candidate.names
    said, width = candidate.said, len(names)
    rows = [row for row in candidate.rows[candidate.samples :] if len(row) == width]
    shown = (*rows[: _SCORED // 2], *rows[_SCORED // 2 :][-_SCORED // 2 :])
    decimal = decimal_mark(cell for row in shown for cell in row)
    columns = [[row[index] for row in shown] for index in range(width)]
    forms = tuple(map(form, columns))
    units_at, row_of_units = said.get("units", (-1, []))
    units = [*(units_in(row_of_units) or []), *[""] * width][:width]
    named = [_named(*column) for column in zip(range(width), names, units, columns, forms, strict=True)]
    nameless = [column for column in named if not names[column.index].strip() and is_unit_of("time", column.unit)]
    if len(nameless) == 1 and not any(column.name == "time" for column in named):
        named[nameless[0].index] = replace(nameless[0], name="time")
    stamps = [index for index, cells in enumerate(forms) if cells.kind == "stamp"]
    clock = next((column.index for column in named if column.name == "time"), next(iter(stamps), None))
    texts = columns[clock] if clock in stamps and clock is not None else []
    even = [_common(said[name][1][1:], decimal) for name in ("starts", "steps") if name in said]
    is_even = clock == 0 and len(even) > 1 and all(map(is_missing, columns[0]))
    whole, lines = distinct(named), [number for number, _ in filled]
    top = max(header, units_at)
    below = lines[top] + 1 + filled[top][1].count("\n") if top >= 0 else lines[0]
    return Dialect(
        candidate.separator,
        decimal,
        whole,
        forms,
        lines[header] if header >= 0 else 0,
        lines[units_at] if units_at >= 0 else 0,
        below if top in (-1, candidate.samples - 1) else lines[candidate.samples],
        tuple(filled[at][1] for at in (header, units_at) if at >= 0),
        clock,
        next((written(cell) for cell in texts if nanoseconds(cell) is not None), ""),
        (even[0], even[1]) if is_even and np.isfinite(even).all() else None,
        tuple(_doubts(whole, forms, units, [[row[index].strip() for row in rows] for index in range(width)], decimal)),
    )


def _named(index: int, name: str, unit: str, cells: Sequence[str], form: CellForm) -> Heading:
    """Heading of a column: dates and times are in seconds, and truth under % is all or nothing."""
    if name.strip() == _TIME:
        return Heading(index, _TIME, "time", "s")
    used = any(not is_missing(cell) for cell in cells)
    column = heading(index, name if name.strip() or not used else f"column {index + 1}", unit or None)
    if form.kind == "truth" and column.unit == "%":
        return replace(column, unit="1")
    seconds = form.kind == "stamp" or any(cell.endswith(" sec") for cell in cells)
    return replace(column, unit="s") if seconds else column


def _common(cells: Sequence[str], decimal: str) -> float:
    """The number that all cells of a row have, NaN where they differ."""
    numbers = {plain_number(cell.strip().replace(decimal or ".", ".")) for cell in cells if cell.strip()}
    return numbers.pop() or 0.0 if len(numbers) == 1 and None not in numbers else math.nan


def _doubts(
    named: Sequence[Heading],
    forms: Sequence[CellForm],
    units: Sequence[str],
    columns: Sequence[list[str]],
    decimal: str,
) -> Iterator[str]:
    """Problems of what would be read wrong: contradicting units, grouped thousands, fractions without zeros."""
    for column, cells, unit, texts in zip(named, forms, units, columns, strict=True):
        below, filled = unit_spelled(unit), [text for text in texts if not is_missing(text)]
        both = UNITS.get(column.unit or ""), UNITS.get(below or "")
        if column.name and cells.kind == "number" and all(both) and both[0] != both[1]:
            yield (
                f"column '{column.text}' has the unit {column.unit} in its name and {below} in the row of units; leave "
                "the one that holds."
            )
        mark = decimal or "."
        marked = [text for text in filled if mark in text]
        whole = [text for text in filled if text.lstrip("+-").isdigit() and len(text) <= len("-999")]
        group = re.compile(_GROUP.format(re.escape(mark)))
        plain = len(marked) + len(whole) == len(filled) and any(text.strip("+-0") for text in whole)
        if plain and len(marked) >= _GROUPED and all(map(group.fullmatch, marked)):
            yield (
                f"column '{column.text}' has '{whole[-1]}' and '{marked[0]}': {'points' if mark == '.' else 'commas'} "
                "that group thousands, where other tools read decimals; write the numbers without them."
            )
        if _CLOCK.search(column.text) and len({len(text.rpartition(".")[2]) for text in filled}) > 1:
            parts = [match.groups() if (match := _FRACTION.fullmatch(text)) else ("", "") for text in filled]
            steps = [(a, b) for (head, a), (other, b) in pairwise(parts) if head == other and head]
            back = [(a, b) for a, b in steps if len(a) < len(b) and float(f"0.{b}") < float(f"0.{a}")]
            falls = sum(int(a) > int(b) for a, b in steps)
            if len(back) > falls and 3 * falls < len(steps):
                yield (
                    f"column '{column.text}': the fraction {back[0][0]} is followed by {back[0][1]}, so they lack "
                    "zeros; write milliseconds with three digits."
                )
    names, stamped = {column.name for column in named}, any(cells.kind == "stamp" for cells in forms)
    if "position" not in names and (pair := _pair(named, _SIGNAL)):
        if forms[pair[0].index].kind == "text":
            yield (
                f"has a row for each value: '{pair[0].text}' names the signal whose value '{pair[1].text}' holds; "
                "pivot it, so that each signal has a column, and each time a row."
            )
    elif "time" not in names and not stamped and (pair := _pair(named, _SECONDS)):
        texts = [text for text in columns[pair[1].index] if text.isdigit() and len(text) <= len("999")]
        if len(texts) < len(columns[0]) or all(int(a) <= int(b) for a, b in pairwise(texts)):
            return
        yield (
            f"seconds and milliseconds are in columns of their own, '{pair[0].text}' and '{pair[1].text}'; write "
            "their sum as time [s], with three decimals."
        )


def _pair(named: Sequence[Heading], patterns: tuple[str, str]) -> list[Heading]:
    """The columns that have these names, both of them."""
    texts = [column.text.partition("[")[0].strip().casefold() for column in named]
    matches = [next((i for i, text in enumerate(texts) if re.fullmatch(pattern, text)), None) for pattern in patterns]
    return [named[index] for index in matches if index is not None] if None not in matches else []

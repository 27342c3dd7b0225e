"""Interpretation of a CSV cell: a number, a missing sample, a truth value, or a date and time."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.measurements.no_value import TRUTH

#: Words for a missing sample, in lower case; an empty cell is missing too. Any other text is a problem.
MISSING = frozenset(
    ["nan", "+nan", "-nan", "na", "n/a", "#n/a", "#na", "#nv", "null", "none", "-", "--", "---"]
    + [f"{sign}1{mark}#{word}" for sign in ("", "-") for mark in ".," for word in ("qnan", "ind")]
    + ["nan(ind)", "-nan(ind)", "nan(snan)", "#div/0!", "#num!", "#value!", "#wert!", "#zahl!"]
)

#: A number with either decimal mark.
NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?|[+-]?inf(?:inity)?", re.ASCII | re.IGNORECASE)

#: A comma that may be a decimal or a thousands separator; all other commas are decimal.
AMBIGUOUS = r"[+-]?[1-9]\d{0,2},\d{3}"
COMMA = r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?"
THOUSANDS = (
    r"[+-]?[1-9]\d{0,2}(?:(?:[.' \xa0\u202f]\d{3}){2,}|(?:,\d{3}){2,}|(?:[' \xa0\u202f]\d{3})+|(?:,\d{3})+\.\d+"
    r"|(?:\.\d{3})+,\d+)(?:[.,]\d+)?"
)

#: Whole numbers whose thousands are grouped by points.
GROUPED = r"[+-]?[1-9]\d{0,2}(?:\.\d{3})+"

#: Numbers of months by the first letters of their names, English and German.
MONTHS = {
    "jan": 1, "feb": 2, "mar": 3, "mär": 3, "apr": 4, "may": 5, "mai": 5, "jun": 6, "jul": 7, "aug": 8, "sep": 9,
    "oct": 10, "okt": 10, "nov": 11, "dec": 12, "dez": 12,
}  # fmt: skip

#: Date and time, or time of day; the same text serves Python and polars. Of a date with slashes the month comes first,
#: as in the United States, unless it is above 12.
STAMP = (
    r"^(?:(?:([0-9]{4})[-/]([0-9]{2})[-/]([0-9]{2})|([0-9]{1,2})\.([0-9]{1,2})\.([0-9]{4})"
    r"|([0-9]{1,2})/([0-9]{1,2})/([0-9]{4})|([0-9]{1,2})-("
    rf"(?i:{'|'.join(MONTHS)}))-([0-9]{{4}}))[T ] *)?"
    r"([0-9]{1,2}):([0-9]{2}):([0-9]{2})(?:[.,:]([0-9]{1,9}))? ?([AaPp][Mm])? ?(Z|[+-][0-9]{2}:?[0-9]{2})?$"
)

#: Beginnings that pandas gives to durations, minutes and seconds as Excel saves them, and what both are for `STAMP`.
SPELLED = ((r"^0 days ", ""), (r"^([0-9]{1,2}:[0-9]{2}[.,][0-9]{1,9})$", "0:${1}"))

#: Groups of `STAMP` that are whole numbers, but for the name of a month, and those of the fraction, of the half of the
#: day, and of the zone.
FIELDS, MONTH, FRACTION, HALF, ZONE = 15, 10, 15, 16, 17

#: A duration as MATLAB writes it to tables.
_SECONDS = r"(?P<seconds>[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?) sec"

#: Dates and times that are read, for messages.
STAMPS_SHOWN = (
    "2024-05-01T12:00:00.001, 01.05.2024 12:00:00,001, 05/01/2024 11:59:58.000 AM, or a time of day such as "
    "23:59:58.001"
)
_SECOND = 10**9
_MONTHS = 12

Integers: TypeAlias = NDArray[np.int64]


def matches(pattern: str, text: str) -> bool:
    """Whether a text matches this pattern, which is compiled on demand because that takes milliseconds."""
    return re.fullmatch(pattern, text, re.ASCII) is not None


@dataclass(frozen=True, slots=True)
class CellForm:
    """Type of the cells of one column: ``number``, ``truth``, ``stamp`` (date or time), ``seconds`` or ``text``.

    `decimal` is the decimal mark; `origin` the first time stamp in ns.
    """

    kind: str = "number"
    decimal: str = "."
    origin: int = 0


def plain_number(text: str) -> float | None:
    """Value of `text` in programming notation; NaN for an empty cell, None for anything else.

    Examples
    --------
    >>> plain_number(" 0.5 "), plain_number("1_000"), plain_number("0,5")
    (0.5, None, None)
    """
    try:
        value = float(text)
    except ValueError:
        return None if text.strip() else math.nan
    return value if text.isascii() and "_" not in text else None


def value_of(text: str, form: CellForm) -> float | None:
    """Value of a cell of this form; None for an invalid cell, NaN for a missing sample.

    Examples
    --------
    >>> value_of("0,5", CellForm(decimal=",")), value_of("Ein", CellForm("truth"))
    (0.5, 1.0)
    >>> value_of("n/a", CellForm()), value_of("1,5", CellForm())
    (nan, None)
    """
    word = text.strip().casefold()
    if not word or word in MISSING:
        return math.nan
    if form.kind == "truth" and word in TRUTH:
        return TRUTH[word]
    if form.kind == "seconds" and (match := re.fullmatch(_SECONDS, word)):
        return float(match["seconds"].replace(",", "."))
    if form.kind == "stamp":
        stamp = nanoseconds(text)
        return None if stamp is None else float(stamp - form.origin) / _SECOND
    if form.decimal == ",":
        return None if "." in text else plain_number(text.replace(",", "."))
    return plain_number(text)


def nanoseconds(text: str) -> int | None:
    """Nanoseconds since 1970, or since midnight without a date; None if the text is not a date or time.

    Examples
    --------
    >>> nanoseconds("1970-01-01T00:00:01.5Z"), nanoseconds("01.01.1970 00:00:01,5"), nanoseconds("1.5")
    (1500000000, 1500000000, None)
    """
    match = re.fullmatch(STAMP, spelled(text.strip())) if ":" in text else None
    if match is None:
        return None
    cells = match.groups("")
    numbers = [*cells[:MONTH], str(month_number(cells[MONTH])), *cells[MONTH + 1 : FIELDS]]
    fields = [np.array([int(number or 0)]) for number in numbers]
    fraction = np.array([int(cells[FRACTION].ljust(9, "0"))])
    zone = np.array([zone_minutes(cells[ZONE])])
    stamps, valid = counted(fields, fraction, np.array([half_hours(cells[HALF])]), zone)
    return int(stamps[0]) if valid[0] else None


def spelled(text: str) -> str:
    """A duration or a time of day with its hours, as `STAMP` has it.

    Examples
    --------
    >>> spelled("0 days 00:00:01.5"), spelled("59:58.5"), spelled("12:00:00")
    ('00:00:01.5', '0:59:58.5', '12:00:00')
    """
    for pattern, instead in SPELLED:
        text = re.sub(pattern, instead.replace("${1}", r"\1"), text)
    return text


def half_hours(text: str) -> int:
    """Hours that AM (0) or PM (12) adds to an hour of 12; -1 where there is neither."""
    return {"am": 0, "pm": 12}.get(text.casefold(), -1)


def month_number(name: str) -> int:
    """Number of the month with this name, 0 without one."""
    return MONTHS.get(name.casefold(), 0)


def counted(
    fields: Sequence[Integers], fraction: Integers, half: Integers, zone: Integers
) -> tuple[Integers, NDArray[np.bool_]]:
    """Nanoseconds from the fields of `STAMP` (0 if empty), and which of them are valid dates and times.

    `half` are hours as `half_hours` has them.
    """
    hour, minute, second = fields[12:15]
    valid = (half < 0) | ((hour >= 1) & (hour <= 12))
    hour = np.where(half < 0, hour, hour % 12 + half)
    swapped = fields[6] > _MONTHS
    month = fields[1] + fields[4] + np.where(swapped, fields[7], fields[6]) + fields[MONTH]
    day = fields[2] + fields[3] + np.where(swapped, fields[6], fields[7]) + fields[9]
    year = fields[0] + fields[5] + fields[8] + fields[11]
    dated = month + day + year > 0
    valid &= (hour < 24) & (minute < 60) & (second < 61)
    valid &= ~dated | ((month >= 1) & (month <= 12) & (day >= 1) & (day <= 31) & (year >= 1700) & (year < 2250))
    days = np.where(dated & valid, _days(np.where(dated, year, 1970), month, day), 0)
    seconds = days * 86400 + hour * 3600 + minute * 60 + second - zone * 60
    return np.where(valid, seconds, 0) * _SECOND + fraction, valid


def _days(year: Integers, month: Integers, day: Integers) -> Integers:
    """Days from 1970-01-01 in the Gregorian calendar."""
    first = (12 * (year - 1970) + month - 1).astype("M8[M]").astype("M8[D]")
    return first.astype(np.int64) + day - 1


def zone_minutes(zone: str) -> int:
    """Offset in minutes of a time zone such as ``+02:00``."""
    if len(zone) < 5:
        return 0
    return int(zone[0] + "1") * (int(zone[1:3]) * 60 + int(zone[-2:]))


def written(text: str) -> str:
    """A date and time for the metadata, in ISO 8601 with a decimal point.

    Examples
    --------
    >>> written("1.05.2024 12:00:00,001")
    '2024-05-01T12:00:00.001'
    """
    match = re.fullmatch(STAMP, spelled(text.strip()))
    if match is None:
        return text.strip()
    y, m, d, day, month, year, first, second_, fourth, *named, hour, minute, second, fraction, half, zone = (
        match.groups("")
    )
    if fourth:
        month, day, year = (second_, first, fourth) if int(first) > _MONTHS else (first, second_, fourth)
    elif named[0]:
        day, month, year = named[0], str(month_number(named[1])), named[2]
    date = f"{y or year}-{m or month:0>2}-{d or day:0>2}T" if y or year else ""
    if half:
        hour = str(int(hour) % 12 + half_hours(half))
    return f"{date}{hour:0>2}:{minute}:{second}{'.' + fraction if fraction else ''}{zone}"


def numberlike(cell: str) -> bool:
    """Whether a cell is a sample: a number with either decimal mark, with or without grouping, or a date or time."""
    cell = cell.strip()
    if NUMBER.fullmatch(cell) or matches(STAMP, spelled(cell)) or matches(THOUSANDS, cell):
        return True
    return cell.endswith(" sec") and matches(_SECONDS, cell)


def is_missing(cell: str) -> bool:
    """Whether a cell marks a missing sample."""
    cell = cell.strip()
    return not cell or cell.casefold() in MISSING


def decimal_mark(cells: Iterable[str]) -> str:
    """Decimal mark of the cells: ``.`` or ``,``; empty if all cells are ambiguous.

    If both occur, one of them is wrong, and the more frequent one is used.

    Examples
    --------
    >>> decimal_mark(["1,234", "0,5"]), decimal_mark(["1,234", "12"])
    (',', '')
    """
    points = commas = 0
    for cell in map(str.strip, cells):
        if "," in cell and matches(COMMA, cell):
            commas += not matches(AMBIGUOUS, cell)
        elif "." in cell:
            points += plain_number(cell) is not None
    return "," if commas > points else "." if points else ""


def form(cells: Sequence[str], decimal: str) -> CellForm:
    """Form of a column, from some of its cells.

    Examples
    --------
    >>> [form(cells, ".").kind for cells in (["off", "on"], ["", "1"], ["12:00:00.5"], ["low"])]
    ['truth', 'number', 'stamp', 'text']
    """
    filled = [cell for cell in cells if not is_missing(cell)]
    stamps = [stamp for cell in filled if (stamp := nanoseconds(cell)) is not None]
    if len(stamps) > len(filled) / 2:
        return CellForm("stamp", decimal, stamps[0])
    if sum(cell.endswith(" sec") and matches(_SECONDS, cell) for cell in map(str.strip, filled)) > len(filled) / 2:
        return CellForm("seconds")
    others = [cell for cell in filled if cell.strip() not in ("0", "1")]
    if others and all(cell.strip().casefold() in TRUTH for cell in others):
        return CellForm("truth", decimal)
    return CellForm("number" if not filled or any(map(numberlike, filled)) else "text", decimal)

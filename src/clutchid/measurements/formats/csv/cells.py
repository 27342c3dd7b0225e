"""Cells of a text table: what one of them means, and a column of them as numbers."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.no_value import TRUTH, means_no_value
from clutchid.measurements.source import Rows

if TYPE_CHECKING:
    import polars as pl

#: Words for a missing sample, in lower case; an empty cell is missing too. Any other text is a problem.
MISSING = frozenset(
    ["nan", "+nan", "-nan", "na", "n/a", "#n/a", "#na", "#nv", "null", "none", "-", "--", "---"]
    + [f"{sign}1{mark}#{word}" for sign in ("", "-") for mark in ".," for word in ("qnan", "ind")]
    + ["nan(ind)", "-nan(ind)", "nan(snan)", "#div/0!", "#num!", "#value!", "#wert!", "#zahl!"]
)

#: A number with either decimal mark, or a duration as MATLAB writes it; one with a comma, one whose comma may group
#: thousands, and one with groups of thousands.
NUMBER = re.compile(
    r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?(?: sec)?|[+-]?inf(?:inity)?", re.ASCII | re.IGNORECASE
)
_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?(?: sec)?", re.ASCII)
AMBIGUOUS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}", re.ASCII)
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:[.,' \xa0\u202f]\d{3})+(?:[.,]\d+)?", re.ASCII)

#: Numbers of months by the first letters of their names, English and German.
MONTHS = {
    "jan": 1, "feb": 2, "mar": 3, "mär": 3, "apr": 4, "may": 5, "mai": 5, "jun": 6, "jul": 7, "aug": 8, "sep": 9,
    "oct": 10, "okt": 10, "nov": 11, "dec": 12, "dez": 12,
}  # fmt: skip

#: A date and time up to its whole second, its fraction, and its zone; and how the first is written, without names.
_STAMP = r"^(?:0 days )?([0-9][0-9A-Za-zä./ -]*:[0-9]{2}:[0-9]{2})(?:[.,:]([0-9]{1,9}))? ?(Z|[+-][0-9]{2}:?[0-9]{2})?$"
_STAMPS = ("%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%d-%m-%Y %H:%M:%S", "%H:%M:%S", "%Y/%m/%d %H:%M:%S")
STAMPS_SHOWN = "2024-05-01T12:00:00.001, 01.05.2024 12:00:00,001, or a time of day such as 23:59:58.001"

_SECOND = 10**9


@dataclass(frozen=True, slots=True)
class CellForm:
    """Form of a column's cells, ``number``, ``truth``, ``stamp`` or ``text``, and the first stamp in ns."""

    kind: str = "number"
    origin: int = 0


def split(line: str, separator: str) -> list[str]:
    """Split a line into cells; a blank as separator means runs of blanks.

    Examples
    --------
    >>> split('0;"a;b";2', ";"), split("  0   1 ", " ")
    (['0', 'a;b', '2'], ['0', '1'])
    """
    if separator == " ":
        line = re.sub(r"[ \t]+", " ", line.strip(" \t"))
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [""])
    except csv.Error:
        return [line]


@lru_cache(maxsize=4096)
def _moment(whole: str) -> datetime | None:
    """The second of a stamp as it is written; of the year 1900 where it has no date."""
    text = re.sub(r"-([^\W\d]+)-", lambda name: f"-{MONTHS.get(name[1].casefold(), '?')}-", whole)
    for pattern in _STAMPS:
        with suppress(ValueError):
            return datetime.strptime(" ".join(re.sub(r"(?<=\d)T", " ", text).split()), pattern)
    return None


def _second(whole: str, zone: str) -> int | None:
    """Seconds since 1970 in universal time, or since midnight."""
    moment = _moment(whole)
    if moment is None:
        return None
    minutes = int(f"{zone[0]}1") * (60 * int(zone[1:3]) + int(zone[-2:])) if zone.strip("Z") else 0
    return round((moment - datetime(1970 if moment.year > 1900 else 1900, 1, 1)).total_seconds()) - 60 * minutes


def nanoseconds(text: str) -> int | None:
    """Nanoseconds since 1970, or since midnight without a date; None if the text is not a date or time.

    Examples
    --------
    >>> nanoseconds("1970-01-01T00:00:01.5Z"), nanoseconds("01.01.1970 00:00:01,5"), nanoseconds("1.5")
    (1500000000, 1500000000, None)
    """
    match = re.match(_STAMP, text.strip()) if ":" in text else None
    second = _second(match[1], match[3] or "") if match else None
    return None if match is None or second is None else second * _SECOND + int((match[2] or "").ljust(9, "0"))


def written(text: str) -> str:
    """A date and time for the metadata, in ISO 8601 with a decimal point.

    Examples
    --------
    >>> written("1.05.2024 12:00:00,001"), written("12:00:00Z")
    ('2024-05-01T12:00:00.001', '12:00:00Z')
    """
    match = re.match(_STAMP, text.strip())
    moment = _moment(match[1]) if match else None
    if match is None or moment is None:
        return text.strip()
    shown = moment.isoformat() if moment.year > 1900 else moment.time().isoformat()
    return shown + (f".{match[2]}" if match[2] else "") + (match[3] or "")


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


@lru_cache(maxsize=1 << 14)
def numberlike(cell: str) -> bool:
    """Whether a cell is a sample: a number with either decimal mark, with or without grouping, or a date or time."""
    cell = cell.strip()
    return bool(NUMBER.fullmatch(cell) or THOUSANDS.fullmatch(cell)) or nanoseconds(cell) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell marks a missing sample."""
    return not cell.strip() or cell.strip().casefold() in MISSING


def is_words(cells: Sequence[str]) -> bool:
    """Whether a line contains words, but no sample."""
    words = any(character.isalpha() for cell in cells if not is_missing(cell) for character in cell)
    return words and not any(map(numberlike, cells))


def decimal_mark(cells: Iterable[str]) -> str:
    """Decimal mark of the cells: ``.`` or ``,``, the more frequent one; empty if all cells are ambiguous.

    Examples
    --------
    >>> decimal_mark(["1,234", "0,5"]), decimal_mark(["1,234", "12"])
    (',', '')
    """
    points = commas = 0
    for cell in map(str.strip, cells):
        commas += _COMMA.fullmatch(cell) is not None and AMBIGUOUS.fullmatch(cell) is None
        points += "." in cell and plain_number(cell.removesuffix(" sec")) is not None
    return "," if commas > points else "." if points else ""


def form(cells: Sequence[str]) -> CellForm:
    """Form of a column, from some of its cells.

    Examples
    --------
    >>> [form(cells).kind for cells in (["off", "on"], ["", "1"], ["12:00:00.5"], ["low"])]
    ['truth', 'number', 'stamp', 'text']
    """
    filled = [cell.strip() for cell in cells if not is_missing(cell)]
    stamps = [stamp for cell in filled if (stamp := nanoseconds(cell)) is not None]
    if len(stamps) > len(filled) / 2:
        return CellForm("stamp", stamps[0])
    others = [cell for cell in filled if cell not in ("0", "1")]
    if others and all(cell.casefold() in TRUTH for cell in others):
        return CellForm("truth")
    return CellForm("number" if not filled or any(map(numberlike, filled)) else "text")


def numbers_of(cells: pl.Series, form: CellForm, decimal: str) -> tuple[FloatArray, Rows, int]:
    """Cells as numbers, NaN where there is none; the rows with cells that are invalid; how many say there is no value.

    Each word is interpreted once.
    """
    import polars as pl

    cells = cells.str.strip_chars()
    values = _stamps(cells, form) if form.kind == "stamp" else _plain(cells, decimal)
    words = cells.filter(values.is_null() & cells.is_not_null() & (cells != "")).unique().to_list()
    truth = TRUTH if form.kind == "truth" else {}
    none = [word for word in words if means_no_value(word) and not is_missing(word)]
    meant = dict.fromkeys([*none, *filter(is_missing, words)], math.nan)
    meant |= {word: truth[word.casefold()] for word in words if word.casefold() in truth}
    if meant:
        values = values.fill_null(cells.replace_strict(meant, default=None, return_dtype=pl.Float64))
    invalid = (values.is_null() & cells.is_not_null() & (cells != "")).arg_true()
    return values.to_numpy(), invalid.to_numpy().astype(np.int64), int(cells.is_in(none).sum()) if none else 0


def _plain(cells: pl.Series, decimal: str) -> pl.Series:
    """Numbers, null if invalid."""
    import polars as pl

    cells = cells.str.strip_suffix(" sec")
    if decimal == ",":
        cells = cells.set(cells.str.contains(".", literal=True).fill_null(value=False), None)
        cells = cells.str.replace_all(",", ".", literal=True)
    return cells.cast(pl.Float64, strict=False)


def _stamps(cells: pl.Series, form: CellForm) -> pl.Series:
    """Dates and times in seconds since the first one, null if invalid; each second is interpreted once."""
    import polars as pl

    parts = cells.str.extract_groups(_STAMP).struct.unnest()
    whole, fraction, zone = (parts[name] for name in parts.columns)
    keys = whole + "\n" + zone.fill_null("")
    meanings = {key: _second(*key.split("\n")) for key in keys.drop_nulls().unique().to_list()}
    seconds = keys.replace_strict(meanings, default=None, return_dtype=pl.Int64)
    stamps = seconds.fill_null(0) * _SECOND + fraction.fill_null("").str.pad_end(9, "0").cast(pl.Int64)
    exact = (stamps.to_numpy() - form.origin) / 1e9  # polars multiplies by 1e-9, which is not exact
    return pl.Series(exact).set(seconds.is_null(), None)

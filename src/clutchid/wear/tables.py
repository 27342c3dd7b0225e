"""Tables that come with recordings: which vehicle, when and how far; and load against wear of the facing."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Hashable, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

import numpy as np

from clutchid.errors import DataError
from clutchid.files import small_file
from clutchid.log import FloatArray
from clutchid.measurements.suffixes import split_name
from clutchid.wear.history import RecordingJob
from clutchid.wear.trend import WearTable

Key = TypeVar("Key", bound=Hashable)

#: Columns of a table of load against wear, in mm, mm and N.
_WEAR_COLUMNS = ("wear [mm]", "half_load [mm]", "load [N]")

#: Columns of a table of recordings; all others are tags.
_RECORDING_COLUMNS = ("recording", "vehicle", "type", "date", "odometer_km", "strokes")

#: Bytes of a table: a hundred for each of a million recordings.
_LARGEST = 100_000_000

#: Largest wear and position in mm and load in N of a clutch, far above those of any truck.
MOST_MM, _MOST_N = 100.0, 1e6

#: Largest odometer reading in km and number of strokes: a hundred lives of a truck.
_MOST_KM, _MOST_STROKES = 1e8, 1e9

#: A number as tables have it: no blanks, no underscores.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def read_table(path: Path) -> dict[str, RecordingJob]:
    """The table of recordings by stem: columns recording, and any of vehicle, type, date, odometer_km and strokes.

    Other columns are tags, such as the depot of the vehicle.

    Raises
    ------
    DataError
        If the file cannot be read, has no column `recording`, or a row cannot be understood; all rows are named.
    """
    return _by(path, lambda row: row.recording)


def read_fleet_table(path: Path) -> dict[tuple[str, str, str], RecordingJob]:
    """The table of the recordings of many vehicles, by vehicle, type and stem.

    Raises
    ------
    DataError
        As `read_table`.
    """
    return _by(path, lambda row: (row.vehicle, row.type, row.recording))


def _by(path: Path, key: Callable[[RecordingJob], Key]) -> dict[Key, RecordingJob]:
    """The rows of a table of recordings by a key, under which no two rows differ."""
    rows = _rows(path)
    if "recording" not in rows[0]:
        raise DataError(f"{path}: has no column 'recording', only {', '.join(map(repr, rows[0]))}.")
    by_key: dict[Key, RecordingJob] = {}
    problems: list[str] = []
    for line, row in enumerate(rows, start=2):
        try:
            entry = _listed(row)
        except ValueError as error:
            problems.append(f"line {line}: {error}")
            continue
        first = by_key.setdefault(key(entry), entry)
        if first is not entry and _known(first) != _known(entry):
            problems.append(f"line {line}: '{entry.recording}' is listed twice, with different values.")
    if problems:
        raise DataError.of(str(path), problems)
    return by_key


def _known(row: RecordingJob) -> dict[str, object]:
    """The entries of a row without its empty cells, whose NaN equals no other."""
    return {name: value for name, value in asdict(row).items() if not (isinstance(value, float) and math.isnan(value))}


def read_wear_table(path: Path) -> WearTable:
    """Half-load position and mean load over 5 to 8 mm against wear, from the first row on, as of a test rig.

    Raises
    ------
    DataError
        If the file cannot be read, lacks a column, or its wear does not increase from 0.
    """
    rows = _rows(path)
    missing = [name for name in _WEAR_COLUMNS if name not in rows[0]]
    if missing:
        raise DataError(f"{path}: lacks the column {' and '.join(map(repr, missing))}.")
    wear, half, load = (_column(path, rows, name, _MOST_N if name == "load [N]" else MOST_MM) for name in _WEAR_COLUMNS)
    if wear.size < 2 or wear[0] != 0.0 or np.any(np.diff(wear) <= 0.0):
        raise DataError(f"{path}: 'wear [mm]' must start at 0 and increase, in two rows or more.")
    if load.min() <= 0.0:
        raise DataError(
            f"{path}: 'load [N]' must be above 0 in every row; line {int(load.argmin()) + 2} has {load.min():g} N."
        )
    return WearTable(wear * 1e-3, (half - half[0]) * 1e-3, load / load[0] - 1.0)


def _column(path: Path, rows: list[dict[str, str]], name: str, most: float) -> FloatArray:
    """A column of numbers of at most `most` in absolute value."""
    values = []
    for line, row in enumerate(rows, start=2):
        try:
            values.append(_value(row[name], -most, most))
        except ValueError as error:
            raise DataError(f"{path}: line {line}: {name} {error}.") from None
    return np.array(values)


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        text = small_file(path, "table", _LARGEST).decode("utf-8-sig")
        reader = csv.DictReader(io.StringIO(text, newline=""))
        names = [name.strip() for name in reader.fieldnames or ()]
        rows = [{(k or "").strip(): (v or "").strip() for k, v in row.items() if isinstance(v, str | None)}
                for row in reader]  # fmt: skip
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: cannot be read as CSV ({error}).") from error
    if not rows:
        raise DataError(f"{path}: has no rows.")
    if twice := [name for name in dict.fromkeys(names) if name and names.count(name) > 1]:
        raise DataError(f"{path}: has the column {' and '.join(map(repr, twice))} twice; keep one of each.")
    return rows


def _listed(row: Mapping[str, str]) -> RecordingJob:
    name = row["recording"]
    if not name:
        raise ValueError("no recording is named.")
    date = row.get("date", "")
    try:
        begin = datetime.fromisoformat(date) if date else None
    except ValueError:
        raise ValueError(f"date '{date}' is not an ISO date, such as 2026-11-23 or 2026-11-23T14:05.") from None
    return RecordingJob(
        split_name(Path(name).name)[0],
        row.get("vehicle", ""),
        row.get("type", ""),
        begin.replace(tzinfo=UTC) if begin and not begin.tzinfo else begin,
        _number(row, "odometer_km", _MOST_KM),
        _number(row, "strokes", _MOST_STROKES),
        Path(name),
        tags=tuple((tag, row[column]) for column in row if (tag := tag_of(column)) and row[column]),
    )


def tag_of(column: str) -> str:
    """Name of a tag, in lower-case letters, digits and underscores, for a further column; empty for a known one."""
    return "" if column in _RECORDING_COLUMNS else re.sub(r"\W+", "_", column.lower()).strip("_")


def _number(row: Mapping[str, str], name: str, most: float) -> float:
    """A number of at least 0, NaN where the cell is empty or says so."""
    text = row.get(name, "")
    try:
        return math.nan if text.lower() in ("", "nan") else _value(text, 0.0, most)
    except ValueError as error:
        raise ValueError(f"{name} {error}.") from None


def _value(text: str, least: float, most: float) -> float:
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"'{text}' is not a number")
    if not least <= float(text) <= most:
        raise ValueError(f"'{text}' is not from {least:g} to {most:g}")
    return float(text)

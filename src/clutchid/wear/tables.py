"""Tables that come with recordings: which vehicle, when and how far; and load against wear of the facing."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

import numpy as np

from clutchid.errors import DataError
from clutchid.wear.history import Listed
from clutchid.wear.trend import WearTable

Key = TypeVar("Key", bound=Hashable)

#: Columns of a table of load against wear, in mm, mm and N.
WEAR_COLUMNS = ("wear [mm]", "half_load [mm]", "load [N]")


def read_table(path: Path) -> dict[str, Listed]:
    """The table of recordings by stem: columns recording, and any of vehicle, type, date, odometer_km and strokes.

    Raises
    ------
    DataError
        If the file cannot be read, has no column `recording`, or a row cannot be understood; all rows are named.
    """
    return _by(path, lambda row: row.recording)


def read_fleet_table(path: Path) -> dict[tuple[str, str], Listed]:
    """The table of the recordings of many vehicles, by vehicle and stem.

    Raises
    ------
    DataError
        As `read_table`.
    """
    return _by(path, lambda row: (row.vehicle, row.recording))


def _by(path: Path, key: Callable[[Listed], Key]) -> dict[Key, Listed]:
    """The rows of a table of recordings by a key, under which no two rows differ."""
    rows = _rows(path)
    if "recording" not in rows[0]:
        raise DataError(f"{path}: has no column 'recording', only {', '.join(map(repr, rows[0]))}.")
    found: dict[Key, Listed] = {}
    problems: list[str] = []
    for line, row in enumerate(rows, start=2):
        try:
            one = _listed(row)
        except ValueError as error:
            problems.append(f"line {line}: {error}")
            continue
        if _known(found.setdefault(key(one), one)) != _known(one):
            problems.append(f"line {line}: '{one.recording}' stands there twice, with other values.")
    if problems:
        raise DataError.of(str(path), problems)
    return found


def _known(row: Listed) -> dict[str, object]:
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
    missing = [name for name in WEAR_COLUMNS if name not in rows[0]]
    if missing:
        raise DataError(f"{path}: lacks the column {' and '.join(map(repr, missing))}.")
    try:
        wear, half, load = (np.array([float(row[name]) for row in rows]) for name in WEAR_COLUMNS)
    except ValueError as error:
        raise DataError(f"{path}: {error}; every cell is a number.") from error
    if wear.size < 2 or wear[0] != 0.0 or np.any(np.diff(wear) <= 0.0):
        raise DataError(f"{path}: 'wear [mm]' must start at 0 and increase, in two rows or more.")
    return WearTable(wear * 1e-3, (half - half[0]) * 1e-3, load / load[0] - 1.0)


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [{(k or "").strip(): (v or "").strip() for k, v in row.items() if isinstance(v, str | None)}
                    for row in csv.DictReader(file)]  # fmt: skip
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: cannot be read as CSV ({error}).") from error
    if not rows:
        raise DataError(f"{path}: has no rows.")
    return rows


def _listed(row: Mapping[str, str]) -> Listed:
    name = row["recording"]
    if not name:
        raise ValueError("no recording is named.")
    date = row.get("date", "")
    try:
        begin = datetime.fromisoformat(date) if date else None
    except ValueError:
        raise ValueError(f"date '{date}' is no ISO date, such as 2026-11-23 or 2026-11-23T14:05.") from None
    return Listed(
        Path(name).name.removesuffix(Path(name).suffix) if Path(name).suffix else name,
        row.get("vehicle", ""),
        row.get("type", ""),
        begin.replace(tzinfo=UTC) if begin and not begin.tzinfo else begin,
        _number(row, "odometer_km"),
        _number(row, "strokes"),
    )


def _number(row: Mapping[str, str], name: str) -> float:
    text = row.get(name, "")
    try:
        return float(text) if text else math.nan
    except ValueError:
        raise ValueError(f"{name} '{text}' is no number.") from None

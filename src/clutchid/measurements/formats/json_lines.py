"""JSON lines: an object a line, with the values by the names of the columns; a key that is missing is no sample."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import FloatArray
from clutchid.measurements.columns import headings
from clutchid.measurements.formats.csv.cells import plain_number
from clutchid.measurements.source import Places, Raster, Source, Table, refused

#: Types of a number in JSON, and of null; true is none, and a string is one if it is written like one.
_NUMBERS = {int, float, type(None)}


def keys_of(text: bytes, name: str) -> list[str]:
    """The keys of the objects of some lines, in the order in which they first occur.

    Raises
    ------
    DataError
        If no line is an object.
    """
    keys = list(dict.fromkeys(key for record in map(_object, text.split(b"\n")) if record for key in record))
    if not keys:
        raise DataError(
            f'{name}: no line is a JSON object; send one object per line, such as {{"time [s]": 0.0, "position [m]": '
            '0.0, "duty_supply [1]": 0.0, "duty_exhaust [1]": 0.0}.'
        )
    return keys


def read_objects(text: bytes, keys: Sequence[str]) -> tuple[list[FloatArray], NDArray[np.bool_], int]:
    """A column for each key; which objects have a value that is no number; the number of lines left out.

    A key that an object lacks is NaN. A line that is no object is left out; a value that is no number is missing.

    Examples
    --------
    >>> columns, spoiled, left_out = read_objects(b'{"a": 1, "b": "0,5"}\\n{"a": 2.5}\\n{"a": 3, "b"\\n', ["a", "b"])
    >>> columns, spoiled.tolist(), left_out
    ([array([1. , 2.5]), array([nan, nan])], [True, False], 1)
    """
    lines = [line for line in text.split(b"\n") if line.strip()]
    objects = _together(lines)
    if objects is None:
        objects = [record for record in map(_object, lines) if record is not None]
    spoiled = np.zeros(len(objects), dtype=bool)
    columns = []
    for key in keys:
        numbers, wrong = _column([record.get(key) for record in objects])
        columns.append(numbers)
        spoiled |= wrong
    return columns, spoiled, len(lines) - len(objects)


def _column(values: Sequence[Any]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Values as numbers, NaN for null and for anything else, and which of them are anything else."""
    if set(map(type, values)) <= _NUMBERS:
        with suppress(OverflowError):
            return np.array(values, dtype=np.float64), np.zeros(len(values), dtype=bool)
    numbers = [_number(value) for value in values]
    return np.array([math.nan if n is None else n for n in numbers]), np.array([n is None for n in numbers], dtype=bool)


def _together(lines: Sequence[bytes]) -> list[dict[str, Any]] | None:
    """The objects of some lines; None unless every line is one."""
    try:
        records = json.loads(b"[" + b",".join(lines) + b"]")
    except (ValueError, RecursionError):
        return None
    whole = len(records) == len(lines) and all(type(record) is dict for record in records)
    return records if whole else None


def _object(line: bytes) -> dict[str, Any] | None:
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def _number(value: Any) -> float | None:
    """A value as a number, NaN for null; None if it is none."""
    if value is None:
        return math.nan
    if isinstance(value, str):
        return plain_number(value)
    try:
        return float(value) if type(value) in _NUMBERS else None
    except OverflowError:
        return None


def is_json_lines(head: bytes) -> bool:
    """Whether a file begins with an object on a line of its own, and goes on with another one.

    Examples
    --------
    >>> is_json_lines(b'{"t": 0}\\n{"t": 1'), is_json_lines(b'{"t": [0,\\n1]}')
    (True, False)
    """
    first, _, rest = head.lstrip().partition(b"\n")
    return _object(first) is not None and rest.lstrip().startswith(b"{")


def open_file(path: Path) -> Source:
    """A file of JSON lines: one time grid, with the keys of all objects as columns.

    Raises
    ------
    OSError
        If the file cannot be read; what is wrong inside it is in `Source.problems`.
    """
    text = path.read_bytes()
    try:
        keys = keys_of(text, "the file")
    except DataError as error:
        return refused(path, "JSON lines", str(error))
    values, spoiled, left_out = read_objects(text, keys)
    columns = headings(keys)
    clock = next((column.index for column in columns if column.name == "time"), None)
    warnings = (f"{left_out:,} lines that are not JSON objects are left out.",) if left_out else ()
    if spoiled.any():
        where = Places("line").ranges(np.flatnonzero(spoiled))
        warnings = (*warnings, f"values that are not numbers count as missing in {where}.")

    def tables(_raster: int, chosen: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        numbers = {index: values[index] for index in chosen}
        yield from Table(columns, numbers, spoiled.size, Places("line")).parts(rows)

    raster = Raster(columns, spoiled.size, clock=clock)
    return Source(path, "JSON lines", (raster,), tables, (), warnings)

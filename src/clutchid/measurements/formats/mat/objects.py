"""Objects of MATLAB's own classes as structs and numbers, where the library mat-io is installed to decode them.

Tables and timetables become structs of their columns, timeseries structs of time and data, dates and durations seconds,
strings texts.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from clutchid.log import FloatArray


class Stamps(NamedTuple):
    """Times: their unit, and the date from which they count in ms since 1970, if any."""

    values: FloatArray
    unit: str | None = "s"
    origin: float | None = None


def of_file(path: Path, names: Sequence[str]) -> dict[str, Any]:
    """These variables with their objects; none where mat-io is not installed, or does not know one of the objects."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "Failed to")  # it would give the numbers that stand for an object
            values = import_module("matio").load_from_mat(str(path), variable_names=list(names), raw_data=True)
    except Exception:  # the user is told how to save them otherwise
        return {}
    return {
        name: value
        for name, value in values.items()
        if name in names and (isinstance(value, np.ndarray) or hasattr(value, "properties"))
    }


def object_content(class_name: str, value: Any) -> Any:
    """The content of an object by mat-io; None where it is unknown."""
    properties, decode = getattr(value, "properties", None), _CLASSES.get(class_name)
    if decode is None or not isinstance(properties, Mapping):
        return None
    try:
        return decode(properties)
    except (KeyError, IndexError, ValueError, TypeError, AttributeError):
        return None


def _duration(properties: Mapping[str, Any]) -> Stamps:
    return Stamps(np.asarray(properties["millis"], dtype=np.float64) / 1e3)


def _datetime(properties: Mapping[str, Any]) -> Stamps:
    """Seconds since the first; the imaginary part holds what a double of milliseconds since 1970 cannot."""
    data = np.asarray(properties["data"], dtype=np.complex128)
    first = data[np.isfinite(data)][:1]
    since = data - first if first.size else data
    return Stamps((since.real + since.imag) / 1e3, origin=float(first[0].real + first[0].imag) if first.size else None)


def _string(properties: Mapping[str, Any]) -> Any:
    return import_module("matio.utils.converters.matstring").mat_to_string(properties, "<")


def _table(properties: Mapping[str, Any]) -> dict[str, Any]:
    units = properties["props"].ravel()[0]["VariableUnits"]
    return _columns(properties["data"], properties["varnames"], units)


def _timetable(properties: Mapping[str, Any]) -> dict[str, Any]:
    whole = properties["any"].ravel()[0]
    columns = _columns(whole["data"], whole["varNames"], whole["varUnits"])
    name = "Time" if "Time" not in columns else _texts(whole["dimNames"])[0]
    return {name: _row_times(whole["rowTimes"], int(whole["numRows"].item())), **columns}


def _row_times(times: Any, count: int) -> Any:
    """Times of the rows: an object, or start and rate of regular ones."""
    if hasattr(times, "properties"):
        return _CLASSES[times.classname](times.properties)
    regular = times.ravel()[0]
    by_rate = regular["specifiedAsRate"].item()
    step = 1 / regular["sampleRate"].item() if by_rate else regular["stepSize"].properties["millis"].item() / 1e3
    origin = regular["origin"]
    start: Stamps = _CLASSES[origin.classname](origin.properties)
    begin = float(np.ravel(start.values)[0])
    return start._replace(values=(begin if math.isfinite(begin) else 0.0) + np.arange(count) * step)


def _timeseries(properties: Mapping[str, Any]) -> dict[str, Any]:
    about, info = properties["TimeInfo"].properties, properties["DataInfo"].properties
    times = np.asarray(properties["Time_"] if "Time_" in properties else properties["Time"], dtype=np.float64)
    if not times.size:
        start, step = about["Start_"].item(), about["Increment_"].item()
        times = start + step * np.arange(int(about["Length"].item()))
    data = properties["Data_"] if "Data_" in properties else properties["Data"]
    stamps = Stamps(times, None, _start_date(about))
    return {"time": stamps, "data": data, "units": {"time": about["Units"], "data": info["Units"]}}


def _start_date(about: Mapping[str, Any]) -> float | None:
    """The date of a timeseries in ms since 1970, as MATLAB writes it by default; None where it has none."""
    for form in ("%d-%b-%Y %H:%M:%S", "%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y"):
        with suppress(ValueError, KeyError, IndexError):
            return 1e3 * datetime.strptime(_texts(about["StartDate"])[0], form).replace(tzinfo=UTC).timestamp()
    return None


def _columns(data: Any, names: Any, units: Any) -> dict[str, Any]:
    columns = dict(zip(_texts(names), data.ravel(), strict=True))
    spelled = dict(zip(columns, _texts(units), strict=False))
    return columns if "units" in columns else {**columns, "units": {k: np.array([unit]) for k, unit in spelled.items()}}


def _texts(cells: Any) -> list[str]:
    return [str(cell.item()) if cell.size == 1 else "" for cell in np.ravel(cells)]


_CLASSES: Mapping[str, Callable[[Mapping[str, Any]], Any]] = MappingProxyType(
    {
        "duration": _duration,
        "datetime": _datetime,
        "string": _string,
        "table": _table,
        "timetable": _timetable,
        "timeseries": _timeseries,
    }
)

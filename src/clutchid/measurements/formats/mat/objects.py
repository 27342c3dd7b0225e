"""Objects of MATLAB's own classes as structs and numbers, where the library mat-io is installed to decode them.

Tables and timetables become structs of their columns, timeseries structs of time and data, dates and durations seconds:
all dates of a file from its first one.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.formats.mat import loaded
from clutchid.measurements.formats.mat.rasters import is_time_name


def with_objects(path: Path, root: loaded.Struct) -> loaded.Struct:
    """`root` with the objects of the file decoded; as it is where there are none, or mat-io is not installed."""
    names = [name for name, item in root.fields.items() if _has_object(item)]
    if not names:
        return root
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "Failed to")  # it would give the numbers that stand for an object
            values = import_module("matio").load_from_mat(str(path), variable_names=names, raw_data=True)
            decoded = {name: loaded.node(values[name], _decoded) for name in names if name in values}
    except Exception:  # it is not installed, or does not know the objects; the user is told how to save them otherwise
        return root
    decoded = {name: item for name, item in decoded.items() if item is not loaded.NO_NUMBERS}
    zero = min((origin for item in decoded.values() for origin in _origins(item)), default=0.0)
    return loaded.Struct(dict(root.fields) | {name: _since(item, zero) for name, item in decoded.items()})


def _has_object(item: loaded.Node) -> bool:
    return (isinstance(item, loaded.NoChannel) and bool(item.class_name)) or any(map(_has_object, _children(item)))


def _children(parent: loaded.Node) -> Iterable[loaded.Node]:
    if isinstance(parent, loaded.Struct):
        return parent.fields.values()
    return parent.items if isinstance(parent, loaded.NodeArray) else ()


def _origins(item: loaded.Node) -> Iterator[float]:
    """The dates from which times count, in ms since 1970."""
    if isinstance(item, loaded.NumberArray) and item.origin is not None and math.isfinite(item.origin):
        yield item.origin
    for child in _children(item):
        yield from _origins(child)


def _since(item: loaded.Node, zero: float) -> loaded.Node:
    """The node with times that count from one date, in ms since 1970."""
    match item:
        case loaded.NumberArray(place=np.ndarray() as place, origin=float(origin)) if math.isfinite(origin):
            return replace(item, place=place + (origin - zero) / 1e3, origin=zero)
        case loaded.Struct():
            return loaded.Struct({name: _since(child, zero) for name, child in item.fields.items()})
        case loaded.NodeArray():
            return replace(item, items=tuple(_since(child, zero) for child in item.items))
    return item


def _decoded(value: Any) -> loaded.Node | None:
    """The node of an object, as mat-io gives it: name of its class and properties; None of anything else."""
    name = getattr(value, "classname", None)
    if name is None:
        return None
    properties = getattr(value, "properties", None)
    decode = _CLASSES.get(name)
    try:
        item = decode(properties) if decode and isinstance(properties, Mapping) else None
    except (KeyError, IndexError, ValueError, TypeError, AttributeError):
        item = None
    return item or loaded.class_object(str(name))


def _duration(properties: Mapping[str, Any]) -> loaded.Node:
    return _seconds(np.asarray(properties["millis"], dtype=np.float64) / 1e3)


def _datetime(properties: Mapping[str, Any]) -> loaded.Node:
    """Seconds since the first; the imaginary part holds what a double of milliseconds since 1970 cannot."""
    data = np.asarray(properties["data"], dtype=np.complex128)
    first = data[np.isfinite(data)][:1]
    since = data - first if first.size else data
    origin = float(first[0].real + first[0].imag) if first.size else None
    return replace(_seconds((since.real + since.imag) / 1e3), origin=origin)


def _table(properties: Mapping[str, Any]) -> loaded.Node:
    props = properties["props"].ravel()[0]
    return _columns(properties["data"], properties["varnames"], props["VariableUnits"])


def _timetable(properties: Mapping[str, Any]) -> loaded.Node | None:
    whole = properties["any"].ravel()[0]
    columns = _columns(whole["data"], whole["varNames"], whole["varUnits"])
    times = _row_times(whole["rowTimes"], int(whole["numRows"].item()))
    name = _texts(whole["dimNames"])[0]
    return times and loaded.Struct({name if is_time_name(name) else "time": times, **columns.fields})


def _row_times(times: Any, count: int) -> loaded.Node | None:
    """Times of the rows: an object, or start and rate of regular ones."""
    if hasattr(times, "properties"):
        return _decoded(times)
    regular = times.ravel()[0]
    step = 1 / regular["sampleRate"].item() if regular["specifiedAsRate"].item() else None
    if step is None:
        step = regular["stepSize"].properties["millis"].item() / 1e3
    origin = _decoded(regular["origin"])
    begin = _number(origin.place) if isinstance(origin, loaded.NumberArray) else 0.0
    date = origin.origin if isinstance(origin, loaded.NumberArray) else None
    return replace(_seconds(begin + np.arange(count) * step), origin=date)


def _number(place: object) -> float:
    values = np.ravel(np.asarray(place, dtype=np.float64))
    return float(values[0]) if values.size and math.isfinite(values[0]) else 0.0


def _timeseries(properties: Mapping[str, Any]) -> loaded.Node | None:
    about, info = properties["TimeInfo"].properties, properties["DataInfo"].properties
    times = np.asarray(properties["Time_"] if "Time_" in properties else properties["Time"], dtype=np.float64)
    if not times.size:
        start, step = about["Start_"].item(), about["Increment_"].item()
        times = start + step * np.arange(int(about["Length"].item()))
    data = loaded.node(properties["Data_"] if "Data_" in properties else properties["Data"])
    units = loaded.Struct({"time": loaded.node(about["Units"]), "data": loaded.node(info["Units"])})
    stamps = loaded.NumberArray(times.shape, times, origin=_started(about))
    return loaded.Struct({"time": stamps, "data": data, "units": units})


def _started(about: Mapping[str, Any]) -> float | None:
    """The date of a timeseries in ms since 1970, as MATLAB writes it by default; None where it has none."""
    for form in ("%d-%b-%Y %H:%M:%S", "%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y"):
        with suppress(ValueError, KeyError, IndexError):
            return 1e3 * datetime.strptime(_texts(about["StartDate"])[0], form).replace(tzinfo=UTC).timestamp()
    return None


def _columns(data: Any, names: Any, units: Any) -> loaded.Struct:
    columns = dict(zip(_texts(names), (loaded.node(column, _decoded) for column in data.ravel()), strict=True))
    spelled = {name: loaded.CharArray(unit) for name, unit in zip(columns, _texts(units), strict=False)}
    return loaded.Struct(columns | {"units": loaded.Struct(spelled)} if spelled and "units" not in columns else columns)


def _texts(cells: Any) -> list[str]:
    return [str(cell.item()) if cell.size == 1 else "" for cell in np.ravel(cells)]


def _seconds(values: FloatArray) -> loaded.NumberArray:
    return loaded.NumberArray(values.shape, values, "s")


_CLASSES = MappingProxyType(
    {
        "duration": _duration,
        "datetime": _datetime,
        "table": _table,
        "timetable": _timetable,
        "timeseries": _timeseries,
    }
)

"""Objects of MATLAB's own classes as structs and numbers, where the library mat-io is installed to decode them.

Tables and timetables become structs of their columns, timeseries structs of time and data, dates and durations seconds.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.formats.mat.loaded import (
    NO_NUMBERS,
    CharArray,
    NoChannel,
    Node,
    NodeArray,
    Numbers,
    Struct,
    class_object,
    node,
)
from clutchid.measurements.formats.mat.rasters import means_time


def with_objects(path: Path, root: Struct) -> Struct:
    """`root` with the objects of the file decoded; as it is where there are none, or mat-io is not installed."""
    names = [name for name, found in root.fields.items() if _has_object(found)]
    if not names:
        return root
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "Failed to")  # it would give the numbers that stand for an object
            found = import_module("matio").load_from_mat(str(path), variable_names=names, raw_data=True)
            decoded = {name: node(found[name], _decoded) for name in names if name in found}
    except Exception:  # it is not installed, or does not know the objects; the user is told how to save them otherwise
        return root
    decoded = {name: found for name, found in decoded.items() if found is not NO_NUMBERS}
    return Struct({name: decoded.get(name, kept) for name, kept in root.fields.items()})


def _has_object(found: Node) -> bool:
    match found:
        case NoChannel():
            return bool(found.class_name)
        case Struct():
            return any(map(_has_object, found.fields.values()))
        case NodeArray():
            return any(map(_has_object, found.items))
    return False


def _decoded(value: Any) -> Node | None:
    """The node of an object, as mat-io gives it: name of its class and properties; None of anything else."""
    name = getattr(value, "classname", None)
    if name is None:
        return None
    properties = getattr(value, "properties", None)
    decode = _CLASSES.get(name)
    try:
        found = decode(properties) if decode and isinstance(properties, Mapping) else None
    except (KeyError, IndexError, ValueError, TypeError, AttributeError):
        found = None
    return found or class_object(str(name))


def _duration(properties: Mapping[str, Any]) -> Node:
    return _seconds(np.asarray(properties["millis"], dtype=np.float64) / 1e3)


def _datetime(properties: Mapping[str, Any]) -> Node:
    """Seconds since the first; the imaginary part holds what a double of milliseconds since 1970 cannot."""
    data = np.asarray(properties["data"], dtype=np.complex128)
    since = data - data.ravel()[0] if data.size else data
    return _seconds((since.real + since.imag) / 1e3)


def _table(properties: Mapping[str, Any]) -> Node:
    props = properties["props"].ravel()[0]
    return _columns(properties["data"], properties["varnames"], props["VariableUnits"])


def _timetable(properties: Mapping[str, Any]) -> Node | None:
    whole = properties["any"].ravel()[0]
    columns = _columns(whole["data"], whole["varNames"], whole["varUnits"])
    times = _row_times(whole["rowTimes"], int(whole["numRows"].item()))
    name = _texts(whole["dimNames"])[0]
    return times and Struct({name if means_time(name) else "time": times, **columns.fields})


def _row_times(times: Any, count: int) -> Node | None:
    """Times of the rows: an object, or start and rate of regular ones."""
    if hasattr(times, "properties"):
        return _decoded(times)
    regular = times.ravel()[0]
    step = 1 / regular["sampleRate"].item() if regular["specifiedAsRate"].item() else None
    if step is None:
        step = regular["stepSize"].properties["millis"].item() / 1e3
    return _seconds(np.arange(count) * step)


def _timeseries(properties: Mapping[str, Any]) -> Node | None:
    about, info = properties["TimeInfo"].properties, properties["DataInfo"].properties
    times = np.asarray(properties["Time_"] if "Time_" in properties else properties["Time"], dtype=np.float64)
    if not times.size:
        start, step = about["Start_"].item(), about["Increment_"].item()
        times = start + step * np.arange(int(about["Length"].item()))
    data = node(properties["Data_"] if "Data_" in properties else properties["Data"])
    units = Struct({"time": node(about["Units"]), "data": node(info["Units"])})
    return Struct({"time": Numbers(times.shape, times), "data": data, "units": units})


def _columns(data: Any, names: Any, units: Any) -> Struct:
    columns = dict(zip(_texts(names), (node(column, _decoded) for column in data.ravel()), strict=True))
    spelled = {name: CharArray(unit) for name, unit in zip(columns, _texts(units), strict=False)}
    return Struct(columns | {"units": Struct(spelled)} if spelled and "units" not in columns else columns)


def _texts(cells: Any) -> list[str]:
    return [str(cell.item()) if cell.size == 1 else "" for cell in np.ravel(cells)]


def _seconds(values: FloatArray) -> Numbers:
    return Numbers(values.shape, values, "s")


_CLASSES = MappingProxyType(
    {
        "duration": _duration,
        "datetime": _datetime,
        "table": _table,
        "timetable": _timetable,
        "timeseries": _timeseries,
    }
)

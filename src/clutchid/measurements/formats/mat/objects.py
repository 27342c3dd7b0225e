"""Objects of MATLAB's own classes as arrays and structs, where the library mat-io is installed to decode them.

Tables and timetables become structs of their columns, timeseries structs of time and data; mat-io makes dates and
durations of NumPy, and texts of strings.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

#: Forms of the start date of a timeseries, of which MATLAB writes the first by default.
_DATES = ("%d-%b-%Y %H:%M:%S", "%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y")


def objects_in(path: Path, names: Sequence[str]) -> dict[str, Any]:
    """These variables with their objects; none where mat-io is not installed, or does not know the objects."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # else it would give the numbers that stand for an object, or those that make a table of an old version
            warnings.filterwarnings("error", "Failed to (load|parse)|.*is not supported")
            values = import_module("matio").load_from_mat(str(path), variable_names=list(names), add_table_attrs=True)
    except Exception:  # the user is told how to save them otherwise
        return {}
    return {name: values[name] for name in names if type(values.get(name)).__name__ != "MatlabCanonicalEmpty"}


def object_content(value: Any) -> Any:
    """The content of a table, timetable or timeseries as mat-io gives it; anything else as it is."""
    if hasattr(value, "columns"):
        return _of_frame(value)
    with suppress(KeyError, IndexError, ValueError, TypeError, AttributeError):
        if getattr(value, "classname", "") == "timeseries":
            return _of_timeseries(value.properties)
    return value


def _of_frame(frame: Any) -> dict[str, Any]:
    """The columns of a data frame, before them the times of its rows, if any."""
    units = frame.attrs.get("VariableUnits", frame.attrs.get("varUnits", ()))
    columns = {name: frame[name].to_numpy() for name in frame}
    spelled = dict(zip(columns, units, strict=True)) if len(units) == len(columns) else {}
    if frame.index.dtype.kind in "mM":
        name = "Time" if "Time" not in columns else str(frame.index.name)
        columns = {name: frame.index.to_numpy(), **columns}
    return {"units": spelled, **columns}


def _of_timeseries(properties: Mapping[str, Any]) -> dict[str, Any]:
    about, info = properties["TimeInfo"].properties, properties["DataInfo"].properties
    times = np.asarray(properties["Time_"] if "Time_" in properties else properties["Time"], dtype=np.float64)
    if not times.size:
        start, step = about["Start_"].item(), about["Increment_"].item()
        times = start + step * np.arange(int(about["Length"].item()))
    data = properties["Data_"] if "Data_" in properties else properties["Data"]
    return {"time": _dated(times, about), "data": data, "units": {"time": about["Units"], "data": info["Units"]}}


def _dated(times: Any, about: Mapping[str, Any]) -> Any:
    """The times of a timeseries from its start date, if it has one and they are in s."""
    for form in _DATES if str(about["Units"].item()) == "seconds" else ():
        with suppress(ValueError, KeyError):
            start = datetime.strptime(str(about["StartDate"].item()), form)
            return np.datetime64(start, "ns") + np.round(times * 1e9).astype("m8[ns]")
    return times

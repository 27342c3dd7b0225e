"""Sensor lags below 0, which parameter files of earlier versions may have."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from os import PathLike
from typing import Any

from clutchid.measured import MEASURED
from clutchid.parameters import is_number

#: Smallest lag in s that earlier versions admitted; they shifted the recorded signal in time.
OLDEST = -0.05


def with_lags(document: Mapping[str, Any], path: str | PathLike[str]) -> dict[str, Any]:
    """The contents of a parameter file with lags of at least 0, in [parameters] and in all [recording] sections.

    A negative one becomes 0, with a UserWarning that names file, parameter and value. Values that no version admitted
    stay as they are.
    """
    recordings = document.get("recording", {})
    sections = {
        "recording": {stem: _at_least_0(part, f"[recording.'{stem}']", path) for stem, part in recordings.items()},
        "parameters": _at_least_0(document.get("parameters", {}), "[parameters]", path),
    }
    return {name: sections.get(name, section) for name, section in document.items()}


def _at_least_0(section: Any, where: str, path: str | PathLike[str]) -> Any:
    if not isinstance(section, dict):
        return section
    lags = {sensor.lag for sensor in MEASURED.values()} & section.keys()
    negative = [name for name in sorted(lags) if is_number(section[name]) and OLDEST <= section[name] < 0]
    for name in negative:
        warnings.warn(
            f"{path}: {where} {name} = {section[name]:g} s is read as 0: the lag of a sensor is at least 0. Earlier "
            f"versions admitted {OLDEST:g} s; calibrate again.",
            UserWarning,
            stacklevel=4,
        )
    return {**section, **dict.fromkeys(negative, 0.0)}

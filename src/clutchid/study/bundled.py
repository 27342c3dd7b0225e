"""The bundled recording, its true load, and its two halves."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.resources import as_file, files
from typing import NamedTuple

import numpy as np

from clutchid.log import FloatArray, Log
from clutchid.measurements import read

#: Folder of the bundled recording and its truth.
_DATA = files("clutchid.study") / "data"

#: Metadata key with the name of the file of the true load.
_TRUTH = "true_load"

#: First sample of the second half of the bundled recording, within the rest nearest to its middle.
_REST = 15_096


class TrueLoad(NamedTuple):
    """True load in N over the position in m of a simulated recording."""

    position: FloatArray
    force: FloatArray


def bundled_recording() -> Log:
    """30 s of a simulated truck at 1 kHz with pressure; the truck is more detailed than the paper's model.

    Returns
    -------
    log : Log
        Columns position, duty_supply, duty_exhaust and pressure_a, 30,000 samples.

    Raises
    ------
    DataError
        If the installation is damaged.

    Examples
    --------
    >>> log = bundled_recording()
    >>> len(log), "pressure_a" in log
    (30000, True)
    """
    with as_file(_DATA / "truck1_calibration.csv") as path:
        log = read(path)
    return replace(log, metadata={**log.metadata, _TRUTH: "truck1_truth.json"})


def true_load(log: Log) -> TrueLoad | None:
    """True load of `log`, known only for the bundled recording and its parts."""
    name = log.metadata.get(_TRUTH)
    if name is None:
        return None
    truth = json.loads((_DATA / name).read_text("utf-8"))
    return TrueLoad(np.array(truth["position_m"]), np.array(truth["logs"]["calibration"]["load_N"]))


def halves() -> tuple[Log, Log]:
    """First and second half of the bundled recording, divided at the rest nearest to its middle.

    Examples
    --------
    >>> [len(half) for half in halves()]
    [15096, 14904]
    """
    log = bundled_recording()
    first, second = log.slice(0, _REST), log.slice(_REST, len(log))
    return replace(first, name=f"{log.name}, first half"), replace(second, name=f"{log.name}, second half")

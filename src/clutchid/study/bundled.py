"""The bundled recording, its true load, and its two halves."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from importlib.resources import as_file, files

import numpy as np

from clutchid.log import FloatArray, Log, sample_interval
from clutchid.measurements import read

#: Folder of the bundled recording and its truth.
_DATA = files("clutchid.study") / "data"

#: Metadata key with the name of the file of the true load.
_TRUTH = "true_load"

#: Largest range of the position in m, and time in s, of a rest.
REST_RANGE, _REST_TIME = 5e-4, 0.2

#: A rest is searched for within this fraction of the length around the middle.
_MIDDLE = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class TrueLoad:
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


def halves(log: Log) -> tuple[Log, Log]:
    """First and second half of `log`, divided at the rest nearest to the middle, or in the middle if there is none.

    Examples
    --------
    >>> first, second = halves(bundled_recording())
    >>> len(first) + len(second)
    30000
    """
    at = _cut(log)
    first, second = log.slice(0, at), log.slice(at, len(log))
    return replace(first, name=f"{log.name}, first half"), replace(second, name=f"{log.name}, second half")


def _cut(log: Log) -> int:
    n = len(log)
    if n < 10 or "position" not in log:
        return n // 2
    width = max(2, round(_REST_TIME / sample_interval(log.time)))
    low = int(n * (0.5 - _MIDDLE / 2))
    part = log["position"][low : n - low + width]
    if part.size <= width:
        return n // 2
    windows = np.lib.stride_tricks.sliding_window_view(part, width)
    centres = low + width // 2 + np.flatnonzero(windows.max(axis=1) - windows.min(axis=1) <= REST_RANGE)
    return int(centres[np.argmin(np.abs(centres - n // 2))]) if centres.size else n // 2

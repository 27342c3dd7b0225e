"""What is usual in the calibration recordings, to compare others with."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.observer.following import observe
from clutchid.observer.mismatch import normalised
from clutchid.observer.observer import observer, start
from clutchid.observer.recording import spacing, too_slow, usable


def usual_nis(actuator: Actuator, calibration: Calibration, logs: Sequence[Log]) -> float:
    """Mean normalised innovation squared of the method 'joint' while the piston moves in the calibration recordings.

    Recordings that cannot be observed are left out; NaN where none is left.
    """
    found = []
    for log in logs:
        with suppress(DataError, ParameterError):  # a calibration is not lost for it
            found.append(_nis(actuator, calibration, log))
    together = np.concatenate(found) if found else np.empty(0)
    known = together[np.isfinite(together)]
    return float(np.mean(known)) if known.size else float("nan")


def _nis(actuator: Actuator, calibration: Calibration, log: Log) -> FloatArray:
    if not usable(log) or too_slow(log, actuator):
        return np.empty(0)
    one = observer(actuator, "joint", spacing(log), calibration)
    _, samples = observe(one, start(one), log)
    return normalised(one, samples.states, samples.innovations)

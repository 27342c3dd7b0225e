"""What is usual in the calibration recordings, to compare others with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.observe.following import observe
from clutchid.observe.mismatch import normalised
from clutchid.observe.observer import observer, start
from clutchid.observe.recording import spacing, too_slow, usable
from clutchid.uncertainty.calibration import Calibration


def usual_nis(actuator: Actuator, calibration: Calibration, logs: Sequence[Log]) -> float:
    """Mean normalised innovation squared of the method 'joint' while the piston moves in the calibration recordings.

    NaN where none can be observed.
    """
    found = []
    for log in logs:
        if usable(log) and not too_slow(log, actuator):
            one = observer(actuator, "joint", spacing(log), calibration)
            _, samples = observe(one, start(one), log)
            found.append(normalised(one, samples.states, samples.innovations))
    together = np.concatenate(found) if found else np.empty(0)
    known = together[np.isfinite(together)]
    return float(np.mean(known)) if known.size else float("nan")

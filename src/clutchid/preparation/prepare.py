"""A recording made ready for an actuator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.simulation import Partition
from clutchid.simulation.plan import Plan, plan
from clutchid.simulation.stiffness import stiffness
from clutchid.simulation.windows import GUESS

#: The steps of the integration follow this many times the stiffness at the start, for values that make it stiffer; from
#: calibrated values, which hardly move, so many times.
MARGIN, CALIBRATED_MARGIN = 1.3, 1.05


def prepared(log: Log, actuator: Actuator, measure: Sequence[str]) -> Plan:
    """The plan of a recording, with the resets of the first guess.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    step = float(np.median(np.diff(log.time))) if len(log) > 1 else GUESS
    every = Partition(every=max(2, round(GUESS / step)))
    return plan(log, actuator, MARGIN * stiffness(actuator), every, "pressure_a" in measure)

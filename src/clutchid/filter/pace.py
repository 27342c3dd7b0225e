"""Integration steps that a filter needs where the piston is, known before the interval."""

from __future__ import annotations

import numpy as np

from clutchid.filter.joint_arrays import Pace
from clutchid.model.actuator import Actuator
from clutchid.simulation.stiffness import STABLE_STEP, TOP_SPEED, local_stiffness

#: Position in m, and shares of the stroke, that separate ranges of different stiffness; how far in m the piston may be
#: from its estimate.
NEAR_REST, SHARES, REACH = 2e-3, (0.6, 0.9), 1e-3

#: Speeds in m/s that separate ranges of different stiffness, and how much faster the piston may become in an interval.
SPEEDS, GAIN = (0.02, 0.05, 0.1, 0.2), 0.05

#: The steps of the plan, whatever the state.
AS_PLANNED: Pace = (np.zeros(0), np.zeros(0), np.zeros((0, 0)))


def pace(actuator: Actuator, margin: float) -> Pace:
    """Steps a second by position and speed, for `margin` times the stiffness of an actuator.

    Most of its stiffness is that of the friction at full speed: at a tenth of it one step a millisecond is enough.
    """
    y_max = actuator.parameters.y_max
    positions = np.array([NEAR_REST, *(share * y_max for share in SHARES)])
    reaches = zip([-np.inf, *positions - REACH], [*positions + REACH, np.inf], strict=True)
    speeds = [min(speed + GAIN, TOP_SPEED) for speed in (*SPEEDS, TOP_SPEED)]
    rates = [[local_stiffness(actuator, speed, reach) for speed in speeds] for reach in reaches]
    return positions, np.array(SPEEDS), margin / STABLE_STEP * np.array(rates)

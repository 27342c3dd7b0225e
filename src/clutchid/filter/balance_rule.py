"""How least squares on the balance of forces smooth the position, and how sure they are of a force."""

from __future__ import annotations

import numpy as np

from clutchid.filter.joint_setup import Rule
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.stiffness import STROKE_TIME, TOP_SPEED

#: Degree of the polynomials that smooth the position; time in s that the balance is late, in the middle of the
#: positions that smooth it; time over which the present position is smoothed. Provenance: docs/derivations_online.md.
DEGREE, LATE, PRESENT = 2, 0.02, 0.01

#: Standard deviation in N of the balance of forces over a window: what pressure in open loop and friction miss.
#: Provenance: docs/derivations_online.md.
FORCE = 600.0


def smoothing(samples: int, at: float) -> FloatArray:
    """Weights (2, samples) of the last positions, for position and velocity on the polynomial closest to them.

    Parameters
    ----------
    at
        Time in samples after the newest position; the velocity is that in a sample.
    """
    powers = np.arange(min(DEGREE, samples - 1) + 1)
    inverse = np.linalg.pinv((np.arange(samples) - (samples - 1.0))[:, None] ** powers)
    weights: FloatArray = np.vstack([at**powers @ inverse, (powers * at ** np.maximum(powers - 1, 0)) @ inverse])
    return weights


def balance_rule(actuator: Actuator, count: int, spacing: float) -> Rule:
    """The rule of least squares on the balance of forces for so many load weights.

    Parameters
    ----------
    spacing : s
        Time from one sample to the next.
    """
    late, present = max(1, round(LATE / spacing)), 1 + round(PRESENT / spacing)
    samples, inputs = max(2 * late + 1, present), len(kernels(actuator.model).INPUTS)
    lag = actuator.value(MEASURED["position"].lag) / spacing
    position, velocity = smoothing(samples, lag - late)
    newest = np.append(np.zeros(samples - present), smoothing(present, lag)[0])
    numbers = (
        np.ascontiguousarray([position, velocity / spacing, newest]),
        FORCE,
        max(TOP_SPEED, actuator.parameters.y_max / STROKE_TIME),
        (actuator.parameter_names.index("M"), actuator.parameters.M),
    )
    memory = 7 + count + samples + (late + 1) * (inputs + 1)
    return Rule(
        "clutchid.filter.balance", "follow_balance", columns=False, memory=memory, numbers=(numbers,), compares="force"
    )

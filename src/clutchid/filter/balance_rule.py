"""How least squares on the balance of forces smooth the position, and how sure they are of a force."""

from __future__ import annotations

import numpy as np

from clutchid.filter.joint_setup import Rule
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.stiffness import STROKE_TIME, TOP_SPEED

#: Time in s over which the position is smoothed, and by how much the balance is late in it; degree of the polynomial.
#: Provenance: docs/derivations.md.
SPAN, LATE, DEGREE = 0.011, 0.005, 2

#: Standard deviation in N of the balance of forces over a window: what pressure in open loop and friction miss.
#: Provenance: docs/derivations.md.
FORCE = 300.0


def smoothing(samples: int, late: float, spacing: float, lag: float) -> FloatArray:
    """Weights (3, samples) of the last positions: of position and velocity `late` s ago, and of the position now.

    They are those of a polynomial of `DEGREE` through the positions in the sense of least squares.

    Parameters
    ----------
    lag : s
        Of the sensor.
    """
    time = spacing * (np.arange(samples) - (samples - 1.0))
    powers = np.arange(DEGREE + 1)
    fitted = np.linalg.pinv((time / spacing)[:, None] ** powers)

    def at(t: float) -> list[FloatArray]:
        s = t / spacing
        rate = powers * s ** np.maximum(powers - 1, 0) / spacing
        return [s**powers @ fitted, rate @ fitted]

    weights: FloatArray = np.ascontiguousarray([*at(lag - late), at(lag)[0]])
    return weights


def balance_rule(actuator: Actuator, count: int, spacing: float) -> Rule:
    """The rule of least squares on the balance of forces for so many load weights.

    Parameters
    ----------
    spacing : s
        Time from one sample to the next.
    """
    samples, late = max(DEGREE + 2, round(SPAN / spacing)), max(0, round(LATE / spacing))
    module = kernels(actuator.model)
    lag = actuator.value(MEASURED["position"].lag)
    numbers = (
        smoothing(samples, late * spacing, spacing, lag),
        FORCE,
        max(TOP_SPEED, actuator.parameters.y_max / STROKE_TIME),
        actuator.parameter_names.index("M"),
    )
    memory = 7 + count + samples + (late + 1) * (len(module.INPUTS) + 1)
    return Rule("clutchid.filter.balance", "follow_balance", columns=False, memory=memory, numbers=(numbers,))

"""Rules by which a joint filter corrects: by covariances, by constant gains, or by the balance of forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.stiffness import STROKE_TIME, TOP_SPEED


class CorrectionRule(NamedTuple):
    """By which rule a filter corrects: the kernel that follows a segment, of the signature of `joint.follow_jointly`.

    `columns` says whether S has its columns, see `joint`; `memory` how many numbers `JointState.waiting` has more;
    `numbers` come last in the settings of the kernel; an innovation is that of the position in m, or of a force in N.
    """

    module: str
    kernel: str
    columns: bool
    memory: int
    numbers: Any
    compares: str = "position"


#: States and free parameters by their covariance, see `joint`.
KALMAN = CorrectionRule("clutchid.inference.filter.joint", "follow_jointly", columns=True, memory=0, numbers=None)


class AdaptiveNumbers(NamedTuple):
    """What the rule of the adaptive observer adds to the settings.

    Gains of the velocity in 1/s; of p_A V_A, in N m by m of motion times area over volume; of the weights, which
    multiplies T T', in 1/(N m); share of a sample in the average position; places of p_A in x, of V_0A and A_A in p.
    """

    velocity: float
    air: float
    adaptation: float
    share: float
    at_pressure: int
    at_volume: int
    at_area: int


class BalanceNumbers(NamedTuple):
    """What the rule of the balance of forces adds to the settings.

    Smoothing weights (3, samples); standard deviation of the force in N; top speed in m/s; place of the mass in p, and
    the mass in kg.
    """

    smoothing: FloatArray
    force: float
    top: float
    at_mass: int
    mass: float


#: Time constant in s of the average position: the piston moves if its position is further from it than an outlier from
#: what is predicted. Provenance: docs/derivations_online.md.
AVERAGE = 0.1


@dataclass(frozen=True, slots=True)
class AdaptiveGains:
    """Gains of the adaptive observer as shares of an error that a sample takes away, each at least 0.

    Parameters
    ----------
    velocity
        Of an error of the velocity, beside what the friction takes; at most 1.
    pressure
        Of an error of the force in steady motion, if it is the pressure's, with the piston at 0.
    load
        The same, if it is the load's, where its prior is widest. `pressure` and `load` are less than 2 together.
    """

    velocity: float = 0.2
    pressure: float = 0.1
    load: float = 0.05

    def __post_init__(self) -> None:
        values = (self.velocity, self.pressure, self.load)
        if not (all(0.0 <= value < np.inf for value in values) and self.velocity <= 1.0 and sum(values[1:]) < 2.0):
            raise ParameterError(
                f"gains {self.velocity:g} (velocity), {self.pressure:g} (pressure) and {self.load:g} (load) of the "
                "adaptive observer would be unstable: none is below 0, that of the velocity is at most 1, and those of "
                "pressure and load are less than 2 together; 0.2, 0.1 and 0.05 are the default."
            )


def adaptive_rule(
    actuator: Actuator, coordinates: Sequence[Coordinate], root: FloatArray, spacing: float, gains: AdaptiveGains
) -> CorrectionRule:
    """The rule of the adaptive observer for load weights with the prior covariance root root'.

    Parameters
    ----------
    spacing : s
        Time from one sample to the next.
    """
    p, load = actuator.parameters, actuator.load
    functions = load.phi(np.linspace(0.0, p.y_max, 200))
    by_coordinate = np.array([functions[:, load.names.index(c.base)] * c.slope(0.0) for c in coordinates]).T
    variance = np.sum((by_coordinate @ root) ** 2, axis=1).max()
    velocity = gains.velocity / spacing
    damping = (p.D_v + p.M * velocity) / spacing
    rows, names = actuator.states, actuator.parameter_names
    numbers = AdaptiveNumbers(
        velocity,
        gains.pressure * damping * (p.V_0A / p.A_A) ** 2,
        gains.load * damping / float(variance),
        min(1.0, spacing / AVERAGE),
        rows.index("p_A"),
        names.index("V_0A"),
        names.index("A_A"),
    )
    return CorrectionRule(
        "clutchid.inference.filter.adaptive", "follow_adaptively", columns=False, memory=2, numbers=numbers
    )


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


def balance_rule(actuator: Actuator, count: int, spacing: float) -> CorrectionRule:
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
    numbers = BalanceNumbers(
        np.ascontiguousarray([position, velocity / spacing, newest]),
        FORCE,
        max(TOP_SPEED, actuator.parameters.y_max / STROKE_TIME),
        actuator.parameter_names.index("M"),
        actuator.parameters.M,
    )
    memory = 7 + count + samples + (late + 1) * (inputs + 1)
    return CorrectionRule(
        "clutchid.inference.filter.balance",
        "follow_balance",
        columns=False,
        memory=memory,
        numbers=numbers,
        compares="force",
    )

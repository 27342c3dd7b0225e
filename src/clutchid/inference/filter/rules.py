"""Rules by which a joint filter corrects: by covariances, by constant gains, or by the balance of forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from clutchid.errors import ParameterError
from clutchid.inference.filter.setup import FilterState, IntArray
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.simulation.stiffness import TOP_SPEED
from clutchid.strokes.stroke import QUICKEST


class CorrectionRule(NamedTuple):
    """By which rule a filter corrects: the kernel that follows a segment, of the signature of `recursion.follow`.

    `start` makes its state from one of the filter at the start of a segment; `numbers` come last in the settings of the
    kernel. `columns` says whether S has its columns, see `recursion`; an innovation is that of the position in m, or of
    a force in N. `drifts` says whether T is a root of a covariance, which grows with the wear of a stroke.
    """

    module: str
    kernel: str
    columns: bool
    numbers: Any
    start: Callable[[FilterState, int], RuleState]
    compares: str = "position"
    drifts: bool = True


def _as_it_is(state: FilterState, _inputs: int) -> FilterState:
    return state


#: States and free parameters by their covariance, see `recursion`.
KALMAN = CorrectionRule("clutchid.inference.filter.recursion", "follow", columns=True, numbers=None, start=_as_it_is)


class AdaptiveState(NamedTuple):
    """State of the adaptive observer between two samples: x (size,), theta (k,), and T (k, m), a root of their gains.

    `known` (1,) is 1 after a sample with a position, and `average` (1,) the average position in m.
    """

    x: FloatArray
    theta: FloatArray
    T: FloatArray
    known: IntArray
    average: FloatArray


class BalanceState(NamedTuple):
    """State of the balance of forces between two samples: x (size,), theta (k,), and T (k, m), a root of covariance.

    `late` (size,) is the late state, see `balance`, and `speed` (1,) its velocity. `usable` (1,) counts usable
    positions in a row, below 0 while more have to follow, `missing` (1,) those missing in a row. The window has
    intervals `in_window` (1,), what mass times velocity gained in them, `momentum` (1,), their `impulse` (1,) and
    `seconds` (1,), and `h` (k,), the derivatives with respect to the weights. Last come the newest `positions`
    (samples,) and `intervals` (late + 1, inputs + 1), inputs and length in s, the oldest first.
    """

    x: FloatArray
    theta: FloatArray
    T: FloatArray
    late: FloatArray
    speed: FloatArray
    usable: IntArray
    missing: IntArray
    in_window: IntArray
    momentum: FloatArray
    impulse: FloatArray
    seconds: FloatArray
    h: FloatArray
    positions: FloatArray
    intervals: FloatArray


RuleState = FilterState | AdaptiveState | BalanceState


def counted_from(state: RuleState, by: float, places: Sequence[int]) -> RuleState:
    """A state whose positions count from a zero that is `by` m higher; `places` are those in x that are positions."""
    less = np.zeros_like(state.x)
    less[list(places)] = by
    if isinstance(state, AdaptiveState):
        return state._replace(x=state.x - less, average=state.average - by)
    if isinstance(state, BalanceState):
        return state._replace(x=state.x - less, late=state.late - less, positions=state.positions - by)
    return state._replace(x=state.x - less)


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
        "clutchid.inference.filter.adaptive", "follow_adaptively", columns=False, numbers=numbers,
        start=_adaptive_start, drifts=False,
    )  # fmt: skip


def _adaptive_start(state: FilterState, _inputs: int) -> AdaptiveState:
    return AdaptiveState(state.x, state.theta, state.T, np.zeros(1, dtype=np.int64), np.zeros(1))


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


def balance_rule(actuator: Actuator, spacing: float) -> CorrectionRule:
    """The rule of least squares on the balance of forces.

    Parameters
    ----------
    spacing : s
        Time from one sample to the next.
    """
    late, present = max(1, round(LATE / spacing)), 1 + round(PRESENT / spacing)
    samples = max(2 * late + 1, present)
    lag = actuator.value(MEASURED["position"].lag) / spacing
    position, velocity = smoothing(samples, lag - late)
    newest = np.append(np.zeros(samples - present), smoothing(present, lag)[0])
    numbers = BalanceNumbers(
        np.ascontiguousarray([position, velocity / spacing, newest]),
        FORCE,
        max(TOP_SPEED, actuator.parameters.y_max / QUICKEST),
        actuator.parameter_names.index("M"),
        actuator.parameters.M,
    )
    return CorrectionRule(
        "clutchid.inference.filter.balance",
        "follow_balance",
        columns=False,
        numbers=numbers,
        start=partial(_balance_start, samples, late + 1),
        compares="force",
    )


def _balance_start(samples: int, kept: int, state: FilterState, inputs: int) -> BalanceState:
    """Before the first sample: no interval is known, and the kernel takes late state and positions from the first."""
    speed, momentum, impulse, seconds = np.zeros((4, 1))
    usable, missing, in_window = np.zeros((3, 1), dtype=np.int64)
    return BalanceState(
        x=state.x, theta=state.theta, T=state.T, late=np.zeros_like(state.x), speed=speed, usable=usable,
        missing=missing, in_window=in_window, momentum=momentum, impulse=impulse, seconds=seconds,
        h=np.zeros(state.theta.size), positions=np.zeros(samples), intervals=np.zeros((kept, inputs + 1)),
    )  # fmt: skip

"""Reference observers, to be compared with the Kalman filter: their states between two samples, and their numbers.

The adaptive observer has constant gains (`adaptive`), least squares take the balance of forces (`balance`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from clutchid.inference.filter.setup import FilterState
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.log import FloatArray, IntArray
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.simulation.stiffness import TOP_SPEED
from clutchid.strokes.stroke import QUICKEST


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


MethodState = FilterState | AdaptiveState | BalanceState


class AdaptiveNumbers(NamedTuple):
    """Numbers of the adaptive observer.

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

    def start(self, x: FloatArray, theta: FloatArray, T: FloatArray, _inputs: int) -> AdaptiveState:
        """State before the first sample."""
        return AdaptiveState(x, theta, T, np.zeros(1, dtype=np.int64), np.zeros(1))


class BalanceNumbers(NamedTuple):
    """Numbers of least squares on the balance of forces.

    Smoothing weights (3, samples); standard deviation of the force in N; top speed in m/s; place of the mass in p, and
    the mass in kg.
    """

    smoothing: FloatArray
    force: float
    top: float
    at_mass: int
    mass: float

    def start(self, x: FloatArray, theta: FloatArray, T: FloatArray, inputs: int) -> BalanceState:
        """State before the first sample, from which the kernel takes late state and positions; no interval is known."""
        samples = self.smoothing.shape[1]
        speed, momentum, impulse, seconds = np.zeros((4, 1))
        usable, missing, in_window = np.zeros((3, 1), dtype=np.int64)
        return BalanceState(
            x, theta, T, np.zeros_like(x), speed, usable, missing, in_window, momentum, impulse, seconds,
            h=np.zeros(theta.size), positions=np.zeros(samples), intervals=np.zeros((samples // 2 + 1, inputs + 1)),
        )  # fmt: skip


#: Numbers of a reference observer, by whose type the recursion is chosen.
Reference = AdaptiveNumbers | BalanceNumbers

#: Time constant in s of the average position: the piston moves if its position is further from it than an outlier from
#: what is predicted. Provenance: docs/derivations_online.md.
_AVERAGE = 0.1

#: Shares of an error that a sample takes away: of the velocity, beside what the friction takes; of the force in steady
#: motion, if it is the pressure's, with the piston at 0; the same, if it is the load's, where its prior is widest.
#: Stable up to 1 for the velocity, and below 2 for the others together. Provenance: docs/derivations_online.md.
_VELOCITY, _PRESSURE, _LOAD = 0.2, 0.1, 0.05


def adaptive_numbers(
    actuator: Actuator, coordinates: Sequence[Coordinate], root: FloatArray, spacing: float
) -> AdaptiveNumbers:
    """Numbers of the adaptive observer for load weights with the prior covariance root root'.

    Parameters
    ----------
    spacing : s
        Time from one sample to the next.
    """
    p, load = actuator.parameters, actuator.load
    functions = load.phi(np.linspace(0.0, p.y_max, 200))
    by_coordinate = np.array([functions[:, load.names.index(c.base)] * c.slope(0.0) for c in coordinates]).T
    variance = np.sum((by_coordinate @ root) ** 2, axis=1).max()
    velocity = _VELOCITY / spacing
    damping = (p.D_v + p.M * velocity) / spacing
    rows, names = actuator.states, actuator.parameter_names
    return AdaptiveNumbers(
        velocity,
        _PRESSURE * damping * (p.V_0A / p.A_A) ** 2,
        _LOAD * damping / float(variance),
        min(1.0, spacing / _AVERAGE),
        rows.index("p_A"),
        names.index("V_0A"),
        names.index("A_A"),
    )


#: Degree of the polynomials that smooth the position; time in s that the balance is late, in the middle of the
#: positions that smooth it; time over which the present position is smoothed. Provenance: docs/derivations_online.md.
_DEGREE, _LATE, _PRESENT = 2, 0.02, 0.01

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
    powers = np.arange(min(_DEGREE, samples - 1) + 1)
    inverse = np.linalg.pinv((np.arange(samples) - (samples - 1.0))[:, None] ** powers)
    return np.vstack([at**powers @ inverse, (powers * at ** np.maximum(powers - 1, 0)) @ inverse])


def balance_numbers(
    actuator: Actuator, _coordinates: Sequence[Coordinate], _root: FloatArray, spacing: float
) -> BalanceNumbers:
    """Numbers of least squares on the balance of forces.

    Parameters
    ----------
    spacing : s
        Time from one sample to the next.
    """
    late, present = max(1, round(_LATE / spacing)), 1 + round(_PRESENT / spacing)
    samples = 2 * late + 1
    lag = actuator.value(MEASURED["position"].lag) / spacing
    position, velocity = smoothing(samples, lag - late)
    newest = np.append(np.zeros(samples - present), smoothing(present, lag)[0])
    return BalanceNumbers(
        np.ascontiguousarray([position, velocity / spacing, newest]),
        FORCE,
        max(TOP_SPEED, actuator.parameters.y_max / QUICKEST),
        actuator.parameter_names.index("M"),
        actuator.parameters.M,
    )

"""Prior of an observer's parameters before its first sample, and of its supply pressure and air, where recorded.

Less supply and a smaller load look alike from position alone, and the pressure that a governor keeps swings by some
percent. Where the vehicle records the supply, the filter corrects its state p_S by it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import sqrt
from typing import NamedTuple

import numpy as np

from clutchid.inference.filter.joint_filter import Considered
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import drift
from clutchid.inference.uncertainty.conditions import ACCURACY, NOT_RECORDED, by_supply
from clutchid.inference.uncertainty.coordinates import CURVATURE, Coordinate, Prior, coordinates, far_stop, smoothness
from clutchid.log import FloatArray
from clutchid.log.states import SENSOR_PARAMETERS
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import Load
from clutchid.numerics.least_squares import triangular
from clutchid.parameters import Parameters

#: Standard deviation of a supply that is not recorded from that of the calibration, as a share of it: what its governor
#: leaves after minutes. Provenance: docs/derivations_online.md.
ASSUMED = 0.006


#: Standard deviation of the supply pressure from that of the calibration, as a share of it: what governors, consumers
#: and the service leave (5 % may change, within 2 of them). For a model with a constant supply as much
#: of the load and of A_A P_0, times the second. Provenance: docs/derivations_online.md.
SUPPLY_STD, BY_FORMULA = 0.03, 0.025 / 0.03

#: Standard deviation that another temperature of the air and the grease than in the calibration leaves to a load, as a
#: share of f + A_A P_0 at full stroke; it is in proportion to the position. Some 16 K, at 0.12 % a kelvin. Provenance:
#: benchmarks/results/observer_band.md.
AIR_STD = 0.02

#: As much where the temperature is recorded, in the calibration too. Provenance: benchmarks/results/observer_band.md.
KNOWN_AIR_STD = 0.0075


def considered_supply(actuator: Actuator, share: float) -> Considered | None:
    """A supply pressure that varies by a share of it, by its effect on the states; None without a governor."""
    if "p_G" not in actuator.states:
        return None
    std, names = share * actuator.parameters.P_S, actuator.states
    start = np.array([[std * (row.starts_at == "P_S")] for row in actuator.state_rows.values()])
    rate = np.array([[std / actuator.parameters.tau_G * (name == "p_G")] for name in names])
    return Considered(start, rate)


class RecordedSupply(NamedTuple):
    """Use of a recorded supply pressure.

    `ratio` of the estimated to the recorded one in the calibration, its standard deviation as a `share` of it, and the
    `recorded` one in Pa.
    """

    ratio: float
    share: float
    recorded: float


def load_deviation(share: float, actuator: Actuator, load: Load, position: FloatArray) -> FloatArray:
    """Standard deviation in N that a supply known to a `share` of it leaves to the load at positions in m."""
    return share * by_supply(actuator, load.force(position))


def deviation_by_air(share: float, actuator: Actuator, load: Load, position: FloatArray) -> FloatArray:
    """Standard deviation in N that the temperature of air and grease leaves to the load at positions in m.

    A `share` of f + A_A P_0 at full stroke.
    """
    return share * position / actuator.parameters.y_max * by_supply(actuator, load.force(position))


class Air(NamedTuple):
    """Use of a recorded temperature of the air.

    Air that is r times as warm as in the calibration has gas and walls r times as warm, valves that pass less, as
    choked flow goes with the inverse root of r, and thinner grease.

    Attributes
    ----------
    calibrated : K
        Temperature in the calibration.
    powers
        Power of r by which each parameter, adapting means included, grows, by name.
    """

    calibrated: float
    powers: Mapping[str, float]


def air_of(actuator: Actuator, calibration: Calibration | None) -> Air | None:
    """Effect of another temperature of the air; None where that of the calibration is not known.

    The powers of r are those of the change that a reading weighs, in the direction of `T_0`; for a change in a unit
    they have its slope at r = 1.
    """
    conditions = calibration.conditions if calibration else NOT_RECORDED
    if conditions.temperature is None:
        return None
    rows = {name: actuator.row(name) for name in sorted(actuator.acting)}  # a fingerprint has their order
    warmer = next(change for change in Parameters.row("T_0").changes if change.along)
    powers = {
        name: (change.std if row.in_shares else change.std / actuator.value(name)) / warmer.std
        for name, row in rows.items()
        for change in row.changes
        if (change.group, change.along) == (warmer.group, warmer.along) and actuator.value(name) > 0.0
    }
    return Air(conditions.temperature, powers)


def supply_of(actuator: Actuator, calibration: Calibration | None, share: float | None = None) -> RecordedSupply | None:
    """Ratio of the supply pressure to a recorded one by the calibration; None if it has none.

    `share` is its standard deviation, None for that of two sensors of a brake system.
    """
    conditions = calibration.conditions if calibration else NOT_RECORDED
    if conditions.supply is None or conditions.supply_estimated is None or "p_S" not in actuator.states:
        return None
    return RecordedSupply(
        conditions.supply_estimated / conditions.supply,
        sqrt(2.0) * ACCURACY["P_S"] / conditions.supply if share is None else share,
        conditions.supply,
    )


#: Parameter of a leak of chamber A, which is not below 0.
LEAK = "C_A0"

#: Bounds of the adapting parameters in prior standard deviations.
BOUND = 5.0


class OnlinePrior(NamedTuple):
    """The parameters that adapt and their prior, of mean 0 in their coordinates.

    `root` (k, k) is a lower triangular root of the covariance of the coordinates `free`, in the order of the filter in
    C: parameters of the model, load weights, lags and offsets of sensors; and `weights` (weights, k) are the
    derivatives of the load's weights with respect to them.
    """

    free: tuple[Coordinate, ...]
    root: FloatArray
    weights: FloatArray


def online_prior(actuator: Actuator, names: Sequence[str]) -> OnlinePrior:
    """Prior of the parameters that adapt.

    The load is that of the calibrated actuator, and may move as smoothly as a clutch wears; everything else drifts as
    between two recordings, see `clutchid.inference.uncertainty.change_prior`.

    Parameters
    ----------
    actuator : Actuator
        As calibrated.
    names
        Load weights and parameters.
    """
    priors = {name: Prior(actuator.value(name), std) for name in names if (std := drift(actuator, name)) > 0.0}
    for name, row in actuator.rows.items():
        if row.adapts and row.adapts.std is not None:
            priors[name] = Prior(actuator.value(name), row.adapts.std * row.size(actuator.value(name)))
    priors["y_max"] = far_stop(actuator, 0.0)
    ordered = sorted(names, key=partial(_group, actuator.load.names))
    free = tuple(coordinates(actuator, tuple(ordered), {}, {n: prior for n, prior in priors.items() if n in names}))
    rows = [np.column_stack([np.eye(len(free)), np.zeros(len(free))])]
    if actuator.load.basis == "b-spline" and set(names) & set(actuator.load.names):
        smooth = smoothness(actuator, ordered, actuator.load.theta, CURVATURE)
        smooth[:, :-1] *= [c.slope(0.0) for c in free]
        rows.append(smooth)
    weights = np.array([[c.width * (c.base == name) for c in free] for name in actuator.load.names])
    if not free:
        return OnlinePrior(free, np.zeros((0, 0)), weights)
    inverse = np.linalg.inv(triangular(np.vstack(rows))[: len(free), : len(free)])
    return OnlinePrior(free, np.linalg.cholesky(inverse @ inverse.T), weights)


def _group(weights: Sequence[str], name: str) -> int:
    """Place of a parameter's group: of the model, load weights, of sensors."""
    return 1 if name in weights else 2 * (name in SENSOR_PARAMETERS)

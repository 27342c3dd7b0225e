"""How many integration steps an interval between two samples needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import ParameterError
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels

FloatArray = NDArray[np.float64]

#: Classical RK4 is stable for real eigenvalues down to -2.785 / h; 2.5 leaves a margin.
STABLE_STEP = 2.5

#: Fastest motion of the piston in m/s: a full stroke in a tenth of a second.
TOP_SPEED = 0.3


def stiffness(actuator: Actuator) -> float:
    """Largest eigenvalue magnitude in 1/s of the model's Jacobian over its operating range.

    Raises
    ------
    Nothing: the actuator is checked where it is built.

    Examples
    --------
    Chamber B at full stroke is the stiffest part of the paper's model:

    >>> 2000 < stiffness(Actuator()) < 2500
    True
    """
    p = actuator.parameters
    near = 5e-4 * p.P_0
    x = np.array(
        list(
            product(
                (-2 * p.d_stop, p.d_stop, p.y_max / 2, p.y_max - p.d_stop, p.y_max + 2 * p.d_stop),
                (-TOP_SPEED, 0.0, TOP_SPEED),
                (p.P_0 + near, (p.P_0 + p.P_S) / 2, p.P_S - near),
                (p.P_0 - near, p.P_0 + near, 1.3 * p.P_0),
                (0.0,),
            )
        )
    )
    rates, jacobian = np.empty_like(x), np.empty((x.shape[0], 5, 5))
    largest = 0.0
    load = actuator.load
    for duty in ((1.0, 0.0), (0.0, 1.0)):
        u = np.tile(np.array(duty), (x.shape[0], 1))
        kernels(actuator.model).linearise(
            x, u, p.array(), load.breakpoints, load.combined(), rates, jacobian
        )
        finite = jacobian[np.all(np.isfinite(jacobian), axis=(1, 2))]
        largest = max(largest, float(np.abs(np.linalg.eigvals(finite)).max()))
    return largest


def stiffness_over(actuator: Actuator, bounds: Mapping[str, tuple[float, float]]) -> float:
    """Largest `stiffness` with each parameter of `bounds` at either of its bounds.

    An infinite or inadmissible bound is replaced by half or twice the value, so that the number of steps stays finite.
    """
    return max([stiffness(actuator), *(stiffness(changed) for changed in _corners(actuator, bounds))])


def _corners(actuator: Actuator, bounds: Mapping[str, tuple[float, float]]) -> Iterable[Actuator]:
    for name, (low, high) in bounds.items():
        if name in actuator.load.names:
            continue
        value = actuator.value(name)
        for bound, fallback in ((low, value / 2), (high, value * 2)):
            try:
                yield actuator.replace({name: bound})
            except ParameterError:
                try:
                    yield actuator.replace({name: fallback})
                except ParameterError:
                    continue


def substeps(dt: FloatArray, rate: float) -> NDArray[np.int32]:
    """Integration steps for each interval `dt` in s, so that no step exceeds `STABLE_STEP` / `rate`."""
    return np.maximum(1, np.ceil(dt * rate / STABLE_STEP * (1 - 1e-9))).astype(np.int32)

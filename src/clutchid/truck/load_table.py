"""`LoadTable`: the load over the position as a piecewise cubic table, and where the vented piston rests in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray, read_only
from clutchid.truck.vehicle import Vehicle

#: Distance of the breakpoints of the table, and its extent beyond the far stop, in m.
PITCH, _BEYOND = 0.1e-3, 2e-3


@dataclass(frozen=True, slots=True, eq=False)
class LoadTable:
    """Load over the mechanical position of the piston, which is 0 at the engaged rest of the new clutch.

    Attributes
    ----------
    breakpoints : m, (s,)
        Where its pieces meet.
    coefficients : N/m^k, (s + 1, 4)
        In powers of the distance to the breakpoint on the left.
    rest : m
        Position of the piston with the clutch engaged.
    touch : m
        The touch point.
    """

    breakpoints: FloatArray
    coefficients: FloatArray
    rest: float
    touch: float

    def force(self, position: FloatArray) -> FloatArray:
        """Load in N at mechanical positions in m, without hysteresis and friction."""
        y = np.asarray(position, dtype=np.float64)
        segment = np.searchsorted(self.breakpoints, y, side="right")
        offset = y - self.breakpoints[np.maximum(segment - 1, 0)]
        c = self.coefficients[segment]
        return c[..., 0] + offset * (c[..., 1] + offset * (c[..., 2] + offset * c[..., 3]))


def travels(truck: Vehicle, rest: float) -> FloatArray:
    """Travel from the engaged rest in m, from 0 to beyond the far stop, at which a table has its breakpoints."""
    return np.arange(0.0, truck.y_max - rest + _BEYOND, PITCH)


def with_return_spring(truck: Vehicle, rest: float, force: FloatArray, touch: float, preload: float) -> LoadTable:
    """Table of the clutch's `force` [N] over `travels`, with the return spring in parallel.

    Parameters
    ----------
    rest, touch : m
        Mechanical position of the engaged rest, and travel from there to the touch point.
    force : N
        Force of the clutch at the actuator over `travels`.
    preload : N
        Force of the return spring at the rest of the new clutch.

    Raises
    ------
    ParameterError
        If the load is negative somewhere in the stroke.
    """
    from scipy.interpolate import CubicSpline

    travel = travels(truck, rest)
    spring = preload + truck.k_r * (rest + travel[:-1])
    if np.any(force[:-1] + spring <= 0):
        low = travel[np.argmin(force)] * 1e3
        raise ParameterError(
            f"springs: at {low:.1f} mm the load is negative, so the clutch would stay open. Check its springs."
        )
    spline = CubicSpline(travel, force).c[::-1].T
    engaged = np.array([[spring[0], truck.k_r, 0.0, 0.0]])
    clutch = spline + np.column_stack([spring, np.full(spring.size, truck.k_r), np.zeros((spring.size, 2))])
    breakpoints, coefficients = read_only(rest + travel[:-1]), read_only(np.concatenate([engaged, clutch]))
    return LoadTable(breakpoints, coefficients, rest, rest + touch)


def rest_position(truck: Vehicle, curve: LoadTable) -> float:
    """Mechanical position in m of the vented piston, pressed into the stop by the return spring."""
    depth = 0.0
    for _ in range(8):  # contracts by k_r / (stiffness of the stop), 1 in 1000
        force = float(curve.force(np.array([curve.rest - depth]))[0])
        depth = (max(force, 0.0) / truck.K_stop) ** (2 / 3)
    return curve.rest - depth

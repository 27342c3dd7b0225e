"""The least-squares problem of a LuGre fit: parameters, scales, bounds, residuals and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import FloatArray, Log
from clutchid.numerics.least_squares import Linearisation, compress
from clutchid.recordings.signals.sampled import velocity
from clutchid.rig.free_run import NAMES, FreeRunSegment, free_run, segments

#: Parameters that a fit estimates or keeps fixed: the friction, and the zero of the load cell.
FREE = (*NAMES, "force_zero")

#: Bounds of F_C as multiples of half the range of the force.
_FORCES = (0.25, 4.0)

#: Bounds of F_C / K_z: from a tenth of the resolution of the position, but at least a millionth of the reach, to ten
#: reaches. Below a tenth the bristle has slid within a sample, so that the force says nothing more about its stiffness.
_FINEST, _LEAST_OF_REACH, _MOST_OF_REACH = 0.1, 1e-6, 10.0

#: Fractions of the reach from which the search for F_C / K_z starts.
_STARTS = (1e-4, 1e-3, 4e-3, 0.01, 0.1)

#: The sign of the force is wrong if its correlation with the velocity is below minus this; a spring alone has 0.
_AGAINST = 0.1

#: Least range of position (m) and force (N).
_LEAST = (1e-10, 1e-10)

#: Least number of samples for a fit of five parameters and the initial deflection.
_FEWEST = 50


@dataclass(frozen=True, slots=True, eq=False)
class LugreProblem:
    """Segments of a recording, and parameters scaled by `unit`: those of `FREE`, then one initial deflection each.

    `inertial` is the part of the force in N that accelerates the mass; NaN outside the segments.
    """

    log: Log
    inertial: FloatArray
    parts: Sequence[FreeRunSegment]
    unit: FloatArray
    low: FloatArray
    high: FloatArray
    free: NDArray[np.bool_]
    base: FloatArray

    def all(self, x: FloatArray) -> FloatArray:
        """All parameters in SI from the scaled free ones."""
        values = self.base.copy()
        values[self.free] = x
        return values * self.unit


def resolution(position: FloatArray) -> tuple[float, float]:
    """Usual step between the values of a position in m, and the standard deviation of its noise, with quantisation.

    Examples
    --------
    >>> y = 0.04 * np.sin(np.linspace(0.0, 6.0, 5000))
    >>> step, noise = resolution(np.round(y, 4))
    >>> f"{step * 1e3:.1f} mm, {noise * 1e3:.2f} mm"
    '0.1 mm, 0.03 mm'
    """
    known = position[np.isfinite(position)]
    values = np.unique(known)
    step = float(np.median(np.diff(values))) if values.size > 1 else 0.0
    quantised = step if 2 * values.size < known.size else 0.0
    third = np.abs(np.diff(known, 3))
    noise = 1.4826 * float(np.median(third)) / np.sqrt(20.0) if third.size else 0.0  # 1 + 9 + 9 + 1
    return step, max(noise, quantised / np.sqrt(12.0))


def lugre_problem(log: Log, fixed: Mapping[str, float], window: float, inertia: float = 0.0) -> LugreProblem:
    """Problem with scales and bounds from the ranges and the resolution of position and force."""
    position = log["position"]
    parts = segments(log, window)
    inertial = inertial_force(log, parts, window, inertia)
    force = log["force"] - (inertial if inertia else 0.0)
    reach = float(np.nanmax(position) - np.nanmin(position))
    ends = np.nanquantile(force, [0.02, 0.98])
    strength = float(ends[1] - ends[0]) / 2
    if not (reach > _LEAST[0] and strength > _LEAST[1]):
        what = "position" if not reach > _LEAST[0] else "force"
        raise DataError(
            f"{log.name}: the {what} does not change; friction can be estimated only if the rig moves back and forth."
        )
    shortest = max(_FINEST * max(resolution(position)), _LEAST_OF_REACH * reach)
    v = np.concatenate([segment.velocity for segment in parts]) if parts else np.zeros(0)
    f = np.concatenate([force[segment.start : segment.stop] for segment in parts]) if parts else np.zeros(0)
    both = np.isfinite(v) & np.isfinite(f)
    if both.sum() < _FEWEST:
        raise DataError(f"{log.name}: {both.sum()} samples have position and force; at least {_FEWEST} are needed.")
    _check_sign(log, v[both], f[both])
    speed = float(np.sqrt(np.mean(v[both] ** 2)))
    if not speed > 0.0:
        raise DataError(f"{log.name}: the position does not change where the force is known.")
    n = len(parts)
    unit = np.array([strength, 10 * strength / reach, *[strength / speed] * 2, strength, *[reach] * n])
    low = np.array([_FORCES[0] * strength, strength / (_MOST_OF_REACH * reach), 0.0, 0.0, -np.inf, *[-np.inf] * n])
    high = np.array([_FORCES[1] * strength, strength / shortest, *[np.inf] * (3 + n)])
    base = np.array([0.9 * strength, np.nan, 0.1 * strength / speed, 0.0, float(ends.mean()), *[0.0] * n])
    for i, name in enumerate(FREE):
        base[i] = fixed.get(name, base[i])
    free = np.array([*(name not in fixed for name in FREE), *[True] * n])
    return LugreProblem(log, inertial, parts, unit, low / unit, high / unit, free, base / unit)


def inertial_force(log: Log, parts: Sequence[FreeRunSegment], window: float, inertia: float) -> FloatArray:
    """Mass times acceleration; the acceleration is the difference of mean velocities, as the velocity of positions."""
    force = np.full(len(log), np.nan)
    for part in parts:
        ends = slice(part.start, part.stop)
        force[ends] = inertia * velocity(log.time[ends], part.velocity, window)
    return force


def _check_sign(log: Log, v: FloatArray, f: FloatArray) -> None:
    """Check that force and velocity correlate positively, because friction dissipates energy."""
    dv, df = v - v.mean(), f - f.mean()
    if np.sum(dv * df) < -_AGAINST * np.sqrt(np.sum(dv**2) * np.sum(df**2)):
        raise DataError(
            f"{log.name}: the force opposes the motion, so friction would supply energy. The force must be that of the "
            "rig on the part, positive towards larger positions; invert its sign."
        )


def starts(problem: LugreProblem) -> list[FloatArray]:
    """Start points of the search, by distance F_C / K_z.

    The cost has a second minimum with lower stiffness and high damping; at least one of these starts avoids it.
    """
    K = FREE.index("K_z")
    if not problem.free[K]:
        return [problem.base[problem.free]]
    points = []
    for part_of_reach in _STARTS:
        base = problem.base.copy()
        base[K] = base[0] * problem.unit[0] / (part_of_reach * problem.unit[-1]) / problem.unit[K]
        limited = base.copy()
        limited[K] = np.clip(base[K], problem.low[K], problem.high[K])
        points.append(limited[problem.free])
    return [point for i, point in enumerate(points) if not any(np.array_equal(point, other) for other in points[:i])]


def residuals(problem: LugreProblem, x: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Simulated minus measured force of each segment, 0 where missing, and its Jacobian (free scaled parameters)."""
    values, shared = problem.all(x), len(FREE)
    answers = []
    for i, segment in enumerate(problem.parts):
        force, slopes = free_run(segment, values[: len(NAMES)].tolist(), float(values[shared + i]))
        ends = slice(segment.start, segment.stop)
        r = force + values[shared - 1] + problem.inertial[ends] - problem.log["force"][ends]
        J = np.zeros((len(segment), problem.unit.size))
        J[:, [*range(len(NAMES)), shared + i]] = slopes
        J[:, shared - 1] = 1.0
        known = np.isfinite(r)
        answers.append((np.where(known, r, 0.0), np.where(known[:, None], J * problem.unit, 0.0)[:, problem.free]))
    return answers


def linearised(problem: LugreProblem, x: FloatArray) -> Linearisation:
    """Compressed residuals and Jacobian at the scaled free parameters `x`."""
    factor = np.vstack([compress(J, r) for r, J in residuals(problem, x)])
    whole = compress(factor[:, :-1], factor[:, -1])
    return Linearisation(whole[:-1, :-1], whole[:-1, -1], 0.5 * float(np.sum(whole[:, -1] ** 2)), factor.shape[0])

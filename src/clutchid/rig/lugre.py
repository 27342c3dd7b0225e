"""`fit_lugre`: the paper's friction model fitted to force and position of a test rig, and its warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.assess.diagnostics import fit_percent
from clutchid.estimation.request import ended
from clutchid.inference.uncertainty.estimates import Estimate
from clutchid.inference.uncertainty.gaussian import Covariance, sandwich
from clutchid.log import BoolArray, FloatArray, Log, sample_interval
from clutchid.names import check_names
from clutchid.numerics.least_squares import Linearisation, Solution, compress, minimise
from clutchid.numerics.whiteness import effective_samples
from clutchid.parameters import Parameters
from clutchid.rig.free_run import NAMES, VELOCITY_WINDOW, FreeRunSegment, free_run, segments
from clutchid.strokes.sampled import velocity

#: Parameters that a fit estimates or keeps fixed: the friction, and the zero of the load cell.
_FREE = (*NAMES, "force_zero")

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
    """Segments of a recording, and parameters scaled by `unit`: those of `_FREE`, then one initial deflection each.

    `inertial` is the part of the force in N that accelerates the mass; NaN outside the segments.
    """

    log: Log
    inertial: FloatArray
    parts: Sequence[FreeRunSegment]
    unit: FloatArray
    low: FloatArray
    high: FloatArray
    free: BoolArray
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
    finite = position[np.isfinite(position)]
    values = np.unique(finite)
    step = float(np.median(np.diff(values))) if values.size > 1 else 0.0
    quantised = step if 2 * values.size < finite.size else 0.0
    third = np.abs(np.diff(finite, 3))
    noise = 1.4826 * float(np.median(third)) / np.sqrt(20.0) if third.size else 0.0  # 1 + 9 + 9 + 1
    return step, max(noise, quantised / np.sqrt(12.0))


def lugre_problem(log: Log, fixed: Mapping[str, float], inertia: float = 0.0) -> LugreProblem:
    """Problem with scales and bounds from the ranges and the resolution of position and force."""
    position = log["position"]
    parts = segments(log)
    inertial = inertial_force(log, parts, inertia)
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
    for i, name in enumerate(_FREE):
        base[i] = fixed.get(name, base[i])
    free = np.array([*(name not in fixed for name in _FREE), *[True] * n])
    return LugreProblem(log, inertial, parts, unit, low / unit, high / unit, free, base / unit)


def inertial_force(log: Log, parts: Sequence[FreeRunSegment], inertia: float) -> FloatArray:
    """Mass times acceleration; the acceleration is the difference of mean velocities, as the velocity of positions."""
    force = np.full(len(log), np.nan)
    for part in parts:
        ends = slice(part.start, part.stop)
        force[ends] = inertia * velocity(log.time[ends], part.velocity, VELOCITY_WINDOW)
    return force


def _check_sign(log: Log, v: FloatArray, f: FloatArray) -> None:
    """Check that force and velocity correlate positively, because friction dissipates energy."""
    dv, df = v - v.mean(), f - f.mean()
    if np.sum(dv * df) < -_AGAINST * np.sqrt(np.sum(dv**2) * np.sum(df**2)):
        raise DataError(
            f"{log.name}: the force opposes the motion, so friction would supply energy. The force must be that of the "
            "rig on the part, positive towards larger positions; invert its sign."
        )


def _starts(problem: LugreProblem) -> list[FloatArray]:
    """Start points of the search, by distance F_C / K_z.

    The cost has a second minimum with lower stiffness and high damping; at least one of these starts avoids it.
    """
    K = _FREE.index("K_z")
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


def _residuals(problem: LugreProblem, x: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Simulated minus measured force of each segment, 0 where missing, and its Jacobian (free scaled parameters)."""
    values, shared = problem.all(x), len(_FREE)
    answers = []
    for i, segment in enumerate(problem.parts):
        force, slopes = free_run(segment, values[: len(NAMES)].tolist(), float(values[shared + i]))
        ends = slice(segment.start, segment.stop)
        r = force + values[shared - 1] + problem.inertial[ends] - problem.log["force"][ends]
        J = np.zeros((len(segment), problem.unit.size))
        J[:, [*range(len(NAMES)), shared + i]] = slopes
        J[:, shared - 1] = 1.0
        finite = np.isfinite(r)
        answers.append((np.where(finite, r, 0.0), np.where(finite[:, None], J * problem.unit, 0.0)[:, problem.free]))
    return answers


def _linearised(problem: LugreProblem, x: FloatArray) -> Linearisation:
    """Compressed residuals and Jacobian at the scaled free parameters `x`."""
    factor = np.vstack([compress(np.column_stack([J, r])) for r, J in _residuals(problem, x)])
    whole = compress(factor)
    return Linearisation(whole[:-1, :-1], whole[:-1, -1], 0.5 * float(np.sum(whole[:, -1] ** 2)), factor.shape[0])


#: A fit in free run below this, in %, is called poor: the rigs of docs/friction.md have 83 to 93 %.
_POOR_FIT = 70.0

#: Parameters that may be 0, the physical bound of a damping.
_DAMPINGS = ("D_v", "D_zdot")


def _unit_of(name: str) -> str:
    """Unit of a parameter of a fit, the zero of the force among them."""
    return "N" if name == "force_zero" else Parameters.row(name).unit


def at_bound(name: str, values: Mapping[str, float]) -> str:
    """Warning about a parameter at a bound of the search beyond which the cost decreases."""
    where = (
        f"{name} lies at a bound of the search, {values[name]:.3g} {_unit_of(name)}, and the cost decreases beyond it"
    )
    if name in _DAMPINGS:
        return (
            f"{where}: this recording does not determine it, and the intervals of the others treat it as fixed there."
        )
    advice = "this recording does not determine it, and the intervals of the others treat it as unknown"
    if name == "K_z":
        advice += (
            f" (F_C / K_z = {values['F_C'] / values['K_z'] * 1e3:.3g} mm); fix it at a known value (--fix K_z=VALUE)"
        )
    return f"{where}: {advice}."


def softened(noise: float, values: Mapping[str, float]) -> str:
    """Warning about a stiffness that is estimated too low because the noise of the position (m) moves the bristle."""
    return (
        f"the noise of the position, {noise * 1e3:.2g} mm, hides the stiffness: F_C / K_z = "
        f"{values['F_C'] / values['K_z'] * 1e3:.2g} mm. The true K_z is above {values['K_z']:.3g} N/m; it and "
        "D_zdot have no interval; fix it at a known value (--fix K_z=VALUE), or measure the position more finely."
    )


def poor(fit: float) -> list[str]:
    """Warning about a law that explains little of the force."""
    if fit >= _POOR_FIT:
        return []
    return [
        f"the fit is poor, {fit:.1f} % in free run (a rig that this law describes has {_POOR_FIT:g} % and more), and "
        "the intervals do not contain such errors: check the units, a pressure that changes, the inertia of moving "
        "parts (--inertia), and noise."
    ]


#: A stiffness that falls by more than this share, and by more than its standard error, when the variance of the noise
#: of the position is doubled has no interval: on simulated rigs the shift is then too small to cover the true value.
_SOFTENED = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class LugreFit:
    """Friction of one recording; 95 % intervals that account for coloured residuals.

    Attributes
    ----------
    name
        Of the recording.
    status, message
        'ok' or 'warning', and how the search ended.
    parameters : SI
        The free ones of F_C, K_z, D_v, D_zdot and force_zero (N).
    values : SI
        All of them.
    starts : m
        Deflection at the start of each segment without a hole.
    force : N, (n,)
        Simulated force; NaN outside the segments.
    fit_percent : %
        As that of MATLAB's `compare`; 100 is perfect.
    rms : N
        Of the force residuals.
    effective_samples : 1
        Number of independent samples.
    warnings
        One sentence each.
    """

    name: str
    status: Literal["ok", "warning"]
    message: str
    parameters: Mapping[str, Estimate]
    values: Mapping[str, float]
    starts: tuple[float, ...]
    force: FloatArray
    fit_percent: float
    rms: float
    effective_samples: float
    warnings: tuple[str, ...]


def fit_lugre(log: Log, *, fixed: Mapping[str, float] | None = None, inertia: float = 0.0) -> LugreFit:
    r"""Fit LuGre friction, Eqs. (2) and (3), to a recording of a test rig.

    .. math:: f = f_0 + M a + D_v v + K_z z + D_{\dot z} \dot z

    The force is simulated from the measured position alone (free run) and compared with the measured force.

    Parameters
    ----------
    log : Log
        Position in m and force in N (applied by the rig, positive towards larger positions), without a pressure
        difference over the piston, or with a constant one, which is then part of force_zero.
    fixed : {name: value}, optional
        Parameters that are not estimated: F_C, K_z, D_v, D_zdot, force_zero. With the first four fixed, the fit
        validates them.
    inertia : kg
        Mass M between the load cell and the friction, at least 0. Its acceleration a is the difference of the mean
        velocities over `VELOCITY_WINDOW` after and before a sample: noise of the position is averaged twice, and
        accelerations shorter than two windows are smoothed.

    Returns
    -------
    fit : LugreFit

    Raises
    ------
    DataError
        If position or force is missing, nothing moves, or the force drives the motion, so that its sign is wrong.
    ParameterError
        If a fixed name is unknown, its value not admissible, or `inertia` below 0.

    Notes
    -----
    The initial deflection of every segment and the zero of the load cell are estimated too. A damping at its bound 0
    gives a warning, and the other intervals treat it as fixed there. F_C / K_z is searched down to a tenth of the
    resolution of the position; a stiffness at that bound has no interval, and the other intervals treat it as unknown.

    Examples
    --------
    A block with 2 N of friction whose contact deflects by 0.1 mm before it slides:

    >>> t = np.arange(0.0, 8.0, 0.005)
    >>> block = Log(t, {"position": 5e-4 * np.sin(2 * np.pi * t / 4), "force": np.zeros(t.size)}, "block")
    >>> (whole,) = segments(block)
    >>> force, *_ = free_run(whole, (2.0, 2e4, 100.0, 0.0), 0.0)
    >>> found = fit_lugre(block.with_columns(force=force))
    >>> f"{found.values['F_C']:.2f} N, {found.values['K_z'] / 1e3:.1f} N/mm, {found.fit_percent:.0f} %"
    '2.00 N, 20.0 N/mm, 100 %'
    """
    constants = _checked(log, {} if fixed is None else fixed)
    if not 0.0 <= inertia < np.inf:
        raise ParameterError(f"inertia = {inertia:g} kg: must be a mass of at least 0 kg.")
    problem = lugre_problem(log, constants, inertia)
    searches = [_searched(problem, start) for start in _starts(problem)]
    best = min(searches, key=lambda solution: solution.at.cost)
    return _result(problem, best, _shift_by_noise(problem, best, inertia))


def _searched(problem: LugreProblem, start: FloatArray) -> Solution[Linearisation]:
    low, high = problem.low[problem.free], problem.high[problem.free]
    return minimise(lambda x: _linearised(problem, x), (start, _linearised(problem, start)), low, high, tolerance=1e-10)


def _shift_by_noise(problem: LugreProblem, best: Solution[Linearisation], inertia: float) -> FloatArray:
    """Shift of the scaled free parameters if noise like that of the position is added to it.

    The noise moves the bristle, which makes it look softer. Its variance is doubled here, so that the shift is about
    the bias of the fit (simulation extrapolation, Cook and Stefanski 1994).
    """
    position = problem.log["position"]
    noise = resolution(position)[1] * np.random.default_rng(0).standard_normal(position.size)
    log = problem.log.with_columns(position=position + noise)
    parts = segments(log)
    noisy = replace(problem, log=log, parts=parts, inertial=inertial_force(log, parts, inertia))
    return _searched(noisy, best.x).x - best.x


def _simulated(
    log: Log, parts: Sequence[FreeRunSegment], values: Mapping[str, float], starts: Sequence[float]
) -> FloatArray:
    force, friction = np.full(len(log), np.nan), [values[name] for name in NAMES]
    for segment, z_start in zip(parts, starts, strict=True):
        force[segment.start : segment.stop] = values["force_zero"] + free_run(segment, friction, z_start)[0]
    return force


def _checked(log: Log, fixed: Mapping[str, float]) -> dict[str, float]:
    for name in fixed:
        check_names([name], _FREE, "friction parameter")
    Parameters(**{name: value for name, value in fixed.items() if name in NAMES})
    missing = [name for name in ("position", "force") if name not in log or not np.isfinite(log[name]).any()]
    if missing:
        raise DataError(
            f"{log.name}: no {' and no '.join(missing)} with finite values; friction needs the position of the rig and "
            f"its force. The recording has {', '.join(log.columns) or 'no column'}."
        )
    return dict(fixed)


def _result(problem: LugreProblem, solution: Solution[Linearisation], shift: FloatArray) -> LugreFit:
    x = solution.x
    parameters = problem.all(x)
    values = {name: float(value) for name, value in zip(_FREE, parameters[: len(_FREE)], strict=True)}
    names = [name for name, free in zip(_FREE, problem.free[: len(_FREE)], strict=True) if free]
    bounded = _bounded(problem, solution, names)
    scores = [J * r[:, None] for r, J in _residuals(problem, x)]
    undamped = [name in bounded and name in _DAMPINGS for name in names] + [False] * (x.size - len(names))
    covariance = sandwich(solution.at.R, scores, ~np.array(undamped), max(1, len(names)))
    force = problem.inertial + _simulated(problem.log, problem.parts, values, parameters[len(_FREE) :].tolist())
    error = problem.log["force"] - force
    fit = fit_percent(problem.log["force"], force)
    warnings = [*problem.log.warnings, *(at_bound(name, values) for name in bounded), *poor(fit)]
    undetermined = set(bounded)
    if "K_z" in names and "K_z" not in bounded:
        at = names.index("K_z")
        if abs(shift[at]) > max(_SOFTENED * x[at], np.sqrt(covariance.matrix[at, at])):
            undetermined.add("K_z")
            warnings.append(softened(resolution(problem.log["position"])[1], values))
    if "K_z" in undetermined:
        undetermined.add("D_zdot")
    if solution.status == "limit":
        warnings.append(f"the search {ended(solution.status, solution.evaluations)}.")
    block = max(1, round(VELOCITY_WINDOW / sample_interval(problem.log.time)))
    return LugreFit(
        name=problem.log.name,
        status="warning" if warnings else "ok",
        message=ended(solution.status, solution.evaluations),
        parameters=_estimates(values, covariance, problem, dict(zip(names, shift, strict=False)), undetermined),
        values=values,
        starts=tuple(parameters[len(_FREE) :].tolist()),
        force=force,
        fit_percent=fit,
        rms=float(np.sqrt(np.nanmean(error**2))),
        effective_samples=effective_samples(error, block),
        warnings=tuple(warnings),
    )


def _bounded(problem: LugreProblem, solution: Solution[Linearisation], names: Sequence[str]) -> list[str]:
    """Parameters at a bound beyond which the cost decreases."""
    low, high = problem.low[problem.free], problem.high[problem.free]
    gradient = solution.at.R.T @ solution.at.q
    at_bound = ((solution.x <= low) & (gradient > 0)) | ((solution.x >= high) & (gradient < 0))
    return [name for i, name in enumerate(names) if at_bound[i]]


def _estimates(
    values: Mapping[str, float],
    covariance: Covariance,
    problem: LugreProblem,
    shifts: Mapping[str, float],
    undetermined: Set[str],
) -> dict[str, Estimate]:
    """Estimates by name; the `shifts` by the noise of the position, scaled as the parameters, widen the intervals."""
    quantile, estimates = covariance.quantile(), {}
    for i, (name, shift) in enumerate(shifts.items()):
        spread = np.hypot(np.sqrt(covariance.matrix[i, i]), shift) * problem.unit[_FREE.index(name)]
        std = np.inf if name in undetermined else float(spread)
        low, high = values[name] - quantile * std, values[name] + quantile * std
        if np.isfinite(std):
            low = max(low, 0.0 if name in NAMES else low)
        estimates[name] = Estimate(values[name], _unit_of(name), std, low, high)
    return estimates

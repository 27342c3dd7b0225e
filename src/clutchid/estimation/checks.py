"""Checks of a fit by multiple shooting: profile likelihood, and a bootstrap over strokes.

The covariance assumes a quadratic cost. Stick-slip or a stop makes the cost non-quadratic; the profile likelihood then
gives an interval that need not be symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from clutchid.errors import ParameterError
from clutchid.estimation.bootstrap import bootstrap, excursions, scatter_ratio
from clutchid.estimation.method import SearchResult
from clutchid.estimation.posterior import Posterior, parameter_uncertainty
from clutchid.estimation.result import Fit, ProfileCurve
from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import condense
from clutchid.inference.smoother.search import CONVERGED_GAIN, ShootingSolution, project
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import Solution

#: Most evaluations per side, relative tolerance of the root to `QUANTILE`, and greatest distance of an end in half
#: widths of the interval from the covariance.
MAX_EVALUATIONS, ROOT_TOLERANCE, MAX_HALF_WIDTHS = 5, 0.03, 4.0

#: Largest factor of an outward step, and least relative distance of an interpolated point from the ends of its bracket.
_MAX_GROWTH, _MIN_INSET = 2.0, 0.1

#: Most repeated searches at the estimate.
_MAX_RESTARTS = 3

#: The cost is non-quadratic if an end of the interval deviates by more than this fraction of the half width.
NONQUADRATIC_SHARE = 0.2


def profile_curve(
    problem: Problem, solution: ShootingSolution, uncertain: Posterior, name: str
) -> ProfileCurve | Failure:
    """Profile likelihood of one free parameter, with its 95 % interval.

    Parameters
    ----------
    problem : Problem
        Free parameters, recordings and noise.
    solution : ShootingSolution
        Its solution, with the noise of `problem`.
    uncertain : Posterior
        Uncertainty of the free parameters at the solution.
    name : str
        The parameter, NAME or NAME@STEM of ``problem.names``.

    Returns
    -------
    curve : ProfileCurve
        Its ends are the values at which the profiled cost has grown by ``(QUANTILE sigma_total / sigma_search)²``:
        sigma_search is the standard deviation from the curvature of the cost, sigma_total that from the covariance,
        which includes autocorrelated residuals and consider parameters. For a quadratic cost these are the ends of the
        interval from the covariance. An end is limited by ``problem.bounds()`` and by `MAX_HALF_WIDTHS`. If no
        simulation succeeds on one side, its end is that of the covariance; on both sides: a `Failure`.

    Raises
    ------
    ParameterError
        If the parameter is not free in `problem`.

    Notes
    -----
    If the data dominate, ``sigma_noise = sqrt(CORRELATED_SAMPLES) sigma_search``; if the prior dominates, they are
    equal.
    A search that stalls gives too high a cost, and so too narrow an interval.

    The interval of a load weight is that before correction for the bias of the calibration.

    References
    ----------
    Venzon and Moolgavkar 1988.
    """
    if name not in problem.names:
        raise ParameterError(f"{name} is not a free parameter of this fit; choose one of {', '.join(problem.names)}.")
    i = problem.names.index(name)
    total = float(np.sqrt(uncertain.matrix[i, i]))
    profile = _Profile(problem, i, solution, _deviation(problem, solution, i) / total)
    at, ends, failures = float(solution.x[i]), [], []
    for sign, bounds in zip((-1.0, 1.0), problem.bounds(), strict=True):
        bound = float(bounds[i])
        room = max(sign * (bound - at), 0.0)
        first, limit = min(QUANTILE * total, room), min(MAX_HALF_WIDTHS * QUANTILE * total, room)
        end = _interval_end(partial(profile.root, at, sign), first, limit)
        if isinstance(end, Failure):
            failures.append(end)
            end = first
        # the bound itself, without rounding errors
        ends.append(problem.coordinates[i].si(bound if end == room else at + sign * end))
    if len(failures) == len(ends):
        return failures[0]
    roots = dict(sorted({at: 0.0, **profile.roots}.items()))
    values = np.array([problem.coordinates[i].si(x) for x in roots])
    return ProfileCurve(ends[0], ends[1], values, np.array(list(roots.values())), _shape(at, roots))


def _shape(at: float, roots: Mapping[float, float]) -> Literal["bounded", "open below", "open above", "flat"]:
    """Whether the cost has grown to that of an end of the interval below and above the estimate."""
    reached = {x > at for x, root in roots.items() if root >= (1.0 - ROOT_TOLERANCE) * QUANTILE}
    if len(reached) == 2:
        return "bounded"
    return "flat" if not reached else "open below" if True in reached else "open above"


def is_nonquadratic(quadratic: tuple[float, float], profiled: tuple[float, float]) -> bool:
    """Whether an end of the interval from the covariance is off by more than `NONQUADRATIC_SHARE` of the half width.

    Parameters
    ----------
    quadratic, profiled : SI
        95 % intervals of one parameter, by the covariance and by profile likelihood.

    Examples
    --------
    A dry friction of 200 ± 50 N by the covariance, which is above 185 N because the piston sticks:

    >>> is_nonquadratic((150.0, 250.0), (185.0, 252.0))
    True
    """
    most = NONQUADRATIC_SHARE * (quadratic[1] - quadratic[0]) / 2
    return any(abs(drawn - other) > most for drawn, other in zip(quadratic, profiled, strict=True))


def _deviation(problem: Problem, solution: ShootingSolution, i: int) -> float:
    """Standard deviation of x_i from the curvature of the cost: at this distance the cost is higher by 1."""
    factor, _ = condense(problem, solution.at)
    return float(np.linalg.norm(np.linalg.pinv(factor[:-1, :-1])[i]))


class _Profile:
    """Cost minimised over all parameters but x_i; each search starts from the nearest previous solution.

    A search ends slightly above its minimum. If the prior dominates, this excess is as large as the growth at an end of
    the interval; the search at the estimate is therefore repeated first, with x_i fixed.
    """

    def __init__(self, problem: Problem, i: int, solution: ShootingSolution, scale: float) -> None:
        self.problem, self.i, self.scale = problem, i, scale
        self.roots: dict[float, float] = {}
        self.solutions, self.min_cost = [solution], solution.at.cost
        for _ in range(_MAX_RESTARTS):
            before, repeated = self.min_cost, self.search(float(solution.x[i]))
            self.min_cost = before if isinstance(repeated, Failure) else min(before, repeated.at.cost)
            # keep only the last of the solutions at the estimate, whose x_i differ by rounding
            self.solutions = self.solutions[-1:]
            if before - self.min_cost < CONVERGED_GAIN:
                break

    def search(self, value: float) -> ShootingSolution | Failure:
        """Solution with x_i fixed at `value`."""
        nearest = min(self.solutions, key=lambda solution: abs(float(solution.x[self.i]) - value))
        x = nearest.x.copy()
        x[self.i] = value
        problem = _fixed(self.problem, self.i, value)
        solution = project(problem, np.clip(x, *problem.bounds()), nearest.at.X, lambda *_: None)
        if isinstance(solution, Solution):
            self.solutions.append(solution)
        return solution

    def root(self, at: float, sign: float, distance: float) -> float | Failure:
        """Root of the growth of the cost at a distance from x_i = `at`, in standard deviations of the covariance.

        Zero if the cost is lower than at the estimate, where the search had not converged then.
        """
        value = at + sign * distance
        solution = self.search(value)
        self.roots[value] = np.inf
        if isinstance(solution, Failure):
            return solution
        self.roots[value] = self.scale * float(np.sqrt(max(0.0, solution.at.cost - self.min_cost)))
        return self.roots[value]


def _fixed(problem: Problem, i: int, value: float) -> Problem:
    """`problem` with x_i fixed at `value`; its prior still contributes to the cost."""
    coordinates = list(problem.coordinates)
    si = coordinates[i].si(value)
    coordinates[i] = replace(coordinates[i], low=si, high=si)
    return replace(problem, coordinates=tuple(coordinates))


def _interval_end(root: Callable[[float], float | Failure], first: float, limit: float) -> float | Failure:
    """The distance, at most `limit`, at which `root` equals `QUANTILE`; a `Failure` if all evaluations fail.

    A single failed evaluation counts as beyond the end.
    """
    if limit == 0.0:
        return limit
    at, answers = first, []
    earlier, inside, outside = (0.0, 0.0), (0.0, 0.0), (np.inf, np.inf)
    for _ in range(MAX_EVALUATIONS):
        answers.append(root(at))
        z = answers[-1] if isinstance(answers[-1], float) else np.inf
        if abs(z - QUANTILE) <= ROOT_TOLERANCE * QUANTILE or (z < QUANTILE and at == limit):
            return at
        if z < QUANTILE:
            earlier, inside = inside, (at, z)
        else:
            outside = (at, z)
        at = _interpolated(inside, outside) if np.isfinite(outside[0]) else min(_extrapolated(earlier, inside), limit)
    failures = [answer for answer in answers if isinstance(answer, Failure)]
    return failures[0] if len(failures) == len(answers) else at


def _interpolated(inside: tuple[float, float], outside: tuple[float, float]) -> float:
    """Point of a bracket where the secant equals `QUANTILE`; its middle if the outer point has no value."""
    share = (QUANTILE - inside[1]) / (outside[1] - inside[1]) if np.isfinite(outside[1]) else 0.5
    return inside[0] + min(max(share, _MIN_INSET), 1.0 - _MIN_INSET) * (outside[0] - inside[0])


def _extrapolated(earlier: tuple[float, float], last: tuple[float, float]) -> float:
    """Point beyond two others where the secant equals `QUANTILE`, limited by `_MAX_GROWTH`."""
    rise = last[1] - earlier[1]
    step = (QUANTILE - last[1]) * (last[0] - earlier[0]) / rise if rise > 0.0 else np.inf
    return float(min(last[0] + step, _MAX_GROWTH * last[0]))


#: Profile of one free parameter, as `profile_curve` searches for it.
SearchProfile = Callable[[Problem, ShootingSolution, Posterior, str], ProfileCurve | Failure]

#: Intervals are too narrow if the bootstrap scatters by this factor more: 8 strokes give a deviation to a quarter only.
_TOO_NARROW = 1.5


def with_checked_intervals(
    result: Fit,
    search_result: SearchResult,
    calibration: Calibration | None,
    profiled: Sequence[str],
    draws: int,
    profile: SearchProfile = profile_curve,
) -> Fit:
    """`result` with profile-likelihood intervals of the parameters `profiled`, and a bootstrap check of its intervals.

    Parameters
    ----------
    result : Fit
        Of the search.
    search_result : SearchResult
        Problem and solution.
    calibration : Calibration, optional
        The calibration that the fit used.
    profiled : names
        Free parameters, NAME or NAME@STEM.
    draws : 1
        Of the bootstrap over strokes; 0 for none.
    profile : function
        Searches for the profile of a parameter.

    Raises
    ------
    ParameterError
        If a parameter to be profiled is not free.
    """
    problem, solution = search_result.problem, search_result.solution
    if isinstance(solution, Failure):
        return result
    uncertain = parameter_uncertainty(problem, solution, calibration, search_result.posterior)
    if isinstance(uncertain, Failure):
        return result
    for name in profiled:
        result = _profiled(result, problem, solution, name, profile(problem, solution, uncertain, name))
    return _bootstrapped(result, problem, solution, uncertain, draws) if draws else result


def _profiled(
    result: Fit, problem: Problem, solution: ShootingSolution, name: str, curve: ProfileCurve | Failure
) -> Fit:
    estimate = result.parameters[name]
    if isinstance(curve, Failure):
        note = f"{name}: no interval by profile likelihood: {curve.message}"
        return replace(result, notes=(*result.notes, note))
    # the interval of a load weight is corrected for the calibration's bias in the same way as its value
    place = problem.names.index(name)
    shift = estimate.value - problem.coordinates[place].si(float(solution.x[place]))
    curve = curve._replace(low=curve.low + shift, high=curve.high + shift, values=curve.values + shift)
    low, high = curve.low, curve.high
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    note = f"{name}: {low:.4g} to {high:.4g}{unit} by profile likelihood"
    if is_nonquadratic((estimate.low, estimate.high), (low, high)):
        note += f"; the covariance, which assumes a quadratic cost, gives {estimate.low:.4g} to {estimate.high:.4g}"
    if curve.shape != "bounded":
        note += f"; its profile is {curve.shape}"
    parameters = {**result.parameters, name: replace(estimate, low=low, high=high)}
    profiles, notes = {**result.profiles, name: curve}, (*result.notes, note + ".")
    return replace(result, parameters=parameters, profiles=profiles, notes=notes)


def _drawn(result: Fit, problem: Problem, solution: ShootingSolution, x: FloatArray) -> FloatArray:
    """Draws of x (draws, k) as values in SI; load weights lack the bias of the calibration, as their estimates do."""
    at = [problem.names.index(name) for name in result.parameters]
    estimates = np.array([e.value for e in result.parameters.values()])
    return np.asarray([problem.si(draw)[at] for draw in x] + estimates - problem.si(solution.x)[at])


def _bootstrapped(result: Fit, problem: Problem, solution: ShootingSolution, uncertain: Posterior, draws: int) -> Fit:
    x = bootstrap(problem, solution, draws)
    result = replace(result, draws=_drawn(result, problem, solution, x))
    times = scatter_ratio(problem, x, uncertain.noise_root)
    if not np.isfinite(times):
        return replace(result, notes=(*result.notes, "no bootstrap: a free load and two strokes are needed."))
    count = 1 + max(int(track.max()) for track in excursions(problem))
    note = f"bootstrap over {count} strokes: the load's standard deviation is {times:.2f} times that of its interval."
    result = replace(result, notes=(*result.notes, note))
    if times < _TOO_NARROW:
        return result
    warning = (
        f"the intervals are too narrow: in a bootstrap over {count} strokes the standard deviation of the load is "
        f"{times:.1f} times larger."
    )
    return replace(result, warnings=(*result.warnings, warning))

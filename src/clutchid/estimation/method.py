"""`Method`: a method of estimation as a record of functions, the end of its search, and the `Fit` there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from clutchid.estimation.filtered_load import load_per_supply
from clutchid.estimation.request import FreeParameters, SearchState, bounds_of, ended
from clutchid.estimation.result import (
    Change,
    Compared,
    Departure,
    Fit,
    errors_over,
    fitted_curve,
    physical_limits,
    plan_warnings,
)
from clutchid.inference.problem import Problem
from clutchid.inference.smoother.search import USUAL_EFFORT, Effort
from clutchid.inference.uncertainty.calibration import DEVIATION_FACTOR, Calibration
from clutchid.inference.uncertainty.coordinates import Coordinate, Prior
from clutchid.inference.uncertainty.estimates import POINTS, Estimate, LoadCurve
from clutchid.inference.uncertainty.identifiability import identifiability, in_words
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.names import base_of
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import Solution
from clutchid.numerics.progress import Progress
from clutchid.preparation.pulses import FindPhase

#: A parameter is not identifiable if its standard deviation exceeds this fraction of that of its prior.
_PRIOR_DOMINATES = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """The problem of a fit, and the solution of its search, or the reason why it could not start.

    `posterior` is that over all hypotheses about changes, where they were weighed, `changes` and `departure` what that
    gave; `effort` says when a search by multiple shooting ends that does not converge.
    """

    problem: Problem
    solution: Solution[Any] | Failure
    posterior: Mixture | None = None
    effort: Effort = USUAL_EFFORT
    changes: tuple[Change, ...] = ()
    departure: Departure | None = None


class MethodResult(NamedTuple):
    """Uncertainty at the solution of a search, and the recordings simulated there.

    `covariance` is that of x, `data` the Jacobian of the data there, or its factor; a 95 % interval has a half width of
    `quantile` standard deviations. `warnings` and `notes` are those that only this method has.
    """

    covariance: FloatArray
    data: FloatArray
    compared: Sequence[Compared]
    quantile: float = QUANTILE
    warnings: Sequence[str] = ()
    notes: Sequence[str] = ()


class ResidualRows(NamedTuple):
    """The cost at parameters x (k,) as rows ``[J | r]``, in standard deviations, those of the prior apart.

    ``J' r`` of all rows is the gradient of `cost`, half the sum of all losses; it is half of ``r' r`` but for outliers.
    `scales` (m,) are the standard deviations of the rows of the data in SI, where these are samples.
    """

    prior: FloatArray
    data: FloatArray
    cost: float
    scales: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class ChangeFunctions:
    """Functions with which a method weighs hypotheses about changes, at solutions of its search.

    `refine` goes on from a result with another prior, from x; `settle` moves a solution to x, with the states that
    belong to it. Both iterate, and end in `Method.evaluated`.
    """

    refine: Callable[[SearchResult, Problem, FloatArray, Progress | None], SearchResult]
    settle: Callable[[Problem, Solution[Any], FloatArray], Solution[Any] | Failure]


@dataclass(frozen=True, slots=True)
class Method:
    """A method of estimation: its search, its result at the end of it, and the requests that it supports.

    `problem` has the free parameters and the prepared recordings; the function in it finds the phase of a carrier, that
    of the method where it is None. `search` is all that iterates: it ends in ``evaluated(problem, x, X)``, which makes
    the rows of the cost at parameters x and window starts X, and `result` is a function of these rows. A result can
    therefore be repeated from x and X alone. `rows` has them at any x for other tools, as a function of x alone: from
    the window starts, or with the gains, of a point that `evaluated` made. `start` has x and X of the start values.

    `priors`: priors, parameters of single recordings, 'auto' and calibrations. `check` adds profile likelihood and a
    bootstrap to a result. Without `changes` a load from position alone is read as if nothing had changed. `partition`
    is empty if the method supports a partition, else the reason why not.
    """

    name: str
    problem: Callable[[Sequence[Log], Actuator, FreeParameters, Calibration | None, FindPhase | None], Problem]
    search: Callable[[Sequence[Log], Actuator, FreeParameters, Calibration | None, Progress | None], SearchResult]
    evaluated: Callable[[Problem, FloatArray, Sequence[FloatArray]], Any]
    rows: Callable[[Problem, FloatArray, Any], ResidualRows | Failure]
    start: Callable[[Problem, FreeParameters], tuple[FloatArray, tuple[FloatArray, ...]] | Failure]
    result: Callable[[Problem, Solution[Any], Calibration | None, Mixture | None], MethodResult | Failure]
    priors: bool = True
    check: Callable[[Fit, SearchResult, Calibration | None, Sequence[str], int], Fit] | None = None
    changes: ChangeFunctions | None = None
    partition: str = ""


def fit_at(method: Method, search_result: SearchResult, calibration: Calibration | None = None) -> Fit:
    """The `Fit` at the end of a search by `method`; status "failed" if it could not start.

    The bias of the `calibration` is subtracted from the load weights, unless hypotheses about changes were weighed.
    """
    problem, solution, mixture = search_result.problem, search_result.solution, search_result.posterior
    result = solution if isinstance(solution, Failure) else method.result(problem, solution, calibration, mixture)
    at = [i for i, c in enumerate(problem.coordinates) if c.base in problem.actuator.names]
    bounds = {c.name: (c.low, c.high) for c in (problem.coordinates[i] for i in at)}
    if isinstance(result, Failure):
        return _failed(method, problem, bounds, result.message)
    assert not isinstance(solution, Failure), "a result is of a solution"
    x, slopes = solution.x, problem.slopes(solution.x)
    fitted = problem.actuator_of(x, problem.stems[0])
    bias = np.zeros(len(fitted.load.theta))
    if calibration and calibration.position_only and mixture is None:
        bias = calibration.position_only.shift((), fitted.load.names)
    weights = np.asarray(fitted.load.theta) - bias
    fitted = replace(fitted, load=replace(fitted.load, theta=tuple(weights.tolist())))
    covariance = (result.covariance * np.outer(slopes, slopes))[np.ix_(at, at)]
    curve = fitted_curve(
        fitted, [problem.coordinates[i].base for i in at], covariance, result.quantile, DEVIATION_FACTOR * bias
    )
    end, converged = ended(solution.status, solution.evaluations), solution.status == "converged"
    warnings = (
        *plan_warnings(problem.plans),
        *result.warnings,
        *_at_bounds(problem, at, x, priors=method.priors),
        *([] if converged else [f"the search {end}."]),
    )
    return Fit(
        status="ok",
        message=end,
        actuator=fitted,
        parameters=_estimates(problem, at, x, fitted, result, mixture),
        covariance=covariance,
        load_curve=curve if mixture is None else _of_mixture(curve, mixture, problem, x),
        recordings={recording.measured.name: recording for recording, _ in result.compared},
        errors=errors_over(shown for _, shown in result.compared),
        scales=dict(problem.noise.measured),
        bounds=bounds,
        evaluations=solution.evaluations,
        warnings=warnings,
        method=method.name,
        notes=(*(_identifiable(problem, result.covariance) if method.priors else ()), *result.notes),
        calibration=calibration,
        converged=converged,
        changes=search_result.changes,
        baseline=calibration,
        search=_search_state(problem, solution) if method.priors else None,
        departure=search_result.departure,
        load_per_supply=load_per_supply(problem, mixture),
        starts=solution.starts,
        identifiability=identifiability(result.data, problem.names, slopes),
    )


def _failed(method: Method, problem: Problem, bounds: Mapping[str, tuple[float, float]], message: str) -> Fit:
    """The result of a search with start values that cannot be simulated."""
    nan, y = float("nan"), np.linspace(0.0, problem.actuator.parameters.y_max, POINTS)
    unknown = np.full(POINTS, nan)
    return Fit(
        status="failed",
        message=f"the start values cannot be simulated. {message}",
        actuator=problem.actuator,
        parameters={name: Estimate(nan, problem.actuator.unit(base_of(name)), nan, nan, nan) for name in bounds},
        covariance=np.full((len(bounds),) * 2, nan),
        load_curve=LoadCurve(y, unknown, unknown, unknown),
        bounds=bounds,
        warnings=plan_warnings(problem.plans),
        method=method.name,
        converged=False,
    )


def _of_mixture(curve: LoadCurve, mixture: Mixture, problem: Problem, x: FloatArray) -> LoadCurve:
    """The load curve with the interval of a mixture about x."""
    load = problem.actuator.load
    at = [i for i, c in enumerate(problem.coordinates) if c.base in load.names]
    rows = np.zeros((curve.position.size, x.size))
    rows[:, at] = load.phi(curve.position)[:, [load.names.index(problem.coordinates[i].base) for i in at]]
    rows *= problem.slopes(x)
    low, high = mixture.interval(rows)
    return replace(curve, low=curve.force + low - rows @ x, high=curve.force + high - rows @ x)


def _estimates(
    problem: Problem, at: Sequence[int], x: FloatArray, fitted: Actuator, result: MethodResult, mixture: Mixture | None
) -> dict[str, Estimate]:
    """The free parameters in SI with their 95 % intervals, from x and its uncertainty."""
    estimates, deviations = {}, np.sqrt(np.diag(result.covariance))
    low, high = x - result.quantile * deviations, x + result.quantile * deviations
    if mixture is not None:
        low, high = mixture.interval(np.eye(x.size))
    for i in at:
        c = problem.coordinates[i]
        shift = fitted.value(c.base) - c.si(float(x[i])) if c.base in fitted.load.names else 0.0
        value, *ends = (c.si(float(of_x)) + shift for of_x in (x[i], low[i], high[i]))
        if not np.isfinite(deviations[i]):
            ends = [-np.inf, np.inf]
        estimates[c.name] = Estimate(value, fitted.unit(c.base), float(deviations[i]) * c.slope(float(x[i])), *ends)
    return estimates


def _at_bounds(problem: Problem, at: Sequence[int], x: FloatArray, *, priors: bool) -> list[str]:
    """Free parameters at a bound that is no physical limit, as sentences; without `priors` at any bound."""
    actuator, warnings, (low, high) = problem.actuator, [], problem.bounds()
    for i in at:
        c = problem.coordinates[i]
        limits = physical_limits(actuator, c.base) if priors else ()
        for bound, end, word in ((low[i], c.low, "lower"), (high[i], c.high, "upper")):
            if np.isfinite(bound) and end not in limits and abs(x[i] - bound) < 1e-9:
                shown = f"{c.si(float(x[i])):g}{actuator.unit_behind(c.base)}"
                others = "; the intervals of the others assume that it is fixed there"
                fixed = "" if priors or c.base in actuator.load.names else others
                usual = _usual_bound(actuator, c, end, priors=priors)
                warnings.append(f"{c.name} lies at its {word} bound {shown}{usual}{fixed}.")
    return warnings


def _usual_bound(actuator: Actuator, c: Coordinate, end: float, *, priors: bool) -> str:
    """Words for a default bound; none for a stated one, and for those of a load."""
    if c.base in actuator.load.names or (priors and np.isfinite(end)):
        return ""
    if priors:
        return f", {c.limit:g} standard deviations from the mean of its prior (the default; --prior moves it)"
    start = actuator.value(c.base)
    three = ", a factor of three from its start" if np.isclose(max(end, start), 3.0 * min(end, start)) else ""
    return f" (the default{three}; --bounds moves it)" if end in bounds_of([c.base], actuator, {})[c.base] else ""


def _search_state(problem: Problem, solution: Solution[Any]) -> SearchState:
    """End of the search, with the priors of its free parameters."""
    priors = {c.name: Prior(c.mean, c.width * c.mean if c.positive else c.width) for c in problem.coordinates}
    return SearchState(solution.status, solution.evaluations, tuple(priors), priors)


def _identifiable(problem: Problem, matrix: FloatArray) -> tuple[str, ...]:
    """Free parameters that the data determine, and those whose prior dominates, as sentences."""
    unnamed = {*problem.actuator.load.names, *problem.changing}
    from_prior = [
        c.name
        for i, c in enumerate(problem.coordinates)
        if not unnamed & {c.base, c.name} and np.sqrt(matrix[i, i]) > _PRIOR_DOMINATES
    ]
    determined = [c.name for c in problem.coordinates if not unnamed & {c.base, c.name} and c.name not in from_prior]
    notes = []
    if determined:
        notes.append(f"determined by the data: {in_words(determined)}.")
    if from_prior:
        notes.append(f"not determined by the data, so the prior applies: {in_words(from_prior)}.")
    return tuple(notes)

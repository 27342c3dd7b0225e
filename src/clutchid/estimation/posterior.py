"""The `Fit` of a search with priors: estimates with intervals, load curve, and identifiability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.request import SearchState, ended
from clutchid.estimation.result import Compared, Estimate, Fit, errors_over, load_curve, physical_limits, plan_warnings
from clutchid.estimation.search_result import SearchResult, SolutionT
from clutchid.inference.smoother.problem import FitProblem
from clutchid.inference.uncertainty.calibration import DEVIATION_FACTOR, Calibration
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.inference.uncertainty.identifiability import listed
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.interval import QUANTILE

#: A parameter is not identifiable if its standard deviation exceeds this fraction of that of its prior.
PRIOR_DOMINATES = 0.9


def posterior(
    search_result: SearchResult[SolutionT],
    solution: SolutionT,
    matrix: FloatArray,
    calibration: Calibration | None,
    compared: Sequence[Compared],
) -> Fit:
    """The `Fit` at `solution`, with the covariance `matrix` of its x, shape (k, k)."""
    problem, x = search_result.problem, solution.x
    theta = problem.actuator.load.theta
    bias = np.zeros(len(theta))
    if calibration and calibration.position_only and search_result.covariance is None:
        bias = calibration.position_only.shift((), problem.actuator.load.names)
    fitted = corrected(problem.actuator_of(x, problem.stems[0]), bias)
    converged = solution.status == "converged"
    not_converged = [] if converged else [f"the search {ended(solution.status, solution.evaluations)}."]
    warnings = (*plan_warnings(search_result.plans), *_at_bounds(problem, x), *not_converged)
    covariance = matrix * np.outer(problem.slopes(x), problem.slopes(x))
    bases = [c.base for c in problem.coordinates]
    return Fit(
        status="warning" if warnings else "ok",
        message=ended(solution.status, solution.evaluations),
        actuator=fitted,
        parameters=_estimates(problem, x, matrix, fitted),
        covariance=covariance,
        load_curve=load_curve(fitted, bases, covariance, QUANTILE, DEVIATION_FACTOR * bias),
        recordings={one.recording.measured.name: one.recording for one in compared},
        errors=errors_over(one.shown for one in compared),
        scales=dict(problem.noise.measured),
        bounds={c.name: (c.low, c.high) for c in problem.coordinates},
        evaluations=solution.evaluations,
        warnings=warnings,
        method=search_result.method,
        notes=_identifiable(problem, matrix),
        converged=converged,
        search=search_state(search_result, solution),
    )


def corrected(actuator: Actuator, bias: FloatArray) -> Actuator:
    """`actuator` with the `bias` of its load weights, in their unit, subtracted."""
    load = actuator.load
    return replace(actuator, load=replace(load, theta=tuple((np.asarray(load.theta) - bias).tolist())))


def _estimates(problem: FitProblem, x: FloatArray, matrix: FloatArray, fitted: Actuator) -> dict[str, Estimate]:
    """The free parameters in SI with their 95 % intervals, from x and its covariance `matrix`."""
    estimates = {}
    for i, c in enumerate(problem.coordinates):
        deviation = float(np.sqrt(matrix[i, i]))
        shift = fitted.value(c.base) - c.si(float(x[i])) if c.base in fitted.load.names else 0.0
        value, low, high = (c.si(float(x[i]) + k * QUANTILE * deviation) + shift for k in (0.0, -1.0, 1.0))
        std = deviation * c.slope(float(x[i]))
        estimates[c.name] = Estimate(value, problem.actuator.unit(c.base), std, low, high)
    return estimates


def _at_bounds(problem: FitProblem, x: FloatArray) -> list[str]:
    """Free parameters at a bound that is no physical limit, as sentences."""
    low, high = problem.bounds()
    warnings = []
    for i, c in enumerate(problem.coordinates):
        limits = physical_limits(problem.actuator, c.base)
        for bound, end, word in ((low[i], c.low, "lower"), (high[i], c.high, "upper")):
            if np.isfinite(bound) and end not in limits and abs(x[i] - bound) < 1e-9:
                shown = f"{c.si(float(x[i])):g}{problem.actuator.unit_behind(c.base)}"
                warnings.append(f"{c.name} lies at its {word} bound {shown}.")
    return warnings


def search_state(search_result: SearchResult[SolutionT], solution: SolutionT) -> SearchState:
    """End of the search, with the priors of its free parameters."""
    coordinates = search_result.problem.coordinates
    priors = {c.name: Prior(c.mean, c.width * c.mean if c.positive else c.width) for c in coordinates}
    return SearchState(solution.status, solution.evaluations, tuple(priors), priors)


def _identifiable(problem: FitProblem, matrix: FloatArray) -> tuple[str, ...]:
    """Free parameters that the data determine, and those whose prior dominates, as sentences."""
    known = {*problem.actuator.load.names, *problem.changing}
    from_prior = [
        c.name
        for i, c in enumerate(problem.coordinates)
        if not known & {c.base, c.name} and np.sqrt(matrix[i, i]) > PRIOR_DOMINATES
    ]
    determined = [c.name for c in problem.coordinates if not known & {c.base, c.name} and c.name not in from_prior]
    notes = []
    if determined:
        notes.append(f"determined by the data: {listed(determined)}.")
    if from_prior:
        notes.append(f"not determined by the data, so that the prior applies: {listed(from_prior)}.")
    return tuple(notes)

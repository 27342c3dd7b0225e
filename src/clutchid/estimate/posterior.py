"""What the end of a search with priors says: estimates with intervals, the band of the load, what is identifiable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimate.outcome import Compared, load_curve, plan_warnings
from clutchid.estimate.result import Estimate, Fit, errors_over
from clutchid.estimate.search_result import SearchResult, SolutionT
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.drift import scale
from clutchid.uncertainty.identifiability import listed

#: Standard deviations of a 95 % interval.
QUANTILE = 1.96

#: A parameter whose standard deviation is more than this share of its prior one is not identifiable.
PRIOR_STANDS = 0.9


def posterior(
    done: SearchResult[SolutionT],
    solution: SolutionT,
    matrix: FloatArray,
    calibration: Calibration | None,
    compared: Sequence[Compared],
) -> Fit:
    """The result of a search that ended at `solution`, with the covariance `matrix` of its x, shape (k, k)."""
    problem, x = done.problem, solution.x
    theta = problem.actuator.load.theta
    bias = np.array(calibration.bias) if calibration and calibration.bias else np.zeros(len(theta))
    fitted = corrected(problem.actuator_of(x, problem.stems[0]), bias)
    ended = _unsettled(solution.status, solution.evaluations)
    warnings = (*plan_warnings(done.plans), *_at_bounds(problem, x), *ended)
    covariance = matrix * np.outer(problem.slopes(x), problem.slopes(x))
    bases = [c.base for c in problem.coordinates]
    return Fit(
        status="warning" if warnings else "ok",
        message=f"{solution.status} after {solution.evaluations} evaluations",
        actuator=fitted,
        parameters=_estimates(problem, x, matrix, fitted),
        covariance=covariance,
        load_curve=load_curve(fitted, bases, covariance, QUANTILE, scale(problem.noise) * bias),
        recordings={one.recording.measured.name: one.recording for one in compared},
        errors=errors_over(one.shown for one in compared),
        scales=dict(problem.noise.measured),
        bounds={c.name: (c.low, c.high) for c in problem.coordinates},
        evaluations=solution.evaluations,
        warnings=warnings,
        method=done.method,
        notes=_identifiable(problem, matrix),
        settled=solution.status == "converged",
    )


def corrected(actuator: Actuator, bias: FloatArray) -> Actuator:
    """`actuator` with the bias of its load weights, in their unit, taken off."""
    load = actuator.load
    return replace(actuator, load=replace(load, theta=tuple((np.asarray(load.theta) - bias).tolist())))


def _estimates(problem: FitProblem, x: FloatArray, matrix: FloatArray, fitted: Actuator) -> dict[str, Estimate]:
    """The free numbers in SI with their 95 % intervals, from x and its covariance `matrix`."""
    estimates = {}
    for i, c in enumerate(problem.coordinates):
        deviation = float(np.sqrt(matrix[i, i]))
        shift = fitted.value(c.base) - c.si(float(x[i])) if c.base in fitted.load.names else 0.0
        value, low, high = (c.si(float(x[i]) + k * QUANTILE * deviation) + shift for k in (0.0, -1.0, 1.0))
        std = deviation * c.slope(float(x[i]))
        estimates[c.name] = Estimate(value, problem.actuator.unit(c.base), std, low, high)
    return estimates


def _at_bounds(problem: FitProblem, x: FloatArray) -> list[str]:
    """Which free numbers lie at a bound, in words."""
    low, high = problem.bounds()
    warnings = []
    for i, c in enumerate(problem.coordinates):
        for bound, word in ((low[i], "lower"), (high[i], "upper")):
            if np.isfinite(bound) and abs(x[i] - bound) < 1e-9:
                shown = f"{c.si(float(x[i])):g}{problem.actuator.unit_behind(c.base)}"
                warnings.append(f"{c.name} lies at its {word} bound {shown}.")
    return warnings


def _unsettled(status: str, evaluations: int) -> list[str]:
    """That a search did not come to its end, in words."""
    if status == "converged":
        return []
    return [f"the search stopped after {evaluations} evaluations without settling."]


def _identifiable(problem: FitProblem, matrix: FloatArray) -> tuple[str, ...]:
    """In words, from the information matrix: for which numbers what was known before the data still stands."""
    weights = problem.actuator.load.names
    stands = [
        c.name
        for i, c in enumerate(problem.coordinates)
        if c.base not in weights and np.sqrt(matrix[i, i]) > PRIOR_STANDS * scale(problem.noise)
    ]
    identified = [c.name for c in problem.coordinates if c.base not in weights and c.name not in stands]
    notes = []
    if identified:
        notes.append(f"told by the recordings: {listed(identified)}.")
    if stands:
        notes.append(f"not told by the recordings, so what was known before stands: {listed(stands)}.")
    return tuple(notes)

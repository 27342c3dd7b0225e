"""Optional checks of a fit by multiple shooting: profile likelihood, and a bootstrap over strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.result import Fit
from clutchid.estimation.search_result import SearchResult
from clutchid.estimation.shooting.bootstrap import bootstrap, scatter_ratio, strokes
from clutchid.estimation.shooting.profile import is_nonquadratic, profile_interval
from clutchid.estimation.shooting.uncertainty import ParameterUncertainty, parameter_uncertainty
from clutchid.inference.smoother.problem import FitProblem
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.numerics.failure import Failure

#: Intervals are too narrow if the bootstrap scatters by this factor more: 8 strokes give a deviation to a quarter only.
TOO_NARROW = 1.5


def checked(
    result: Fit,
    search_result: SearchResult[ShootingSolution],
    calibration: Calibration | None,
    profiled: Sequence[str],
    draws: int,
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

    Raises
    ------
    ParameterError
        If a parameter to be profiled is not free.
    """
    problem, solution = search_result.problem, search_result.solution
    if isinstance(solution, Failure):
        return result
    uncertain = parameter_uncertainty(problem, solution, calibration, search_result.covariance)
    if isinstance(uncertain, Failure):
        return result
    for name in profiled:
        result = _profiled(result, problem, solution, uncertain, name)
    return _bootstrapped(result, problem, solution, uncertain, draws) if draws else result


def _profiled(
    result: Fit, problem: FitProblem, solution: ShootingSolution, uncertain: ParameterUncertainty, name: str
) -> Fit:
    interval = profile_interval(problem, solution, uncertain, name)
    estimate = result.parameters[name]
    if isinstance(interval, Failure):
        note = f"{name}: no interval by profile likelihood: {interval.message}"
        return replace(result, notes=(*result.notes, note))
    # the interval of a load weight is corrected for the calibration's bias in the same way as its value
    place = problem.names.index(name)
    shift = estimate.value - problem.coordinates[place].si(float(solution.x[place]))
    low, high = interval[0] + shift, interval[1] + shift
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    note = f"{name}: {low:.4g} to {high:.4g}{unit} by profile likelihood"
    if is_nonquadratic((estimate.low, estimate.high), (low, high)):
        note += f"; the covariance, which assumes a quadratic cost, gives {estimate.low:.4g} to {estimate.high:.4g}"
    parameters = {**result.parameters, name: replace(estimate, low=low, high=high)}
    return replace(result, parameters=parameters, notes=(*result.notes, note + "."))


def _bootstrapped(
    result: Fit, problem: FitProblem, solution: ShootingSolution, uncertain: ParameterUncertainty, draws: int
) -> Fit:
    times = scatter_ratio(problem, bootstrap(problem, solution, draws), uncertain.noise_root)
    if not np.isfinite(times):
        return replace(result, notes=(*result.notes, "no bootstrap: a free load and two strokes are needed."))
    count = 1 + max(int(track.max()) for track in strokes(problem))
    note = f"bootstrap over {count} strokes: the load's standard deviation is {times:.2f} times that of its interval."
    result = replace(result, notes=(*result.notes, note))
    if times < TOO_NARROW:
        return result
    warning = (
        f"the intervals are too narrow: in a bootstrap over {count} strokes the standard deviation of the load is "
        f"{times:.1f} times larger."
    )
    return replace(result, status="warning", warnings=(*result.warnings, warning))

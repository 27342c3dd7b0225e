"""Checks of a fit by multiple shooting that cost extra time: profile likelihood, and a bootstrap over strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimate.result import Fit
from clutchid.estimate.search_result import SearchResult
from clutchid.estimate.shooting.bootstrap import bootstrap, ratio, strokes
from clutchid.estimate.shooting.profile import bent, profile_interval
from clutchid.estimate.shooting.uncertainty import Spread, spread
from clutchid.numerics.failure import Failure
from clutchid.smoother.problem import FitProblem
from clutchid.smoother.projection import ShootingSolution
from clutchid.uncertainty.calibration import Calibration

#: Bands are too narrow where the bootstrap scatters so many times as far: eight strokes know a deviation to a quarter.
TOO_NARROW = 1.5


def checked(
    result: Fit,
    done: SearchResult[ShootingSolution],
    calibration: Calibration | None,
    profiled: Sequence[str],
    draws: int,
) -> Fit:
    """`result` with the intervals of `profiled` numbers by profile likelihood, and its bands checked by a bootstrap.

    Parameters
    ----------
    result : Fit
        Of the search.
    done : SearchResult
        Where the search ended.
    calibration : Calibration, optional
        What the fit was built on.
    profiled : names
        Free numbers, NAME or NAME@STEM.
    draws : 1
        Of the bootstrap over strokes; 0 for none.

    Raises
    ------
    ParameterError
        If a number to be profiled is not free.
    """
    of = Failure("") if isinstance(done.solution, Failure) else spread(done.problem, done.solution, calibration)
    if isinstance(done.solution, Failure) or isinstance(of, Failure):
        return result
    for name in profiled:
        result = _profiled(result, done.problem, done.solution, of, name)
    return _bootstrapped(result, done.problem, done.solution, of, draws) if draws else result


def _profiled(result: Fit, task: FitProblem, found: ShootingSolution, of: Spread, name: str) -> Fit:
    interval = profile_interval(task, found, of, name)
    estimate = result.parameters[name]
    if isinstance(interval, Failure):
        note = f"{name}: no interval by profile likelihood, because {interval.message}"
        return replace(result, notes=(*result.notes, note))
    # a load weight's ends as those of its value: what position alone misses is taken off
    shift = estimate.value - task.coordinates[task.names.index(name)].si(float(found.x[task.names.index(name)]))
    low, high = interval[0] + shift, interval[1] + shift
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    note = f"{name}: {low:.4g} to {high:.4g}{unit} by profile likelihood"
    if bent((estimate.low, estimate.high), (low, high)):
        note += f"; the covariance, which takes the cost for a parabola, says {estimate.low:.4g} to {estimate.high:.4g}"
    parameters = {**result.parameters, name: replace(estimate, low=low, high=high)}
    return replace(result, parameters=parameters, notes=(*result.notes, note + "."))


def _bootstrapped(result: Fit, task: FitProblem, found: ShootingSolution, of: Spread, draws: int) -> Fit:
    times = ratio(task, bootstrap(task, found, draws), of.known)
    if not np.isfinite(times):
        return replace(result, notes=(*result.notes, "no bootstrap: it needs a free load and two strokes."))
    count = 1 + max(int(track.max()) for track in strokes(task))
    note = f"bootstrap over {count} strokes: the load scatters {times:.2f} times as far as the noise in its bands."
    result = replace(result, notes=(*result.notes, note))
    if times < TOO_NARROW:
        return result
    warning = f"the bands are too narrow: over {count} strokes the load scatters {times:.1f} times as far."
    return replace(result, status="warning", warnings=(*result.warnings, warning))

"""The search for the least errors of prediction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimate.free import FreeParameters
from clutchid.estimate.prediction_error.innovations import noise_scales
from clutchid.estimate.prediction_error.problem import FilterSolution, Prediction, predict_errors
from clutchid.estimate.prediction_error.result import result
from clutchid.estimate.problem import fit_problem
from clutchid.estimate.search_result import SearchMethod, SearchResult
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, Progress, Solution, minimise
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration

#: A round ends when the cost falls by less than this share of it.
TOLERANCE = 1e-5

#: The search ends when a round wants to move the free numbers by less than this many standard deviations. Where a round
#: wants to take back what the one before did, as stiction makes it, only half the share of a move is made, at least the
#: least; where it goes on, twice.
SETTLED, LEAST_SHARE = 0.5, 0.1

#: Most rounds before the noise of the sensors is estimated again, and after; most evaluations of a round.
COARSE, FINE, STEPS = 1, 12, 6

_METHOD = "prediction-error"


def predict(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> SearchResult[FilterSolution]:
    """Search for the `free` parameters with the least errors of prediction.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    problem, plans = fit_problem(logs, actuator, free, calibration)
    coarse = search(problem, np.zeros(len(problem.coordinates)), COARSE, progress)
    if isinstance(coarse, Failure):
        return SearchResult(_METHOD, problem, plans, coarse)
    problem = replace(problem, noise=replace(problem.noise, measured=noise_scales(problem, coarse.at)))
    return SearchResult(_METHOD, problem, plans, search(problem, coarse.x, FINE, progress, coarse.evaluations))


def search(
    task: FitProblem, x: FloatArray, rounds: int, progress: Progress | None = None, before: int = 0
) -> FilterSolution | Failure:
    """The free numbers at which the errors of prediction do not tell of better ones, from `x`, within their bounds.

    The least sum of squares would not be that: a filter that trusts less predicts errors with larger variances, so a
    free number that makes the model less certain of itself would lower it. In each round gains and variances are those
    of the filter where the round begins, and the sum of squares is made least with them; in the last one nothing moves.
    """
    count, name = before, "fine" if before else "coarse"

    def evaluate(at: FloatArray, held: Prediction | None = None) -> Prediction | Failure:
        nonlocal count
        count += 1
        if progress:
            progress(name, count)
        return predict_errors(task, at, held)

    here, share, last = evaluate(x), 1.0, np.zeros(x.size)
    for _ in range(rounds):
        if isinstance(here, Failure):
            return here
        done = _round(task, x, here, evaluate)
        move, R = done.x - x, done.at.R
        turned = float((R @ move) @ (R @ last)) < 0.0
        share = max(0.5 * share, LEAST_SHARE) if turned else min(2.0 * share, 1.0)
        there = evaluate(x + share * move)
        if isinstance(there, Failure):
            return FilterSolution(x, here, "stalled", count)
        x, here, last = x + share * move, there, move
        if float(np.linalg.norm(R @ move)) < SETTLED:
            return FilterSolution(x, here, "converged", count)
    return here if isinstance(here, Failure) else FilterSolution(x, here, "limit", count)


def _round(
    task: FitProblem, x: FloatArray, here: Prediction, evaluate: Callable[..., Prediction | Failure]
) -> Solution:
    """The least sum of squares with the gains and variances of the filter at `x`."""

    def linearise(at: FloatArray) -> Linearisation | Failure:
        found = evaluate(at, here)
        return found if isinstance(found, Failure) else found.linearisation()

    start = x, here.linearisation()
    return minimise(linearise, start, *task.bounds(), tolerance=TOLERANCE, max_evaluations=STEPS)


#: Prediction error through a Kalman filter.
PREDICTION_ERROR = SearchMethod(predict, result)

"""Search for the smallest prediction errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.phase import phase_finder
from clutchid.estimation.prediction_error.innovations import noise_scales
from clutchid.estimation.prediction_error.problem import FilterSolution, Prediction, predict_errors
from clutchid.estimation.prediction_error.result import result
from clutchid.estimation.problem import fit_problem, start_point
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.search_result import SearchMethod, SearchResult
from clutchid.inference.smoother.problem import FitProblem
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, Progress, Solution, minimise

#: Relative decrease of the cost below which a round has converged.
TOLERANCE = 1e-5

#: The search has converged if the step of a round is below this many standard deviations. If the step reverses that of
#: the round before, as stiction can cause, the step size is halved, down to the given fraction; otherwise it is
#: doubled.
CONVERGED_MOVE, MIN_STEP_SHARE = 0.5, 0.1

#: Most rounds before and after the re-estimation of the sensor noise; most evaluations of a round, and of one in which
#: all steps of the first evaluations were rejected: within ten the damping grows from 1e-3 beyond its limit of 1e12.
COARSE_ROUNDS, FINE_ROUNDS, MAX_EVALUATIONS, MAX_REJECTED = 1, 40, 6, 12

_METHOD = "prediction-error"


def predict(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> SearchResult[FilterSolution]:
    """Estimate the `free` parameters by prediction error.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    problem, plans = fit_problem(logs, actuator, free, calibration, phase_finder(actuator, free, calibration))
    x = start_point(problem, free)
    if free.start is not None:
        return SearchResult(_METHOD, problem, plans, search(problem, x, FINE_ROUNDS, progress, 1))
    coarse = search(problem, x, COARSE_ROUNDS, progress)
    if isinstance(coarse, Failure):
        return SearchResult(_METHOD, problem, plans, coarse)
    problem = replace(problem, noise=replace(problem.noise, measured=noise_scales(problem, coarse.at)))
    return SearchResult(_METHOD, problem, plans, search(problem, coarse.x, FINE_ROUNDS, progress, coarse.evaluations))


def search(
    problem: FitProblem, x: FloatArray, rounds: int, progress: Progress | None = None, before: int = 0
) -> FilterSolution | Failure:
    """Pseudo-linear regression from `x` within the bounds: minimum of the prediction errors at fixed gains.

    Minimising over the gains as well would be wrong: the standardised errors decrease if the predicted variances grow,
    so any parameter that increases the uncertainty of the model would lower the sum of squares. Each round minimises it
    with gains and variances of the filter at the start of the round, until the step of a round is negligible.
    """
    count, name = before, "fine" if before else "coarse"

    def evaluate(at: FloatArray, fixed_gains: Prediction | None = None) -> Prediction | Failure:
        nonlocal count
        count += 1
        if progress:
            progress(name, count)
        return predict_errors(problem, at, fixed_gains)

    current, step_share, previous_move = evaluate(x), 1.0, np.zeros(x.size)
    for _ in range(rounds):
        if isinstance(current, Failure):
            return current
        minimum = minimise_round(problem, x, current, evaluate)
        move, R = minimum.x - x, minimum.at.R
        if minimum.status != "converged" and not move.any():
            return FilterSolution(x, current, "stalled", count)
        reverses = float((R @ move) @ (R @ previous_move)) < 0.0
        step_share = max(0.5 * step_share, MIN_STEP_SHARE) if reverses else min(2.0 * step_share, 1.0)
        candidate = evaluate(x + step_share * move)
        if isinstance(candidate, Failure):
            return FilterSolution(x, current, "stalled", count)
        x, current, previous_move = x + step_share * move, candidate, move
        if float(np.linalg.norm(R @ move)) < CONVERGED_MOVE:
            return FilterSolution(x, current, "converged", count)
    return current if isinstance(current, Failure) else FilterSolution(x, current, "limit", count)


def minimise_round(
    problem: FitProblem, x: FloatArray, current: Prediction, evaluate: Callable[..., Prediction | Failure]
) -> Solution:
    """Minimum of the sum of squares, with gains and variances of the filter at `x`.

    A round in which every step was rejected goes on with shorter ones: no step is not a minimum.
    """

    def linearise(at: FloatArray) -> Linearisation | Failure:
        prediction = evaluate(at, current)
        return prediction if isinstance(prediction, Failure) else prediction.linearisation()

    start = x, current.linearisation()
    for evaluations in (MAX_EVALUATIONS, MAX_REJECTED):
        minimum = minimise(linearise, start, *problem.bounds(), tolerance=TOLERANCE, max_evaluations=evaluations)
        if minimum.status != "limit" or not np.array_equal(minimum.x, x):
            break
    return minimum


#: Prediction error through a Kalman filter.
PREDICTION_ERROR = SearchMethod(predict, result)

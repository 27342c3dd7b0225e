"""A whole fit by prediction error: what is free, the search, and what a calibration leaves to later fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimate.calibration import Calibration
from clutchid.estimate.least_squares import Failure, Linearisation, Solution, minimise
from clutchid.estimate.prediction_error.innovations import noise_scales
from clutchid.estimate.prediction_error.problem import Predicted, Prediction, predict_errors
from clutchid.estimate.prediction_error.summary import summary
from clutchid.estimate.result import Fit
from clutchid.estimate.search import Progress
from clutchid.estimate.shooting.calibrate import Request, calibration_of, check_size, wanted_of
from clutchid.estimate.shooting.fit import Shot, Wanted, problem_of
from clutchid.estimate.shooting.problem import Shooting
from clutchid.estimate.shooting.summary import failed, position_only
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator

#: A round ends when the cost falls by less than this share of it.
TOLERANCE = 1e-5

#: The search ends when a round wants to move the free numbers by less than this many standard deviations. Where a round
#: wants to take back what the one before did, as stiction makes it, only half the share of a move is made, at least the
#: least; where it goes on, twice.
SETTLED, LEAST_SHARE = 0.5, 0.1

#: Most rounds before the noise of the sensors is estimated again, and after; most evaluations of a round.
COARSE, FINE, STEPS = 1, 12, 6


def fit_by_prediction_error(
    logs: Sequence[Log], actuator: Actuator, request: Request, progress: Progress | None = None
) -> Fit:
    """Fit what is asked for; where the pressure is in use and the load is free, also calibrate.

    Parameters
    ----------
    logs : several
        Recordings with the measured columns of the request.
    actuator : Actuator
        Model and start values.
    request : Request
        As for a fit by shooting.
    progress : function(stage, evaluations), optional
        Called at each evaluation.

    Returns
    -------
    fit : Fit
        Its notes have the statistics of the errors of prediction; `simulated` of its recordings is what the filter
        made of them.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`; a failed search is a result of status "failed".
    """
    actuator, wanted = wanted_of(logs, actuator, request)
    check_size(logs, wanted)
    shot, found = predict(logs, actuator, wanted, request.calibration, progress)
    result = found if isinstance(found, Failure) else summary(shot, found, request.calibration)
    if isinstance(result, Failure):
        return replace(failed(shot, result.message), method="prediction-error")
    free_load = set(wanted.names) >= set(actuator.load.names)
    if "pressure_a" not in wanted.measure or not free_load:
        return result
    kept = calibration_of(result, actuator)
    return replace(result, calibration=replace(kept, bias=bias(logs, result.actuator, kept, progress)))


def predict(
    logs: Sequence[Log],
    actuator: Actuator,
    wanted: Wanted,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> tuple[Shot, Predicted | Failure]:
    """Search for the numbers `wanted` with the least errors of prediction: the problem with its plans, and the end.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    shot = problem(logs, actuator, wanted, calibration)
    coarse = search(shot.task, np.zeros(len(shot.task.coordinates)), COARSE, progress)
    if isinstance(coarse, Failure):
        return shot, coarse
    scales = noise_scales(shot.task, coarse.at)
    shot = replace(shot, task=replace(shot.task, noise=replace(shot.task.noise, measured=scales)))
    return shot, search(shot.task, coarse.x, FINE, progress, coarse.evaluations)


def problem(logs: Sequence[Log], actuator: Actuator, wanted: Wanted, calibration: Calibration | None) -> Shot:
    """Free numbers, recordings and noise as multiple shooting has them; nothing is searched yet.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    task, plans, _ = problem_of(logs, actuator, wanted, calibration)
    return Shot(task, plans, Failure("nothing is searched yet"))


def search(
    task: Shooting, x: FloatArray, rounds: int, progress: Progress | None = None, before: int = 0
) -> Predicted | Failure:
    """The free numbers at which the errors of prediction do not tell of better ones, from `x`, within their bounds.

    The least sum of squares would not be that: a filter that trusts less predicts errors with larger variances, so a
    free number that makes the model less certain of itself would lower it. In each round gains and variances are those
    of the filter where the round begins, and the sum of squares is made least with them; in the last one nothing moves.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
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
            return Predicted(x, here, "stalled", count)
        x, here, last = x + share * move, there, move
        if float(np.linalg.norm(R @ move)) < SETTLED:
            return Predicted(x, here, "converged", count)
    return here if isinstance(here, Failure) else Predicted(x, here, "limit", count)


def _round(task: Shooting, x: FloatArray, here: Prediction, evaluate: Callable[..., Prediction | Failure]) -> Solution:
    """The least sum of squares with the gains and variances of the filter at `x`."""

    def linearise(at: FloatArray) -> Linearisation | Failure:
        found = evaluate(at, here)
        return found if isinstance(found, Failure) else found.linearisation()

    start = x, here.linearisation()
    return minimise(linearise, start, *task.bounds(), tolerance=TOLERANCE, max_evaluations=STEPS)


def bias(
    logs: Sequence[Log], actuator: Actuator, kept: Calibration, progress: Progress | None = None
) -> tuple[float, ...]:
    """What a fit by prediction error to position alone misses of the load weights of a calibrated actuator, in N.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`; a recording whose search fails is left out.
    """
    missed = []
    for log in logs:
        wanted = Wanted(actuator.load.names, ("position",))
        shot, found = predict([position_only(log)], actuator, wanted, kept, progress)
        if isinstance(found, Predicted):
            theta = shot.task.actuator_of(found.x, log.name).load.theta
            missed.append(np.asarray(theta) - np.asarray(actuator.load.theta))
    return tuple(np.mean(missed, axis=0).tolist()) if missed else (0.0,) * len(actuator.load.theta)

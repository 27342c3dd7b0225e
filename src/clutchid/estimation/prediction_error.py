"""The method 'prediction-error': the smallest prediction errors of an extended Kalman filter, and its result there.

The filter predicts each sample from all earlier ones. The estimate minimises the sum of squares of the standardised
prediction errors and of the deviations from the priors, with the gains of the filter fixed in each round (Ljung 1999,
chapter 7; pseudo-linear regression, section 10.4). The filter is in square-root form (Maybeck 1979, chapter 7; 1982,
chapter 9). Its process noise is that of multiple shooting, so that both methods make the same assumptions; multiple
shooting is a smoother, which estimates each state from all measurements.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.method import Method, MethodResult, ResidualRows, SearchResult
from clutchid.estimation.phase import phase_finder
from clutchid.estimation.posterior import Posterior, consider_shift, considering
from clutchid.estimation.prediction import FilterSolution, Prediction, innovation_scales, innovations, predict_errors
from clutchid.estimation.problem import fit_problem, start_point
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.result import Compared, compare_states, position_and_pressure
from clutchid.inference.problem import Problem
from clutchid.inference.uncertainty.calibration import DEVIATION_FACTOR, Calibration
from clutchid.log import FloatArray, Log
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import INITIAL_VALUES, Linearisation, Solution, Start, minimise, triangular
from clutchid.numerics.progress import Progress, Stage, Step
from clutchid.preparation.pulses import FindPhase


def result(
    problem: Problem, solution: FilterSolution, calibration: Calibration | None, *_: object
) -> MethodResult | Failure:
    """Uncertainty at the solution of a search by prediction error, and the filtered recordings there."""
    uncertain = _parameter_uncertainty(problem, solution, calibration)
    if isinstance(uncertain, Failure):
        return uncertain
    data = np.vstack([segment.rows[:, :-1] for segment in solution.at.segments])
    compared = _recordings(problem, solution, uncertain)
    return MethodResult(uncertain.matrix, data, compared, notes=_statistics(problem, solution))


def _parameter_uncertainty(
    problem: Problem, solution: FilterSolution, calibration: Calibration | None
) -> Posterior | Failure:
    """Uncertainty of the free parameters due to noise and to consider parameters (Schmidt 1966).

    The prediction errors are autocorrelated because of the model error; their autocorrelation gives the number of
    samples that are weighted as one.
    """
    wide, x, consider_root = considering(problem, solution.x, calibration)
    prediction = predict_errors(wide, x)
    if isinstance(prediction, Failure):
        return prediction
    prior, data = prediction.prior, [segment.rows for segment in prediction.segments]
    shift = consider_shift(triangular(np.vstack([prior, *data])), consider_root)
    weight = 1.0 / np.sqrt(max(innovations(solution.at, name).correlated_samples for name in problem.measure))
    k, information = solution.x.size, triangular(np.vstack([prior, *(weight * rows for rows in data)]))
    noise_root = np.linalg.pinv(information[:k, :k]).astype(np.float64)
    return Posterior(wide, noise_root, shift, consider_root, DEVIATION_FACTOR)


def _recordings(problem: Problem, solution: FilterSolution, uncertain: Posterior) -> list[Compared]:
    """The recordings as filtered states, compared through their predictions."""
    compared, matrix = [], uncertain.matrix
    for number, plan in enumerate(problem.plans):
        tracks = zip(problem.tracks, solution.at.segments, strict=True)
        mine = [(track, segment) for track, segment in tracks if track.log == number]
        states = np.full((len(plan.log), len(plan.actuator.states)), np.nan)
        half = np.full(len(plan.log), np.nan)
        predicted = {name: np.full(len(plan.log), np.nan) for name in problem.measure}
        for track, segment in mine:
            at = slice(track.segment.start, track.segment.stop)
            states[at] = segment.states
            rows = segment.pressures[:, :-1]
            variance = np.einsum("ni,ij,nj->n", rows, matrix, rows)
            filtered = DEVIATION_FACTOR**2 * segment.pressures[:, -1] ** 2
            half[at] = QUANTILE * np.sqrt(np.maximum(variance, 0.0) + filtered)
            for name, values in predicted.items():
                values[at] = plan.log[name][at] - segment.errors[:, list(MEASURED).index(name), 0]
        starts = [position_and_pressure(plan.actuator, segment.states[0]) for _, segment in mine]
        compared.append(compare_states(plan, states, starts, predicted, half))
    return compared


def _statistics(problem: Problem, solution: FilterSolution) -> tuple[str, ...]:
    """Statistics of the prediction errors as sentences."""
    notes = []
    for name in problem.measure:
        statistics = innovations(solution.at, name)
        notes.append(
            f"prediction errors of {name}: mean square {statistics.nis:.2f} times the expected value (1 if the noise "
            f"is as assumed); correlation of neighbouring samples {statistics.lag_1:.2f} (0 for a correct model)."
        )
    return tuple(notes)


#: Relative decrease of the cost below which a round has converged.
_TOLERANCE = 1e-5

#: The search has converged if the step of a round is below this many standard deviations. If the step reverses that of
#: the round before, as stiction can cause, the step size is halved, down to the given fraction; otherwise it is
#: doubled.
CONVERGED_MOVE, _MIN_STEP_SHARE = 0.5, 0.1

#: Most rounds before and after the re-estimation of the sensor noise; most evaluations of a round, and of one in which
#: all steps of the first evaluations were rejected: within ten the damping grows from 1e-3 beyond its limit of 1e12.
_COARSE_ROUNDS, _FINE_ROUNDS, _MAX_EVALUATIONS, _MAX_REJECTED = 1, 40, 6, 12


def predict(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Estimate the `free` parameters by prediction error.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    problem = problem_of(logs, actuator, free, calibration)
    x, count = start_point(problem, free), 1
    if free.start is None:
        coarse = search(problem, x, _COARSE_ROUNDS, progress)
        if isinstance(coarse, Failure):
            return SearchResult(problem, coarse)
        problem = replace(problem, noise=replace(problem.noise, measured=innovation_scales(problem, coarse.at)))
        x, count = coarse.x, coarse.evaluations
    fine = search(problem, x, _FINE_ROUNDS, progress, count)
    if isinstance(fine, Solution):
        fine = replace(fine, starts=(Start(INITIAL_VALUES, fine.at.cost, fine.status),))
    return SearchResult(problem, fine)


def problem_of(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    find: FindPhase | None = None,
) -> Problem:
    """The problem of `predict`; `find` is the function that finds the phase of a carrier."""
    return fit_problem(logs, actuator, free, calibration, find or phase_finder(actuator, free, calibration))


def evaluated(problem: Problem, x: FloatArray, _: Sequence[FloatArray] = ()) -> Prediction | Failure:
    """The recordings filtered at x; a filter has no window starts."""
    return predict_errors(problem, x)


def rows(problem: Problem, x: FloatArray, near: Prediction) -> ResidualRows | Failure:
    """The standardised prediction errors of all samples at x, with gains and variances of the filter at `near`."""
    at = predict_errors(problem, x, near, compressed=False)
    if isinstance(at, Failure):
        return at
    data, scales = np.vstack([segment.rows for segment in at.segments]), [s.deviations for s in at.segments]
    return ResidualRows(at.prior, data, 0.5 * at.cost, np.concatenate(scales))


def search(
    problem: Problem, x: FloatArray, rounds: int, progress: Progress | None = None, before: int = 0
) -> FilterSolution | Failure:
    """Pseudo-linear regression from `x` within the bounds: minimum of the prediction errors at fixed gains.

    Minimising over the gains as well would be wrong: the standardised errors decrease if the predicted variances grow,
    so any parameter that increases the uncertainty of the model would lower the sum of squares. Each round minimises it
    with gains and variances of the filter at the start of the round, until the step of a round is negligible.
    """
    count, cost = before, np.nan
    stage: Stage = "fine search" if before else "coarse search"

    def evaluate(at: FloatArray, fixed_gains: Prediction | None = None) -> Prediction | Failure:
        nonlocal count, cost
        count += 1
        if progress:
            progress(Step(stage, count, cost, before + 1 + rounds * (_MAX_EVALUATIONS + _MAX_REJECTED)))
        prediction = predict_errors(problem, at, fixed_gains)
        if isinstance(prediction, Prediction):
            cost = float(prediction.cost)
        return prediction

    current, step_share, previous_move = evaluate(x), 1.0, np.zeros(x.size)
    for _ in range(rounds):
        if isinstance(current, Failure):
            return current
        minimum = minimise_round(problem, x, current, evaluate)
        move, R = minimum.x - x, minimum.at.R
        if minimum.status != "converged" and not move.any():
            return Solution(x, current, "stalled", count)
        reverses = float((R @ move) @ (R @ previous_move)) < 0.0
        step_share = max(0.5 * step_share, _MIN_STEP_SHARE) if reverses else min(2.0 * step_share, 1.0)
        candidate = evaluate(x + step_share * move)
        if isinstance(candidate, Failure):
            return Solution(x, current, "stalled", count)
        x, current, previous_move = x + step_share * move, candidate, move
        if float(np.linalg.norm(R @ move)) < CONVERGED_MOVE:
            return Solution(x, current, "converged", count)
    return current if isinstance(current, Failure) else Solution(x, current, "limit", count)


def minimise_round(
    problem: Problem, x: FloatArray, current: Prediction, evaluate: Callable[..., Prediction | Failure]
) -> Solution[Linearisation]:
    """Minimum of the sum of squares, with gains and variances of the filter at `x`.

    A round in which every step was rejected goes on with shorter ones: no step is not a minimum.
    """

    def linearise(at: FloatArray) -> Linearisation | Failure:
        prediction = evaluate(at, current)
        return prediction if isinstance(prediction, Failure) else prediction.linearisation()

    start = x, current.linearisation()
    for evaluations in (_MAX_EVALUATIONS, _MAX_REJECTED):
        minimum = minimise(linearise, start, *problem.bounds(), tolerance=_TOLERANCE, max_evaluations=evaluations)
        if minimum.status != "limit" or not np.array_equal(minimum.x, x):
            break
    return minimum


#: Prediction error through a Kalman filter.
PREDICTION_ERROR = Method(
    "prediction-error",
    problem_of,
    predict,
    evaluated,
    rows,
    lambda problem, free: (start_point(problem, free), ()),
    result,
    partition="a Kalman filter is corrected at every sample",
)

"""The `Fit` of a search by prediction error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.estimation.posterior import posterior
from clutchid.estimation.prediction_error.innovations import innovations
from clutchid.estimation.prediction_error.problem import FilterSolution, predict_errors
from clutchid.estimation.result import Compared, Fit, compare, position_and_pressure
from clutchid.estimation.search_result import SearchResult
from clutchid.inference.smoother.problem import FitProblem
from clutchid.inference.uncertainty.calibration import DEVIATION_FACTOR, Calibration, consider_parameters
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import triangular


@dataclass(frozen=True, slots=True, eq=False)
class JointCovariance:
    """Covariance of the free parameters x, and of the consider parameters.

    `full` is their joint covariance, shape (k + m, k + m); `matrix` that of x alone.
    """

    full: FloatArray
    size: int

    @property
    def matrix(self) -> FloatArray:
        """Covariance of x, shape (k, k)."""
        return self.full[: self.size, : self.size]


def result(search_result: SearchResult[FilterSolution], calibration: Calibration | None) -> Fit | Failure:
    """The `Fit` of a search by prediction error, corrected for the bias of the `calibration`."""
    solution = search_result.solution
    if isinstance(solution, Failure):
        return solution
    uncertain = parameter_uncertainty(search_result.problem, solution, calibration)
    if isinstance(uncertain, Failure):
        return uncertain
    recordings = _recordings(search_result, solution, uncertain)
    fit = posterior(search_result, solution, uncertain.matrix, calibration, recordings)
    return replace(fit, notes=(*fit.notes, *_statistics(search_result.problem, solution)))


def parameter_uncertainty(
    problem: FitProblem, solution: FilterSolution, calibration: Calibration | None
) -> JointCovariance | Failure:
    """Uncertainty of the free parameters due to noise and to consider parameters (Schmidt 1966).

    The prediction errors are autocorrelated because of the model error; their autocorrelation gives the number of
    samples that are weighted as one.
    """
    k = len(problem.coordinates)
    extra, consider_root = consider_parameters(problem.actuator, problem.coordinates, calibration)
    wide = problem.widened(extra)
    prediction = predict_errors(wide, np.concatenate([solution.x, np.zeros(len(extra))]))
    if isinstance(prediction, Failure):
        return prediction
    without_extra = [*range(k), *range(k + len(extra), prediction.prior.shape[0])]
    prior, data = prediction.prior[without_extra, :-1], [segment.rows[:, :-1] for segment in prediction.segments]
    factor = triangular(np.vstack([prior, *data]))
    inner = np.linalg.pinv(factor[:k, :k])
    consider_shift = -inner @ factor[:k, k:] @ consider_root
    weight = 1.0 / np.sqrt(max(innovations(solution.at, name).correlated_samples for name in problem.measure))
    noise_root = np.linalg.pinv(triangular(np.vstack([prior, *(weight * rows for rows in data)]))[:k, :k])
    both = np.vstack([consider_shift, consider_root])
    full = both @ both.T
    full[:k, :k] += noise_root @ noise_root.T
    return JointCovariance(DEVIATION_FACTOR**2 * full, k)


def _recordings(
    search_result: SearchResult[FilterSolution], solution: FilterSolution, uncertain: JointCovariance
) -> list[Compared]:
    """The recordings as filtered states, compared through their predictions."""
    compared = []
    for number, plan in enumerate(search_result.plans):
        tracks = zip(search_result.problem.tracks, solution.at.segments, strict=True)
        mine = [(track, segment) for track, segment in tracks if track.log == number]
        states = np.full((len(plan.log), len(plan.actuator.states)), np.nan)
        half = np.full(len(plan.log), np.nan)
        predicted = {name: np.full(len(plan.log), np.nan) for name in search_result.problem.measure}
        for track, segment in mine:
            at = slice(track.segment.start, track.segment.stop)
            states[at] = segment.states
            rows = segment.pressures[:, :-1]
            variance = np.einsum("ni,ij,nj->n", rows, uncertain.matrix, rows)
            filtered = DEVIATION_FACTOR**2 * segment.pressures[:, -1] ** 2
            half[at] = QUANTILE * np.sqrt(np.maximum(variance, 0.0) + filtered)
            for name, values in predicted.items():
                values[at] = plan.log[name][at] - segment.errors[:, list(MEASURED).index(name), 0]
        starts = [position_and_pressure(plan.actuator, segment.states[0]) for _, segment in mine]
        compared.append(compare(plan, states, starts, predicted, half))
    return compared


def _statistics(problem: FitProblem, solution: FilterSolution) -> tuple[str, ...]:
    """Statistics of the prediction errors as sentences."""
    notes = []
    for name in problem.measure:
        statistics = innovations(solution.at, name)
        notes.append(
            f"prediction errors of {name}: mean square {statistics.nis:.2f} times the expected one, 1 if the noise "
            f"is as assumed; correlation of neighbouring samples {statistics.lag_1:.2f}, 0 for a correct model."
        )
    return tuple(notes)

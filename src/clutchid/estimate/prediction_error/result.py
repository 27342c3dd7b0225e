"""From the end of a search by prediction error to the result that the user sees."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.estimate.outcome import Compared, compare, position_and_pressure
from clutchid.estimate.posterior import QUANTILE, posterior
from clutchid.estimate.prediction_error.innovations import innovations
from clutchid.estimate.prediction_error.problem import FilterSolution, predict_errors
from clutchid.estimate.result import Fit
from clutchid.estimate.search_result import SearchResult
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.drift import SCALE, considered


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Covariance of the free numbers x and the considered ones together, and how it moves the pressure.

    `full` is the covariance of both, shape (k + m, k + m); `matrix` that of x alone.
    """

    full: FloatArray
    size: int

    @property
    def matrix(self) -> FloatArray:
        """Covariance of x, shape (k, k)."""
        return self.full[: self.size, : self.size]


def result(done: SearchResult[FilterSolution], calibration: Calibration | None) -> Fit | Failure:
    """The result of a search for the least errors of prediction.

    Of the `calibration` the bias is taken off, and its covariance counts.
    """
    solution = done.solution
    if isinstance(solution, Failure):
        return solution
    spread = uncertainty(done.problem, solution, calibration)
    if isinstance(spread, Failure):
        return spread
    found = posterior(done, solution, spread.matrix, calibration, _recordings(done, solution, spread))
    return replace(found, notes=(*found.notes, *_statistics(done.problem, solution)))


def uncertainty(task: FitProblem, found: FilterSolution, calibration: Calibration | None) -> Spread | Failure:
    """How uncertain the free numbers are: what the noise leaves, and what is only taken as known (Schmidt 1966).

    Errors of prediction are coloured where the model is not the truck; as many neighbours count as one as their own
    correlation says.
    """
    k = len(task.coordinates)
    extra, root = considered(task.actuator, task.coordinates, calibration)
    wide = replace(task, coordinates=(*task.coordinates, *extra))
    there = predict_errors(wide, np.concatenate([found.x, np.zeros(len(extra))]))
    if isinstance(there, Failure):
        return there
    own = [*range(k), *range(k + len(extra), there.prior.shape[0])]
    prior, data = there.prior[own, :-1], [segment.rows[:, :-1] for segment in there.segments]
    searched = triangular(np.vstack([prior, *data]))
    inner = np.linalg.pinv(searched[:k, :k])
    moved = -inner @ searched[:k, k:] @ root
    share = 1.0 / np.sqrt(max(innovations(found.at, name).colour for name in task.measure))
    known = np.linalg.pinv(triangular(np.vstack([prior, *(share * rows for rows in data)]))[:k, :k])
    both = np.vstack([moved, root])
    full = both @ both.T
    full[:k, :k] += known @ known.T
    return Spread(SCALE**2 * full, k)


def _recordings(done: SearchResult[FilterSolution], solution: FilterSolution, spread: Spread) -> list[Compared]:
    """The recordings as the filter's state after each sample, compared with what was predicted of each."""
    compared = []
    for number, plan in enumerate(done.plans):
        tracks = zip(done.problem.tracks, solution.at.segments, strict=True)
        mine = [(track, segment) for track, segment in tracks if track.log == number]
        states = np.full((len(plan.log), len(plan.actuator.states)), np.nan)
        half = np.full(len(plan.log), np.nan)
        predicted = {name: np.full(len(plan.log), np.nan) for name in done.problem.measure}
        for track, segment in mine:
            at = slice(track.segment.start, track.segment.stop)
            states[at] = segment.states
            rows = segment.pressures[:, :-1]
            variance = np.einsum("ni,ij,nj->n", rows, spread.matrix, rows)
            half[at] = QUANTILE * np.sqrt(np.maximum(variance, 0.0) + SCALE**2 * segment.pressures[:, -1] ** 2)
            for name, values in predicted.items():
                values[at] = plan.log[name][at] - segment.errors[:, list(MEASURED).index(name), 0]
        starts = [position_and_pressure(plan.actuator, segment.states[0]) for _, segment in mine]
        compared.append(compare(plan, states, starts, predicted, half))
    return compared


def _statistics(task: FitProblem, found: FilterSolution) -> tuple[str, ...]:
    """What the errors of prediction look like, in words."""
    notes = []
    for name in task.measure:
        of = innovations(found.at, name)
        notes.append(
            f"errors of prediction of {name}: mean square {of.nis:.2f} times what the filter expects, 1 where noise "
            f"is as assumed; neighbours correlate at {of.lag_1:.2f}, 0 where the model misses nothing."
        )
    return tuple(notes)

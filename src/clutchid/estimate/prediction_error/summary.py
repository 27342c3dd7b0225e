"""From the end of a search by prediction error to the result that the user sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clutchid.estimate.calibration import Calibration
from clutchid.estimate.prediction_error.innovations import innovations
from clutchid.estimate.prediction_error.problem import FilterSolution, predict_errors
from clutchid.estimate.result import Fit, Recording, errors_over
from clutchid.estimate.shooting.fit import SearchResult
from clutchid.estimate.shooting.summary import QUANTILE, described
from clutchid.estimate.shooting.uncertainty import SCALE, considered
from clutchid.log import FloatArray, Log
from clutchid.measured import MEASURED
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.simulation import simulated_log
from clutchid.smoother.problem import FitProblem


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


def summary(shot: SearchResult[FilterSolution], calibration: Calibration | None) -> Fit | Failure:
    """The result of a search for the least errors of prediction.

    Parameters
    ----------
    shot : SearchResult
        The problem, its plans, and where the search ended.
    calibration : Calibration, optional
        What the fit builds on: its bias is taken off, its covariance counts.
    """
    found = shot.found
    if isinstance(found, Failure):
        return found
    spread = uncertainty(shot.task, found, calibration)
    if isinstance(spread, Failure):
        return spread
    recordings, compared = _recordings(shot, found, spread)
    result = described(shot, found, spread.matrix, calibration, "prediction-error")
    notes = (*result.notes, *_statistics(shot.task, found))
    return replace(result, recordings=recordings, errors=errors_over(compared), notes=notes)


def uncertainty(task: FitProblem, found: FilterSolution, calibration: Calibration | None) -> Spread | Failure:
    """How uncertain the free numbers are: what the noise leaves, and what is only taken as known (Schmidt 1966).

    Errors of prediction are coloured where the model is not the truck; as many neighbours count as one as their own
    correlation says.
    """
    k = len(task.coordinates)
    extra, root = considered(task, calibration)
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


def _recordings(
    shot: SearchResult[FilterSolution], found: FilterSolution, spread: Spread
) -> tuple[dict[str, Recording], list[tuple[Log, Log]]]:
    """The recordings by name, and each as measured and as it was foreseen sample by sample."""
    task, names = shot.task, shot.task.actuator.states
    recordings, pairs = {}, []
    for number, prepared in enumerate(shot.plans):
        mine = [(t, s) for t, s in zip(task.tracks, found.at.segments, strict=True) if t.log == number]
        states = np.full((len(prepared.log), len(names)), np.nan)
        half = np.full(len(prepared.log), np.nan)
        foreseen = {name: np.full(len(prepared.log), np.nan) for name in task.measure}
        for track, segment in mine:
            at = slice(track.segment.start, track.segment.stop)
            states[at] = segment.states
            rows = segment.pressures[:, :-1]
            variance = np.einsum("ni,ij,nj->n", rows, spread.matrix, rows)
            half[at] = QUANTILE * np.sqrt(np.maximum(variance, 0.0) + SCALE**2 * segment.pressures[:, -1] ** 2)
            for name, values in foreseen.items():
                values[at] = prepared.log[name][at] - segment.errors[:, list(MEASURED).index(name), 0]
        simulated = simulated_log(prepared, states, names)
        pairs.append((prepared.log, simulated.with_columns(**foreseen)))
        simulated = simulated.with_columns(**_band(simulated["pressure_a"], half))
        starts = tuple((float(segment.states[0, 0]), float(segment.states[0, 2])) for _, segment in mine)
        recordings[prepared.log.name] = Recording(prepared.log, simulated, errors_over(pairs[-1:]), starts)
    return recordings, pairs


def _band(pressure: FloatArray, half: FloatArray) -> Mapping[str, FloatArray]:
    return {"pressure_a low": pressure - half, "pressure_a high": pressure + half}


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

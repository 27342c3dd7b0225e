"""A fit by prediction error as a least-squares problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from clutchid.filter.filtering import Filtered, filtered
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, triangular
from clutchid.smoother.problem import FitProblem, prior_rows


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """All recordings filtered: rows ``[theta | r]`` of prior and data, filtered segments, and sum of losses."""

    prior: FloatArray
    segments: tuple[Filtered, ...]
    cost: float

    def linearisation(self) -> Linearisation:
        """The problem as `clutchid.numerics.least_squares` takes it."""
        k = self.prior.shape[1] - 1
        factor = triangular(np.vstack([self.prior, *(segment.rows for segment in self.segments)]))
        count = self.prior.shape[0] + sum(np.isfinite(s.errors[:, :, 0]).sum() for s in self.segments)
        return Linearisation(factor[:k, :k], factor[:k, k], 0.5 * self.cost, int(count))


def predict_errors(task: FitProblem, x: FloatArray, held: Prediction | None = None) -> Prediction | Failure:
    """Errors of prediction at the free numbers `x`, standardised, with their derivatives.

    The gains of the filter are held fixed in the derivatives, as in pseudo-linear regression.

    Parameters
    ----------
    task : FitProblem
        Free numbers, recordings and noise, as for a fit by shooting; its windows do not matter.
    x : 1
        Free numbers as coordinates, see `clutchid.uncertainty.coordinates`.
    held : Prediction, optional
        Take its gains and variances: the errors are then a smooth function of x with these derivatives.

    Returns
    -------
    prediction : Prediction, or Failure where a simulation leaves the finite numbers or values contradict each other.
    """
    parameter_maps = task.parameter_maps(x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    prior = prior_rows(task, x)
    cost = float(np.sum(prior[:, -1] ** 2))
    segments = []
    for number, track in enumerate(task.tracks):
        gains = held.segments[number].gains if held else None
        segment = filtered(track, parameter_maps[task.stems[track.log]], task.measure, task.noise, gains)
        if isinstance(segment, Failure):
            return segment
        segments.append(segment)
        cost += segment.cost
    return Prediction(prior, tuple(segments), cost) if np.isfinite(cost) else Failure("the cost is not finite")


@dataclass(frozen=True, slots=True, eq=False)
class FilterSolution:
    """Where a search ended: free numbers, the recordings filtered with them, how it ended, and after how much work."""

    x: FloatArray
    at: Prediction
    status: Literal["converged", "stalled", "limit"]
    evaluations: int

"""Estimation by prediction error as a least-squares problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from clutchid.inference.filter.filtering import Filtered, filtered
from clutchid.inference.smoother.problem import FitProblem, prior_rows
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, triangular


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """All recordings filtered: prior rows ``[theta | r]``, filtered segments, and the cost (sum of losses)."""

    prior: FloatArray
    segments: tuple[Filtered, ...]
    cost: float

    def linearisation(self) -> Linearisation:
        """The problem as in `clutchid.numerics.least_squares`."""
        k = self.prior.shape[1] - 1
        factor = triangular(np.vstack([self.prior, *(segment.rows for segment in self.segments)]))
        count = self.prior.shape[0] + sum(np.isfinite(s.errors[:, :, 0]).sum() for s in self.segments)
        return Linearisation(factor[:k, :k], factor[:k, k], 0.5 * self.cost, int(count))


def predict_errors(problem: FitProblem, x: FloatArray, fixed_gains: Prediction | None = None) -> Prediction | Failure:
    """Standardised prediction errors at the free parameters `x`, with their derivatives.

    The gains of the filter are fixed in the derivatives, as in pseudo-linear regression.

    Parameters
    ----------
    problem : FitProblem
        Free parameters, recordings and noise, as for multiple shooting; its windows have no influence.
    x : 1
        Free parameters as coordinates, see `clutchid.inference.uncertainty.coordinates`.
    fixed_gains : Prediction, optional
        Use its gains and variances: the errors are then a smooth function of x with these derivatives.

    Returns
    -------
    prediction : Prediction, or Failure if a simulation diverges or values contradict each other.
    """
    parameter_maps = problem.parameter_maps(x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    prior = prior_rows(problem, x)
    cost = float(np.sum(prior[:, -1] ** 2))
    segments = []
    for number, track in enumerate(problem.tracks):
        gains = fixed_gains.segments[number].gains if fixed_gains else None
        segment = filtered(track, parameter_maps[problem.stems[track.log]], problem.measure, problem.noise, gains)
        if isinstance(segment, Failure):
            return segment
        segments.append(segment)
        cost += segment.cost
    return Prediction(prior, tuple(segments), cost) if np.isfinite(cost) else Failure("the cost is not finite")


@dataclass(frozen=True, slots=True, eq=False)
class FilterSolution:
    """Solution of a search: free parameters, the filtered recordings, status, and number of evaluations."""

    x: FloatArray
    at: Prediction
    status: Literal["converged", "stalled", "limit"]
    evaluations: int

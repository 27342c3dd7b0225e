"""Prediction errors of the filter as a least-squares problem, and their statistics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.inference.filter.filtering import Filtered, filtered
from clutchid.inference.problem import Problem, prior_rows
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, Solution, triangular
from clutchid.simulation.noise import noise_scale


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


def predict_errors(
    problem: Problem, x: FloatArray, fixed_gains: Prediction | None = None, *, compressed: bool = True
) -> Prediction | Failure:
    """Standardised prediction errors at the free parameters `x`, with their derivatives.

    The gains of the filter are fixed in the derivatives, as in pseudo-linear regression.

    Parameters
    ----------
    problem : Problem
        Free parameters, recordings and noise, as for multiple shooting; its windows have no influence.
    x : 1
        Free parameters as coordinates, see `clutchid.inference.uncertainty.coordinates`.
    fixed_gains : Prediction, optional
        Use its gains and variances: the errors are then a smooth function of x with these derivatives.
    compressed : bool
        Whether the rows are compressed.

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
        mapped = parameter_maps[problem.stems[track.log]]
        segment = filtered(track, mapped, problem.measure, problem.noise, gains, compressed=compressed)
        if isinstance(segment, Failure):
            return segment
        segments.append(segment)
        cost += segment.cost
    return Prediction(prior, tuple(segments), cost) if np.isfinite(cost) else Failure("the cost is not finite")


#: Solution of a search by prediction error: its parameters, and the recordings filtered there.
FilterSolution = Solution[Prediction]


#: Largest lag of the autocorrelation in samples.
_MAX_LAG = 200


@dataclass(frozen=True, slots=True)
class Innovations:
    """Statistics of the standardised prediction errors of one measured column.

    `nis` is their mean square, 1 if the noise is as assumed; `lag_1` the correlation of neighbouring samples, 0 for a
    correct model; `correlated_samples` the number of neighbouring samples with the information of an independent one.
    """

    nis: float
    lag_1: float
    correlated_samples: float


def innovations(prediction: Prediction, name: str) -> Innovations:
    """Statistics of the standardised prediction errors of a measured column.

    Parameters
    ----------
    prediction : Prediction
        With at least two samples of the column.
    name : 'position' or 'pressure_a'
        The column.

    Returns
    -------
    innovations : Innovations
    """
    column = list(MEASURED).index(name)
    errors = np.concatenate([segment.errors[:, column] for segment in prediction.segments])
    nu = errors[:, 0] / np.sqrt(errors[:, 1])
    nu = nu[np.isfinite(nu)]
    power = float(np.mean(nu**2)) if nu.size else float("nan")
    correlation = np.array([np.mean(nu[lag:] * nu[:-lag]) / power for lag in range(1, min(_MAX_LAG, nu.size // 10))])
    lag_1 = float(correlation[0]) if correlation.size else float("nan")
    return Innovations(power, lag_1, _correlated_samples(correlation))


def _correlated_samples(correlation: FloatArray) -> float:
    """Sum of the autocorrelation over both sides, up to its first value that is not positive; at least 1."""
    below = np.flatnonzero(correlation <= 0.0)
    return float(1.0 + 2.0 * np.sum(correlation[: below[0] if below.size else correlation.size]))


def innovation_scales(problem: Problem, prediction: Prediction) -> dict[str, float]:
    """Noise scale of each measured column, from the errors less the part due to the state covariance."""
    scales = {}
    for column, name in enumerate(MEASURED):
        if name not in problem.measure:
            continue
        usual = problem.noise.measured[name]
        errors = np.concatenate([segment.errors[:, column] for segment in prediction.segments])
        errors = errors[np.isfinite(errors[:, 0])]
        state_variance = float(np.median(errors[:, 1])) - usual**2 if errors.size else 0.0
        scales[name] = noise_scale(errors[:, 0], usual, state_variance)
    return scales

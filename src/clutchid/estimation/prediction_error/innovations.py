"""Statistics of the prediction errors: sensor noise from their size, model error from their autocorrelation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.estimation.prediction_error.problem import Prediction
from clutchid.inference.smoother.problem import FitProblem
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.simulation.noise import noise_scale

#: Largest lag of the autocorrelation in samples.
MAX_LAG = 200


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
    correlation = np.array([np.mean(nu[lag:] * nu[:-lag]) / power for lag in range(1, min(MAX_LAG, nu.size // 10))])
    lag_1 = float(correlation[0]) if correlation.size else float("nan")
    return Innovations(power, lag_1, _correlated_samples(correlation))


def _correlated_samples(correlation: FloatArray) -> float:
    """Sum of the autocorrelation over both sides, up to its first value that is not positive; at least 1."""
    below = np.flatnonzero(correlation <= 0.0)
    return float(1.0 + 2.0 * np.sum(correlation[: below[0] if below.size else correlation.size]))


def noise_scales(problem: FitProblem, prediction: Prediction) -> dict[str, float]:
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

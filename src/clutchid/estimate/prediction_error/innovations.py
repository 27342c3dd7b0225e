"""Errors of prediction, looked at: their size tells the noise of the sensors, their colour what the filter misses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.estimate.prediction_error.problem import Prediction
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.smoother.problem import FitProblem
from clutchid.smoother.trajectory import LEAST, MOST

#: Errors this many samples apart are taken as independent when their colour is counted.
FAR = 200


@dataclass(frozen=True, slots=True)
class Innovations:
    """Statistics of the standardised errors of prediction of one measured column.

    `nis` is their mean square, 1 where the noise is as assumed; `lag_1` the correlation of neighbours, 0 where nothing
    is missed; `colour` how many neighbouring samples tell what one would, were they independent.
    """

    nis: float
    lag_1: float
    colour: float


def innovations(prediction: Prediction, name: str) -> Innovations:
    """Statistics of the standardised errors of prediction of a measured column.

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
    correlation = np.array([np.mean(nu[lag:] * nu[:-lag]) / power for lag in range(1, min(FAR, nu.size // 10))])
    lag_1 = float(correlation[0]) if correlation.size else float("nan")
    return Innovations(power, lag_1, _colour(correlation))


def _colour(correlation: FloatArray) -> float:
    """Sum of the correlations of both sides up to the first that is not positive, at least 1."""
    below = np.flatnonzero(correlation <= 0.0)
    return float(1.0 + 2.0 * np.sum(correlation[: below[0] if below.size else correlation.size]))


def noise_scales(task: FitProblem, prediction: Prediction) -> dict[str, float]:
    """Noise scale of each measured column: the median error beyond what the spread of the state explains, bounded."""
    scales = {}
    for column, name in enumerate(MEASURED):
        if name not in task.measure:
            continue
        usual = task.noise.measured[name]
        errors = np.concatenate([segment.errors[:, column] for segment in prediction.segments])
        errors = errors[np.isfinite(errors[:, 0])]
        square = 0.0
        if errors.size:
            spread = float(np.median(errors[:, 1])) - usual**2
            square = max(0.0, (1.4826 * float(np.median(np.abs(errors[:, 0])))) ** 2 - spread)
        scales[name] = float(np.clip(np.sqrt(square), LEAST * usual, MOST * usual))
    return scales

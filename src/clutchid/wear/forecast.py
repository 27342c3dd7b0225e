"""Remaining life until a limit: distribution of the time at which the trend first reaches it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import stats

from clutchid.log import FloatArray
from clutchid.wear.trend import growth_noise

#: Quantiles of a forecast: its 90 % interval and its median.
QUANTILES = (0.05, 0.5, 0.95)

#: How far a forecast looks, in lives.
HORIZON = 5.0


class Remaining(NamedTuple):
    """Remaining life until a limit, in strokes, km or days: median and 90 % interval; infinite beyond five lives."""

    low: float
    median: float
    high: float


def remaining(name: str, mean: FloatArray, covariance: FloatArray, limit: float, life: float) -> Remaining:
    """Remaining life until a quantity reaches `limit`, from its value and rate now.

    The probability to have reached it by then is that the trend is beyond it, which must not decrease.

    Parameters
    ----------
    name
        A row of `clutchid.wear.settings.GROWTH`.
    mean, covariance
        Of value and rate, (2,) and (2, 2).
    limit
        Value that ends the life; below 0 if the quantity falls.
    life
        How much of s a life has.
    """
    sign = 1.0 if limit >= 0 else -1.0
    ahead = np.concatenate([[0.0], np.geomspace(1e-4, HORIZON, 600)]) * life
    value = mean[0] + mean[1] * ahead
    noise = np.array([growth_noise(name, life, float(ds))[0, 0] for ds in ahead])
    variance = covariance[0, 0] + 2 * ahead * covariance[0, 1] + ahead**2 * covariance[1, 1] + noise
    reached = np.maximum.accumulate(stats.norm.cdf(sign * (value - limit) / np.sqrt(variance)))
    return Remaining(*(_first(reached, ahead, quantile) for quantile in QUANTILES))


def _first(reached: FloatArray, ahead: FloatArray, quantile: float) -> float:
    """Distance ahead at which the probability first reaches a quantile."""
    if reached[0] >= quantile:
        return 0.0
    if reached[-1] < quantile:
        return float("inf")
    k = int(np.argmax(reached >= quantile))
    share = (quantile - reached[k - 1]) / (reached[k] - reached[k - 1])
    return float(ahead[k - 1] + share * (ahead[k] - ahead[k - 1]))

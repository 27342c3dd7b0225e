"""When clutches are due: probabilities to reach the limit within a distance or a time, what is left, replacements."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import special

from clutchid.log import FloatArray
from clutchid.numerics.quadrature import normal_nodes
from clutchid.wear.evidence import USE_NODES, WEAR_NODES, LifeEvidence
from clutchid.wear.pooling import (
    LEAST_WEIGHT,
    USE_GUESSES,
    TypePool,
    TypeSpread,
    level_posterior,
    rate_posterior,
)

#: Distances in km and times in days of which the probabilities are kept.
WITHIN_KM, WITHIN_DAYS = (20e3, 50e3, 100e3), (90.0, 180.0, 365.0)

#: Months of a forecast of replacements, and the days of one.
FORECAST_MONTHS, MONTH = 12, 365.25 / 12

#: Quantiles of a forecast: its 90 % interval and its median.
QUANTILES = (0.05, 0.5, 0.95)

#: Horizon of a forecast in lives, and the distances at which it is computed.
FORECAST_LIVES = 5.0
_AHEAD = np.concatenate([[0.0], np.geomspace(2e-3, FORECAST_LIVES, 47)])

#: Vehicles at a time, for room.
_CHUNK = 20_000


#: Nodes and weights over the rate of a vehicle, and over its use.
_RATES, _USES = normal_nodes(9), normal_nodes(7)


class Forecast(NamedTuple):
    """Forecast of vehicles: arrays with a first axis for these.

    Attributes
    ----------
    left : (k, 3), lives
        Until the limit: 5 %, 50 % and 95 % quantile; infinite beyond `FORECAST_LIVES`.
    left_days, left_km : (k, 3)
        The same in days and km; NaN where the use is not known.
    within_days, within_km : (k, 3)
        Probability to reach the limit within `WITHIN_DAYS` and `WITHIN_KM`.
    by_month : (k, 12)
        Probability to have reached it by the end of each month.
    common : (k, 12)
        Change of `by_month` by one standard deviation of the error that vehicles of a calibration share.
    """

    left: FloatArray
    left_days: FloatArray
    left_km: FloatArray
    within_days: FloatArray
    within_km: FloatArray
    by_month: FloatArray
    common: FloatArray


def forecast(evidence: LifeEvidence, pool: TypePool) -> Forecast:
    """The forecast of vehicles of a type."""
    parts = [_forecast(evidence.at(some), pool) for some in _chunks(evidence)]
    return Forecast(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _chunks(evidence: LifeEvidence) -> Iterator[slice]:
    return (slice(k, k + _CHUNK) for k in range(0, evidence.limit.size, _CHUNK))


def _forecast(evidence: LifeEvidence, pool: TypePool) -> Forecast:
    months = np.asarray(MONTH * np.arange(1, FORECAST_MONTHS + 1), dtype=np.float64)
    reached, worse = reached_by(evidence, pool, _AHEAD), reached_by(evidence, pool, _AHEAD, offset=1.0)
    n = _AHEAD.size
    days, km = (
        _by_use(reached, evidence, pool, q, np.concatenate([_grid(q), x]))
        for q, x in enumerate(([*months, *WITHIN_DAYS], WITHIN_KM))
    )
    by_month = days[:, n : n + FORECAST_MONTHS]
    return Forecast(
        _inverted(reached, _AHEAD), _inverted(days[:, :n], _grid(0)), _inverted(km[:, :n], _grid(1)),
        days[:, n + FORECAST_MONTHS :], km[:, n:], by_month, _by_use(worse, evidence, pool, 0, months) - by_month,
    )  # fmt: skip


def reached_within(evidence: LifeEvidence, pool: TypePool, q: int, x: FloatArray) -> FloatArray:
    """Probability of each vehicle to reach its limit within days (`q` = 0) or km (1) of its own, (k,)."""
    parts = []
    for some in _chunks(evidence):
        own = evidence.at(some)
        parts.append(_by_use(reached_by(own, pool, _AHEAD), own, pool, q, x[some, None])[:, 0])
    return np.concatenate(parts)


def _grid(q: int) -> FloatArray:
    """Days or km of a usual use for the distances ahead."""
    return np.asarray(_AHEAD * np.exp(-USE_GUESSES[q].mean))


def reached_by(evidence: LifeEvidence, pool: TypePool, ahead: FloatArray, offset: float = 0.0) -> FloatArray:
    """Probability of each vehicle to have reached its limit at distances in lives ahead, rising, (k, ahead).

    `offset` is the error of the calibration, in its standard deviations. The limit is taken as reached where the trend
    is beyond it, and stays so.
    """
    total, weights = np.zeros((evidence.limit.size, ahead.size)), _counting(pool.rate)
    for n in np.flatnonzero(weights):
        node, (_, u, r, uu, rr, ur) = WEAR_NODES[n], evidence.wear[:, n].T
        mean, std = rate_posterior(evidence.wear, pool.rate, int(n))
        noise = node.walk**2 * ahead**3 / 3 + node.scatter**2 * ahead
        sd = np.sqrt(np.maximum(uu - ur**2 / rr, 1e-12)[:, None] + noise)
        for x, weight in zip(*_RATES, strict=True):
            rate = np.exp(mean + std * x)
            value = u + offset * np.sqrt(node.shared) * evidence.constant + ur / rr * (rate - r)
            beyond = (value[:, None] + rate[:, None] * ahead - evidence.limit[:, None]) / sd
            total += weights[n] * weight * np.maximum.accumulate(special.ndtr(beyond), axis=1)
    return total


def _counting(spread: TypeSpread) -> FloatArray:
    """Weights of the nodes, 0 for those that hardly count."""
    weights = np.where(spread.weight >= LEAST_WEIGHT * spread.weight.max(), spread.weight, 0.0)
    return np.asarray(weights / weights.sum())


def _by_use(reached: FloatArray, evidence: LifeEvidence, pool: TypePool, q: int, x: FloatArray) -> FloatArray:
    """Probabilities by days (`q` = 0) or km (1) from those by distances ahead; NaN where the use is not known."""
    use, spread, guess = evidence.use[:, q], pool.use[q], USE_GUESSES[q]
    days = x if q == 0 else x * np.exp(USE_GUESSES[1].mean - USE_GUESSES[0].mean)
    share = np.minimum(np.nan_to_num(evidence.interval, nan=MONTH)[:, None] / np.maximum(days, 1e-9), 1.0)
    mean, square = np.zeros((len(use), 1)), np.zeros((len(use), x.shape[-1]))
    weights = _counting(spread)
    for n in np.flatnonzero(weights):
        node, (level, variance) = USE_NODES[n], level_posterior(use, spread, int(n), guess)
        is_exact = use[:, n, 2, None] == 0.0
        noise = np.where(is_exact, 0.0, node.walk**2 * days / 3 / 365.25 + node.scatter**2 * share)
        mean += weights[n] * level[:, None]
        square += weights[n] * (level[:, None] ** 2 + variance[:, None] + noise)
    sd = np.sqrt(np.maximum(square - mean**2, 0.0))
    nodes = (weight * _interpolated(reached, x * np.exp(mean + sd * z)) for z, weight in zip(*_USES, strict=True))
    return np.asarray(sum(nodes))


def _interpolated(reached: FloatArray, ahead: FloatArray) -> FloatArray:
    """Probabilities at a vehicle's own distances ahead, (k, n); NaN where the distance is."""
    with np.errstate(divide="ignore"):
        place = 1.0 + (np.log(ahead) - np.log(_AHEAD[1])) / np.log(_AHEAD[2] / _AHEAD[1])
    after = np.clip(np.ceil(np.nan_to_num(place, nan=1.0)), 1, _AHEAD.size - 1).astype(np.intp)
    share = np.minimum((ahead - _AHEAD[after - 1]) / (_AHEAD[after] - _AHEAD[after - 1]), 1.0)
    first = np.arange(len(reached))[:, None] * reached.shape[1]
    flat = reached.ravel()
    low, high = flat[first + after - 1], flat[first + after]
    return np.asarray(low + share * (high - low))


def _inverted(reached: FloatArray, x: FloatArray) -> FloatArray:
    """Quantiles of where the limit is reached, (k, 3)."""
    columns = []
    for quantile in QUANTILES:
        k = np.argmax(reached >= quantile, axis=1)
        after = np.maximum(k, 1)
        rows = np.arange(len(reached))
        low, high = reached[rows, after - 1], reached[rows, after]
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            at = x[after - 1] + (quantile - low) / (high - low) * (x[after] - x[after - 1])
        at = np.where(reached[:, 0] >= quantile, 0.0, at)
        at = np.where(reached[:, -1] < quantile, np.inf, at)
        columns.append(np.where(np.isnan(reached[:, -1]), np.nan, at))
    return np.stack(columns, axis=1)


class Replacements(NamedTuple):
    """Expected replacements in a month, with their 95 % interval."""

    expected: FloatArray
    low: FloatArray
    high: FloatArray


def replacements(by_month: FloatArray, common: FloatArray) -> Replacements:
    """Replacements of vehicles by month: each clutch by chance, and all together by the error that they share.

    Parameters
    ----------
    by_month, common : (k, months)
        As in `Forecast`; vehicles without a forecast have NaN and do not count.
    """
    counts = np.isfinite(by_month).all(axis=1)
    by_clutch = np.diff(by_month[counts], axis=1, prepend=0.0)
    shared = np.diff(common[counts], axis=1, prepend=0.0).sum(axis=0)
    expected = by_clutch.sum(axis=0)
    variance = (by_clutch * (1.0 - by_clutch)).sum(axis=0) + shared**2
    with np.errstate(invalid="ignore", divide="ignore"):
        shape, scale = expected**2 / variance, variance / expected
        low, high = (np.nan_to_num(special.gammaincinv(shape, p) * scale) for p in (0.025, 0.975))
    return Replacements(expected, low, high)

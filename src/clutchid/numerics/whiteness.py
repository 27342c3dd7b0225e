"""Whiteness of a residual: autocorrelation, effective samples, and cross-correlation with inputs, with 99 % bounds.

A missing value is NaN; each lag uses the available pairs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from clutchid.log import FloatArray

#: Lags on each side, and order of the autoregressive model that whitens an input: those of MATLAB's `resid`.
LAGS, _WHITENING_ORDER = 25, 10

#: Half width of a 99 % interval in standard deviations.
_Z_99 = 2.5758

#: Least number of values for an autocorrelation.
FEWEST_VALUES = 2 * LAGS

#: Samples per block of a correlation sum.
_CHUNK = 4096

#: Regularisation of the whitening filter of a constant or a straight line; far below the noise of any duty cycle.
_RIDGE = 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class CrossCorrelation:
    """Correlation of a residual with one input over `lag` in s, and its 99 % bounds.

    At a positive lag the residual follows the input. `strongest_lag` in s is where the correlation is the largest
    multiple of its bound, `strongest` and `strongest_bound` are the values there.
    """

    lag: FloatArray
    correlation: FloatArray
    bound: FloatArray
    share_outside: float
    strongest_lag: float
    strongest: float
    strongest_bound: float


@dataclass(frozen=True, slots=True, eq=False)
class Colour:
    """Autocorrelation of a residual sampled every `interval` s, over `lag` in s, and its 99 % bounds if it were white.

    `share_outside` is the fraction of the lags above 0 outside the bounds, about 0.01 for white noise; `first` the
    autocorrelation at the first lag. `inputs` has the correlation with each input that changes. NaN, and no inputs,
    with too few values.
    """

    interval: float
    lag: FloatArray
    autocorrelation: FloatArray
    bound: FloatArray
    share_outside: float
    first: float
    inputs: Mapping[str, CrossCorrelation] = field(default_factory=dict)


def colour(residual: FloatArray, inputs: Mapping[str, FloatArray], interval: float) -> Colour:
    """Autocorrelation of a residual on a uniform time grid, NaN where it is missing, and correlation with inputs.

    Parameters
    ----------
    residual : any unit
        One value per `interval`.
    inputs : {name: values}
        At the same times.
    interval : s

    Returns
    -------
    colour : Colour

    Examples
    --------
    Noise that contains a fraction of its last value:

    >>> noise = np.random.default_rng(0).standard_normal(20_001)
    >>> found = colour(noise[1:] + 0.5 * noise[:-1], {}, 1e-3)
    >>> round(found.first, 1), found.share_outside > 0.01
    (0.4, True)
    """
    lag = interval * np.arange(LAGS + 1, dtype=np.float64)
    if np.isfinite(residual).sum() < FEWEST_VALUES:
        blank = np.full(LAGS + 1, np.nan)
        return Colour(interval, lag, blank, blank, np.nan, np.nan)
    r, pairs = _autocorrelation(residual)
    bound = _Z_99 / np.sqrt(np.maximum(pairs, 1.0))
    crossed = {name: _crossed(residual, values, interval) for name, values in inputs.items()}
    return Colour(
        interval, lag, r, bound, float(np.mean(np.abs(r[1:]) > bound[1:])), float(r[1]),
        {name: correlation for name, correlation in crossed.items() if correlation is not None},
    )  # fmt: skip


def effective_samples(residual: FloatArray, block: int) -> float:
    r"""Number of independent samples that would give the mean of a residual the same variance as its coloured ones.

    .. math:: n / \Big(1 + 2 \sum_l r_l\Big)

    Parameters
    ----------
    residual : any unit
        On a uniform time grid, NaN where it is missing.
    block : int
        Number of samples that are averaged first; the sum is over lags of blocks.

    Returns
    -------
    number : 1
        From 1 to the number of finite samples; NaN where there are none.

    Notes
    -----
    The sum ends before the first pair of neighbouring lags that is not positive together (Geyer 1992), so that noise
    at long lags does not count.
    """
    finite = residual[np.isfinite(residual)]
    means = block_means(residual, block)
    full = np.isfinite(means)
    if finite.size < FEWEST_VALUES or full.sum() < 2:
        return float(finite.size) if finite.size else float("nan")
    x = _centred(means)
    size = 1 << int(2 * x.size - 1).bit_length()
    power = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: x.size]
    if not power[0] > 0.0 or not np.var(finite) > 0.0:
        return float(finite.size)
    r = power / power[0]
    pairs = r[: r.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    end = int(np.argmax(pairs <= 0.0)) if np.any(pairs <= 0.0) else pairs.size
    time_constant = max(2.0 * float(pairs[:end].sum()) - 1.0, 1e-12)
    of_mean = float(np.var(means[full])) * time_constant / full.sum()
    return float(np.clip(np.var(finite) / of_mean, 1.0, finite.size))


def block_means(values: FloatArray, block: int) -> FloatArray:
    """Means of consecutive blocks of `block` values without the missing ones; an incomplete last block is dropped."""
    if block == 1:
        return values
    cut = values[: values.size // block * block].reshape(-1, block)
    finite = np.isfinite(cut)
    with np.errstate(invalid="ignore"):
        result: FloatArray = np.where(finite, cut, 0.0).sum(axis=1) / finite.sum(axis=1)
    return result


def _centred(values: FloatArray) -> FloatArray:
    """Values minus their mean, 0 where they are missing."""
    finite = np.isfinite(values)
    return np.where(finite, values - np.mean(values[finite]), 0.0)


def _autocorrelation(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Autocorrelation at lags 0 to `LAGS`, and the number of pairs for each."""
    x, counts = _centred(values), np.isfinite(values).astype(np.float64)
    sums, pairs = _products(x, x, range(LAGS + 1)), _products(counts, counts, range(LAGS + 1))
    variance = max(sums[0] / pairs[0], np.finfo(float).tiny)
    return sums / np.maximum(pairs, 1.0) / variance, pairs


def _crossed(residual: FloatArray, values: FloatArray, interval: float) -> CrossCorrelation | None:
    r"""Correlation of the residual with an input after both were filtered by the whitening filter of the input.

    .. math:: |r_l| \le 2.58 \sqrt{\sum_t e_{t+l}^2 u_t^2 \; c} \, / \, (N_l \sigma_e \sigma_u), \quad
              c = \max\Big(1, \sum_k r_{ee}(k) \, r_{uu}(k)\Big)

    Whitening is what MATLAB's `resid` does; c is Bartlett's formula for the remaining autocorrelation. The sum of
    squares replaces N because residuals and duty cycles are large at the same times, which alone would exceed plain
    bounds.
    """
    finite = values[np.isfinite(values)]
    if finite.size < FEWEST_VALUES or not np.ptp(finite) > 0.0:
        return None
    whitener = _whitener(_centred(values))
    e, u = (np.convolve(x, whitener, mode="valid") for x in (residual, values))
    if min(np.isfinite(e).sum(), np.isfinite(u).sum()) < FEWEST_VALUES:
        e, u = residual, values  # the gaps are too dense to filter: use Bartlett's formula alone
    colour_left = _autocorrelation(e)[0] * _autocorrelation(u)[0]
    spread = max(1.0, float(colour_left[0] + 2 * colour_left[1:].sum()))
    numbers = np.isfinite(e).astype(np.float64), np.isfinite(u).astype(np.float64)
    e, u = _centred(e), _centred(u)
    # sums, not dot products: on busy cores the threads of one long dot product wait for each other
    sigma = np.sqrt(np.sum(e**2) / numbers[0].sum() * np.sum(u**2) / numbers[1].sum())
    if not sigma > 0.0:
        return None
    both = range(-LAGS, LAGS + 1)
    lag = interval * np.array(both, dtype=np.float64)
    pairs = np.maximum(_products(*numbers, both), 1.0)
    r = _products(e, u, both) / pairs / sigma
    bound = _Z_99 * np.sqrt(_products(e**2, u**2, both) * spread) / pairs / sigma
    at = int(np.argmax(np.abs(r) / np.maximum(bound, np.finfo(float).tiny)))
    outside = float(np.mean(np.abs(r) > bound))
    return CrossCorrelation(lag, r, bound, outside, float(lag[at]), float(r[at]), float(bound[at]))


def _products(e: FloatArray, u: FloatArray, lags: range) -> FloatArray:
    """Sums of e_{t+l} u_t for the lags l, in chunks that fit the cache: memory bandwidth limits long recordings."""
    aside = max(abs(lag) for lag in lags)
    padded = np.concatenate([np.zeros(aside), e, np.zeros(aside)])
    sums = np.zeros(len(lags))
    for start in range(0, u.size, _CHUNK):
        piece = u[start : start + _CHUNK]
        for i, lag in enumerate(lags):
            first = start + aside + lag
            sums[i] += padded[first : first + piece.size] @ piece
    return sums


def _whitener(x: FloatArray) -> FloatArray:
    """Filter (1, -a_1, ...) whose output of `x` is white: the autoregression by the Yule-Walker equations."""
    from scipy.linalg import solve_toeplitz

    c = _products(x, x, range(_WHITENING_ORDER + 1))
    a = solve_toeplitz(c[:-1] + _RIDGE * c[0] * (np.arange(_WHITENING_ORDER) == 0), c[1:])
    return np.concatenate([[1.0], -a])

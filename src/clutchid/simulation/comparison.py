"""The inner loops of estimation: lags of sensors, and rows of the least-squares problem."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: A lag shorter than this part of a sample is taken as a shift in time.
LEAST = 0.01


@kernel
def lag_shares(q: float) -> tuple[float, float, float]:
    """Shares of the last value shown, the last sample and this in the value shown now; the lag is q samples long."""
    decay = math.exp(-1.0 / q)
    now = 1.0 - (1.0 - decay) * q
    return decay, 1.0 - decay - now, now


@kernel
def follow(x: FloatArray, q: float, shown: FloatArray) -> None:
    """What a sensor with a lag of q samples shows of the columns of x, see `sensing.lagged`."""
    last = x.shape[0] - 1
    if q < LEAST or last < 1:
        for i in range(last + 1):
            before, after = max(i - 1, 0), min(i + 1, last)
            for c in range(x.shape[1]):
                shown[i, c] = x[i, c] - (q * (x[after, c] - x[before, c]) / (after - before) if last > 0 else 0.0)
        return
    decay, of_last, of_now = lag_shares(q)
    for c in range(x.shape[1]):
        shown[0, c] = x[0, c] - q * (x[1, c] - x[0, c])
    for i in range(1, last + 1):
        for c in range(x.shape[1]):
            shown[i, c] = decay * shown[i - 1, c] + of_last * x[i - 1, c] + of_now * x[i, c]


@kernel
def follow_slope(x: FloatArray, shown: FloatArray, q: float, slope: FloatArray) -> None:
    """Derivative of `follow` to q of the last column alone; `shown` is what it gave."""
    last, c = x.shape[0] - 1, x.shape[1] - 1
    if q < LEAST or last < 1:
        for i in range(last + 1):
            before, after = max(i - 1, 0), min(i + 1, last)
            slope[i] = (x[before, c] - x[after, c]) / (after - before) if last > 0 else 0.0
        return
    decay, _, _ = lag_shares(q)
    of_decay = decay / q**2
    of_now = of_decay * q + decay - 1.0
    slope[0] = x[0, c] - x[1, c]
    for i in range(1, last + 1):
        change = of_decay * shown[i - 1, c] - (of_now + of_decay) * x[i - 1, c] + of_now * x[i, c]
        slope[i] = decay * slope[i - 1] + change


@kernel
def huber(r: float, outlier: float) -> float:
    """Squared residual, which beyond `outlier` counts linearly only (Huber 1964)."""
    size = abs(r)
    near = min(size, outlier)
    return near * (2.0 * size - near)


@kernel
def row_losses(r: FloatArray, outlier: float, cost: FloatArray) -> None:
    """Sum of `huber` over every row of residuals, into `cost`."""
    for i in range(r.shape[0]):
        cost[i] = 0.0
        for c in range(r.shape[1]):
            cost[i] += huber(r[i, c], outlier)


@kernel
def robust(rows: FloatArray, outlier: float) -> float:
    """Scale rows ``[J | r]`` in place so that their squares grow as `huber` does; the sum of it."""
    cost, last = 0.0, rows.shape[1] - 1
    for i in range(rows.shape[0]):
        r = rows[i, last]
        cost += huber(r, outlier)
        if abs(r) > outlier:
            by = math.sqrt(outlier / abs(r))
            for c in range(last + 1):
                rows[i, c] *= by
    return cost


@kernel
def compare(
    states: FloatArray,
    sens: FloatArray,
    sensors: FloatArray,
    own: NDArray[np.int64],
    measured: FloatArray,
    slopes: FloatArray,
    rows: FloatArray,
) -> int:
    """Compare a simulated window with what was measured: rows ``[J | r]`` in standard deviations, and their number.

    Parameters
    ----------
    states, sens : (samples, states), (samples, watched, columns)
        At the samples that are compared, and their derivatives to the first columns of J.
    sensors : (measured columns, 5)
        Of each measured column the state, the lag in s and the offset of its sensor; the time from sample to sample and
        the standard deviation.
    own : (measured columns, 2)
        Columns of J that are the lag and the offset of its sensor; -1 where they are not free.
    measured : (measured columns, samples)
        NaN where nothing was measured, of which no row is made.
    slopes : (columns of J,)
        Factors on these columns.
    """
    samples, columns = sens.shape[0], sens.shape[2]
    x, slope, count = np.empty((samples, columns + 1)), np.empty(samples), 0
    shown = np.empty((samples, columns + 1))
    for m in range(measured.shape[0]):
        at, tau, offset, step, sigma = int(sensors[m, 0]), sensors[m, 1], sensors[m, 2], sensors[m, 3], sensors[m, 4]
        for i in range(samples):
            for c in range(columns):
                x[i, c] = sens[i, at, c]
            x[i, columns] = states[i, at]
        follow(x, tau / step, shown)
        if own[m, 0] >= 0:
            follow_slope(x, shown, tau / step, slope)
        for i in range(samples):
            r = shown[i, columns] + (offset - measured[m, i])
            if math.isnan(r):
                continue
            for c in range(columns):
                rows[count, c] = shown[i, c] * slopes[c] / sigma
            rows[count, columns:] = 0.0
            if own[m, 0] >= 0:
                rows[count, own[m, 0]] = slope[i] * slopes[own[m, 0]] / (step * sigma)
            if own[m, 1] >= 0:
                rows[count, own[m, 1]] = slopes[own[m, 1]] / sigma
            rows[count, rows.shape[1] - 1] = r / sigma
            count += 1
    return count


@kernel
def reach(x: FloatArray, first: float) -> tuple[float, float]:
    """Least and greatest of `first` and of all x that are known."""
    low = high = first
    for value in x:
        if value < low:
            low = value
        elif value > high:
            high = value
    return low, high


@kernel
def spread(small: FloatArray, columns: NDArray[np.int64], wide: FloatArray) -> None:
    """Put the columns of `small` where they stand among more, which are 0."""
    wide[:] = 0.0
    for i in range(small.shape[0]):
        for c in range(columns.size):
            wide[i, columns[c]] = small[i, c]


@kernel
def compare_cost(states: FloatArray, sensors: FloatArray, measured: FloatArray, outlier: float) -> float:
    """The sum of `huber` over the residuals of `compare`."""
    samples, cost = states.shape[0], 0.0
    x, shown = np.empty((samples, 1)), np.empty((samples, 1))
    for m in range(measured.shape[0]):
        at, tau, offset, step, sigma = int(sensors[m, 0]), sensors[m, 1], sensors[m, 2], sensors[m, 3], sensors[m, 4]
        for i in range(samples):
            x[i, 0] = states[i, at]
        follow(x, tau / step, shown)
        for i in range(samples):
            r = (shown[i, 0] + (offset - measured[m, i])) / sigma
            if not math.isnan(r):
                cost += huber(r, outlier)
    return cost

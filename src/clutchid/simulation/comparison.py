"""Compiled inner loops of estimation: sensor lags, and residual rows of the least-squares problem."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: A lag shorter than this fraction of a sample is applied as a time shift.
SHORTEST_LAG = 0.01


@kernel
def lag_weights(q: float) -> tuple[float, float, float]:
    """Weights of the previous output, the previous sample and the present one, for a lag of q samples."""
    if q < SHORTEST_LAG:
        return 0.0, q, 1.0 - q
    decay = math.exp(-1.0 / q)
    present = 1.0 - (1.0 - decay) * q
    return decay, 1.0 - decay - present, present


@kernel
def lag_weight_slopes(q: float) -> tuple[float, float, float]:
    """Derivatives of `lag_weights` with respect to q."""
    if q < SHORTEST_LAG:
        return 0.0, 1.0, -1.0
    decay = math.exp(-1.0 / q)
    decay_slope = decay / q**2
    present = decay_slope * q + decay - 1.0
    return decay_slope, -(present + decay_slope), present


@kernel
def lag_coefficients(tau: float, dt: FloatArray, coefficients: FloatArray) -> None:
    """`lag_weights` and `lag_weight_slopes`, these with respect to tau, of a sensor in intervals dt."""
    for i in range(dt.size):
        q = tau / dt[i]
        coefficients[i, 0], coefficients[i, 1], coefficients[i, 2] = lag_weights(q)
        by_decay, by_previous, by_present = lag_weight_slopes(q)
        coefficients[i, 3] = by_decay / dt[i]
        coefficients[i, 4] = by_previous / dt[i]
        coefficients[i, 5] = by_present / dt[i]


@kernel
def apply_lag(x: FloatArray, q: float, output: FloatArray) -> None:
    """Output of a sensor with a lag of q samples for the columns of x, see `sensors.lagged`."""
    last = x.shape[0] - 1
    if q < SHORTEST_LAG or last < 1:
        for i in range(last + 1):
            before, after = max(i - 1, 0), min(i + 1, last)
            for c in range(x.shape[1]):
                output[i, c] = x[i, c] - (q * (x[after, c] - x[before, c]) / (after - before) if last > 0 else 0.0)
        return
    decay, last_weight, weight = lag_weights(q)
    for c in range(x.shape[1]):
        output[0, c] = x[0, c] - q * (x[1, c] - x[0, c])
    for i in range(1, last + 1):
        for c in range(x.shape[1]):
            output[i, c] = decay * output[i - 1, c] + last_weight * x[i - 1, c] + weight * x[i, c]


@kernel
def lag_derivative(x: FloatArray, output: FloatArray, q: float, slope: FloatArray) -> None:
    """Derivative of `apply_lag` with respect to q, for the last column alone; `output` is its result."""
    last, c = x.shape[0] - 1, x.shape[1] - 1
    if q < SHORTEST_LAG or last < 1:
        for i in range(last + 1):
            before, after = max(i - 1, 0), min(i + 1, last)
            slope[i] = (x[before, c] - x[after, c]) / (after - before) if last > 0 else 0.0
        return
    decay, _, _ = lag_weights(q)
    by_decay, by_previous, by_present = lag_weight_slopes(q)
    slope[0] = x[0, c] - x[1, c]
    for i in range(1, last + 1):
        change = by_decay * output[i - 1, c] + by_previous * x[i - 1, c] + by_present * x[i, c]
        slope[i] = decay * slope[i - 1] + change


@kernel
def huber(r: float, outlier: float) -> float:
    """Huber loss (1964): the squared residual, linear beyond `outlier`."""
    size = abs(r)
    clipped = min(size, outlier)
    return clipped * (2.0 * size - clipped)


@kernel
def row_losses(r: FloatArray, outlier: float, cost: FloatArray) -> None:
    """Sum of `huber` over every row of residuals, into `cost`."""
    for i in range(r.shape[0]):
        cost[i] = 0.0
        for c in range(r.shape[1]):
            cost[i] += huber(r[i, c], outlier)


@kernel
def downweight_outliers(rows: FloatArray, outlier: float) -> float:
    """Scale rows ``[J | r]`` in place so that the squares of r are their Huber losses; the sum of the losses."""
    cost, last = 0.0, rows.shape[1] - 1
    for i in range(rows.shape[0]):
        r = rows[i, last]
        cost += huber(r, outlier)
        if abs(r) > outlier:
            weight = math.sqrt(outlier / abs(r))
            for c in range(last + 1):
                rows[i, c] *= weight
    return cost


@kernel
def compare(
    states: FloatArray,
    sens: FloatArray,
    sensors: FloatArray,
    sensor_columns: NDArray[np.int64],
    measured: FloatArray,
    slopes: FloatArray,
    rows: FloatArray,
) -> int:
    """Compare a simulated window with the measurement: rows ``[J | r]`` in standard deviations, and their number.

    Parameters
    ----------
    states, sens : (samples, states), (samples, watched, columns)
        At the compared samples, and their derivatives with respect to the first columns of J.
    sensors : (measured columns, 5)
        For each measured column: index of its state, lag in s and offset of its sensor, sample interval in s, standard
        deviation.
    sensor_columns : (measured columns, 2)
        Columns of J of the lag and the offset of each sensor; -1 if fixed.
    measured : (measured columns, samples)
        NaN where nothing was measured: these samples have no row.
    slopes : (columns of J,)
        Factors on these columns.
    """
    samples, columns = sens.shape[0], sens.shape[2]
    x, slope, count = np.empty((samples, columns + 1)), np.empty(samples), 0
    output = np.empty((samples, columns + 1))
    for m in range(measured.shape[0]):
        at, tau, offset, step, sigma = int(sensors[m, 0]), sensors[m, 1], sensors[m, 2], sensors[m, 3], sensors[m, 4]
        for i in range(samples):
            for c in range(columns):
                x[i, c] = sens[i, at, c]
            x[i, columns] = states[i, at]
        apply_lag(x, tau / step, output)
        if sensor_columns[m, 0] >= 0:
            lag_derivative(x, output, tau / step, slope)
        for i in range(samples):
            r = output[i, columns] + (offset - measured[m, i])
            if math.isnan(r):
                continue
            for c in range(columns):
                rows[count, c] = output[i, c] * slopes[c] / sigma
            rows[count, columns:] = 0.0
            if sensor_columns[m, 0] >= 0:
                rows[count, sensor_columns[m, 0]] = slope[i] * slopes[sensor_columns[m, 0]] / (step * sigma)
            if sensor_columns[m, 1] >= 0:
                rows[count, sensor_columns[m, 1]] = slopes[sensor_columns[m, 1]] / sigma
            rows[count, rows.shape[1] - 1] = r / sigma
            count += 1
    return count


@kernel
def value_range(x: FloatArray, first: float) -> tuple[float, float]:
    """Minimum and maximum of `first` and of all x that are not NaN."""
    low = high = first
    for value in x:
        if value < low:
            low = value
        elif value > high:
            high = value
    return low, high


@kernel
def scatter_columns(small: FloatArray, columns: NDArray[np.int64], wide: FloatArray) -> None:
    """Copy the columns of `small` to `columns` of `wide`, whose other columns become 0."""
    wide[:] = 0.0
    for i in range(small.shape[0]):
        for c in range(columns.size):
            wide[i, columns[c]] = small[i, c]


@kernel
def compare_cost(states: FloatArray, sensors: FloatArray, measured: FloatArray, outlier: float) -> float:
    """The sum of `huber` over the residuals of `compare`."""
    samples, cost = states.shape[0], 0.0
    x, output = np.empty((samples, 1)), np.empty((samples, 1))
    for m in range(measured.shape[0]):
        at, tau, offset, step, sigma = int(sensors[m, 0]), sensors[m, 1], sensors[m, 2], sensors[m, 3], sensors[m, 4]
        for i in range(samples):
            x[i, 0] = states[i, at]
        apply_lag(x, tau / step, output)
        for i in range(samples):
            r = (output[i, 0] + (offset - measured[m, i])) / sigma
            if not math.isnan(r):
                cost += huber(r, outlier)
    return cost

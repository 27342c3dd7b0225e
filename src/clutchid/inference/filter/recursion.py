"""One recursion of the filter: `predict` moves state and columns over an interval, `correct` takes one measurement.

The state x has the n states of the model, then the output of each sensor, because a first-order lag is a state of its
own. Its covariance P = L L' is carried as the square root L, so it stays positive and has twice the digits. L stands
beside k columns dx of derivatives with respect to free parameters, ``S = [dx | L]``, because the model moves both
alike; with given gains S has no L. Nothing is allocated: the caller makes all arrays once.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clutchid.codegen.kernels import inlined, kernel
from clutchid.inference.filter.setup import (
    LAG,
    OFFSET,
    OUTPUT,
    STATE,
    FilterOutput,
    FilterState,
    IntArray,
    Intervals,
    Measurements,
    ModelArrays,
    Scratch,
)
from clutchid.log import FloatArray


@inlined
def move_sensors(x: FloatArray, S: FloatArray, before: FloatArray, sensors: IntArray, lags: FloatArray) -> None:
    """Move the outputs of the sensors over an interval, in which a measured state is a straight line.

    Parameters
    ----------
    x, S : (size,), (size, columns)
        The model's states are those at the end of the interval, the outputs still those at its start.
    before : (sensors, 1 + columns)
        The measured states at the start of the interval, each with its row of S.
    lags : (sensors, 6)
        Coefficients a, b, c of each lag, and their derivatives with respect to it.
    """
    for m in range(sensors.shape[0]):
        output, state, a, b, c = sensors[m, OUTPUT], sensors[m, STATE], lags[m, 0], lags[m, 1], lags[m, 2]
        by_lag = lags[m, 3] * x[output] + lags[m, 4] * before[m, 0] + lags[m, 5] * x[state]
        x[output] = a * x[output] + b * before[m, 0] + c * x[state]
        for j in range(S.shape[1]):
            S[output, j] = a * S[output, j] + b * before[m, 1 + j] + c * S[state, j]
        if sensors[m, LAG] >= 0:
            S[output, sensors[m, LAG]] += by_lag


@kernel
def add_process_noise(S: FloatArray, sigma: FloatArray, sensors: IntArray, shares: FloatArray, W: FloatArray) -> None:
    """Replace L in S by the lower triangular square root of ``L L' + Q Q'``.

    Parameters
    ----------
    sigma : (n,)
        Standard deviation of the process noise of each state of the model. The noise moves a state at the end of the
        interval.
    shares : (sensors,)
        Of the noise of a measured state in the output of its sensor: the coefficients c of its lag.
    W : (size, size + n)
        Scratch, ``[L | Q]``.
    """
    size, n = W.shape[0], sigma.size
    k = S.shape[1] - size
    for i in range(size):
        for j in range(size):
            W[i, j] = S[i, k + j]
        for j in range(n):
            W[i, size + j] = 0.0
    for i in range(n):
        W[i, size + i] = sigma[i]
    for m in range(sensors.shape[0]):
        W[sensors[m, OUTPUT], size + sensors[m, STATE]] = shares[m] * sigma[sensors[m, STATE]]
    triangularise(W)
    for i in range(size):
        for j in range(size):
            S[i, k + j] = W[i, j]


@inlined
def step_model(
    step: Callable[..., bool],
    x: FloatArray,
    S: FloatArray,
    u: FloatArray,
    length: float,
    substeps: int,
    model: ModelArrays,
) -> bool:
    """The generated `step` over an interval; whether the state is finite."""
    m = model
    return step(
        x, S, u, m.p, length, substeps, m.breakpoints, m.load, m.basis, m.table_basis, m.table_column, m.fill_slot,
        m.fill_row, m.fill_column, m.work,
    )  # fmt: skip


@inlined
def move(
    step: Callable[..., bool],
    x: FloatArray,
    S: FloatArray,
    model: ModelArrays,
    interval: tuple[FloatArray, float, int],
    sensors: IntArray,
    lags: FloatArray,
    before: FloatArray,
) -> bool:
    """`predict` without process noise; `interval` are its inputs, length in s and steps."""
    u, length, substeps = interval
    for m in range(sensors.shape[0]):
        before[m, 0] = x[sensors[m, STATE]]
        for j in range(S.shape[1]):
            before[m, 1 + j] = S[sensors[m, STATE], j]
    finite = step_model(step, x, S, u, length, substeps, model)
    move_sensors(x, S, before, sensors, lags)
    return finite


@kernel
def predict(
    step: Callable[..., bool],
    x: FloatArray,
    S: FloatArray,
    model: ModelArrays,
    interval: tuple[FloatArray, float, int, FloatArray, FloatArray],
    sensors: IntArray,
    scratch: Scratch,
) -> bool:
    """Move state and columns over an interval; whether the state is finite.

    Parameters
    ----------
    step
        Generated step of the model variant. It moves the first n rows of x and S.
    x, S : (size,), (size, columns)
        In SI; S in units of x per free parameter, and of x in the columns of L. In place.
    interval
        A row of each of `Intervals`.
    """
    u, length, substeps, sigma, lags = interval
    finite = move(step, x, S, model, (u, length, substeps), sensors, lags, scratch.before)
    if scratch.W.shape[0] > 0:
        add_process_noise(S, sigma, sensors, lags[:, 2], scratch.W)
    return finite


@kernel
def correct(
    x: FloatArray,
    S: FloatArray,
    sensor: IntArray,
    measurement: tuple[float, float, float, float],
    given: bool,
    h: FloatArray,
    gain: FloatArray,
) -> float:
    """Correct state and columns by one measurement; the innovation, in the unit of the measurement.

    Parameters
    ----------
    x, S : (size,), (size, columns)
        In place.
    sensor : (4,)
        A row of `sensors`.
    measurement
        Value, offset of the sensor, its standard deviation, and the standard deviations beyond which an innovation is
        an outlier.
    given : bool
        Whether `gain` is given; then S has no L. Otherwise `gain` receives the optimal one.
    h : (columns,)
        Receives the derivatives of the predicted measurement: the row of its output in S, 1 for its offset.
    gain : (size + 1,)
        Gain of each state, and the variance of the innovation.
    """
    value, offset, sigma, outlier = measurement
    size, k = x.size, S.shape[1] if given else S.shape[1] - x.size
    for j in range(h.size):
        h[j] = S[sensor[OUTPUT], j]
    if sensor[OFFSET] >= 0:
        h[sensor[OFFSET]] += 1.0
    e = value - (x[sensor[OUTPUT]] + offset)
    if not given:
        update_covariance(S, h, e, sigma, outlier, gain)
    for i in range(size):
        x[i] += gain[i] * e
        for j in range(k):
            S[i, j] -= gain[i] * h[j]
    return float(e)


@kernel
def update_covariance(S: FloatArray, h: FloatArray, e: float, sigma: float, outlier: float, gain: FloatArray) -> None:
    """Optimal gain of one measurement, and L after it (Potter's update of the square root).

    An innovation e beyond `outlier` standard deviations moves the state as if its sensor were as much worse as makes
    its share of the correction constant (Huber). Units and shapes as in `correct`.
    """
    size = S.shape[0]
    k = S.shape[1] - size
    predicted = 0.0
    for j in range(k, k + size):
        predicted += h[j] * h[j]
    s = predicted + sigma * sigma
    weighted = s * max(1.0, abs(e) / math.sqrt(s) / outlier)
    update_root(S, h, predicted, weighted, gain)
    gain[size] = s


@kernel
def update_root(S: FloatArray, h: FloatArray, predicted: float, weighted: float, gain: FloatArray) -> None:
    """Gain of a measurement and L after it, if its innovation has variance `weighted`, of which `predicted` is L's."""
    size = S.shape[0]
    k = S.shape[1] - size
    share = 1.0 / (1.0 + math.sqrt((weighted - predicted) / weighted))
    for i in range(size):
        covariance = 0.0
        for j in range(k, k + size):
            covariance += S[i, j] * h[j]
        gain[i] = covariance / weighted
        for j in range(k, k + size):
            S[i, j] -= share * gain[i] * h[j]


@kernel
def write_row(row: FloatArray, h: FloatArray, e: float, s: float, outlier: float) -> None:
    """Row ``[dr | r]`` of the standardised residual r = -e / sqrt(s), scaled so that r^2 grows as |e| for outliers."""
    scale = 1.0 / math.sqrt(s)
    scale *= math.sqrt(min(1.0, outlier / max(abs(e) * scale, 1e-300)))
    k = row.size - 1
    for j in range(k):
        row[j] = h[j] * scale
    row[k] = -e * scale


@kernel
def correct_sample(
    x: FloatArray,
    S: FloatArray,
    sensors: IntArray,
    values: FloatArray,
    measurements: Measurements,
    given: bool,
    h: FloatArray,
    gains: FloatArray,
    rows: FloatArray,
    errors: FloatArray,
) -> None:
    """`correct` by each measurement of a sample, `values`, in turn; `rows` and `errors` as in `FilterOutput`."""
    of_sensor, outlier = measurements.of_sensor, measurements.outlier
    for m in range(sensors.shape[0]):
        if math.isnan(values[m]):
            errors[m] = np.nan
            rows[m] = 0.0
            continue
        measurement = values[m], of_sensor[m, 0], of_sensor[m, 1], outlier
        errors[m, 0] = correct(x, S, sensors[m], measurement, given, h, gains[m])
        errors[m, 1] = gains[m, x.size]
        write_row(rows[m], h, errors[m, 0], errors[m, 1], outlier)


@kernel
def follow(
    step: Callable[..., bool],
    state: FilterState,
    model: ModelArrays,
    intervals: Intervals,
    sensors: IntArray,
    measurements: Measurements,
    gains: FloatArray,
    output: FilterOutput,
    scratch: Scratch,
    span: tuple[int, int, int],
) -> int:
    """Filter some samples of a segment in place; the first that is not finite, or -1.

    Parameters
    ----------
    state
        x and S after the sample before; before the first sample, those predicted for it.
    gains : (samples, sensors, size + 1)
        Given if the scratch matrix W is empty, otherwise received, see `correct`.
    output
        Its rows begin with the first of the samples, the other arrays with the segment.
    span
        First sample, the one after the last, and the state whose derivatives and deviation are written.
    """
    x, S, out = state.x, state.S, output
    u, length, substeps, sigma, lags = intervals
    begin, end, at = span
    n, k, given = out.states.shape[1], out.rows.shape[2] - 1, scratch.W.shape[0] == 0
    for i in range(begin, end):
        if i > 0:
            interval = u[i - 1], length[i - 1], int(substeps[i - 1]), sigma[i - 1], lags[i - 1]
            if not predict(step, x, S, model, interval, sensors, scratch):
                return i
        values = measurements.values[i]
        correct_sample(
            x, S, sensors, values, measurements, given, scratch.h, gains[i], out.rows[i - begin], out.errors[i]
        )
        square = 0.0
        for j in range(k, S.shape[1]):
            square += S[at, j] * S[at, j]
        out.states[i] = x[:n]
        out.watched[i, :k] = S[at, :k]
        out.watched[i, k] = math.sqrt(square)
    return -1


@kernel
def triangularise(W: FloatArray) -> None:
    """Make ``[A, B]`` lower triangular in place by Householder reflections of its columns, which keep W W'.

    A has as many columns as rows; B is 0 where the number of the column exceeds that of the row. Slices show
    the compiler that rows do not overlap: it is three times as fast with them.
    """
    n, width = W.shape
    for i in range(n):
        end = min(width, n + i + 1)
        pivot = W[i, i:end]
        square = 0.0
        for c in range(pivot.size):
            square += pivot[c] * pivot[c]
        if square == 0.0:
            continue
        norm = -math.copysign(math.sqrt(square), pivot[0])
        beta = 1.0 / (square - pivot[0] * norm)
        pivot[0] -= norm
        for j in range(i + 1, n):
            row, dot = W[j, i:end], 0.0
            for c in range(pivot.size):
                dot += pivot[c] * row[c]
            dot *= beta
            for c in range(pivot.size):
                row[c] -= dot * pivot[c]
        pivot[0] = norm
        for c in range(1, pivot.size):
            pivot[c] = 0.0

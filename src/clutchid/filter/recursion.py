"""One sample of the filter: sensors and process noise, measurements taken in, derivatives carried along.

The filter's state is that of the model with what each sensor shows behind it, because a sensor of first order is a
state of its own. Its covariance P = L L' is carried as the square root L, so it stays positive and is accurate to twice
the digits. The columns of L and the derivatives of the state to the free parameters are one matrix ``S = [dx | L]``,
because the model moves both alike. ``W = [L | Q]`` is L beside the square root of the process noise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: Places in the array of what is known of the sensors: lags in s, offsets and standard deviations, one a sensor; then
#: where an error becomes an outlier, in standard deviations.
TAU, OFFSET, SIGMA, OUTLIER = 0, 2, 4, 6

#: What the filter writes, sample by sample, in this order: rows (samples, 2, k + 1), ``[d r | r]`` with r = predicted -
#: measured over its deviation, 0 for none; the errors of prediction and their variances (samples, 2, 2), NaN for none;
#: the states of the model that it ends each sample with (samples, n); the derivatives of the pressure in chamber A and
#: its standard deviation (samples, k + 1).
FilterOutput = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


@kernel
def triangularise(W: FloatArray) -> None:
    """Turn the columns of a wide matrix, in place, until it is lower triangular; W W' stays (Householder)."""
    n, width = W.shape
    for i in range(n):
        square = 0.0
        for c in range(i, width):
            square += W[i, c] * W[i, c]
        if square == 0.0:
            continue
        norm = -math.copysign(math.sqrt(square), W[i, i])
        beta = 1.0 / (square - W[i, i] * norm)
        W[i, i] -= norm
        for j in range(i + 1, n):
            dot = 0.0
            for c in range(i, width):
                dot += W[j, c] * W[i, c]
            for c in range(i, width):
                W[j, c] -= beta * dot * W[i, c]
        W[i, i] = norm
        for c in range(i + 1, width):
            W[i, c] = 0.0


@kernel
def weigh(W: FloatArray, seen: FloatArray, e: float, sigma: float, outlier: float, gain: FloatArray) -> None:
    """How one measurement moves the state, and what is then left of its covariance, in place (Potter).

    Parameters
    ----------
    W : (n, 2 n)
        Square root of the covariance.
    seen : (k + 2 n,)
        The predicted measurement as a row of ``[dx | W]``.
    e, sigma : the unit of the measurement
        What was measured beyond what was predicted, and the deviation of the sensor.
    outlier : 1
        An error beyond so many standard deviations moves the state as if it came from so much worse a sensor.
    gain : (n + 1,)
        Receives the gain of every state, and the variance of the error of prediction.
    """
    n, width = W.shape
    k = seen.size - width
    known = 0.0
    for c in range(width):
        known += seen[k + c] * seen[k + c]
    s = known + sigma * sigma
    taken = s * max(1.0, abs(e) / math.sqrt(s) / outlier)
    part = 1.0 / (1.0 + math.sqrt((taken - known) / taken))
    for i in range(n):
        moved = 0.0
        for c in range(width):
            moved += W[i, c] * seen[k + c]
        moved /= taken
        gain[i] = moved
        for c in range(width):
            W[i, c] -= part * moved * seen[k + c]
    gain[n] = s


@kernel
def correct(x: FloatArray, S: FloatArray, gain: FloatArray, seen: FloatArray, e: float, k: int) -> None:
    """Move the state by its gain of an error, and its derivatives with it: ``dx <- (I - K C) dx``."""
    for i in range(x.size):
        x[i] += gain[i] * e
        for c in range(k):
            S[i, c] -= gain[i] * seen[c]


@kernel
def show(
    x: FloatArray,
    S: FloatArray,
    before: FloatArray,
    lags: FloatArray,
    own: NDArray[np.int64],
    state: NDArray[np.int64],
) -> None:
    """Move what the sensors show from the sample before to this one; between them a state is a straight line.

    Parameters
    ----------
    x, S : (n + 2,), (n + 2, columns)
        The model's states are those of this sample, the last two rows, one a sensor, still those of the one before.
    before : (2, 1 + columns)
        The measured states of the sample before, each with its row of S.
    lags : (2, 6)
        Of each sensor, see `sensors.lag_coefficients`.
    state : (2,)
        Which state a sensor measures.
    """
    n = x.size - state.size
    for m in range(state.size):
        at = state[m]
        decay, of_last, of_now = lags[m, 0], lags[m, 1], lags[m, 2]
        by_lag = lags[m, 3] * x[n + m] + lags[m, 4] * before[m, 0] + lags[m, 5] * x[at]
        x[n + m] = decay * x[n + m] + of_last * before[m, 0] + of_now * x[at]
        for c in range(S.shape[1]):
            S[n + m, c] = decay * S[n + m, c] + of_last * before[m, 1 + c] + of_now * S[at, c]
        if own[TAU + m] >= 0:
            S[n + m, own[TAU + m]] += by_lag


@kernel
def write(row: FloatArray, error: FloatArray, seen: FloatArray, e: float, s: float, outlier: float) -> None:
    """Keep an error of prediction with its variance, and its row; beyond `outlier` deviations it counts linearly."""
    error[0] = e
    error[1] = s
    scale = 1.0 / math.sqrt(s)
    scale *= math.sqrt(min(1.0, outlier / max(abs(e) * scale, 1e-300)))
    for c in range(row.size - 1):
        row[c] = seen[c] * scale
    row[row.size - 1] = -e * scale


@kernel
def leave(row: FloatArray, error: FloatArray) -> None:
    """Keep that nothing was measured."""
    error[0] = np.nan
    error[1] = np.nan
    for c in range(row.size):
        row[c] = 0.0


@kernel
def beside(S: FloatArray, noise: FloatArray, lags: FloatArray, state: NDArray[np.int64]) -> FloatArray:
    """``W = [L | Q]``: the square root in the last columns of S beside that of the process noise.

    The noise of an interval moves a state at its end, and what its sensor shows by the share of the last sample.
    """
    size, n = S.shape[0], noise.size
    k = S.shape[1] - size
    W = np.zeros((size, size + n))
    for i in range(size):
        for c in range(size):
            W[i, c] = S[i, k + c]
    for i in range(n):
        W[i, size + i] = noise[i]
    for m in range(state.size):
        W[n + m, size + state[m]] = lags[m, 2] * noise[state[m]]
    return W


@kernel
def keep(
    x: FloatArray,
    S: FloatArray,
    W: FloatArray,
    before: FloatArray,
    state: NDArray[np.int64],
    states: FloatArray,
    pressure: FloatArray,
) -> None:
    """Put the square root back into S, and write down what the sample ends with."""
    k, p_A = pressure.size - 1, state[1]
    square = 0.0
    for c in range(min(W.shape[1], x.size)):
        square += W[p_A, c] * W[p_A, c]
        for i in range(x.size):
            S[i, k + c] = W[i, c]
    for i in range(states.size):
        states[i] = x[i]
    for m in range(state.size):
        before[m, 0] = x[state[m]]
        for c in range(S.shape[1]):
            before[m, 1 + c] = S[state[m], c]
    for c in range(k):
        pressure[c] = S[p_A, c]
    pressure[k] = math.sqrt(square)


@kernel
def update(
    at: int,
    first: bool,
    now: tuple[FloatArray, FloatArray, FloatArray],
    measured: FloatArray,
    noise: FloatArray,
    lags: FloatArray,
    sensors: FloatArray,
    own: NDArray[np.int64],
    state: NDArray[np.int64],
    gains: FloatArray,
    output: FilterOutput,
    fixed: bool,
) -> None:
    """Sample `at`: from the state that the model has predicted, in place, to the one corrected by its measurements.

    Parameters
    ----------
    at : sample
        Its number in the arrays.
    first : bool
        No interval lies before the sample.
    now : (n + 2,), (n + 2, k + n + 2), (2, 1 + k + n + 2)
        State and ``S = [dx | L]``, of which the model has moved the first n rows, and `before` as in `show`.
    measured : (samples, 2)
        Position and pressure; NaN where there is none, or it is not in use.
    noise : (samples, n)
        Standard deviation of the process noise of the interval before each sample.
    lags : (samples, 2, 6)
        Of the sensors in the interval before each sample, see `sensors.lag_coefficients`.
    sensors, own
        What is known of the sensors; columns of tau_y, tau_p, e_y and e_p in S, or -1.
    state : (2,)
        Which states are measured.
    gains : (samples, 2, n + 3)
        Receives the gain of every state and the variance of each error of prediction.
    output : FilterOutput
        Receives what the filter finds.
    fixed : bool
        Take the gains as they are instead: then S has no columns for L.
    """
    x, S, before = now
    rows, errors, states, pressures = output
    size, k = x.size, rows.shape[2] - 1
    n = size - state.size
    if not first:
        show(x, S, before, lags[at], own, state)
    W = np.zeros((size, 0)) if fixed else beside(S, noise[at], lags[at], state)
    row = np.empty(k + W.shape[1])
    for m in range(state.size):
        value = measured[at, m]
        if value != value:  # noqa: PLR0124, NaN: the filter goes on without it
            leave(rows[at, m], errors[at, m])
            continue
        row[:k] = S[n + m, :k]
        row[k:] = W[n + m]
        if own[OFFSET + m] >= 0:
            row[own[OFFSET + m]] += 1.0
        e = value - (x[n + m] + sensors[OFFSET + m])
        gain = gains[at, m]
        if not fixed:
            weigh(W, row, e, sensors[SIGMA + m], sensors[OUTLIER], gain)
        correct(x, S, gain, row, e, k)
        write(rows[at, m], errors[at, m], row, e, gain[size], sensors[OUTLIER])
    if not fixed:
        triangularise(W)
    keep(x, S, W, before, state, states[at], pressures[at])

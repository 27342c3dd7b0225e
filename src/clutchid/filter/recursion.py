"""One sample of the filter: measurements taken in, derivatives carried along, process noise added.

The covariance P = L L' of the state is carried as its square root L, so it stays positive and is accurate to twice the
digits. The columns of L and the derivatives of the state to the free numbers stand in one matrix ``S = [dx | L]``,
because the model moves both alike. ``W = [L | Q]`` is L beside the square root of the process noise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: Places in the array of numbers of the sensors: lags, offsets and deviations; where an error becomes an outlier.
TAU, OFFSET, SIGMA, OUTLIER = 0, 2, 4, 6


#: What the filter writes, sample by sample, in this order: rows (samples, 2, k + 1), ``[d r | r]`` with r = predicted -
#: measured over its deviation, 0 for none; the errors of prediction and their variances (samples, 2, 2), NaN for none;
#: the states that it ends each sample with (samples, n); the derivatives of the pressure in chamber A and its standard
#: deviation (samples, k + 1).
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
def see_position(x: FloatArray, S: FloatArray, W: FloatArray, lag: float, seen: FloatArray) -> float:
    """The rate that the lag of the position sensor sees; `seen` receives y - lag v as a row of ``[dx | W]``."""
    k = seen.size - W.shape[1]
    for c in range(k):
        seen[c] = S[0, c] - lag * S[1, c]
    for c in range(W.shape[1]):
        seen[k + c] = W[0, c] - lag * W[1, c]
    return float(x[1])


@kernel
def see_pressure(
    x: FloatArray, S: FloatArray, W: FloatArray, before: FloatArray, steps: float, lag: float, seen: FloatArray
) -> float:
    """The rate that the lag of the pressure sensor sees; `seen` receives p_A - lag dp_A/dt as a row of ``[dx | W]``.

    `before` are the pressure after the sample before and its row of S, `steps` one over the interval since.
    """
    n, k = W.shape[1] // 2, seen.size - W.shape[1]
    part = lag * steps
    for c in range(k):
        seen[c] = S[2, c] - part * (S[2, c] - before[1 + c])
    for c in range(n):
        seen[k + c] = W[2, c] - part * (W[2, c] - before[1 + k + c])
        seen[k + n + c] = W[2, n + c]
    return float(steps * (x[2] - before[0]))


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
def beside(S: FloatArray, noise: FloatArray) -> FloatArray:
    """``W = [L | Q]``: the square root in the last columns of S beside that of the process noise."""
    n = noise.size
    k = S.shape[1] - n
    W = np.zeros((n, 2 * n))
    for i in range(n):
        for c in range(n):
            W[i, c] = S[i, k + c]
        W[i, n + i] = noise[i]
    return W


@kernel
def keep(
    x: FloatArray, S: FloatArray, W: FloatArray, before: FloatArray, state: FloatArray, pressure: FloatArray
) -> None:
    """Put the square root back into S, and write down what the sample ends with."""
    n, k = x.size, pressure.size - 1
    square = 0.0
    for c in range(W.shape[1] // 2):
        square += W[2, c] * W[2, c]
        for i in range(n):
            S[i, k + c] = W[i, c]
    for i in range(n):
        state[i] = x[i]
    before[0] = x[2]
    for c in range(S.shape[1]):
        before[1 + c] = S[2, c]
    for c in range(k):
        pressure[c] = S[2, c]
    pressure[k] = math.sqrt(square)


@kernel
def update(
    at: int,
    steps: float,
    now: tuple[FloatArray, FloatArray, FloatArray],
    measured: FloatArray,
    noise: FloatArray,
    sensors: FloatArray,
    own: NDArray[np.int64],
    gains: FloatArray,
    told: FilterOutput,
    held: bool,
) -> None:
    """Sample `at`: from the predicted state, in place, to the one that knows the measurements of this sample too.

    Parameters
    ----------
    at : sample
        Its number in the segment.
    steps : 1/s
        One over the interval before the sample, 0 at the first.
    now : (n,), (n, k + n), (1 + k + n,)
        State, ``S = [dx | L]`` as the model has moved them, and `before` as in `see_pressure`.
    measured : (samples, 2)
        Position and pressure; NaN where there is none, or it is not in use.
    noise : (samples, n)
        Deviation of the process noise of the interval before each sample.
    sensors, own
        Numbers of the sensors; columns of tau_y, tau_p, e_y and e_p in S, or -1.
    gains : (samples, 2, n + 1)
        Receives the gain of every state and the variance of each error of prediction.
    told : FilterOutput
        Receives what the filter finds.
    held : bool
        Take the gains as they are instead: then S has no columns for L.
    """
    x, S, before = now
    rows, errors, states, pressures = told
    n, k = x.size, rows.shape[2] - 1
    W = np.zeros((n, 0)) if held else beside(S, noise[at])
    seen = np.empty(k + W.shape[1])
    for sensor in (1, 0):  # the lag of the pressure is about the sample before, which the position must not have moved
        value = measured[at, sensor]
        if value != value:  # noqa: PLR0124, NaN: the filter goes on without it
            leave(rows[at, sensor], errors[at, sensor])
            continue
        lag = sensors[TAU + sensor]
        rate = see_position(x, S, W, lag, seen) if sensor == 0 else see_pressure(x, S, W, before, steps, lag, seen)
        if own[TAU + sensor] >= 0:
            seen[own[TAU + sensor]] -= rate
        if own[OFFSET + sensor] >= 0:
            seen[own[OFFSET + sensor]] += 1.0
        e = value - (x[2 * sensor] - lag * rate + sensors[OFFSET + sensor])
        gain = gains[at, sensor]
        if not held:
            weigh(W, seen, e, sensors[SIGMA + sensor], sensors[OUTLIER], gain)
        correct(x, S, gain, seen, e, k)
        write(rows[at, sensor], errors[at, sensor], seen, e, gain[n], sensors[OUTLIER])
    if not held:
        triangularise(W)
    keep(x, S, W, before, states[at], pressures[at])

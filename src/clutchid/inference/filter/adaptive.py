"""The recursion of the adaptive observer: constant gains by a Lyapunov function, no covariance.

What the piston has moved further than predicted since the last sample, e, is the integral of the velocity's error. The
position becomes the measured one; e corrects the velocity, the air q_A = p_A V_A of chamber A along A_A / V_A, and the
load weights along -phi(y). See docs/derivations_online.md for the function that does not grow. Nothing is allocated.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clutchid.codegen.kernels import kernel
from clutchid.codegen.linked import by_address
from clutchid.inference.filter.joint_parameters import basis_at, refresh, steps_at, within
from clutchid.inference.filter.recursion import move
from clutchid.inference.filter.references import AdaptiveNumbers, AdaptiveState
from clutchid.inference.filter.setup import (
    OUTPUT_ROW,
    STATE,
    FilterArrays,
    FilterOutput,
    FreeArrays,
    Intervals,
    ModelArrays,
)
from clutchid.log import FloatArray, IntArray

by_address(AdaptiveState)


@kernel
def adapt_weights(
    theta: FloatArray, T: FloatArray, free: FreeArrays, slopes: FloatArray, h: FloatArray, e: float, w: FloatArray
) -> None:
    """Move theta by -T T' h e within its bounds; h (k,) is phi(y), w (m,) is scratch."""
    w[:] = 0.0
    for i in range(T.shape[0]):
        if h[i] != 0.0:
            for j in range(min(i + 1, w.size)):
                w[j] += T[i, j] * (h[i] * slopes[i])
    for i in range(T.shape[0]):
        moved = theta[i]
        for j in range(min(i + 1, w.size)):
            moved -= T[i, j] * w[j] * e
        theta[i] = within(free.numbers[i], moved)


@kernel
def correct_position(
    x: FloatArray, e: float, model: ModelArrays, sensor: IntArray, numbers: AdaptiveNumbers, gain: float
) -> None:
    """Correct position and output of its sensor by e in m, and the air q_A = p_A V_A by gain A_A / V_A e.

    V_A is that in the middle of the old position and the new one: at either of them it goes with the noise in e, and
    the air would drift by gain (A_A / V_A)^2 times the variance of the noise a sample.
    """
    volume, area = model.p[numbers.at_volume], model.p[numbers.at_area]
    before = volume + area * x[sensor[STATE]]
    after = before + area * e
    q = x[numbers.at_pressure] * before + gain * area / (0.5 * (before + after)) * e
    x[numbers.at_pressure] = q / after
    x[sensor[OUTPUT_ROW]] += e
    x[sensor[STATE]] += e


@kernel
def correct_sample_adaptively(state: AdaptiveState, value: float, arrays: FilterArrays, errors: FloatArray) -> bool:
    """Correct by the position of a sample; whether theta has moved.

    Only the position is corrected after samples without one, for nobody knows when the piston has moved, and while it
    is at rest, as measured and as predicted, where friction balances an error of the forces. An innovation beyond the
    outliers counts as one at their bound, and theta does not follow it.

    Parameters
    ----------
    errors : (2,)
        Receives innovation and variance of the sensor, NaN for none.
    """
    x, average, follows, sensor = state.x, state.average, state.known, arrays.sensors[0]
    model, settings, scratch, numbers = arrays.model, arrays.settings, arrays.scratch, arrays.settings.reference
    offset, sigma = arrays.derived.of_sensor[0, 0], arrays.derived.of_sensor[0, 1]
    at_speed, at_position = settings.at_speed, settings.at_position
    errors[:] = np.nan
    if math.isnan(value):
        follows[0] = 0
        return False
    e = value - (x[sensor[OUTPUT_ROW]] + offset)
    bound = settings.outlier * sigma
    errors[0], errors[1] = e, sigma * sigma
    if follows[0] == 0:
        correct_position(x, e, model, sensor, numbers, 0.0)
        follows[0], average[0] = 1, x[at_position]
        return False
    inside, e = abs(e) <= bound, min(max(e, -bound), bound)
    middle = x[at_position] + 0.5 * e
    moves = abs(x[at_speed]) > settings.least_speed or abs(x[at_position] + e - average[0]) > bound
    correct_position(x, e, model, sensor, numbers, numbers.air if moves else 0.0)
    average[0] += numbers.share * (x[at_position] - average[0])
    if moves:
        x[at_speed] += numbers.velocity * e
    if moves and inside:
        basis_at(middle, model, arrays.free, scratch.step)
        slopes, gain = arrays.derived.slopes, numbers.adaptation * e
        adapt_weights(state.theta, state.T, arrays.free, slopes, scratch.step, gain, scratch.w)
    return bool(moves and inside)


@kernel
def follow_adaptively(
    step: Callable[..., bool],
    prepare: Callable[..., None],
    state: AdaptiveState,
    arrays: FilterArrays,
    intervals: Intervals,
    values: FloatArray,
    output: FilterOutput,
    span: tuple[int, int, int],
) -> int:
    """Observe some samples of a segment in place; the first that is not finite, or -1.

    Parameters as of `recursion.follow_segment`; T is a root of the gains of the weights; there are no columns and no
    drift.
    """
    u, length, substeps, lags = intervals.inputs, intervals.length, intervals.substeps, intervals.lags
    begin, end, _ = span
    x, at_speed, at_position = state.x, arrays.settings.at_speed, arrays.settings.at_position
    model, none, before = arrays.model, arrays.scratch.S, arrays.scratch.before
    output.deviations[:] = np.nan
    refresh(prepare, state.theta, arrays.free, arrays.derived, model)
    for i in range(begin, end):
        row = i - begin
        if i > 0:
            steps = steps_at(arrays.pace, x[at_position], x[at_speed], length[i - 1], int(substeps[i - 1]))
            interval = u[i - 1], length[i - 1], steps
            if not move(step, x, none, model, interval, arrays.sensors, lags[i - 1], before):
                return i
        if correct_sample_adaptively(state, values[i, 0], arrays, output.errors[row, 0]):
            refresh(prepare, state.theta, arrays.free, arrays.derived, model)
        output.states[row] = x[: output.states.shape[1]]
    return -1

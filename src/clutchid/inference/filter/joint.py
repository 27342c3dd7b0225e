"""The recursion of the joint filter: states, load weights and parameters, corrected by one measurement after another.

The filter is the two-stage one of Friedland (1969), which is the Kalman filter of states and parameters together. The
error of the state x is ``D dtheta + L n``, with dtheta the error of the parameters, whose covariance is T T', and n
independent of it. So D are derivatives with respect to the parameters that the model moves like L, and T does
not change between corrections. Potter's update keeps both L and T roots of covariances. Nothing is allocated.

D is with respect to the parameters in SI, theta are their coordinates with a prior of mean 0 and standard deviation 1,
and T is in theta.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clutchid.codegen.kernels import inlined, kernel
from clutchid.inference.filter.joint_parameters import move_parameters, refresh, state_deviations, steps_at
from clutchid.inference.filter.recursion import add_process_noise, move, triangularise, update_root
from clutchid.inference.filter.setup import (
    LAG,
    OFFSET,
    OUTPUT,
    STROKE_BEGINS,
    STROKE_ENDS,
    Derived,
    FreeArrays,
    IntArray,
    Intervals,
    JointOutput,
    JointScratch,
    JointState,
    ModelArrays,
    SettingsArrays,
    Window,
)
from clutchid.inference.filter.transition import AHEAD, MARGIN, bring_up, place_window
from clutchid.log import FloatArray
from clutchid.simulation.comparison import lag_coefficients
from clutchid.simulation.stiffness import Pace


@inlined
def move_columns(
    step: Callable[..., bool],
    x: FloatArray,
    columns: FloatArray,
    waiting: FloatArray,
    model: ModelArrays,
    interval: tuple[FloatArray, FloatArray, int, FloatArray, FloatArray],
    lags: FloatArray,
    sensors: IntArray,
    before: FloatArray,
) -> bool:
    """Move x and columns (size, c) over an interval, see `recursion.move`; its process noise waits for a correction.

    Parameters
    ----------
    waiting : (n + sensors,)
        Process noise since the last correction, see `JointState`.
    interval
        Inputs, length in s (1,), steps, process noise, coefficients of the sensors' lags, as in `recursion.predict`.
    lags : (sensors,)
        Of the sensors in s: where one is free, its coefficients are computed anew.
    """
    u, length, substeps, sigma, coefficients = interval
    for m in range(sensors.shape[0]):
        if sensors[m, LAG] >= 0:
            lag_coefficients(lags[m], length, coefficients[m : m + 1])
    for i in range(sigma.size):
        waiting[i] += sigma[i] * sigma[i]
    for m in range(sensors.shape[0]):
        waiting[sigma.size + m] = coefficients[m, 2]
    return move(step, x, columns, model, (u, length[0], substeps), sensors, coefficients, before)


@inlined
def leaves(x: FloatArray, settings: SettingsArrays, length: float, within: FloatArray) -> bool:
    """Whether the piston may leave positions (2,) in m in an interval of a length in s."""
    reach = MARGIN + AHEAD * abs(x[settings.at_speed]) * length
    position = x[settings.at_position]
    return bool(position - reach < within[0] or position + reach > within[1])


@kernel
def add_waiting_noise(state: JointState, sensors: IntArray, scratch: JointScratch) -> None:
    """Add the process noise since the last correction to the covariance of the states."""
    waiting, sigma = state.waiting, scratch.h
    n = waiting.size - sensors.shape[0]
    for i in range(n):
        sigma[i] = math.sqrt(waiting[i])
        waiting[i] = 0.0
    add_process_noise(state.S, sigma[:n], sensors, waiting[n:], scratch.W)


@kernel
def project_parameters(T: FloatArray, h: FloatArray, slopes: FloatArray, w: FloatArray) -> float:
    """The variance w' w of a predicted measurement due to the parameters, and w, with its derivatives h in SI."""
    w[:] = 0.0
    for i in range(T.shape[0]):
        for j in range(w.size):
            w[j] += T[i, j] * (h[i] * slopes[i])
    variance = 0.0
    for j in range(w.size):
        variance += w[j] * w[j]
    return variance


@kernel
def update_parameters(
    T: FloatArray, w: FloatArray, e: float, weighted: float, predicted: float, step: FloatArray
) -> None:
    """Step of theta by an innovation e of variance `weighted`, of which `predicted` is T's, and T after it (Potter)."""
    share = 1.0 / (1.0 + math.sqrt((weighted - predicted) / weighted))
    for i in range(T.shape[0]):
        covariance = 0.0
        for j in range(w.size):
            covariance += T[i, j] * w[j]
        covariance /= weighted
        step[i] = covariance * e
        for j in range(w.size):
            T[i, j] -= share * covariance * w[j]


@kernel
def correct_jointly(
    state: JointState,
    sensor: IntArray,
    measurement: tuple[float, float, float, float],
    adapts: bool,
    free: FreeArrays,
    slopes: FloatArray,
    scratch: JointScratch,
) -> float:
    """Correct states and, if it `adapts`, parameters by one measurement; the innovation, in its unit.

    Parameters
    ----------
    state
        In place.
    sensor
        A row of `sensors`, see `recursion`.
    measurement
        Value; offset and standard deviation of the sensor; standard deviations beyond which an innovation is an outlier
        (Huber, see `recursion.update_covariance`).
    slopes : (k,)
        Derivatives of the free parameters in SI with respect to theta.
    scratch
        Its gain receives the gain of x with fixed parameters and the variance of the innovation.
    """
    x, S, theta, T = state.x, state.S, state.theta, state.T
    value, offset, sigma, outlier = measurement
    h, gain, w, step = scratch.h, scratch.gain, scratch.w, scratch.step
    size, k = x.size, theta.size
    for j in range(k + size):
        h[j] = S[sensor[OUTPUT], j]
    if sensor[OFFSET] >= 0:
        h[sensor[OFFSET]] += 1.0
    e = value - (x[sensor[OUTPUT]] + offset)
    by_states = 0.0
    for j in range(k, k + size):
        by_states += h[j] * h[j]
    by_parameters = project_parameters(T, h, slopes, w)
    s = by_states + by_parameters + sigma * sigma
    weighted = s * max(1.0, abs(e) / math.sqrt(s) / outlier)
    update_root(S, h, by_states, weighted - by_parameters, gain)
    gain[size] = s
    for i in range(size):
        x[i] += gain[i] * e
        for j in range(k):
            S[i, j] -= gain[i] * h[j]
    if adapts:
        update_parameters(T, w, e, weighted, by_parameters, step)
        move_parameters(x, S, theta, free, step)
    return float(e)


@kernel
def correct_sample_jointly(
    prepare: Callable[..., None],
    state: JointState,
    model: ModelArrays,
    free: FreeArrays,
    derived: Derived,
    sensors: IntArray,
    values: FloatArray,
    settings: SettingsArrays,
    errors: FloatArray,
    scratch: JointScratch,
) -> None:
    """Add the process noise since the last correction, and correct by each measurement of a sample.

    Parameters
    ----------
    values : (sensors,)
        NaN for none.
    errors : (sensors, 2)
        Receives the innovations and their variances, NaN for none.
    """
    of_sensor = derived.of_sensor
    add_waiting_noise(state, sensors, scratch)
    adapts = abs(state.x[settings.at_speed]) > settings.least_speed
    for m in range(sensors.shape[0]):
        errors[m] = np.nan
        if not math.isnan(values[m]):
            measurement = values[m], of_sensor[m, 0], of_sensor[m, 1], settings.outlier
            errors[m, 0] = correct_jointly(state, sensors[m], measurement, adapts, free, derived.slopes, scratch)
            errors[m, 1] = scratch.gain[state.x.size]
            if adapts:
                refresh(prepare, state.theta, free, derived, model)


@kernel
def stroke_ends(stroke: IntArray, position: float) -> bool:
    """Whether a stroke ends with this position in m; `stroke` (1,) is 1 while one lasts."""
    if position > STROKE_BEGINS:
        stroke[0] = 1
    ends = stroke[0] == 1 and position < STROKE_ENDS
    if ends:
        stroke[0] = 0
    return bool(ends)


@kernel
def drift(T: FloatArray, root: FloatArray, W: FloatArray) -> None:
    """Add root root' to the covariance T T' of the parameters; the states move with them along D.

    Parameters
    ----------
    T : (k, k)
        Lower triangular after it.
    root : (k, d)
        Lower trapezoidal.
    W : (k, k + d)
        Scratch.
    """
    k = T.shape[0]
    W[:, :k] = T
    W[:, k:] = root
    triangularise(W)
    T[:] = W[:, :k]


@kernel
def follow_jointly(
    step: Callable[..., bool],
    prepare: Callable[..., None],
    state: JointState,
    model: ModelArrays,
    free: FreeArrays,
    derived: Derived,
    intervals: Intervals,
    sensors: IntArray,
    values: FloatArray,
    settings: SettingsArrays,
    drifts: FloatArray,
    pace: Pace,
    output: JointOutput,
    scratch: JointScratch,
    window: Window,
    span: tuple[int, int, int],
) -> int:
    """Filter some samples of a segment in place; the first that is not finite, or -1.

    Parameters
    ----------
    step, prepare
        Generated functions of the model variant.
    state
        After the sample before; before the first sample, that predicted for it.
    sensors
        See `recursion`; the columns of their lags are those of `transition`, as in `model`.
    values : (samples, sensors)
        Measurements, NaN for none.
    drifts : (k, d)
        Root of the covariance that theta gains in a stroke, as for `drift`; d = 0 for none.
    pace
        Integration steps by position and speed, see `steps_at`.
    span
        First sample, and the one after the last; number of sample 0 since the filter started.
    """
    u, length, substeps, sigma, lags = intervals
    errors, states, deviations = output
    begin, end, number = span
    x, at_speed, at_position = state.x, settings.at_speed, settings.at_position
    refresh(prepare, state.theta, free, derived, model)
    place_window(state.first[0], window, free.pieces, model.breakpoints)
    for i in range(begin, end):
        errors[i - begin] = np.nan
        deviations[i - begin] = np.nan
        if i > 0:
            steps = steps_at(pace, x[at_position], x[at_speed], length[i - 1], int(substeps[i - 1]))
            interval = u[i - 1], length[i - 1 : i], steps, sigma[i - 1], lags[i - 1]
            if leaves(x, settings, length[i - 1], window.within):
                bring_up(state, window, free.pieces, model.breakpoints, x[at_position])
            if not move_columns(
                step, x, state.moved, state.waiting, model, interval, derived.lags, sensors, scratch.before
            ):
                return i
        if (number + i) % settings.every == 0:
            bring_up(state, window, free.pieces, model.breakpoints, x[at_position])
            correct_sample_jointly(
                prepare, state, model, free, derived, sensors, values[i], settings, errors[i - begin], scratch
            )
            state_deviations(state.S, state.T, derived.slopes, deviations[i - begin], scratch.w)
        if stroke_ends(state.stroke, x[at_position]) and drifts.size > 0:
            drift(state.T, drifts, scratch.room)
        states[i - begin] = x[: states.shape[1]]
    return -1

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
from clutchid.inference.filter.joint_parameters import basis_at, refresh, steps_at, within
from clutchid.inference.filter.recursion import move
from clutchid.inference.filter.rules import AdaptiveNumbers
from clutchid.inference.filter.setup import (
    OUTPUT,
    STATE,
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
from clutchid.log import FloatArray
from clutchid.simulation.stiffness import Pace


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
    x: FloatArray, e: float, model: ModelArrays, sensor: IntArray, rule: AdaptiveNumbers, gain: float
) -> None:
    """Correct position and output of its sensor by e in m, and the air q_A = p_A V_A by gain A_A / V_A e.

    V_A is that in the middle of the old position and the new one: at either of them it goes with the noise in e, and
    the air would drift by gain (A_A / V_A)^2 times the variance of the noise a sample.
    """
    volume, area = model.p[rule.at_volume], model.p[rule.at_area]
    before = volume + area * x[sensor[STATE]]
    after = before + area * e
    q = x[rule.at_pressure] * before + gain * area / (0.5 * (before + after)) * e
    x[rule.at_pressure] = q / after
    x[sensor[OUTPUT]] += e
    x[sensor[STATE]] += e


@kernel
def correct_sample_adaptively(
    state: JointState,
    value: float,
    model: ModelArrays,
    free: FreeArrays,
    derived: Derived,
    sensor: IntArray,
    settings: SettingsArrays,
    errors: FloatArray,
    scratch: JointScratch,
) -> bool:
    """Correct by the position of a sample; whether theta has moved.

    Only the position is corrected after samples without one, for nobody knows when the piston has moved, and while it
    is at rest, as measured and as predicted, where friction balances an error of the forces. An innovation beyond the
    outliers counts as one at their bound, and theta does not follow it.

    Parameters
    ----------
    errors : (2,)
        Receives innovation and variance of the sensor, NaN for none.
    """
    x, memory, rule, of_sensor = state.x, state.waiting, settings.rule, derived.of_sensor
    at_speed, at_position = settings.at_speed, settings.at_position
    follows, average = memory.size - 2, memory.size - 1
    errors[:] = np.nan
    if math.isnan(value):
        memory[follows] = 0.0
        return False
    e = value - (x[sensor[OUTPUT]] + of_sensor[0, 0])
    bound = settings.outlier * of_sensor[0, 1]
    errors[0], errors[1] = e, of_sensor[0, 1] * of_sensor[0, 1]
    if memory[follows] == 0.0:
        correct_position(x, e, model, sensor, rule, 0.0)
        memory[follows], memory[average] = 1.0, x[at_position]
        return False
    inside, e = abs(e) <= bound, min(max(e, -bound), bound)
    middle = x[at_position] + 0.5 * e
    moves = abs(x[at_speed]) > settings.least_speed or abs(x[at_position] + e - memory[average]) > bound
    correct_position(x, e, model, sensor, rule, rule.air if moves else 0.0)
    memory[average] += rule.share * (x[at_position] - memory[average])
    if moves:
        x[at_speed] += rule.velocity * e
    if moves and inside:
        basis_at(middle, model, free, scratch.step)
        adapt_weights(state.theta, state.T, free, derived.slopes, scratch.step, rule.adaptation * e, scratch.w)
    return bool(moves and inside)


@kernel
def follow_adaptively(
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
    _drifts: FloatArray,
    pace: Pace,
    output: JointOutput,
    scratch: JointScratch,
    _window: Window,
    span: tuple[int, int, int],
) -> int:
    """Observe some samples of a segment in place; the first that is not finite, or -1.

    Parameters as of `joint.follow_jointly`; T is a root of the gains of the weights, S has no columns, and there is no
    drift.
    """
    u, length, substeps, _, lags = intervals
    errors, states, deviations = output
    begin, end, _ = span
    x, at_speed, at_position = state.x, settings.at_speed, settings.at_position
    deviations[:] = np.nan
    refresh(prepare, state.theta, free, derived, model)
    for i in range(begin, end):
        if i > 0:
            steps = steps_at(pace, x[at_position], x[at_speed], length[i - 1], int(substeps[i - 1]))
            interval = u[i - 1], length[i - 1], steps
            if not move(step, x, state.S, model, interval, sensors, lags[i - 1], scratch.before):
                return i
        if correct_sample_adaptively(
            state, values[i, 0], model, free, derived, sensors[0], settings, errors[i - begin, 0], scratch
        ):
            refresh(prepare, state.theta, free, derived, model)
        states[i - begin] = x[: states.shape[1]]
    return -1

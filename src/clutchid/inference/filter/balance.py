"""The recursion of least squares on the balance of forces: the load weights from position and duty cycles.

The piston moves as it was measured, smoothed; the generated step moves it so if its mass is very large, and what its
velocity gains is then the impulse of pressure, load, friction and stops. Pressure and temperature follow the duty
cycles in open loop. Over a window of samples in motion ``M dv - impulse = h' dtheta``, one equation for the weights,
with their covariance T T' as in `recursion`. Smoothing needs samples on both sides, so there are two states that move
so: the present one, which is reported, and a late one, whose forces are in balance. Nothing is allocated.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clutchid.codegen.kernels import kernel
from clutchid.codegen.linked import by_address
from clutchid.inference.filter.joint_parameters import basis_at, refresh, steps_at, within
from clutchid.inference.filter.recursion import project_parameters, step_model, update_parameters
from clutchid.inference.filter.references import BalanceState
from clutchid.inference.filter.setup import (
    FilterArrays,
    FilterOutput,
    FreeArrays,
    Intervals,
    ModelArrays,
    Scratch,
    SettingsArrays,
)
from clutchid.log import FloatArray

#: Mass in kg whose velocity the forces do not change, but in digits that are left of it.
_PRESCRIBED = 1e9

#: Rows of the smoothing weights: position and velocity late, position of the newest sample.
LATE, _LATE_SPEED, _NEWEST = range(3)


by_address(BalanceState)


@kernel
def correct_balance(
    state: BalanceState,
    equation: tuple[float, float, float],
    h: FloatArray,
    free: FreeArrays,
    slopes: FloatArray,
    scratch: Scratch,
) -> float:
    """One step of recursive least squares: theta and T; the variance of the residual.

    Parameters
    ----------
    equation
        Residual e = h' dtheta + noise in N s, standard deviation of its noise, and standard deviations beyond which it
        is an outlier.
    h : (k,)
        With respect to the weights in SI.
    """
    theta, T, w, step = state.theta, state.T, scratch.w, scratch.step
    e, sigma, outlier = equation
    by_weights = project_parameters(T, h, slopes, w)
    s = by_weights + sigma * sigma
    update_parameters(T, w, s * max(1.0, abs(e) / math.sqrt(s) / outlier), by_weights, step, scratch.turns)
    for j in range(theta.size):
        theta[j] = within(free.numbers[j], theta[j] + step[j] * e)
    return s


@kernel
def move_prescribed(
    step: Callable[..., bool],
    x: FloatArray,
    S: FloatArray,
    model: ModelArrays,
    interval: tuple[FloatArray, float, int],
    settings: SettingsArrays,
    to: float,
) -> tuple[bool, float]:
    """Move the piston in a straight line, and all else with it; whether x is finite, and the impulse on it in N s.

    Parameters
    ----------
    interval
        Inputs, length in s, steps.
    to
        Position in m, and largest speed in m/s.
    """
    u, length, substeps = interval
    at_speed, at_position = settings.at_speed, settings.at_position
    top = settings.reference.top
    speed = min(max((to - x[at_position]) / length, -top), top)
    reached = x[at_position] + speed * length
    x[at_speed] = speed
    finite = step_model(step, x, S, u, length, substeps, model)
    impulse = _PRESCRIBED * (x[at_speed] - speed)
    x[at_speed], x[at_position] = speed, reached
    return finite, impulse


@kernel
def close_window(state: BalanceState, arrays: FilterArrays, errors: FloatArray) -> None:
    """Correct the weights by the balance of a window, and begin the next one; `errors` (2,) are in N and N^2."""
    settings, seconds, e = arrays.settings, state.seconds[0], state.momentum[0] - state.impulse[0]
    equation = e, settings.reference.force * seconds, settings.outlier
    variance = correct_balance(state, equation, state.h, arrays.free, arrays.derived.slopes, arrays.scratch)
    errors[0], errors[1] = e / seconds, variance / (seconds * seconds)
    state.in_window[0], state.momentum[0], state.impulse[0], state.seconds[0] = 0, 0.0, 0.0, 0.0
    state.h[:] = 0.0


@kernel
def move_late(step: Callable[..., bool], state: BalanceState, arrays: FilterArrays) -> bool:
    """Move the late state by the oldest interval, and add its balance to the window if the piston moves.

    What mass times velocity gained, the impulse, and its derivatives are summed. Returns whether the state is finite.
    """
    settings, h, late, oldest = arrays.settings, arrays.scratch.step, state.late, state.intervals[0]
    numbers, at_speed, at_position = settings.reference, settings.at_speed, settings.at_position
    length = oldest[oldest.size - 1]
    speed = smoothed(numbers.smoothing[_LATE_SPEED], state.positions)
    to = smoothed(numbers.smoothing[LATE], state.positions)
    middle = 0.5 * (late[at_position] + to)
    steps = steps_at(arrays.pace, late[at_position], late[at_speed], length, 1)
    interval = oldest[: oldest.size - 1], length, steps
    finite, impulse = move_prescribed(step, late, arrays.scratch.S, arrays.model, interval, settings, to)
    if state.usable[0] >= state.positions.size and abs(late[at_speed]) > settings.least_speed:
        basis_at(middle, arrays.model, arrays.free, h)
        state.in_window[0] += 1
        state.momentum[0] += numbers.mass * (speed - state.speed[0])
        state.impulse[0] += impulse
        state.seconds[0] += length
        for j in range(h.size):
            state.h[j] -= h[j] * length
    state.speed[0] = speed
    return finite


@kernel
def move_both(
    step: Callable[..., bool], state: BalanceState, arrays: FilterArrays, sample: tuple[FloatArray, float, float]
) -> bool:
    """Move the present state and the late one by the inputs, length in s and position in m of a new sample.

    Returns whether both are finite.
    """
    x, settings = state.x, arrays.settings
    u, length, value = sample
    take_position(state, value)
    take_interval(state.intervals, u, length)
    finite = True
    if state.intervals[0, u.size] > 0.0:
        finite = move_late(step, state, arrays)
    steps = steps_at(arrays.pace, x[settings.at_position], x[settings.at_speed], length, 1)
    to = smoothed(settings.reference.smoothing[_NEWEST], state.positions)
    interval = u, length, steps
    return move_prescribed(step, x, arrays.scratch.S, arrays.model, interval, settings, to)[0] and finite


@kernel
def follow_balance(
    step: Callable[..., bool],
    prepare: Callable[..., None],
    state: BalanceState,
    arrays: FilterArrays,
    intervals: Intervals,
    values: FloatArray,
    output: FilterOutput,
    span: tuple[int, int, int],
) -> int:
    """Follow some samples of a segment in place; the first that is not finite, or -1.

    Parameters as of `recursion.follow_segment`, but there are no columns.
    """
    x, model, settings, derived = state.x, arrays.model, arrays.settings, arrays.derived
    at_position = settings.at_position
    output.errors[:], output.deviations[:] = np.nan, np.nan
    model.p[settings.reference.at_mass] = _PRESCRIBED
    prepare(model.p, model.fill_slot, model.work)
    refresh(prepare, state.theta, arrays.free, derived, model)
    for i in range(span[0], span[1]):
        value, row = values[i, 0] - derived.of_sensor[0, 0], i - span[0]
        if i == 0:
            state.late[:] = x
            state.positions[:] = x[at_position] if math.isnan(value) else value
        else:
            sample = intervals.inputs[i - 1], intervals.length[i - 1], value
            if not move_both(step, state, arrays, sample):
                return i
        if state.in_window[0] >= settings.every:
            close_window(state, arrays, output.errors[row, 0])
            refresh(prepare, state.theta, arrays.free, derived, model)
        output.states[row] = x[: output.states.shape[1]]
    return -1


#: A position further from the last one than this in m for each sample since is left out: faster than any piston.
_REACH = 1e-3

#: For each sample without a usable position so many with one must follow before the balance counts again: the pressure
#: in open loop knows nothing of how the piston moved meanwhile, until the chamber is vented. Provenance:
#: docs/derivations_online.md.
_RENEWAL = 2


@kernel
def take_position(state: BalanceState, value: float) -> None:
    """Put a position behind the others; where it is missing, or no piston can have reached it, the last one again."""
    positions, usable, missing = state.positions, state.usable, state.missing
    last = positions.size - 1
    newest = positions[last]
    for i in range(last):
        positions[i] = positions[i + 1]
    usable_value = not math.isnan(value) and abs(value - newest) <= _REACH * (1.0 + missing[0])
    positions[last] = value if usable_value else newest
    usable[0] = usable[0] + 1 if usable_value else min(usable[0], 0) - _RENEWAL
    missing[0] = 0 if usable_value else missing[0] + 1


@kernel
def smoothed(weights: FloatArray, positions: FloatArray) -> float:
    """The sum of the last positions with weights."""
    total = 0.0
    for j in range(weights.size):
        total += weights[j] * positions[j]
    return total


@kernel
def take_interval(intervals: FloatArray, u: FloatArray, length: float) -> None:
    """Put inputs and length in s of an interval behind the others; the oldest is lost."""
    last = intervals.shape[0] - 1
    for i in range(last):
        intervals[i] = intervals[i + 1]
    intervals[last, : u.size] = u
    intervals[last, u.size] = length

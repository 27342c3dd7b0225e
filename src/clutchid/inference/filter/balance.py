"""The recursion of least squares on the balance of forces: the load weights from position and duty cycles.

The piston moves as it was measured, smoothed; the generated step moves it so if its mass is very large, and what its
velocity gains is then the impulse of pressure, load, friction and stops. Pressure and temperature follow the duty
cycles in open loop. Over a window of samples in motion ``M dv - impulse = h' dtheta``, one equation for the weights,
with their covariance T T' as in `joint`. Smoothing needs samples on both sides, so there are two states that move so:
the present one, which is reported, and a late one, whose forces are in balance. Nothing is allocated.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clutchid.codegen.kernels import kernel
from clutchid.inference.filter.joint import drift, project_parameters, stroke_ends, update_parameters
from clutchid.inference.filter.joint_parameters import basis_at, refresh, steps_at, within
from clutchid.inference.filter.recursion import step_model
from clutchid.inference.filter.setup import (
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

#: Mass in kg whose velocity the forces do not change, but in digits that are left of it.
PRESCRIBED = 1e9

#: Rows of the smoothing weights: position and velocity late, position of the newest sample.
LATE, LATE_SPEED, NEWEST = range(3)


@kernel
def correct_balance(
    state: JointState,
    equation: tuple[float, float, float],
    h: FloatArray,
    free: FreeArrays,
    slopes: FloatArray,
    scratch: JointScratch,
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
    update_parameters(T, w, e, s * max(1.0, abs(e) / math.sqrt(s) / outlier), by_weights, step)
    for j in range(theta.size):
        theta[j] = within(free.numbers[j], theta[j] + step[j])
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
    top = settings.rule.top
    speed = min(max((to - x[at_position]) / length, -top), top)
    reached = x[at_position] + speed * length
    x[at_speed] = speed
    finite = step_model(step, x, S, u, length, substeps, model)
    impulse = PRESCRIBED * (x[at_speed] - speed)
    x[at_speed], x[at_position] = speed, reached
    return finite, impulse


@kernel
def close_window(
    state: JointState,
    memory: FloatArray,
    free: FreeArrays,
    slopes: FloatArray,
    settings: SettingsArrays,
    errors: FloatArray,
    scratch: JointScratch,
) -> None:
    """Correct the weights by the balance of a window, and begin the next one; `errors` (2,) are in N and N^2."""
    seconds, e = memory[SECONDS], memory[MASS_TIMES_SPEED] - memory[IMPULSE]
    end = HEAD + state.theta.size
    h, equation = memory[HEAD:end], (e, settings.rule.force * seconds, settings.outlier)
    variance = correct_balance(state, equation, h, free, slopes, scratch)
    errors[0], errors[1] = e / seconds, variance / (seconds * seconds)
    memory[IN_WINDOW:end] = 0.0


@kernel
def move_late(
    step: Callable[..., bool],
    late: FloatArray,
    S: FloatArray,
    memory: FloatArray,
    model: ModelArrays,
    oldest: FloatArray,
    free: FreeArrays,
    settings: SettingsArrays,
    pace: Pace,
    h: FloatArray,
) -> bool:
    """Move the late state by the oldest interval, and add its balance to the window if the piston moves.

    Returns whether the state is finite.
    """
    smoothing, at_speed, at_position = settings.rule.smoothing, settings.at_speed, settings.at_position
    before = HEAD + h.size
    length = oldest[oldest.size - 1]
    speed = smoothed(smoothing[LATE_SPEED], memory, before + 1)
    to = smoothed(smoothing[LATE], memory, before + 1)
    middle = 0.5 * (late[at_position] + to)
    steps = steps_at(pace, late[at_position], late[at_speed], length, 1)
    interval = oldest[: oldest.size - 1], length, steps
    finite, impulse = move_prescribed(step, late, S, model, interval, settings, to)
    if memory[AGE] >= smoothing.shape[1] and abs(late[at_speed]) > settings.least_speed:
        basis_at(middle, model, free, h)
        add_to_window(memory, h, settings.rule.mass * (speed - memory[before]), impulse, length)
    memory[before] = speed
    return finite


@kernel
def move_both(
    step: Callable[..., bool],
    state: JointState,
    model: ModelArrays,
    free: FreeArrays,
    settings: SettingsArrays,
    pace: Pace,
    sample: tuple[FloatArray, float, float],
    scratch: JointScratch,
) -> bool:
    """Move the present state and the late one by the inputs, length in s and position in m of a new sample.

    Returns whether both are finite.
    """
    x, S, smoothing = state.x, state.S, settings.rule.smoothing
    u, length, value = sample
    late, memory = state.waiting[: x.size], state.waiting[x.size :]
    positions, samples = HEAD + state.theta.size + 1, smoothing.shape[1]
    take_position(memory, positions, samples, value)
    take_interval(memory, positions + samples, u, length)
    oldest = memory[positions + samples : positions + samples + u.size + 1]
    finite = True
    if oldest[u.size] > 0.0:
        finite = move_late(step, late, S, memory, model, oldest, free, settings, pace, scratch.step)
    steps = steps_at(pace, x[settings.at_position], x[settings.at_speed], length, 1)
    to = smoothed(smoothing[NEWEST], memory, positions)
    return move_prescribed(step, x, S, model, (u, length, steps), settings, to)[0] and finite


@kernel
def begin(state: JointState, value: float, at_position: int, samples: int) -> None:
    """The memory before the first interval: the piston has been where it is first measured."""
    x, waiting = state.x, state.waiting
    first = x.size + HEAD + state.theta.size + 1
    waiting[: x.size] = x
    waiting[first : first + samples] = x[at_position] if math.isnan(value) else value


@kernel
def follow_balance(
    step: Callable[..., bool],
    prepare: Callable[..., None],
    state: JointState,
    model: ModelArrays,
    free: FreeArrays,
    derived: Derived,
    intervals: Intervals,
    _sensors: IntArray,
    values: FloatArray,
    settings: SettingsArrays,
    drifts: FloatArray,
    pace: Pace,
    output: JointOutput,
    scratch: JointScratch,
    _window: Window,
    span: tuple[int, int, int],
) -> int:
    """Follow some samples of a segment in place; the first that is not finite, or -1.

    Parameters as of `joint.follow_jointly`, but S has no columns.
    """
    errors, states, deviations = output
    x, rule, at_position = state.x, settings.rule, settings.at_position
    memory = state.waiting[x.size :]
    errors[:], deviations[:] = np.nan, np.nan
    model.p[rule.at_mass] = PRESCRIBED
    prepare(model.p, model.fill_slot, model.work)
    refresh(prepare, state.theta, free, derived, model)
    for i in range(span[0], span[1]):
        value, row = values[i, 0] - derived.of_sensor[0, 0], i - span[0]
        if i == 0:
            begin(state, value, at_position, rule.smoothing.shape[1])
        else:
            sample = intervals.inputs[i - 1], intervals.length[i - 1], value
            if not move_both(step, state, model, free, settings, pace, sample, scratch):
                return i
        if memory[IN_WINDOW] >= settings.every:
            close_window(state, memory, free, derived.slopes, settings, errors[row, 0], scratch)
            refresh(prepare, state.theta, free, derived, model)
        if stroke_ends(state.stroke, state.waiting[at_position]) and drifts.size > 0:
            drift(state.T, drifts, scratch.room)
        states[row] = x[: states.shape[1]]
    return -1


#: A position further from the last one than this in m for each sample since is left out: faster than any piston.
REACH = 1e-3

#: For each sample without a usable position so many with one must follow before the balance counts again: the pressure
#: in open loop knows nothing of how the piston moved meanwhile, until the chamber is vented. Provenance:
#: docs/derivations_online.md.
RENEWAL = 2.0

#: What stands in `JointState.waiting` behind the late state (size,): usable positions in a row, less than 0 while more
#: have to follow; missing ones in a row; intervals in the window, with what mass times velocity gained, impulse and
#: length; derivatives with respect to the weights (k,); late velocity; the last positions (samples,) and intervals
#: (late + 1, inputs + 1), the oldest first.
AGE, MISSING, IN_WINDOW, MASS_TIMES_SPEED, IMPULSE, SECONDS, HEAD = range(7)


@kernel
def push(memory: FloatArray, first: int, width: int, count: int) -> None:
    """Move `count` rows of `width` numbers up by one: the oldest is lost, the last is free."""
    for i in range(first, first + (count - 1) * width):
        memory[i] = memory[i + width]


@kernel
def take_position(memory: FloatArray, first: int, samples: int, value: float) -> None:
    """Put a position behind the others; one that is missing, or that no piston can have reached, is as the last."""
    last = first + samples - 1
    newest = memory[last]
    push(memory, first, 1, samples)
    usable = not math.isnan(value) and abs(value - newest) <= REACH * (1.0 + memory[MISSING])
    memory[last] = value if usable else newest
    memory[AGE] = memory[AGE] + 1.0 if usable else min(memory[AGE], 0.0) - RENEWAL
    memory[MISSING] = 0.0 if usable else memory[MISSING] + 1.0


@kernel
def smoothed(weights: FloatArray, memory: FloatArray, first: int) -> float:
    """The sum of the last positions with weights."""
    total = 0.0
    for j in range(weights.size):
        total += weights[j] * memory[first + j]
    return total


@kernel
def take_interval(memory: FloatArray, first: int, u: FloatArray, length: float) -> None:
    """Put inputs and length in s of an interval behind the others."""
    width = u.size + 1
    count = (memory.size - first) // width
    push(memory, first, width, count)
    at = first + (count - 1) * width
    memory[at : at + u.size] = u
    memory[at + u.size] = length


@kernel
def add_to_window(memory: FloatArray, h: FloatArray, gained: float, impulse: float, length: float) -> None:
    """Add what mass times velocity gained in an interval, the impulse, and its derivatives, to those of the window."""
    memory[IN_WINDOW] += 1.0
    memory[MASS_TIMES_SPEED] += gained
    memory[IMPULSE] += impulse
    memory[SECONDS] += length
    for j in range(h.size):
        memory[HEAD + j] -= h[j] * length

"""One Kalman filter, along a recording: states, and parameters beside them, moved and corrected sample by sample.

The state x has the n states of the model, then the output of each sensor, because a first-order lag is a state of its
own. The filter is the two-stage one of Friedland (1969), which is the Kalman filter of states and parameters together:
the error of x is ``D dtheta + L n``, with dtheta the error of the parameters, whose covariance is T T', and n
independent of it. So D are derivatives with respect to the parameters, which the model moves like L, ``S = [D | L]``,
and T changes by corrections only. Potter's update keeps L a root of a covariance, and Carlson's keeps T lower
triangular, so covariances stay positive and have twice the digits.

On line a correction takes the time of several samples, and a control unit cannot do all of it in one. So the recursion
has the same schedule: a correction by a sample is computed from what the filter knew there, and acts just before the
next one is due, moved on by Phi and Gamma (`begin_correction`, `end_correction`). What the parameters gain in a stroke
is added to T a column at each of the next corrections. Nothing else is known in between, so a filter
that starts anew, or a state that is stored, never sees half of a correction.

A control unit must not need the time of several samples for a late one. So over the samples missing before it x moves
alone, and the parts of a correction are counted in samples, not in time.

References
----------
Carlson, N. A., Fast triangular formulation of the square root filter, AIAA Journal 11 (1973) 1259-1265.

Where T has no columns no parameter adapts, and D are the derivatives that a fit needs (prediction error); with given
gains S has no L. D is with respect to the parameters in SI, theta are their coordinates with a prior of mean 0 and
standard deviation 1, and T is in theta. Nothing is allocated: the caller makes all arrays once.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clutchid.codegen.kernels import inlined, kernel
from clutchid.codegen.linked import by_address
from clutchid.inference.filter.joint_parameters import first_deviations, move_parameters, refresh, steps_at, value_in_si
from clutchid.inference.filter.setup import (
    ADAPTS,
    LAG,
    LONG,
    OFFSET,
    OUTPUT_ROW,
    STATE,
    WEARS,
    FilterArrays,
    FilterOutput,
    FilterState,
    FreeArrays,
    Intervals,
    ModelArrays,
    Scratch,
)
from clutchid.inference.filter.transition import begin_columns, bring_up, place_window
from clutchid.log import FloatArray, IntArray
from clutchid.simulation.comparison import lag_coefficients

by_address(FilterState, FilterArrays, Intervals, FilterOutput)


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
        output, state, a, b, c = sensors[m, OUTPUT_ROW], sensors[m, STATE], lags[m, 0], lags[m, 1], lags[m, 2]
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
        W[sensors[m, OUTPUT_ROW], size + sensors[m, STATE]] = shares[m] * sigma[sensors[m, STATE]]
    lower_triangular(W)
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
    """Move x and S (size, columns) over an interval, given by its inputs, length in s and steps; whether x is finite.

    The generated step moves the first n rows, `move_sensors` the others; units of x per free parameter in the columns.
    """
    u, length, substeps = interval
    for m in range(sensors.shape[0]):
        before[m, 0] = x[sensors[m, STATE]]
        for j in range(S.shape[1]):
            before[m, 1 + j] = S[sensors[m, STATE], j]
    finite = step_model(step, x, S, u, length, substeps, model)
    move_sensors(x, S, before, sensors, lags)
    return finite


@inlined
def move_wide_columns(
    step: Callable[..., bool],
    state: FilterState,
    columns: FloatArray,
    interval: tuple[FloatArray, FloatArray, int, FloatArray, FloatArray],
    arrays: FilterArrays,
) -> bool:
    """Move x and columns (size, c) over an interval, see `move`; its process noise waits for a correction.

    Parameters
    ----------
    interval
        Inputs, length in s (1,), steps, process noise, coefficients of the sensors' lags: a row of each of `Intervals`.
        Where a lag is free, its coefficients are computed anew.
    """
    u, length, substeps, sigma, coefficients = interval
    waiting, sensors, lags = state.waiting, arrays.sensors, arrays.derived.lags
    for m in range(sensors.shape[0]):
        if sensors[m, LAG] >= 0:
            lag_coefficients(lags[m], length, coefficients[m : m + 1])
    for i in range(sigma.size):
        waiting[i] += sigma[i] * sigma[i]
    for m in range(sensors.shape[0]):
        waiting[sigma.size + m] = coefficients[m, 2]
    before, moved = arrays.scratch.before, (u, length[0], substeps)
    return move(step, state.x, columns, arrays.model, moved, sensors, coefficients, before)


@kernel
def move_alone(
    step: Callable[..., bool],
    state: FilterState,
    columns: FloatArray,
    interval: tuple[FloatArray, float, FloatArray],
    arrays: FilterArrays,
    rest: FloatArray,
) -> None:
    """Move x alone over the part of a long interval that is late.

    Where the piston moves, the positions in columns (size, c) move by their speeds: that is most of what the model does
    to columns in some milliseconds, and costs a control unit next to nothing.

    Parameters
    ----------
    interval
        Inputs, length in s, coefficients of the sensors' lags: receives those of the rest.
    rest : (1,)
        Receives what is left in s of the interval, for one step of the pace.
    """
    u, length, coefficients = interval
    x, sensors, model, pace, scratch = state.x, arrays.sensors, arrays.model, arrays.pace, arrays.scratch
    at_speed, at_position, spacing = arrays.settings.at_speed, arrays.settings.at_position, arrays.settings.spacing
    before, lags, columns_before, width = scratch.before, arrays.derived.lags, scratch.S, columns.shape[1]
    own = spacing / steps_at(pace, x[at_position], x[at_speed], spacing, 1)
    late = length - own
    rest[0] = late
    for m in range(sensors.shape[0]):
        lag_coefficients(lags[m], rest, coefficients[m : m + 1])
        copy(before[m, 1 : 1 + width], columns[sensors[m, STATE]])
        before[m, 0] = x[sensors[m, STATE]]
    for i in range(x.size):
        copy(columns_before[i, :width], columns[i])
    left = late
    while left > 0.0:
        steps = steps_at(pace, x[at_position], x[at_speed], left, 1)
        step_model(step, x, columns, u, left / steps, 1, model)
        left -= left / steps
    move_sensors(x, columns, before, sensors, coefficients)
    for i in range(x.size):
        copy(columns[i], columns_before[i])
    # at a stop, speeds times milliseconds would grow without end
    moves = abs(x[at_speed]) > arrays.settings.least_speed
    for j in range(width if moves else 0):
        by_speed = late * columns[at_speed, j]
        columns[at_position, j] += by_speed
        for m in range(sensors.shape[0]):
            if sensors[m, STATE] == at_position:
                columns[sensors[m, OUTPUT_ROW], j] += by_speed
    rest[0] = own
    for m in range(sensors.shape[0]):
        lag_coefficients(lags[m], rest, coefficients[m : m + 1])


@kernel
def add_waiting_noise(S: FloatArray, waiting: FloatArray, sensors: IntArray, scratch: Scratch) -> None:
    """Add the process noise since the last correction to the covariance of the states."""
    sigma = scratch.h
    n = waiting.size - sensors.shape[0]
    for i in range(n):
        sigma[i] = math.sqrt(waiting[i])
        waiting[i] = 0.0
    add_process_noise(S, sigma[:n], sensors, waiting[n:], scratch.W)


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
def project_parameters(T: FloatArray, h: FloatArray, slopes: FloatArray, w: FloatArray) -> float:
    """The variance w' w of a predicted measurement due to the parameters, and w, with its derivatives h in SI."""
    w[:] = 0.0
    for i in range(T.shape[0]):
        for j in range(min(i + 1, w.size)):
            w[j] += T[i, j] * (h[i] * slopes[i])
    variance = 0.0
    for j in range(w.size):
        variance += w[j] * w[j]
    return variance


@kernel
def update_parameters(
    T: FloatArray, w: FloatArray, weighted: float, predicted: float, gain: FloatArray, turns: FloatArray
) -> None:
    """Gain of theta by an innovation of variance `weighted`, of which `predicted` is T's, and T after it (Carlson).

    T (k, k) stays lower triangular; `turns` (2, k) is scratch.
    """
    variance = weighted - predicted
    for j in range(w.size - 1, -1, -1):
        after = variance + w[j] * w[j]
        turns[0, j] = math.sqrt(variance / after)
        turns[1, j] = w[j] / math.sqrt(variance * after)
        variance = after
    for i in range(T.shape[0]):
        covariance = 0.0
        for j in range(i, -1, -1):
            root = T[i, j]
            T[i, j] = root * turns[0, j] - covariance * turns[1, j]
            covariance += root * w[j]
        gain[i] = covariance / weighted


@kernel
def correct(
    x: FloatArray,
    state: FilterState,
    sensor: IntArray,
    measurement: tuple[float, float, float, float],
    adapts: bool,
    free: FreeArrays,
    slopes: FloatArray,
    gain: FloatArray,
    scratch: Scratch,
) -> float:
    """Correct states and, if it `adapts`, parameters by one measurement; the innovation, in its unit.

    An innovation beyond the outliers moves the state as if its sensor were as much worse as makes its share of the
    correction constant (Huber).

    Parameters
    ----------
    x, state
        The filter's state where the measurement was made, in place.
    sensor : (4,)
        A row of `sensors`.
    measurement
        Value; offset and standard deviation of the sensor; standard deviations beyond which an innovation is an
        outlier.
    slopes : (k,)
        Derivatives of the free parameters in SI with respect to theta.
    gain : (size + 1,)
        Gain of x with fixed parameters, and the variance of the innovation: given where S has no L, else received.
    scratch
        Its h receives the derivatives of the predicted measurement: the row of its output in S, 1 for its offset.
    """
    S, theta, T = state.S, state.theta, state.T
    value, offset, sigma, outlier = measurement
    h, w, step = scratch.h, scratch.w, scratch.step
    size, k, columns = x.size, theta.size, S.shape[1]
    for j in range(columns):
        h[j] = S[sensor[OUTPUT_ROW], j]
    if sensor[OFFSET] >= 0:
        h[sensor[OFFSET]] += 1.0
    e = value - (x[sensor[OUTPUT_ROW]] + offset)
    weighted, by_parameters = 0.0, 0.0
    if columns > k:
        by_states = 0.0
        for j in range(k, columns):
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
        update_parameters(T, w, weighted, by_parameters, step, scratch.turns)
    correct_considered(state, sensor[OUTPUT_ROW], adapts, slopes, gain, h, step)
    if adapts:
        for j in range(k):
            step[j] *= e
        move_parameters(x, S, theta, free, step)
    return float(e)


@kernel
def correct_considered(
    state: FilterState, output: int, adapts: bool, slopes: FloatArray, gain: FloatArray, h: FloatArray, step: FloatArray
) -> None:
    """E and G after a correction with the gains (size,) of x and `step` (k,) of theta, if it `adapts`.

    Parameters
    ----------
    h : (k + size,)
        Derivatives of the predicted measurement, before the correction.
    """
    E, G = state.E, state.G
    for c in range(E.shape[1]):
        of_measurement = E[output, c]
        by_theta = 0.0
        for j in range(G.shape[0]):
            by_theta += h[j] * slopes[j] * G[j, c]
        for i in range(E.shape[0]):
            E[i, c] -= gain[i] * of_measurement
        if adapts:
            for j in range(G.shape[0]):
                G[j, c] -= step[j] * (of_measurement + by_theta)


@kernel
def add_considered(state: FilterState, slopes: FloatArray, deviations: FloatArray) -> None:
    """Add to the standard deviations of the first states (n,) what is considered."""
    S, E, G = state.S, state.E, state.G
    for c in range(E.shape[1]):
        for i in range(deviations.size):
            error = E[i, c]
            for j in range(G.shape[0]):
                error += S[i, j] * slopes[j] * G[j, c]
            deviations[i] = math.sqrt(deviations[i] * deviations[i] + error * error)


@kernel
def correct_sample(
    prepare: Callable[..., None],
    moment: tuple[FloatArray, FloatArray, FloatArray],
    state: FilterState,
    arrays: FilterArrays,
    adapts: bool,
    output: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Add the process noise since the last correction, and correct by each measurement of a sample.

    Parameters
    ----------
    moment
        x, waiting noise and measurements (sensors,), NaN for none, of the sample.
    adapts
        Whether the parameters are corrected too.
    output
        Errors (sensors, 2), gains (sensors, size + 1) and rows (1, sensors, k + 1) of the sample, see `FilterOutput`;
        rows (0, ...) are not written.
    """
    x, waiting, values = moment
    errors, gains, rows = output
    sensors, settings, derived, scratch = arrays.sensors, arrays.settings, arrays.derived, arrays.scratch
    of_sensor, size = derived.of_sensor, x.size
    if state.S.shape[1] > state.theta.size:
        add_waiting_noise(state.S, waiting, sensors, scratch)
    for c in range(state.E.shape[1]):
        for i in range(size):
            state.E[i, c] += settings.source[i, c]
    for m in range(sensors.shape[0]):
        errors[m] = np.nan
        if math.isnan(values[m]):
            if rows.shape[0] > 0:
                rows[0, m] = 0.0
            continue
        measurement = values[m], of_sensor[m, 0], of_sensor[m, 1], settings.outlier
        e = correct(x, state, sensors[m], measurement, adapts, arrays.free, derived.slopes, gains[m], scratch)
        errors[m, 0], errors[m, 1] = e, gains[m, size]
        if rows.shape[0] > 0:
            write_row(rows[0, m], scratch.h, e, gains[m, size], settings.outlier)
        if adapts:
            refresh(prepare, state.theta, arrays.free, derived, arrays.model)


@kernel
def begin_correction(state: FilterState, arrays: FilterArrays, values: FloatArray) -> None:
    """Keep a sample with its measurements (sensors,) for a correction; what moves from here on is counted anew."""
    settings, x, position = arrays.settings, state.x, arrays.settings.at_position
    copy(state.at_x, x)
    copy(state.at_waiting, state.waiting)
    copy(state.at_values, values)
    for i in range(x.size):
        copy(state.at_moved[i], state.moved[i])
    state.at_first[0] = state.first[0]
    adapts = state.T.shape[1] > 0 and abs(x[settings.at_speed]) > settings.least_speed
    state.due[0] = 1 + (ADAPTS if adapts else 0) + (WEARS if state.wear[0] > 0 else 0)
    for i in range(x.size - arrays.sensors.shape[0]):
        state.waiting[i] = 0.0
    centre = x[position] + settings.ahead * x[settings.at_speed]
    begin_columns(state, arrays.window, arrays.free.pieces, arrays.model.breakpoints, centre)


@kernel
def end_correction(
    prepare: Callable[..., None],
    state: FilterState,
    arrays: FilterArrays,
    output: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Correct by the sample that was kept, and move what that changes on to the present one.

    Parameters
    ----------
    output
        Of `correct_sample`; the errors are those of the sample that was kept.
    """
    window, scratch, numbers, theta = arrays.window, arrays.scratch, arrays.free.numbers, state.theta
    x, moved, responses = state.x, state.moved, window.columns.size
    at_x = state.at_x
    place_window(state.at_first[0], window)
    bring_up(state, state.at_moved, window.columns, scratch.S)
    place_window(state.first[0], window)
    copy(scratch.x, at_x)
    for j in range(theta.size):
        scratch.si[j] = value_in_si(numbers[j], theta[j])
    moment = at_x, state.at_waiting, state.at_values
    correct_sample(prepare, moment, state, arrays, state.due[0] & ADAPTS > 0, output)
    if state.due[0] & WEARS > 0:
        add_drift(state.T, arrays.settings.drifts, state.wear, scratch.turns)
    for j in range(theta.size):
        scratch.si[j] = value_in_si(numbers[j], theta[j]) - scratch.si[j]
    for i in range(x.size):
        change = 0.0
        for c in range(responses):
            change += moved[i, c] * scratch.si[window.columns[c]]
        for q in range(x.size):
            change += moved[i, responses + q] * (at_x[q] - scratch.x[q])
        x[i] += change
    state.due[0] = 0


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
def copy(to: FloatArray, values: FloatArray) -> None:
    """The first of the values, as many as `to` has; a slice that is assigned compiles for a second, for its error."""
    for j in range(to.size):
        to[j] = values[j]


@kernel
def add_drift(T: FloatArray, root: FloatArray, wear: IntArray, turns: FloatArray) -> None:
    """Add the next column of the root of what the parameters gain in a stroke, d d', to their covariance T T'.

    Parameters
    ----------
    T : (k, k)
        Lower triangular, by rotations of its columns with d.
    root : (k, d)
        Lower trapezoidal.
    wear : (1,)
        Columns that are still to be added, at least 1; the first of a stroke is next where they are a multiple of d.
    turns : (2, k)
        Scratch.
    """
    first = (root.shape[1] - wear[0] % root.shape[1]) % root.shape[1]
    for i in range(first, T.shape[0]):
        added = root[i, first]
        for j in range(first, i):
            before = T[i, j]
            T[i, j] = turns[0, j] * before + turns[1, j] * added
            added = turns[0, j] * added - turns[1, j] * before
        pivot = T[i, i]
        T[i, i] = math.sqrt(pivot * pivot + added * added)
        turns[0, i] = pivot / T[i, i] if T[i, i] > 0.0 else 1.0
        turns[1, i] = added / T[i, i] if T[i, i] > 0.0 else 0.0
    wear[0] -= 1


@kernel
def lower_triangular(W: FloatArray) -> None:
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


@kernel
def write_watched(watched: FloatArray, of_state: FloatArray) -> None:
    """From the row of a state in S its derivatives and its standard deviation with fixed parameters (k + 1,)."""
    k, square = watched.size - 1, 0.0
    for j in range(k, of_state.size):
        square += of_state[j] * of_state[j]
    copy(watched[:k], of_state)
    watched[k] = math.sqrt(square)


@kernel
def follow_segment(
    step: Callable[..., bool],
    prepare: Callable[..., None],
    state: FilterState,
    arrays: FilterArrays,
    intervals: Intervals,
    values: FloatArray,
    output: FilterOutput,
    span: tuple[int, int, int],
) -> int:
    """Filter some samples of a segment in place; the first that is not finite, or -1.

    Parameters
    ----------
    step, prepare
        Generated functions of the model variant.
    state
        After the sample before; before the first sample, that predicted for it.
    arrays
        The columns of the lags of its sensors are those of `transition`, as in its model.
    values : (samples, sensors)
        Measurements, NaN for none.
    output
        Its rows begin with the first of the samples.
    span
        First sample, and the one after the last; number of sample 0 since the filter started.
    """
    u, length, substeps, sigma, lags = (
        intervals.inputs, intervals.length, intervals.substeps, intervals.sigma, intervals.lags,
    )  # fmt: skip
    errors, states, deviations, gains, rows, watched = (
        output.errors, output.states, output.deviations, output.gains, output.rows, output.watched,
    )  # fmt: skip
    model, free, settings, window = arrays.model, arrays.free, arrays.settings, arrays.window
    begin, end, number = span
    x, at_speed, at_position = state.x, settings.at_speed, settings.at_position
    adapting, packed = state.T.shape[1] > 0, state.moved.shape[1] > 0
    columns = state.moved if packed else state.S
    if adapting:
        refresh(prepare, state.theta, free, arrays.derived, model)
    if packed:
        place_window(state.first[0], window)
    for i in range(begin, end):
        row, turn = i - begin, (number + i) % settings.every
        if i > 0:
            own = length[i - 1 : i]
            if packed and own[0] > LONG * settings.spacing:
                late, own = (u[i - 1], own[0], lags[i - 1]), arrays.scratch.x[:1]
                move_alone(step, state, columns, late, arrays, own)
            steps = steps_at(arrays.pace, x[at_position], x[at_speed], own[0], int(substeps[i - 1]))
            interval = u[i - 1], own, steps, sigma[i - 1], lags[i - 1]
            if not move_wide_columns(step, state, columns, interval, arrays):
                return i
        errors[row] = np.nan
        corrected = False
        of_sample = errors[row], gains[min(row, gains.shape[0] - 1)], rows[row : row + 1]
        if packed and turn == 0:
            begin_correction(state, arrays, values[i])
        if packed and turn == settings.every - 1 and state.due[0] > 0:
            end_correction(prepare, state, arrays, of_sample)
            corrected = True
        if not packed and turn == 0:
            correct_sample(prepare, (x, state.waiting, values[i]), state, arrays, False, of_sample)
            corrected = True
        if deviations.shape[0] > 0:
            deviations[row] = np.nan
            if corrected:
                first_deviations(state.S, state.T, arrays.derived.slopes, deviations[row], arrays.scratch.w)
                add_considered(state, arrays.derived.slopes, deviations[row])
        if watched.shape[0] > 0:
            write_watched(watched[row], state.S[settings.at_watched])
        copy(states[row], x)
    return -1

"""Inputs of the filters at the start of a segment: arrays of the model, intervals, sensors, first state.

The outputs of the sensors `names` are states behind those of the model.

The filter has n states of the model and one output per sensor; size = n + sensors. S has k columns for free parameters
and, where gains are computed, size columns for the square root of the covariance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray, IntArray
from clutchid.log.states import SENSORS
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.noise import Noise, process_noise
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.plan import OUTSIDE, Segment
from clutchid.simulation.run import Columns, start_sensitivities, start_state
from clutchid.simulation.sensors import lag_coefficients
from clutchid.simulation.stiffness import Pace
from clutchid.simulation.windows import Track


class ModelArrays(NamedTuple):
    """Arguments of the generated `step` after state, inputs and interval.

    Parameters (p,); load, by breakpoints (b,), coefficients (b + 1, 4), and those of its basis functions; which columns
    are those of load weights (basis function, column) and of parameters (slot, row, column); and its work array.
    """

    p: FloatArray
    breakpoints: FloatArray
    load: FloatArray
    basis: FloatArray
    table_basis: IntArray
    table_column: IntArray
    fill_slot: IntArray
    fill_row: IntArray
    fill_column: IntArray
    work: FloatArray


class Intervals(NamedTuple):
    """Intervals of a segment.

    Inputs (samples, inputs), of which the last row is not used; `length` in s and steps of integration (samples - 1,);
    standard deviation of the process noise (samples - 1, n); coefficients of the sensors' lags (samples - 1, sensors,
    6), see `clutchid.simulation.sensors.lag_coefficients`.
    """

    inputs: FloatArray
    length: FloatArray
    substeps: NDArray[np.int32]
    sigma: FloatArray
    lags: FloatArray


#: Columns of `sensors`, one row a sensor: row of its output in x, row of the state that it measures, columns in S of
#: its lag and its offset, -1 if they are fixed.
OUTPUT_ROW, STATE, LAG, OFFSET = 0, 1, 2, 3

#: Share of the usual interval, up to rounding: in a longer one samples are missing.
LONG = 1.5 * (1 + 1e-6)

#: Free load weights whose columns move beside those that act at one position, see `transition`. With cubic B-splines,
#: of which four act, eight are those of 6 mm with knots at 1.25 mm, which the piston passes in the 10 ms between
#: corrections at 0.5 m/s.
BESIDE = 4

#: Columns of `numbers`, one row a free parameter: mean, width, whether it is positive, bounds in SI, bounds of theta;
#: see `clutchid.inference.uncertainty.coordinates.Coordinate`.
MEAN, PRIOR_WIDTH, POSITIVE, BOUND_LOW, BOUND_HIGH, LEAST, MOST = range(7)

#: Columns of `places`, one row a free parameter, -1 for none: its load weight, its place among the parameters, the
#: sensor whose lag it is, the sensor whose offset it is.
WEIGHT, PARAMETER, LAG_OF, OFFSET_OF = range(4)


class FreeArrays(NamedTuple):
    """Constants of k free parameters: `numbers` (k, 7), `places` (k, 4).

    `pieces` are the first and last piece of each load weight's basis function (weights, 2).
    """

    numbers: FloatArray
    places: IntArray
    pieces: IntArray


class Derived(NamedTuple):
    """Values that follow from theta.

    Load weights (weights,); lag of each sensor (sensors,), its offset and standard deviation (sensors, 2); derivatives
    of the free parameters in SI with respect to theta (k,).
    """

    weights: FloatArray
    lags: FloatArray
    of_sensor: FloatArray
    slopes: FloatArray


#: Bits of a correction that is under way, beside 1.
ADAPTS, WEARS = 2, 4


class FilterState(NamedTuple):
    """State of the filter between two samples: x (size,), S = [D | L], theta (k,), T (k, m), see `recursion`.

    x are the states of the model, then the output of each sensor, in SI; theta the free parameters as coordinates. S is
    (size, k + size), or (size, k) with given gains. T has as many columns as rows, or none where no parameter adapts.
    `waiting` (n + sensors,) is the process noise since the last correction: variances of the states, and the share of a
    measured state's noise in its sensor's output. S is that after the last correction: since then it has moved by
    `moved` = [Gamma | Phi] (size, p + w + size), with Gamma for the free parameters of the model, for a window of w
    load weights, of which number `first` (1,) is the first, and for those of the sensors; see `transition`. Without
    columns in `moved`, S itself moves. To write a state, write its arrays: a filter goes on from them bit by bit.

    A correction that is under way, see `recursion.follow_segment`, is that of an earlier sample: its x, columns that
    had moved, noise, window and measurements are `at_x`, `at_moved`, `at_waiting`, `at_first` and `at_values`
    (sensors,). `due` (1,) is 0 without one, else 1, with `ADAPTS` if it corrects the parameters too and `WEARS` if T
    gains drift. `wear` (1,) counts the columns of drift that T has still to gain for strokes that have ended, see
    `recursion.add_drift`.

    What is not known and does not adapt is considered: `E` (size, c) are the derivatives of the error of x with fixed
    parameters with respect to c such parameters, in their standard deviations, and `G` (k, c) those of the error of
    theta, for the gains as they are. They act on no gain and no mean, only on what is said to be uncertain.
    """

    x: FloatArray
    S: FloatArray
    theta: FloatArray
    T: FloatArray
    waiting: FloatArray
    moved: FloatArray
    first: IntArray
    E: FloatArray = np.zeros((0, 0))
    G: FloatArray = np.zeros((0, 0))
    at_x: FloatArray = np.zeros(0)
    at_moved: FloatArray = np.zeros((0, 0))
    at_waiting: FloatArray = np.zeros(0)
    at_first: IntArray = np.zeros(0, dtype=np.int64)
    at_values: FloatArray = np.zeros(0)
    due: IntArray = np.zeros(1, dtype=np.int64)
    wear: IntArray = np.zeros(1, dtype=np.int64)


class Window(NamedTuple):
    """Window of load weights whose columns move, see `transition`.

    Their basis functions (w,); columns in S of all responses Gamma (p + w,), of which `placed` (w,) are those of the
    window; basis functions and columns in S of all free load weights, by their place in the stroke.
    """

    bases: IntArray
    columns: IntArray
    placed: IntArray
    weight_bases: IntArray
    weight_columns: IntArray


class Scratch(NamedTuple):
    """Scratch arrays of the filter.

    Measured states before a step with their rows of the columns that move (sensors, 1 + columns); ``[L | Q]``, with Q
    the square root of the process noise (size, size + n), or (0, 0) with given gains; of the shape of S, and a row of
    it; vectors of theta (m,) and (k,); two rows of rotations of T's columns (2, k); x (size,) and parameters in SI (k,)
    before a correction.
    """

    before: FloatArray
    W: FloatArray
    S: FloatArray
    h: FloatArray
    w: FloatArray
    step: FloatArray
    turns: FloatArray
    x: FloatArray
    si: FloatArray


class SettingsArrays(NamedTuple):
    """Settings of the filter.

    Samples between corrections; standard deviations beyond which an innovation is an outlier; speed in m/s above which
    parameters adapt; rows of speed and position in x, and of the state that is watched; what E gains from one
    correction to the next (size, c); root of what T gains in a stroke (k, d); time in s from a correction to the middle
    between it and the next, around which the window of load weights is placed; usual time in s from one sample to the
    next.
    """

    every: int
    outlier: float
    least_speed: float
    at_speed: int
    at_position: int
    at_watched: int
    source: FloatArray = np.zeros((0, 0))
    drifts: FloatArray = np.zeros((0, 0))
    ahead: float = 0.0
    spacing: float = np.inf


class FilterArrays(NamedTuple):
    """Arrays of a filter besides its state, which its caller makes once.

    `sensors` are rows of `OUTPUT_ROW` to `OFFSET`; `pace` has the integration steps by position and speed, see
    `joint_parameters.steps_at`.
    """

    model: ModelArrays
    free: FreeArrays
    derived: Derived
    sensors: IntArray
    settings: SettingsArrays
    pace: Pace
    window: Window
    scratch: Scratch


class FilterOutput(NamedTuple):
    """Output of a filter by sample; an array without samples is not written.

    Innovations and their variances (samples, sensors, 2), NaN for none; the states of the model after each sample
    (samples, n), and their standard deviations (samples, n), NaN between corrections. For a fit: gains (samples,
    sensors, size + 1), given or received, see `recursion.correct`, and where they are not wanted, of one sample; rows
    (samples, sensors, k + 1), see `recursion.write_row`; derivatives of the watched state with respect to the
    parameters, and its standard deviation (samples, k + 1).
    """

    errors: FloatArray
    states: FloatArray
    deviations: FloatArray
    gains: FloatArray
    rows: FloatArray
    watched: FloatArray


def sensor_rows(mapped: ParameterMap, names: Sequence[str]) -> IntArray:
    """Rows and columns of each sensor, see `STATE`; the outputs stand behind the states of the model."""
    states, column = mapped.actuator.states, {name: c for c, name in enumerate(mapped.bases)}
    rows = [
        (len(states) + m, states.index(sensor.state), column.get(sensor.lag, -1), column.get(sensor.offset, -1))
        for m, sensor in enumerate(SENSORS[name] for name in names)
    ]
    return np.array(rows, dtype=np.int64)


def model_arrays(mapped: ParameterMap, which: Columns, width: int, few: bool = False) -> ModelArrays:
    """Arguments of the generated step for `width` columns, or of that for few parameters."""
    arrays, module = mapped.arrays, kernels(mapped.actuator.model)
    work = np.empty(module.work_size(width))
    (module.prepare_few if few else module.prepare)(arrays.parameters, which.fill_slot, work)
    return ModelArrays(
        arrays.parameters, arrays.breakpoints, arrays.load, arrays.basis, which.table_basis, which.table_column,
        which.fill_slot, which.fill_row, which.fill_column, work,
    )  # fmt: skip


def intervals(segment: Segment, actuator: Actuator, noise: Noise, names: Sequence[str]) -> Intervals:
    """The intervals of a segment, with process noise and lags of the sensors as for `actuator`."""
    lags = [lag_coefficients(actuator.value(SENSORS[name].lag), segment.dt) for name in names]
    sigma = process_noise(segment, actuator, noise)
    of_sensors = lags[0][:, None] if len(lags) == 1 else np.stack(lags, axis=1)
    return Intervals(segment.inputs, segment.dt, segment.substeps, sigma, of_sensors)


def measured_values(track: Track, measure: Sequence[str], names: Sequence[str]) -> FloatArray:
    """Measurements of a segment (samples, sensors), NaN for none, and for sensors that are not in `measure`."""
    inside = slice(track.segment.start, track.segment.stop)
    values = np.full((len(track.segment), len(names)), np.nan)
    for m, name in enumerate(names):
        if name in measure:
            recorded = track.measured[name][inside]
            values[:, m] = np.where(np.isfinite(recorded), recorded, np.nan)
    return values


def first_state(
    segment: Segment, mapped: ParameterMap, which: Columns, L: FloatArray, names: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """State x of the filter at the start and S, with L for the states of the model (n, n), or (n, 0) with given gains.

    The output of a sensor is what it measures, less the lag times the velocity for the position; of the pressure no
    rate is known. At the far end stop it is anywhere between that of the load and the supply's: uniformly.
    """
    actuator, k = mapped.actuator, len(mapped.bases)
    states, n = actuator.states, len(actuator.states)
    outputs = np.zeros((len(names), n))
    outputs[np.arange(len(names)), [states.index(SENSORS[name].state) for name in names]] = 1.0
    lag = SENSORS["position"].lag
    if "position" in names:
        outputs[names.index("position"), states.index("v")] = -actuator.value(lag)
    both = np.vstack([np.eye(n), outputs])
    start, sensitivities = start_state(segment, actuator), start_sensitivities(segment, actuator, which, False)
    if segment.position_start > actuator.parameters.y_max - OUTSIDE and not np.isfinite(segment.pressure_start):
        at, L = states.index("p_A"), L.copy()
        span = max(0.0, actuator.parameters.P_S - start[at])
        start[at] += 0.5 * span
        sensitivities[at] = 0.5 * (sensitivities[at] + [name == "P_S" for name in which.names])
        L[at, at : at + 1] = span / math.sqrt(12.0)
    x, dx = both @ start, both @ sensitivities[:, :k]
    if lag in mapped.bases and "position" in names:
        dx[n + names.index("position"), mapped.bases.index(lag)] -= x[states.index("v")]
    of_outputs = np.zeros((x.size, len(names) if L.shape[1] else 0))
    return x, np.ascontiguousarray(np.column_stack([dx, both @ L, of_outputs]))


def derived_arrays(actuator: Actuator, names: Sequence[str], deviations: Sequence[float], k: int) -> Derived:
    """`Derived` before it is computed from theta; `deviations` are those of the noise of the sensors `names` in SI."""
    rows = [SENSORS[name] for name in names]
    offsets = [actuator.value(row.offset) for row in rows]
    lags = np.array([actuator.value(row.lag) for row in rows])
    return Derived(np.array(actuator.load.theta), lags, np.column_stack([offsets, deviations]), np.ones(k))


def scratch(size: int, width: int, T: FloatArray, n: int, sensors: int) -> Scratch:
    """Scratch arrays for x of `size`, of which n are states of the model, S with `width` columns, and T (k, m)."""
    k, m = T.shape
    W = np.empty((size, size + n) if width > k else (0, 0))
    vectors = np.empty(width), np.empty(m), np.empty(k), np.empty((2, k)), np.empty(size), np.empty(k)
    return Scratch(np.empty((sensors, 1 + width)), W, np.empty((size, width)), *vectors)

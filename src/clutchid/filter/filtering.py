"""A segment of a recording, filtered: innovations, and their derivatives with respect to the free parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.filter.arrays import FilterOutput, IntArray, Intervals, Measurements, ModelArrays, Scratch
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels, step
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.plan import Segment
from clutchid.simulation.process_noise import process_noise, start_deviations
from clutchid.simulation.run import Columns, columns, inputs_of, start_sensitivities, start_state
from clutchid.simulation.sensors import lag_coefficients
from clutchid.simulation.simulation import failure_message
from clutchid.simulation.windows import Track
from clutchid.uncertainty.noise import Noise

_KERNELS = "clutchid.filter.recursion"

#: Samples whose rows are compressed together.
BLOCK = 2048


class FilterState(NamedTuple):
    """State of the filter between two samples, see `recursion`: x (size,) and S = [dx | L] (size, columns), in SI."""

    x: FloatArray
    S: FloatArray

    def copy(self) -> FilterState:
        """An independent copy, to return to."""
        return FilterState(self.x.copy(), self.S.copy())


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """A filtered segment of n samples.

    `rows` are ``[theta | r]``, compressed to as many as they have columns, and `cost` the sum of losses. `errors`
    (n, 2, 2) are the innovations of position and pressure in SI with their variances, `states` (n, n_states) the states
    after the measurements of each sample, `pressures` (n, size + 1) the derivatives of the pressure in chamber A with
    respect to theta and its standard deviation; `gains` (n, 2, n_states + 3) the gain of each state and sensor output
    for each innovation, and its variance.
    """

    rows: FloatArray
    cost: float
    errors: FloatArray
    states: FloatArray
    pressures: FloatArray
    gains: FloatArray


def filtered(
    track: Track, mapped: ParameterMap, measure: Sequence[str], noise: Noise, fixed_gains: FloatArray | None = None
) -> Filtered | Failure:
    """Filter a segment with the parameters of one recording.

    Parameters
    ----------
    track : Track
        The segment; its windows do not matter.
    mapped : ParameterMap
        The actuator of the recording, and where the derivatives belong in theta.
    measure : 'position', 'pressure_a'
        Measured columns in use.
    noise : Noise
        Of the sensors and of the model, in SI.
    fixed_gains : (n, 2, n_states + 3), optional
        Gains and variances of another pass to use instead of the optimal ones. Then the derivatives are exact, and the
        standard deviation of the states is not computed.
    """
    segment, states, k = track.segment, mapped.actuator.states, len(mapped.bases)
    inputs_of(segment, mapped.actuator.model)
    pass_ = _Pass.of(track, mapped, measure, noise, fixed_gains)
    length = len(segment)
    errors, passed = np.empty((length, len(MEASURED), 2)), np.full((length, len(states)), np.nan)
    pressures, factor, cost = np.empty((length, k + 1)), np.zeros((0, k + 1)), 0.0
    for begin in range(0, length, BLOCK):
        end = min(begin + BLOCK, length)
        output = (np.empty((end - begin, len(MEASURED), k + 1)), errors, passed, pressures)
        failed = pass_.follow(begin, end, output)
        if failed >= 0:
            return Failure(failure_message(track.measured, segment, passed, failed, states, mapped.actuator))
        rows = output[0].reshape(-1, k + 1)
        cost += _loss(rows[:, -1], noise.outlier)
        factor = triangular(np.vstack([factor, rows]))
    return Filtered(_spread(factor, mapped), cost, errors, passed, _spread(pressures, mapped), pass_.gains)


def _loss(r: FloatArray, outlier: float) -> float:
    """Sum of the Huber losses of rows scaled by `recursion.write_row`: an outlier is sqrt(outlier |r|) there."""
    size = np.abs(r)
    far = size > outlier
    return float(np.sum(r**2) + np.sum(r[far] ** 2 - outlier**2))


def _spread(rows: FloatArray, mapped: ParameterMap) -> FloatArray:
    """Rows on the parameters of one recording in SI, as rows on theta."""
    wide = np.zeros((rows.shape[0], mapped.size + 1))
    wide[:, list(mapped.places)] = rows[:, :-1] * mapped.slopes
    wide[:, -1] = rows[:, -1]
    return wide


@dataclass(frozen=True, slots=True, eq=False)
class _Pass:
    """A pass of the filter over a segment, with all arrays that `recursion.follow` needs."""

    step: Any
    state: FilterState
    model: ModelArrays
    intervals: Intervals
    sensors: IntArray
    measurements: Measurements
    gains: FloatArray
    scratch: Scratch

    @classmethod
    def of(
        cls, track: Track, mapped: ParameterMap, measure: Sequence[str], noise: Noise, fixed_gains: FloatArray | None
    ) -> _Pass:
        """The filter at the start of a segment."""
        segment, actuator = track.segment, mapped.actuator
        which, sensors = columns(actuator, mapped.bases), _sensors(mapped)
        with_pressure, given = "pressure_a" in measure, fixed_gains is not None
        L = np.diag(start_deviations(segment, actuator, with_pressure, noise))
        state = _start(segment, mapped, which, L[:, :0] if given else L)
        size, width, n = state.x.size, state.S.shape[1], len(actuator.states)
        return cls(
            step=step(actuator.model),
            state=state,
            model=_model_arrays(mapped, which, width),
            intervals=_intervals(segment, actuator, noise),
            sensors=sensors,
            measurements=_measurements(track, actuator, measure, noise),
            gains=np.zeros((len(segment), len(MEASURED), size + 1)) if fixed_gains is None else fixed_gains,
            scratch=(
                np.empty((len(MEASURED), 1 + width)),
                np.empty((0, 0) if given else (size, size + n)),
                np.empty(width),
            ),
        )

    def follow(self, begin: int, end: int, output: FilterOutput) -> int:
        """Filter the samples from `begin` to `end`; the first that is not finite, or -1."""
        watched = int(self.sensors[list(MEASURED).index("pressure_a"), 1])
        failed: int = kernels_in(_KERNELS).follow(
            self.step, tuple(self.state), self.model, self.intervals, self.sensors, self.measurements, self.gains,
            output, self.scratch, (begin, end, watched),
        )  # fmt: skip
        return end - 1 if failed < 0 and not np.isfinite(self.state.S).all() else failed


def _sensors(mapped: ParameterMap) -> IntArray:
    """Rows and columns of each sensor, see `recursion.STATE`; the outputs stand behind the states of the model."""
    states, column = mapped.actuator.states, {name: c for c, name in enumerate(mapped.bases)}
    rows = [
        (len(states) + m, states.index(sensor.state), column.get(sensor.lag, -1), column.get(sensor.offset, -1))
        for m, sensor in enumerate(MEASURED.values())
    ]
    return np.array(rows, dtype=np.int64)


def _model_arrays(mapped: ParameterMap, which: Columns, width: int) -> ModelArrays:
    """Arguments of the generated step for `width` columns."""
    arrays, module = mapped.arrays, kernels(mapped.actuator.model)
    work = np.empty(module.work_size(width))
    module.prepare(arrays.parameters, which.fill_slot, work)
    return (
        arrays.parameters, arrays.breakpoints, arrays.load, arrays.basis, which.table_basis, which.table_column,
        which.fill_slot, which.fill_row, which.fill_column, work,
    )  # fmt: skip


def _intervals(segment: Segment, actuator: Actuator, noise: Noise) -> Intervals:
    lags = [lag_coefficients(actuator.value(sensor.lag), segment.dt) for sensor in MEASURED.values()]
    sigma = process_noise(segment, actuator, noise)
    return segment.inputs, segment.dt, segment.substeps, sigma, np.stack(lags, axis=1)


def _measurements(track: Track, actuator: Actuator, measure: Sequence[str], noise: Noise) -> Measurements:
    inside = slice(track.segment.start, track.segment.stop)
    values = np.full((len(track.segment), len(MEASURED)), np.nan)
    for m, name in enumerate(MEASURED):
        if name in measure:
            recorded = track.measured[name][inside]
            values[:, m] = np.where(np.isfinite(recorded), recorded, np.nan)
    of_sensor = [(actuator.value(s.offset), noise.measured.get(name, np.inf)) for name, s in MEASURED.items()]
    return values, np.array(of_sensor), float(noise.outlier)


def _start(segment: Segment, mapped: ParameterMap, which: Columns, L: FloatArray) -> FilterState:
    """State of the filter at the start, with L for the states of the model (n, n), or (n, 0) with given gains.

    The output of a sensor is what it measures, less the lag times the velocity for the position; of the pressure no
    rate is known.
    """
    actuator, k = mapped.actuator, len(mapped.bases)
    states, n = actuator.states, len(actuator.states)
    outputs = np.zeros((len(MEASURED), n))
    outputs[np.arange(len(MEASURED)), [states.index(sensor.state) for sensor in MEASURED.values()]] = 1.0
    position, lag = list(MEASURED).index("position"), MEASURED["position"].lag
    outputs[position, states.index("v")] = -actuator.value(lag)
    both = np.vstack([np.eye(n), outputs])
    x = both @ start_state(segment, actuator)
    dx = both @ start_sensitivities(segment, actuator, which, estimated=False)[:, :k]
    if lag in mapped.bases:
        dx[n + position, mapped.bases.index(lag)] -= x[states.index("v")]
    of_outputs = np.zeros((x.size, len(MEASURED) if L.shape[1] else 0))
    return FilterState(x, np.column_stack([dx, both @ L, of_outputs]))

"""A segment of a recording, filtered: innovations, and their derivatives with respect to the free parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.beside import compile_beside, wait_for_kernels
from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.setup import (
    FilterArrays,
    FilterOutput,
    FilterState,
    FreeArrays,
    SettingsArrays,
    Window,
    derived_arrays,
    first_state,
    intervals,
    measured_values,
    model_arrays,
    scratch,
    sensor_rows,
)
from clutchid.log import FloatArray, Log
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import preparation_kernel, step
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.noise import Noise, start_deviations
from clutchid.simulation.parameter_map import ParameterMap, parameter_map
from clutchid.simulation.plan import plan
from clutchid.simulation.run import columns, inputs_of
from clutchid.simulation.sensors import lagged
from clutchid.simulation.stiffness import AS_PLANNED
from clutchid.simulation.windows import Track, tracks

#: Module of the kernel that goes through the samples.
KERNELS = "clutchid.inference.filter.recursion"

#: To compile the filter: times in s of the samples that are filtered, and the model that most calibrations use.
_TIME, _USUAL = np.arange(4) / 1000, "energy-balance-stribeck"

#: Sensors whose outputs are in the state, in the order of the rows of `Filtered`.
_SENSORS = tuple(MEASURED)

#: Samples whose rows are compressed together.
_BLOCK = 2048


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """A filtered segment of n samples.

    `rows` are ``[theta | r]``, compressed to as many as they have columns, and `cost` the sum of losses. `errors`
    (n, 2, 2) are the innovations of position and pressure in SI with their variances, `states` (n, n_states) the states
    after the measurements of each sample; `gains` (n, 2, n_states + 3) the gain of each state and sensor output for
    each innovation, and its variance. `watched` (n, k + 1) are the derivatives of the pressure in chamber A with
    respect to the parameters of `mapped`, and its standard deviation.
    """

    rows: FloatArray
    cost: float
    errors: FloatArray
    states: FloatArray
    gains: FloatArray
    watched: FloatArray
    mapped: ParameterMap

    @property
    def pressures(self) -> FloatArray:
        """Derivatives of the pressure in chamber A with respect to theta and its standard deviation, (n, size + 1)."""
        return _spread(self.watched, self.mapped)

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations in SI of the innovations of rows that are not compressed; NaN without a measurement."""
        return np.sqrt(self.errors[np.isfinite(self.errors[:, :, 0]).any(axis=1), :, 1]).ravel()

    def measured(self, name: str) -> NDArray[np.bool_]:
        """Mask of the samples that have a measurement of a column (n,)."""
        return np.isfinite(self.errors[:, _SENSORS.index(name), 0])


def filtered(
    track: Track,
    mapped: ParameterMap,
    measure: Sequence[str],
    noise: Noise,
    fixed_gains: FloatArray | None = None,
    *,
    compressed: bool = True,
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
    compressed : bool
        Whether the rows are compressed; else there is one for each sensor at each sample with a measurement.
    """
    segment, states, k = track.segment, mapped.actuator.states, len(mapped.bases)
    inputs_of(segment, mapped.actuator.model)
    state, arrays = _start(track, mapped, measure, noise, with_gains=fixed_gains is not None)
    along = intervals(segment, mapped.actuator, noise, _SENSORS), measured_values(track, measure, _SENSORS)
    calls = step(mapped.actuator.model), preparation_kernel(mapped.actuator.model)
    length, sensors = len(segment), len(_SENSORS)
    errors, passed = np.empty((length, sensors, 2)), np.full((length, len(states)), np.nan)
    gains = np.zeros((length, sensors, state.x.size + 1)) if fixed_gains is None else fixed_gains
    pressures, factor, cost = np.empty((length, k + 1)), np.zeros((0, k + 1)), 0.0
    wait_for_kernels()
    for begin in range(0, length, _BLOCK):
        end = min(begin + _BLOCK, length)
        of_block = np.empty((end - begin, sensors, k + 1))
        part = slice(begin, end)
        output = FilterOutput(errors[part], passed[part], passed[:0], gains[part], of_block, pressures[part])
        failed: int = kernels_in(KERNELS).follow_segment(*calls, state, arrays, *along, output, (begin, end, 0))
        failed = end - 1 if failed < 0 and not np.isfinite(state.S).all() else failed
        if failed >= 0:
            return Failure(failure_message(track.measured, segment, passed, failed, states, mapped.actuator))
        cost += _loss(of_block[:, :, -1].ravel(), noise.outlier)
        measured = np.isfinite(errors[part, :, 0]).any(axis=1)  # not so between the samples of a slow recording
        factor = np.vstack([factor, of_block[measured].reshape(-1, k + 1)])
        factor = triangular(factor) if compressed else factor
    return Filtered(_spread(factor, mapped), cost, errors, passed, gains, pressures, mapped)


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


def _start(
    track: Track, mapped: ParameterMap, measure: Sequence[str], noise: Noise, *, with_gains: bool
) -> tuple[FilterState, FilterArrays]:
    """State at the start of a segment, and arrays of a filter that corrects at every sample and adapts nothing."""
    segment, actuator, k = track.segment, mapped.actuator, len(mapped.bases)
    which, sensors, states = columns(actuator, mapped.bases), sensor_rows(mapped, _SENSORS), actuator.states
    L = np.diag(start_deviations(segment, actuator, "pressure_a" in measure, noise))
    x, S = first_state(segment, mapped, which, L[:, :0] if with_gains else L, _SENSORS)
    none, nothing = np.zeros(0, dtype=np.int64), np.zeros((x.size, 0))
    first = np.zeros(1, dtype=np.int64)
    state = FilterState(x, S, np.zeros(k), np.zeros((k, 0)), np.zeros(x.size), nothing, first)
    places = states.index("v"), states.index("y"), states.index("p_A")
    arrays = FilterArrays(
        model=model_arrays(mapped, which, S.shape[1]),
        free=FreeArrays(np.zeros((0, 7)), np.zeros((0, 4), dtype=np.int64), np.zeros((0, 2), dtype=np.int64)),
        derived=derived_arrays(actuator, _SENSORS, [noise.measured.get(name, np.inf) for name in _SENSORS], k),
        sensors=sensors,
        settings=SettingsArrays(1, float(noise.outlier), np.inf, *places),
        pace=AS_PLANNED,
        window=Window(none, none, none, none, none),
        scratch=scratch(x.size, S.shape[1], state.T, len(states), len(_SENSORS)),
    )
    return state, arrays


def compile_filter(model: str = _USUAL) -> None:
    """Filter four samples of a piston at rest, by default with the model that calibrations use.

    The kernel that goes through the samples is one for all models.
    """
    actuator = Actuator(model=model)
    names = "position", "duty_supply", "duty_exhaust"
    log = Log(_TIME, {name: np.zeros(_TIME.size) for name in names})
    (track,) = tracks([plan(log, actuator, 1.0)])
    filtered(track, parameter_map(actuator, ["P_S"], [0], np.ones(1), 1), names[:1], Noise())


def compile_filter_beside() -> None:
    """Let a second process compile the filter on a first start, while this one compiles and calls what comes before.

    While it waits for the filter, it compiles what comes after it.
    """
    from clutchid.codegen.machine_code import is_kept

    if not is_kept(kernels_in(KERNELS).follow_segment):
        few = (partial(call, _USUAL, few=True) for call in (step, preparation_kernel))
        compile_beside(compile_filter, _USUAL, (*few, partial(lagged, np.zeros(2), 1.0, 1.0)))

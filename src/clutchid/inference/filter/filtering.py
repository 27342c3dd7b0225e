"""A segment of a recording, filtered: innovations, and their derivatives with respect to the free parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.setup import (
    FilterOutput,
    FilterState,
    IntArray,
    Intervals,
    Measurements,
    ModelArrays,
    Scratch,
    first_state,
    intervals,
    measurements,
    model_arrays,
    scratch,
    sensor_rows,
)
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.model.compiled import step
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.noise import Noise, start_deviations
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.run import columns, inputs_of
from clutchid.simulation.windows import Track

_KERNELS = "clutchid.inference.filter.recursion"

#: Sensors whose outputs are in the state, in the order of the rows of `Filtered`.
_SENSORS = tuple(MEASURED)

#: Samples whose rows are compressed together.
BLOCK = 2048


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
        output = FilterOutput(np.empty((end - begin, len(MEASURED), k + 1)), errors, passed, pressures)
        failed = pass_.follow(begin, end, output)
        if failed >= 0:
            return Failure(failure_message(track.measured, segment, passed, failed, states, mapped.actuator))
        rows = output.rows.reshape(-1, k + 1)
        cost += _loss(rows[:, -1], noise.outlier)
        factor = triangular(np.vstack([factor, rows[_measured(rows, len(MEASURED))]]))
    return Filtered(_spread(factor, mapped), cost, errors, passed, pass_.gains, pressures, mapped)


def _measured(rows: FloatArray, sensors: int) -> NDArray[np.bool_]:
    """Rows of the samples that have a measurement; those between the samples of a slow recording have none."""
    known: NDArray[np.bool_] = np.repeat(rows.any(axis=1).reshape(-1, sensors).any(axis=1), sensors)
    return known


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
        which, sensors = columns(actuator, mapped.bases), sensor_rows(mapped, _SENSORS)
        with_pressure, given = "pressure_a" in measure, fixed_gains is not None
        L = np.diag(start_deviations(segment, actuator, with_pressure, noise))
        state = first_state(segment, mapped, which, L[:, :0] if given else L, _SENSORS)
        size, width, n = state.x.size, state.S.shape[1], len(actuator.states)
        return cls(
            step=step(actuator.model),
            state=state,
            model=model_arrays(mapped, which, width),
            intervals=intervals(segment, actuator, noise, _SENSORS),
            sensors=sensors,
            measurements=measurements(track, actuator, measure, noise, _SENSORS),
            gains=np.zeros((len(segment), len(MEASURED), size + 1)) if fixed_gains is None else fixed_gains,
            scratch=scratch(size, n, width, len(MEASURED), given),
        )

    def follow(self, begin: int, end: int, output: FilterOutput) -> int:
        """Filter the samples from `begin` to `end`; the first that is not finite, or -1."""
        watched = int(self.sensors[list(MEASURED).index("pressure_a"), 1])
        failed: int = kernels_in(_KERNELS).follow(
            self.step, self.state, self.model, self.intervals, self.sensors, self.measurements, self.gains,
            output, self.scratch, (begin, end, watched),
        )  # fmt: skip
        return end - 1 if failed < 0 and not np.isfinite(self.state.S).all() else failed

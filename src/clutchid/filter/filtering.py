"""A segment of a recording, filtered: errors of prediction, and their derivatives to the free numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.process_noise import process_noise, start_deviations
from clutchid.simulation.run import Columns, columns, inputs_of, start_sensitivities, start_state
from clutchid.simulation.sensors import lag_coefficients
from clutchid.simulation.simulation import failure_message
from clutchid.simulation.windows import Track
from clutchid.uncertainty.noise import Noise

if TYPE_CHECKING:
    from clutchid.filter.recursion import FilterOutput

_KERNELS = "clutchid.filter.recursion"

#: Samples whose rows are compressed together.
BLOCK = 2048


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """A filtered segment of n samples.

    `rows` are ``[theta | r]``, compressed to as many as they have columns, and `cost` the sum of losses. `errors`
    (n, 2, 2) are the errors of prediction of position and pressure in SI with their variances, `states` the states that
    the filter ends each sample with, `pressures` (n, size + 1) the derivatives of the pressure in chamber A to theta
    and its standard deviation; `gains` (n, 2, n_states + 3) how far each error of prediction moves the state and what
    the two sensors show, and its variance.
    """

    rows: FloatArray
    cost: float
    errors: FloatArray
    states: FloatArray
    pressures: FloatArray
    gains: FloatArray


def filtered(
    track: Track, mapped: ParameterMap, measure: Sequence[str], noise: Noise, held: FloatArray | None = None
) -> Filtered | Failure:
    """Filter a segment with the numbers of one recording.

    Parameters
    ----------
    track : Track
        The segment; its windows do not matter.
    mapped : ParameterMap
        The actuator of the recording, and where the derivatives belong in theta.
    measure : 'position', 'pressure_a'
        Measured columns that the filter takes in.
    noise : Noise
        Of the sensors and of the model, in SI.
    held : (n, 2, n_states + 3), optional
        Gains and variances of another filter to take over. Then the derivatives are exact, and nothing is said of the
        spread of the states.
    """
    states = mapped.actuator.states
    n, k, length = len(states), len(mapped.bases), len(track.segment)
    errors, passed, pressures = np.empty((length, 2, 2)), np.full((length, n), np.nan), np.empty((length, k + 1))
    filter_ = _Filter.of(track, mapped, measure, noise, held)
    factor, cost = np.zeros((0, k + 1)), 0.0
    for begin in range(0, length, BLOCK):
        at = slice(begin, min(begin + BLOCK, length))
        output = (np.empty((at.stop - begin, 2, k + 1)), errors[at], passed[at], pressures[at])
        failed = filter_.follow(at, output)
        if failed >= 0:
            return Failure(failure_message(track.measured, track.segment, passed, failed, states, mapped.actuator))
        rows = output[0].reshape(-1, k + 1)
        cost += _loss(rows[:, -1], noise.outlier)
        factor = triangular(np.vstack([factor, rows]))
    return Filtered(_spread(factor, mapped), cost, errors, passed, _spread(pressures, mapped), filter_.gains)


def _loss(r: FloatArray, outlier: float) -> float:
    """Sum of Huber's losses of rows that were scaled for it: beyond `outlier` a scaled one is sqrt(outlier |r|)."""
    size = np.abs(r)
    far = size > outlier
    return float(np.sum(r**2) + np.sum(r[far] ** 2 - outlier**2))


def _spread(rows: FloatArray, mapped: ParameterMap) -> FloatArray:
    """Rows on the numbers of one recording in SI, as rows on theta."""
    wide = np.zeros((rows.shape[0], mapped.size + 1))
    wide[:, list(mapped.places)] = rows[:, :-1] * mapped.slopes
    wide[:, -1] = rows[:, -1]
    return wide


@dataclass(frozen=True, slots=True, eq=False)
class _Filter:
    """A filter on its way through a segment: x, S and `before` go with it, see `recursion`."""

    track: Track
    mapped: ParameterMap
    which: Columns
    now: tuple[FloatArray, FloatArray, FloatArray]
    measured: FloatArray
    noise: FloatArray
    lags: FloatArray
    sensors: FloatArray
    own: NDArray[np.int64]
    measured_states: NDArray[np.int64]
    gains: FloatArray
    held: bool

    @classmethod
    def of(
        cls, track: Track, mapped: ParameterMap, measure: Sequence[str], noise: Noise, held: FloatArray | None
    ) -> _Filter:
        """The filter at the start of a segment."""
        segment, p, k = track.segment, mapped.actuator.parameters, len(mapped.bases)
        states, inside = mapped.actuator.states, slice(segment.start, segment.stop)
        inputs_of(segment, mapped.actuator.model)
        which = columns(mapped.actuator, mapped.bases)
        names = [*(sensor.lag for sensor in MEASURED.values()), *(sensor.offset for sensor in MEASURED.values())]
        own = np.array([mapped.bases.index(name) if name in mapped.bases else -1 for name in names])
        shown = _shown_at_start(mapped.actuator)
        dx = start_sensitivities(segment, mapped.actuator, which, estimated=False)[:, :k]
        L = np.diag(start_deviations(segment, mapped.actuator, "pressure_a" in measure, noise))
        x, dx, L = shown @ start_state(segment, mapped.actuator), shown @ dx, shown @ L
        if own[0] >= 0:  # a piston that moves at the start is shown where it was
            dx[len(states), own[0]] -= x[states.index("v")]
        L = np.column_stack([L, np.zeros((x.size, x.size - len(states)))])
        S = np.column_stack([dx, L]) if held is None else np.ascontiguousarray(dx)
        measured = np.full((len(segment), 2), np.nan)
        for column, name in enumerate(MEASURED):
            if name in measure:
                values = track.measured[name][inside]
                measured[:, column] = np.where(np.isfinite(values), values, np.nan)
        lags = np.stack([lag_coefficients(getattr(p, s.lag), segment.dt) for s in MEASURED.values()], axis=1)
        sigma = [noise.measured.get(name, np.inf) for name in MEASURED]
        return cls(
            track=track,
            mapped=mapped,
            which=which,
            now=(x, S, np.zeros((len(MEASURED), 1 + S.shape[1]))),
            measured=measured,
            noise=np.vstack([np.zeros(len(states)), process_noise(segment, mapped.actuator, noise)]),
            lags=np.concatenate([np.zeros((1, len(MEASURED), 6)), lags]),
            sensors=np.array([*(getattr(p, name) for name in names), *sigma, noise.outlier]),
            own=own,
            measured_states=np.array([states.index(sensor.state) for sensor in MEASURED.values()]),
            gains=np.zeros((len(segment), len(MEASURED), x.size + 1)) if held is None else held,
            held=held is not None,
        )

    def follow(self, at: slice, output: FilterOutput) -> int:
        """Go on through the samples `at`; the first that is not finite, or -1."""
        segment, numbers, which = self.track.segment, self.mapped.numbers, self.which
        module, update = kernels(numbers.model), kernels_in(_KERNELS).update
        move = module.run_all if which.needs_parameters else module.run_table
        x, S, _ = self.now
        jump, taken, watched = np.zeros(2, np.uint8), np.zeros((2, 2)), np.zeros(0, np.int64)
        n = self.noise.shape[1]
        of_model, S_of_model = x[:n], S[:n]  # what the sensors show stands behind them
        out, sens = np.empty((2, n)), np.empty((2, 0, S.shape[1]))
        u, dt, substeps, p = segment.inputs, segment.dt, segment.substeps, numbers.parameters
        tables = numbers.breakpoints, numbers.load, numbers.basis
        free = which.table_basis, which.table_column, which.fill_slot, which.fill_row, which.fill_column
        measured, noise, lags, gains = self.measured[at], self.noise[at], self.lags[at], self.gains[at]
        for i in range(at.start, at.stop):
            if i > 0:
                last = slice(i - 1, i)
                failed = move(
                    of_model,
                    S_of_model,
                    u[i - 1 : i + 1],
                    p,
                    dt[last],
                    substeps[last],
                    jump,
                    taken,
                    *tables,
                    *free,
                    watched,
                    out,
                    sens,
                )
                if failed >= 0:
                    return i
            update(
                i - at.start, i == 0, self.now, measured, noise, lags, self.sensors, self.own, self.measured_states,
                gains, output, self.held,
            )  # fmt: skip
        return -1 if np.isfinite(S).all() else at.stop - 1


def _shown_at_start(actuator: Actuator) -> FloatArray:
    """Matrix (n + 2, n) from the model's states to these and what the sensors show of them at the start.

    The position has moved as it does at the start; of the pressure, which rests there, no rate is known.
    """
    states = actuator.states
    shown = np.zeros((len(states) + len(MEASURED), len(states)))
    shown[: len(states)] = np.eye(len(states))
    for row, sensor in enumerate(MEASURED.values(), len(states)):
        shown[row, states.index(sensor.state)] = 1.0
    shown[len(states), states.index("v")] = -actuator.parameters.tau_y
    return shown

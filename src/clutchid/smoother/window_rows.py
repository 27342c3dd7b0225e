"""Residual rows of one window: its simulation compared with the measurement, with derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.plan import Segment
from clutchid.simulation.run import run, run_to_end
from clutchid.simulation.simulation import failure_message
from clutchid.simulation.windows import Track
from clutchid.uncertainty.noise import Noise

#: States whose sensitivities are stored at every sample: up to the last measured one.
OUTPUT_STATES = np.arange(3)

#: Within an integration step the position exceeds the stored samples by less than this, in m.
STEP_OVERSHOOT = 1e-4

#: Expected deviation of the simulated from the measured position in m; a window that exceeds it is simulated again with
#: all load weights that it needs.
EXPECTED_DEVIATION = 3e-4


@dataclass(frozen=True, slots=True, eq=False)
class WindowRows:
    """Residual rows and final state of a window.

    `rows` are ``[state | theta | r]``, triangular, so that only the first n of them depend on the initial state. `end`
    is the final state, `to_start` and `to_theta` are its derivatives with respect to initial state and theta.
    """

    rows: FloatArray
    end: FloatArray
    to_start: FloatArray
    to_theta: FloatArray
    cost: float


def window_rows(
    track: Track, window: Segment, start: FloatArray, mapped: ParameterMap, measure: Sequence[str], noise: Noise
) -> WindowRows | Failure:
    """Simulate a window from `start` with sensitivities and compare it with the measurement.

    Load weights whose basis functions vanish over the positions of the window are left out of the simulation.
    """
    n, compiled, pieces = start.size, _kernels(), _expected_pieces(track, window, start, mapped)
    while True:
        active = mapped.active_columns(pieces)
        out, sens, end, failed = run_to_end(
            window, mapped.arrays, (start, active.start), active.sensitivities, OUTPUT_STATES
        )
        if failed >= 0 or not np.isfinite(end).all():
            return _failure(track, window, out, failed, mapped)
        low, high = compiled.value_range(out[:, 0], start[0])
        needed = mapped.load_pieces(low - STEP_OVERSHOOT, high + STEP_OVERSHOOT)
        if not mapped.bases or (pieces[0] <= needed[0] and needed[1] <= pieces[1]):
            break
        pieces = min(pieces[0], needed[0]), max(pieces[1], needed[1])
    sensors, measured = _sensors_and_samples(track, window, mapped, measure, noise)
    rows, slopes = np.empty((measured.size, active.row_columns.size)), np.ones(active.row_columns.size - 1)
    slopes[n:] = mapped.slopes[active.parameters]
    sensor_columns = np.array([active.sensor_columns[name] for name in measure])
    rows = rows[: compiled.compare(out, sens[: measured.shape[1]], sensors, sensor_columns, measured, slopes, rows)]
    cost = downweight_outliers(rows, noise.outlier)
    factor = triangular(rows)
    if not np.isfinite(factor).all():
        return _failure(track, window, out, failed, mapped)
    full, to_theta = np.empty((factor.shape[0], n + mapped.size + 1)), np.empty((n, mapped.size))
    compiled.scatter_columns(factor, active.row_columns, full)
    compiled.scatter_columns(end[:, n:] * slopes[n : end.shape[1]], active.theta_columns, to_theta)
    return WindowRows(full, out[-1], end[:, :n], to_theta, cost)


def window_cost(
    track: Track, window: Segment, start: FloatArray, mapped: ParameterMap, measure: Sequence[str], noise: Noise
) -> tuple[FloatArray, float] | Failure:
    """Final state of a window from `start`, and the cost of its residuals, without derivatives."""
    out, failed = run(window, mapped.arrays, start)
    if failed >= 0:
        return _failure(track, window, out, failed, mapped)
    sensors, measured = _sensors_and_samples(track, window, mapped, measure, noise)
    stop = _compared_samples(track, window)
    return out[-1], _kernels().compare_cost(out[:stop], sensors, measured, noise.outlier)


def _kernels() -> Any:
    return kernels_in("clutchid.simulation.comparison")


def _expected_pieces(track: Track, window: Segment, start: FloatArray, mapped: ParameterMap) -> tuple[int, int]:
    """First and last piece of the load over the measured positions of a window and its start."""
    if not mapped.bases:
        return 0, 0
    low, high = _kernels().value_range(track.measured["position"][window.start : window.stop], start[0])
    return mapped.load_pieces(low - EXPECTED_DEVIATION, high + EXPECTED_DEVIATION)


def _compared_samples(track: Track, window: Segment) -> int:
    """Number of samples of a window that are compared: the last one belongs to the next window."""
    return len(window) if window.stop == track.segment.stop else len(window) - 1


def _sensors_and_samples(
    track: Track, window: Segment, mapped: ParameterMap, measure: Sequence[str], noise: Noise
) -> tuple[FloatArray, FloatArray]:
    """Sensors of a window, in the order of `comparison.compare`, and their measured samples."""
    step, at = float(window.dt[0]), slice(window.start, window.start + _compared_samples(track, window))
    states = mapped.actuator.states
    sensors = [
        (states.index(MEASURED[name].state), *mapped.sensors[name], step, noise.of_samples(name, track.spacing))
        for name in measure
    ]
    return np.array(sensors), np.array([track.measured[name][at] for name in measure])


def _failure(track: Track, window: Segment, out: FloatArray, failed: int, mapped: ParameterMap) -> Failure:
    names = mapped.actuator.states
    return Failure(failure_message(track.measured, window, out, max(failed, 0), names, mapped.actuator))


def huber_losses(r: FloatArray, outlier: float) -> FloatArray:
    """Huber loss (1964) of each row of residuals: squares, linear beyond `outlier`."""
    cost = np.empty(r.shape[0])
    _kernels().row_losses(r, outlier, cost)
    return cost


def downweight_outliers(rows: FloatArray, outlier: float) -> float:
    """Scale `rows` ``[J | r]`` in place so that their squares are the Huber losses of r; the sum of the losses."""
    return float(_kernels().downweight_outliers(rows, outlier))

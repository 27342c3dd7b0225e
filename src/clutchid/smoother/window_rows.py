"""What a window says: its simulation, compared with what was measured, as rows of the least-squares problem."""

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

#: States whose derivatives a window needs at every sample: up to the last one that is measured.
WATCHED = np.arange(3)

#: A step of the integration looks this far beyond the positions that it stores, in m.
BEYOND = 1e-4

#: A simulated position is expected to stay this near to the measured one, in m; where it does not the window is
#: simulated again with all that it meets.
EXPECTED = 3e-4


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """What a window says, and where it ends.

    `own` are rows ``[state | theta | r]``, of which only as many as there are states tell of the state; `end` is the
    state at the end, with derivatives to start and theta.
    """

    own: FloatArray
    end: FloatArray
    to_start: FloatArray
    to_theta: FloatArray
    cost: float


def window_rows(
    track: Track, window: Segment, start: FloatArray, mapped: ParameterMap, measure: Sequence[str], noise: Noise
) -> Rows | Failure:
    """Simulate a window from `start` and compare it with what was measured.

    Load weights that the piston does not meet in the window have no influence in it and are left out of the simulation.
    """
    n, by, met = start.size, _kernels(), _expected(track, window, start, mapped)
    while True:
        active = mapped.active_columns(met)
        out, sens, end, failed = run_to_end(window, mapped.numbers, (start, active.start), active.which, WATCHED)
        if failed >= 0 or not np.isfinite(end).all():
            return _failure(track, window, out, failed, mapped)
        low, high = by.reach(out[:, 0], start[0])
        needed = mapped.met(low - BEYOND, high + BEYOND)
        if not mapped.bases or (met[0] <= needed[0] and needed[1] <= met[1]):
            break
        met = min(met[0], needed[0]), max(met[1], needed[1])
    sensors, measured = _sensed(track, window, mapped, measure, noise)
    rows, slopes = np.empty((measured.size, active.columns.size)), np.ones(active.columns.size - 1)
    slopes[n:] = mapped.slopes[active.theta]
    own = np.array([active.own[name] for name in measure])
    rows = rows[: by.compare(out, sens[: measured.shape[1]], sensors, own, measured, slopes, rows)]
    cost = robust(rows, noise.outlier)
    small = triangular(rows)
    if not np.isfinite(small).all():
        return _failure(track, window, out, failed, mapped)
    linearised, to_theta = np.empty((small.shape[0], n + mapped.size + 1)), np.empty((n, mapped.size))
    by.spread(small, active.columns, linearised)
    by.spread(end[:, n:] * slopes[n : end.shape[1]], active.carried, to_theta)
    return Rows(linearised, out[-1], end[:, :n], to_theta, cost)


def window_cost(
    track: Track, window: Segment, start: FloatArray, mapped: ParameterMap, measure: Sequence[str], noise: Noise
) -> tuple[FloatArray, float] | Failure:
    """End of a window from `start`, and the cost of its residuals; without derivatives, so much cheaper."""
    out, failed = run(window, mapped.numbers, start)
    if failed >= 0:
        return _failure(track, window, out, failed, mapped)
    sensors, measured = _sensed(track, window, mapped, measure, noise)
    stop = _compared_samples(track, window)
    return out[-1], _kernels().compare_cost(out[:stop], sensors, measured, noise.outlier)


def _kernels() -> Any:
    return kernels_in("clutchid.simulation.comparison")


def _expected(track: Track, window: Segment, start: FloatArray, mapped: ParameterMap) -> tuple[int, int]:
    """Parts of the load's table that a window will meet, as far as its start and its measured position tell."""
    if not mapped.bases:
        return 0, 0
    low, high = _kernels().reach(track.measured["position"][window.start : window.stop], start[0])
    return mapped.met(low - EXPECTED, high + EXPECTED)


def _compared_samples(track: Track, window: Segment) -> int:
    """Samples of a window that are compared: the border belongs to the next one."""
    return len(window) if window.stop == track.segment.stop else len(window) - 1


def _sensed(
    track: Track, window: Segment, mapped: ParameterMap, measure: Sequence[str], noise: Noise
) -> tuple[FloatArray, FloatArray]:
    """Sensors as `kernels.compare` wants them, and what they measured in a window."""
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


def losses(r: FloatArray, outlier: float) -> FloatArray:
    """Sum over each row of squared residuals, of which those beyond `outlier` count linearly only (Huber 1964)."""
    cost = np.empty(r.shape[0])
    _kernels().row_losses(r, outlier, cost)
    return cost


def robust(rows: FloatArray, outlier: float) -> float:
    """Scale `rows` in place so that residuals beyond `outlier` count linearly only, see `losses`; their cost."""
    return float(_kernels().robust(rows, outlier))

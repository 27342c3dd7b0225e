"""What a window says: its simulation, compared with what was measured, as rows of the least-squares problem."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.estimate.least_squares import Failure, triangular
from clutchid.estimate.shooting.noise import Noise
from clutchid.estimate.shooting.windows import Track, units
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import VARIANTS
from clutchid.simulation.plan import Segment
from clutchid.simulation.run import Columns, IntArray, Numbers, columns, run, run_to_end
from clutchid.simulation.simulation import failure_message

#: Numbers of the sensors, which the equations of the actuator do not hold.
SENSORS = ("tau_y", "e_y", "tau_p", "e_p")

#: Of each measured column the place of its state, and the lag and offset of its sensor.
COLUMN = {"position": (0, "tau_y", "e_y"), "pressure_a": (2, "tau_p", "e_p")}

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


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """What a window that is simulated needs to know of theta: which of it matters there, and where it stands.

    The simulation carries the columns `which` from `start`; the rows of the window go on with numbers of sensors, which
    stand in `own`, as `kernels.compare` wants them. `theta` are all their places among the parameters of the view;
    `columns` those in `Rows.own`, with the columns of the start and of the residual; `carried` those in
    `Rows.to_theta`.
    """

    which: Columns
    start: FloatArray
    own: Mapping[str, tuple[int, int]]
    theta: IntArray
    columns: IntArray
    carried: IntArray


#: Layouts by the first and the last part of the load's table that a window meets.
Layouts = dict[tuple[int, int], Layout]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """How theta looks from one recording: its actuator, and the parameters `bases` at its `places`.

    `slopes` are dSI/dtheta, `sensors` lag and offset of the sensor of each measured column;
    `layouts` keeps what windows have asked for.
    """

    actuator: Actuator
    numbers: Numbers
    bases: tuple[str, ...]
    places: tuple[int, ...]
    slopes: FloatArray
    size: int
    sensors: Mapping[str, tuple[float, float]]
    layouts: Layouts

    def held(self) -> View:
        """The same with theta held: no parameters, their values in the actuator only."""
        return View(self.actuator, self.numbers, (), (), np.zeros(0), 0, self.sensors, {})

    def met(self, low: float, high: float) -> tuple[int, int]:
        """First and last part of the load's table between two positions in m."""
        return bisect_right(self.numbers.breakpoints, low), bisect_right(self.numbers.breakpoints, high)

    def layout(self, met: tuple[int, int]) -> Layout:
        """The layout of a window that meets these parts of the load's table.

        A load weight matters to the states where its basis function is not zero, a number of a sensor nowhere.
        """
        if met not in self.layouts:
            touched = np.any(self.numbers.basis[:, met[0] : met[1] + 1] != 0.0, axis=(1, 2))
            idle = {name for name, meets in zip(self.actuator.load.names, touched.tolist(), strict=True) if not meets}
            active = [i for i, name in enumerate(self.bases) if name not in idle and name not in SENSORS]
            self.layouts[met] = self._layout(active)
        return self.layouts[met]

    def _layout(self, active: Sequence[int]) -> Layout:
        states, unit = VARIANTS[self.actuator.model], units(self.actuator)
        n, theta = len(states), [*active, *(i for i, name in enumerate(self.bases) if name in SENSORS)]
        which = columns(self.actuator, [*(f"start of {name}" for name in states), *(self.bases[i] for i in active)])
        start = np.zeros((n, n + len(active)))
        start[:, :n] = np.diag(unit)
        column = {self.bases[i]: n + number for number, i in enumerate(theta) if self.bases[i] in SENSORS}
        own = {name: (column.get(lag, -1), column.get(offset, -1)) for name, (_, lag, offset) in COLUMN.items()}
        carried = np.array([self.places[i] for i in theta], dtype=np.int64)
        placed = np.concatenate([np.arange(n), n + carried, [n + self.size]])
        return Layout(which, start, own, np.array(theta, dtype=np.int64), placed, carried[: len(active)])


def view(
    actuator: Actuator,
    bases: Sequence[str],
    places: Sequence[int],
    slopes: FloatArray,
    size: int,
    layouts: Layouts | None = None,
) -> View:
    """The view of a recording in which theta's `places` are the parameters `bases`, with dSI/dtheta `slopes`.

    `layouts` may be those of another view, which differs in values only.
    """
    sensors = {name: (actuator.value(lag), actuator.value(offset)) for name, (_, lag, offset) in COLUMN.items()}
    known = {} if layouts is None else layouts
    return View(actuator, Numbers.of(actuator), tuple(bases), tuple(places), slopes, size, sensors, known)


def window_rows(
    track: Track, window: Segment, start: FloatArray, seen: View, measure: Sequence[str], noise: Noise
) -> Rows | Failure:
    """Simulate a window from `start` and compare it with what was measured.

    Load weights that the piston does not meet in the window have no influence in it and are left out of the simulation.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    n, by, met = start.size, _kernels(), _expected(track, window, start, seen)
    while True:
        layout = seen.layout(met)
        out, sens, end, failed = run_to_end(window, seen.numbers, (start, layout.start), layout.which, WATCHED)
        if failed >= 0 or not np.isfinite(end).all():
            return _failure(track, window, out, failed, seen)
        low, high = by.reach(out[:, 0], start[0])
        needed = seen.met(low - BEYOND, high + BEYOND)
        if not seen.bases or (met[0] <= needed[0] and needed[1] <= met[1]):
            break
        met = min(met[0], needed[0]), max(met[1], needed[1])
    sensors, measured = _sensed(track, window, seen, measure, noise)
    rows, slopes = np.empty((measured.size, layout.columns.size)), np.ones(layout.columns.size - 1)
    slopes[n:] = seen.slopes[layout.theta]
    own = np.array([layout.own[name] for name in measure])
    rows = rows[: by.compare(out, sens[: measured.shape[1]], sensors, own, measured, slopes, rows)]
    cost = robust(rows, noise.outlier)
    small = triangular(rows)
    if not np.isfinite(small).all():
        return _failure(track, window, out, failed, seen)
    told, to_theta = np.empty((small.shape[0], n + seen.size + 1)), np.empty((n, seen.size))
    by.spread(small, layout.columns, told)
    by.spread(end[:, n:] * slopes[n : end.shape[1]], layout.carried, to_theta)
    return Rows(told, out[-1], end[:, :n], to_theta, cost)


def window_cost(
    track: Track, window: Segment, start: FloatArray, seen: View, measure: Sequence[str], noise: Noise
) -> tuple[FloatArray, float] | Failure:
    """End of a window from `start`, and the cost of its residuals; without derivatives, so much cheaper.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    out, failed = run(window, seen.numbers, start)
    if failed >= 0:
        return _failure(track, window, out, failed, seen)
    sensors, measured = _sensed(track, window, seen, measure, noise)
    stop = _compared_samples(track, window)
    return out[-1], _kernels().compare_cost(out[:stop], sensors, measured, noise.outlier)


def _kernels() -> Any:
    return kernels_in("clutchid.estimate.kernels")


def _expected(track: Track, window: Segment, start: FloatArray, seen: View) -> tuple[int, int]:
    """Parts of the load's table that a window will meet, as far as its start and its measured position tell."""
    if not seen.bases:
        return 0, 0
    low, high = _kernels().reach(track.measured["position"][window.start : window.stop], start[0])
    return seen.met(low - EXPECTED, high + EXPECTED)


def _compared_samples(track: Track, window: Segment) -> int:
    """Samples of a window that are compared: the border belongs to the next one."""
    return len(window) if window.stop == track.segment.stop else len(window) - 1


def _sensed(
    track: Track, window: Segment, seen: View, measure: Sequence[str], noise: Noise
) -> tuple[FloatArray, FloatArray]:
    """Sensors as `kernels.compare` wants them, and what they measured in a window."""
    step, at = float(window.dt[0]), slice(window.start, window.start + _compared_samples(track, window))
    sensors = [(COLUMN[name][0], *seen.sensors[name], step, noise.of_samples(name, track.spacing)) for name in measure]
    return np.array(sensors), np.array([track.measured[name][at] for name in measure])


def _failure(track: Track, window: Segment, out: FloatArray, failed: int, seen: View) -> Failure:
    names = VARIANTS[seen.actuator.model]
    return Failure(failure_message(track.measured, window, out, max(failed, 0), names, seen.actuator))


def losses(r: FloatArray, outlier: float) -> FloatArray:
    """Sum over each row of squared residuals, of which those beyond `outlier` count linearly only (Huber 1964)."""
    cost = np.empty(r.shape[0])
    _kernels().row_losses(r, outlier, cost)
    return cost


def robust(rows: FloatArray, outlier: float) -> float:
    """Scale `rows` in place so that residuals beyond `outlier` count linearly only, see `losses`; their cost."""
    return float(_kernels().robust(rows, outlier))

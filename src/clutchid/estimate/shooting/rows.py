"""What a window says: its simulation, compared with what was measured, as rows of the least-squares problem."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.estimate.least_squares import Failure, triangular
from clutchid.estimate.sensing import lag_slope, lagged
from clutchid.estimate.shooting.noise import Noise
from clutchid.estimate.shooting.windows import Track, units
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import VARIANTS
from clutchid.simulation.plan import Segment
from clutchid.simulation.run import Columns, Numbers, columns, run, run_to_end
from clutchid.simulation.simulation import failure_message

#: Numbers of the sensors, which the equations of the actuator do not hold.
SENSORS = ("tau_y", "e_y", "tau_p", "e_p")

#: Of each measured column the place of its state, and the lag and offset of its sensor.
COLUMN = {"position": (0, "tau_y", "e_y"), "pressure_a": (2, "tau_p", "e_p")}

#: A step of the integration looks this far beyond the positions that it stores, in m.
BEYOND = 1e-4


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
class View:
    """How theta looks from one recording: its actuator, and the parameters `bases` at its `places`, with dSI/dtheta.

    `layouts` keeps what windows have asked for: which of the `bases` matter, and their kernel columns.
    """

    actuator: Actuator
    numbers: Numbers
    bases: tuple[str, ...]
    places: tuple[int, ...]
    slopes: FloatArray
    size: int
    layouts: dict[tuple[int, int], tuple[tuple[int, ...], Columns]]

    def held(self) -> View:
        """The same with theta held: no parameters, their values in the actuator only."""
        return View(self.actuator, self.numbers, (), (), np.zeros(0), 0, {})

    def layout(self, low: float, high: float) -> tuple[tuple[int, ...], Columns]:
        """Which of `bases` matter to the states between two positions in m; kernel columns of all starts and of these.

        A load weight does where its basis function is not zero, a number of a sensor nowhere.
        """
        first, last = np.searchsorted(self.numbers.breakpoints, (low, high), side="right").tolist()
        if (first, last) not in self.layouts:
            met = np.any(self.numbers.basis[:, first : last + 1] != 0.0, axis=(1, 2))
            idle = {name for name, meets in zip(self.actuator.load.names, met.tolist(), strict=True) if not meets}
            active = tuple(i for i, name in enumerate(self.bases) if name not in idle and name not in SENSORS)
            states = [f"start of {name}" for name in VARIANTS[self.actuator.model]]
            which = columns(self.actuator, [*states, *(self.bases[i] for i in active)])
            self.layouts[first, last] = (active, which)
        return self.layouts[first, last]


def view(actuator: Actuator, bases: Sequence[str], places: Sequence[int], slopes: FloatArray, size: int) -> View:
    """The view of a recording in which theta's `places` are the parameters `bases`, with dSI/dtheta `slopes`."""
    return View(actuator, Numbers.of(actuator), tuple(bases), tuple(places), slopes, size, {})


def window_rows(
    track: Track, window: Segment, start: FloatArray, seen: View, measure: Sequence[str], noise: Noise
) -> Rows | Failure:
    """Simulate a window from `start` and compare it with what was measured.

    Load weights that the piston does not meet in the window have no influence in it and are left out of the simulation.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    n, unit = start.size, units(seen.actuator)
    low, high = 0.0, 0.0
    if seen.bases:
        out, failed = run(window, seen.numbers, start)
        if failed >= 0:
            return _failure(track, window, out, failed, seen)
        low, high = float(out[:, 0].min()) - BEYOND, float(out[:, 0].max()) + BEYOND
    active, which = seen.layout(low, high)
    S = np.zeros((n, n + len(active)))
    S[:, :n] = np.diag(unit)
    out, sens, end, failed = run_to_end(window, seen.numbers, (start, S), which, (0, 1, 2))
    if failed >= 0 or not np.isfinite(end).all():
        return _failure(track, window, out, failed, seen)
    theta = (*active, *(i for i, name in enumerate(seen.bases) if name in SENSORS))
    slopes, places = seen.slopes[list(theta)], np.array([seen.places[i] for i in theta], dtype=int)
    stop = _compared_samples(track, window)
    rows = np.concatenate(
        [
            _compared(track, window, (out[:stop], sens[:stop]), (seen, theta), name)
            / noise.of_samples(name, track.spacing)
            for name in measure
        ]
    )
    rows[:, n:-1] *= slopes
    known = np.isfinite(rows[:, -1])
    rows = rows if known.all() else rows[known]
    cost = robust(rows, noise.outlier)
    small = triangular(rows)
    own = np.zeros((small.shape[0], n + seen.size + 1))
    own[:, :n], own[:, n + places], own[:, -1] = small[:, :n], small[:, n:-1], small[:, -1]
    to_theta = np.zeros((n, seen.size))
    to_theta[:, places[: len(active)]] = end[:, n:] * slopes[: len(active)]
    return Rows(own, out[-1], end[:, :n], to_theta, cost)


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
    stop = _compared_samples(track, window)
    cost = 0.0
    for name in measure:
        at, lag, offset = COLUMN[name]
        shown = lagged(out[:stop, at], seen.actuator.value(lag), float(window.dt[0]))
        r = _residual(track, window, shown, seen.actuator.value(offset), name)
        cost += loss(r / noise.of_samples(name, track.spacing), noise.outlier)
    return out[-1], cost


def _compared_samples(track: Track, window: Segment) -> int:
    """Samples of a window that are compared: the border belongs to the next one."""
    return len(window) if window.stop == track.segment.stop else len(window) - 1


def _failure(track: Track, window: Segment, out: FloatArray, failed: int, seen: View) -> Failure:
    names = VARIANTS[seen.actuator.model]
    return Failure(failure_message(track.measured, window, out, max(failed, 0), names, seen.actuator))


def _residual(track: Track, window: Segment, shown: FloatArray, offset: float, name: str) -> FloatArray:
    """Simulated less measured column in SI, NaN where nothing was measured."""
    measured = track.measured[name][window.start : window.start + shown.shape[0]]
    return shown + (offset - measured)


def _compared(
    track: Track,
    window: Segment,
    run_of: tuple[FloatArray, FloatArray],
    theta_of: tuple[View, tuple[int, ...]],
    name: str,
) -> FloatArray:
    """Rows ``[start | theta | r]`` in SI of one measured column; r is NaN where nothing was measured."""
    out, sens = run_of
    seen, theta = theta_of
    at, lag, offset = COLUMN[name]
    tau, step = seen.actuator.value(lag), float(window.dt[0])
    carried = sens.shape[2]
    shown = lagged(np.column_stack([sens[:, at], out[:, at]]), tau, step)
    rows = np.zeros((out.shape[0], out.shape[1] + len(theta) + 1))
    rows[:, :carried] = shown[:, :-1]
    for column, i in enumerate(theta[carried - out.shape[1] :], carried):
        if seen.bases[i] == lag:
            rows[:, column] = lag_slope(out[:, at], shown[:, -1], tau, step)
        elif seen.bases[i] == offset:
            rows[:, column] = 1.0
    rows[:, -1] = _residual(track, window, shown[:, -1], seen.actuator.value(offset), name)
    return rows


def losses(r: FloatArray, outlier: float) -> FloatArray:
    """Squared residuals, of which those beyond `outlier` count linearly only (Huber 1964)."""
    size = np.abs(r)
    near = np.minimum(size, outlier)
    found: FloatArray = near * (2.0 * size - near)
    return found


def loss(r: FloatArray, outlier: float) -> float:
    """Sum of the `losses` of residuals; NaN left out."""
    each = losses(r, outlier)
    total = float(each.sum())
    return total if math.isfinite(total) else float(np.nansum(each))


def robust(rows: FloatArray, outlier: float) -> float:
    """Scale `rows` in place so that residuals beyond `outlier` count linearly only, see `loss`; their cost."""
    size = np.abs(rows[:, -1])
    cost = loss(rows[:, -1], outlier)
    far = size > outlier
    if far.any():
        rows[far] *= np.sqrt(outlier / size[far])[:, None]
    return cost

"""Residual rows of a track (windows, links, first state), and elimination of its chain of states.

Linear least squares in x_0 ... x_n and theta, with rows in x_i and theta, and link rows in x_i, x_{i+1} and theta. The
states are eliminated one by one by orthogonal transformations, which leaves a triangular system in theta, whatever the
length of the chain; back-substitution recovers the states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.noise import Noise, opening_of_valves, start_deviations, state_deviations
from clutchid.simulation.parameter_map import LoadPieces, ParameterMap
from clutchid.simulation.plan import Segment
from clutchid.simulation.run import columns, run, run_with_sensitivities, start_sensitivities, start_state
from clutchid.simulation.windows import Track, units

_KERNELS = "clutchid.numerics.householder"


@dataclass(frozen=True, slots=True, eq=False)
class Eliminated:
    """An eliminated chain: the remaining `rows` ``[theta | r]``, and `state_rows` for the back-substitution.

    `state_rows`, shape (windows, n, 2 n + k + 1), are ``[x_i | x_{i+1} | theta | r]``, upper triangular in x_i.
    """

    rows: FloatArray
    state_rows: FloatArray


def eliminate(first: FloatArray, windows: FloatArray, links: FloatArray) -> Eliminated:
    """Eliminate the states of a chain.

    Each elimination passes only the rows that involve the next state on to the next step; the rows in theta alone are
    collected. So the size of a step depends on the number of states, not on the number of parameters.

    Parameters
    ----------
    first : (n, n + k + 1)
        Rows in x_0 and theta, with the residual last; as many rows as states.
    windows : (windows, m, n + k + 1)
        Rows in x_i and theta.
    links : (windows - 1, n, 2 n + k + 1)
        Rows in x_i, x_{i+1} and theta.
    """
    n, width = first.shape
    state_rows = np.empty((windows.shape[0], n, n + width))
    theta_rows = np.empty((windows.shape[0], windows.shape[1] + n, width - n))
    # one layout, which is compiled once
    kernels_in(_KERNELS).eliminate(*map(np.ascontiguousarray, (first, windows, links)), state_rows, theta_rows)
    return Eliminated(stacked_factor(theta_rows), state_rows)


def stacked_factor(rows: FloatArray) -> FloatArray:
    """Triangular factor of the rows (windows, m, k + 1) of all windows, stacked row by row of a window."""
    return triangular(rows.swapaxes(0, 1).reshape(-1, rows.shape[2]))


def recover(chain: Eliminated, theta: FloatArray, noise: FloatArray | None = None) -> FloatArray:
    """States for given `theta` by back-substitution, shape (windows, n, m) for theta of shape (k, m).

    With standard normal `noise`, shape (windows, n, m): draws from the distribution of the states given theta.

    Raises
    ------
    LinAlgError
        If the chain does not determine its states.
    """
    n = chain.state_rows.shape[1]
    states = -chain.state_rows[:, :, -1:] - chain.state_rows[:, :, 2 * n : -1] @ theta
    if noise is not None:
        # each row as if its diagonal were positive: its sign is that of a difference, which rounding may turn
        states += np.sign(np.diagonal(chain.state_rows, axis1=1, axis2=2))[:, :, None] * noise
    if not kernels_in(_KERNELS).substitute(chain.state_rows, states):
        raise np.linalg.LinAlgError("the chain does not determine its states.")
    return states


#: States whose sensitivities are stored at every sample: up to the last measured one.
_OUTPUT_STATES = np.arange(3)

#: Within an integration step the position exceeds the stored samples by less than this, in m.
_STEP_OVERSHOOT = 1e-4

#: Expected deviation of the simulated from the measured position in m; a window that exceeds it is simulated again with
#: all load weights that it needs.
_EXPECTED_DEVIATION = 3e-4


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


class Sensors(NamedTuple):
    """Sensors and samples of the measured columns `names` of a track at a point, as far as all windows share them.

    `table`, (columns, 5), are the sensors of `comparison.compare` without the sample interval, `samples` the columns.
    """

    names: tuple[str, ...]
    table: FloatArray
    samples: tuple[FloatArray, ...]
    outlier: float

    @classmethod
    def of(cls, track: Track, mapped: ParameterMap, measure: Sequence[str], noise: Noise) -> Sensors:
        """Sensors of the columns `measure`."""
        states, names = mapped.actuator.states, tuple(measure)
        table = [
            (states.index(MEASURED[name].state), *mapped.sensors[name], np.nan, noise.of_samples(name, track.spacing))
            for name in names
        ]
        return cls(names, np.array(table), tuple(track.measured[name] for name in names), noise.outlier)

    def within(self, track: Track, window: Segment) -> tuple[FloatArray, FloatArray]:
        """The sensors, and the samples of a window that are compared, (columns, samples)."""
        table, stop = self.table.copy(), window.start + _compared_samples(track, window)
        table[:, 3] = window.dt[0]
        return table, np.array([column[window.start : stop] for column in self.samples])


def window_rows(
    track: Track, window: Segment, start: FloatArray, mapped: ParameterMap, sensors: Sensors
) -> WindowRows | Failure:
    """Simulate a window from `start` with sensitivities and compare it with the measurement.

    Load weights whose basis functions vanish over the positions of the window are left out of the simulation.
    """
    n, compiled, pieces = start.size, _kernels(), _expected_pieces(track, window, start, mapped)
    while True:
        active = mapped.active_columns(pieces)
        out, sens, end, failed = run_with_sensitivities(
            window, mapped.arrays, (start, active.start), active.sensitivities, _OUTPUT_STATES
        )
        if failed >= 0 or not np.isfinite(end).all():
            return _failure(track, window, out, failed, mapped)
        low, high = compiled.value_range(out[:, 0], start[0])
        needed = mapped.load_pieces(low - _STEP_OVERSHOOT, high + _STEP_OVERSHOOT)
        if not mapped.bases or pieces.contains(needed):
            break
        pieces = pieces.joined(needed)
    table, measured = sensors.within(track, window)
    rows, slopes = np.empty((measured.size, active.row_columns.size)), np.ones(active.row_columns.size - 1)
    slopes[n:] = mapped.slopes[active.parameters]
    sensor_columns = np.array([active.sensor_columns[name] for name in sensors.names])
    rows = rows[: compiled.compare(out, sens[: measured.shape[1]], table, sensor_columns, measured, slopes, rows)]
    cost = downweight_outliers(rows, sensors.outlier)
    factor = triangular(rows)
    if not np.isfinite(factor).all():
        return _failure(track, window, out, failed, mapped)
    full, to_theta = np.empty((factor.shape[0], n + mapped.size + 1)), np.empty((n, mapped.size))
    compiled.scatter_columns(factor, active.row_columns, full)
    compiled.scatter_columns(end[:, n:] * slopes[n : end.shape[1]], active.theta_columns, to_theta)
    return WindowRows(full, out[-1], end[:, :n], to_theta, cost)


def window_cost(
    track: Track, window: Segment, start: FloatArray, mapped: ParameterMap, sensors: Sensors
) -> tuple[FloatArray, float] | Failure:
    """Final state of a window from `start`, and the cost of its residuals, without derivatives."""
    out, failed = run(window, mapped.arrays, start)
    if failed >= 0:
        return _failure(track, window, out, failed, mapped)
    table, measured = sensors.within(track, window)
    return out[-1], _kernels().compare_cost(out[: measured.shape[1]], table, measured, sensors.outlier)


def _kernels() -> Any:
    return kernels_in("clutchid.simulation.comparison")


def _expected_pieces(track: Track, window: Segment, start: FloatArray, mapped: ParameterMap) -> LoadPieces:
    """Pieces of the load over the measured positions of a window and its start."""
    if not mapped.bases:
        return LoadPieces(0, 0)
    low, high = _kernels().value_range(track.measured["position"][window.start : window.stop], start[0])
    return mapped.load_pieces(low - _EXPECTED_DEVIATION, high + _EXPECTED_DEVIATION)


def _compared_samples(track: Track, window: Segment) -> int:
    """Number of samples of a window that are compared: the last one belongs to the next window."""
    return len(window) if window.stop == track.segment.stop else len(window) - 1


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


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedWindows:
    """The `WindowRows` of all windows of a track; the first axis is the window.

    With fixed theta there are no columns for it.
    """

    jacobian: FloatArray
    r: FloatArray
    end: FloatArray
    to_start: FloatArray
    to_theta: FloatArray
    cost: FloatArray

    @classmethod
    def stack(cls, windows: Sequence[WindowRows]) -> LinearisedWindows:
        """Stack `windows`; missing rows are zero."""
        width = windows[0].rows.shape[1]
        padded = np.zeros((len(windows), width, width))
        for place, window in enumerate(windows):
            padded[place, : window.rows.shape[0]] = window.rows
        end, to_start, to_theta = (
            np.array([getattr(window, name) for window in windows]) for name in ("end", "to_start", "to_theta")
        )
        cost = np.array([window.cost for window in windows])
        return cls(padded[:, :, :-1], padded[:, :, -1], end, to_start, to_theta, cost)

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self.end.shape[1])

    @property
    def state_rows(self) -> FloatArray:
        """Rows ``[state | theta | r]`` that depend on the initial states, shape (windows, n, n + k + 1)."""
        n = self.states
        return np.concatenate([self.jacobian[:, :n], self.r[:, :n, None]], axis=2)

    @property
    def theta_rows(self) -> FloatArray:
        """Rows ``[theta | r]`` that depend on theta alone, shape (windows, rows, k + 1)."""
        n = self.states
        return np.concatenate([self.jacobian[:, n:, n:], self.r[:, n:, None]], axis=2)

    def extrapolated(self, starts: FloatArray, step: FloatArray) -> LinearisedWindows:
        """Residuals, end and cost after a step of the initial states, (windows, n) in natural sizes, and of theta."""
        both = np.column_stack([starts, np.broadcast_to(step, (starts.shape[0], step.size))])
        r = self.r + np.einsum("wij,wj->wi", self.jacobian, both)
        end = self.end + np.einsum("wij,wj->wi", self.to_start, starts) + self.to_theta @ step
        return replace(self, r=r, end=end, cost=self.cost + np.sum(r**2 - self.r**2, axis=1))

    def states_only(self) -> LinearisedWindows:
        """The rows that depend on the initial states, with theta fixed."""
        n = self.states
        return replace(self, jacobian=self.jacobian[:, :n, :n], r=self.r[:, :n], to_theta=self.to_theta[:, :, :0])

    def updated(self, places: NDArray[np.intp], new: LinearisedWindows) -> LinearisedWindows:
        """The windows with those at `places` replaced by `new`."""
        height = self.jacobian.shape[1]

        def replaced(old: FloatArray, other: FloatArray) -> FloatArray:
            both = old.copy()
            both[places] = other
            return both

        return LinearisedWindows(
            replaced(self.jacobian, new.jacobian[:, :height]),
            replaced(self.r, new.r[:, :height]),
            replaced(self.end, new.end),
            replaced(self.to_start, new.to_start),
            replaced(self.to_theta, new.to_theta),
            replaced(self.cost, new.cost),
        )


def link_sigma(track: Track, actuator: Actuator, noise: Noise) -> FloatArray:
    """Standard deviation of each window's final state from the next initial state, shape (n windows, n states).

    This is the process noise over a window: a random walk of the states, an error in the flow through open valves, and
    what flows where changes of the duty cycles are not recorded.
    """
    segment = track.segment
    edges = np.array([window.start for window in track.windows]) - segment.start
    span = np.add.reduceat(segment.dt, edges)
    opened = np.add.reduceat(opening_of_valves(segment, actuator) * segment.dt, edges)
    unrecorded = np.sqrt(np.add.reduceat(segment.open_std**2, edges))
    return state_deviations(actuator, noise, span, np.hypot(noise.flow * opened, unrecorded))


def link_costs(ends: FloatArray, starts: FloatArray, sigma: FloatArray, outlier: float) -> FloatArray:
    """Cost of the link from the end of each window to the start of the next; 0 for the last, which has none."""
    return np.append(huber_losses((starts[1:] - ends[:-1]) / sigma[:-1], outlier), 0.0)


def link_rows(
    linearised: LinearisedWindows,
    ends: FloatArray,
    starts: FloatArray,
    sigma: FloatArray,
    actuator: Actuator,
    outlier: float,
) -> FloatArray:
    """Rows ``[state | next state | theta | r]`` that link the `ends` of windows to the next `starts`.

    Shape (windows - 1, n, 2 n + k + 1).
    """
    n = linearised.states
    rows = np.empty((starts.shape[0] - 1, n, 2 * n + linearised.to_theta.shape[2] + 1))
    rows[:, :, :n], rows[:, :, n : 2 * n] = -linearised.to_start[:-1], np.diag(units(actuator))
    rows[:, :, 2 * n : -1], rows[:, :, -1] = -linearised.to_theta[:-1], starts[1:] - ends[:-1]
    rows /= sigma[:-1, :, None]
    downweight_outliers(rows.reshape(-1, rows.shape[2]), outlier)
    return rows


def first_rows(
    track: Track, start: FloatArray, mapped: ParameterMap, with_pressure: bool, noise: Noise
) -> tuple[FloatArray, float]:
    """Prior rows of the first state of a track, and their cost."""
    segment = track.segment
    sigma = start_deviations(segment, mapped.actuator, with_pressure, noise)
    mean = start_sensitivities(segment, mapped.actuator, columns(mapped.actuator, mapped.bases), estimated=False)
    r = (start - start_state(segment, mapped.actuator)) / sigma
    rows = np.zeros((start.size, start.size + mapped.size + 1))
    rows[:, : start.size] = np.diag(units(mapped.actuator) / sigma)
    rows[:, [start.size + place for place in mapped.places]] = -mean * mapped.slopes / sigma[:, None]
    rows[:, -1] = r
    return rows, float(r @ r)

"""Links between neighbouring windows (process noise of the model), and the prior on the first state of a track."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.process_noise import opening_of_valves, start_deviations, state_deviations
from clutchid.simulation.run import columns, start_sensitivities, start_state
from clutchid.simulation.windows import Track, units
from clutchid.smoother.linearised_windows import LinearisedWindows
from clutchid.smoother.window_rows import downweight_outliers, huber_losses
from clutchid.uncertainty.noise import Noise


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

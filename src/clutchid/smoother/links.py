"""What ties windows together: the model's own error between neighbours, and what is known of the first state."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import VARIANTS, kernels
from clutchid.simulation.parameter_map import View
from clutchid.simulation.run import columns, start_sensitivities, start_state
from clutchid.simulation.windows import Track, units
from clutchid.smoother.linearised_windows import Told
from clutchid.smoother.window_rows import losses, robust
from clutchid.uncertainty.noise import SPAN, START, UNKNOWN_START, Noise


def link_sigma(track: Track, actuator: Actuator, noise: Noise) -> FloatArray:
    """Standard deviation of the step from the end of each window to the next start, shape (n windows, n states).

    That is the model's own error over a window: its states drift like a random walk, and of the air that flows through
    an open valve a part is misjudged.
    """
    p, names = actuator.parameters, VARIANTS[actuator.model]
    segment = track.segment
    edges = np.array([window.start for window in track.windows]) - segment.start
    span = np.add.reduceat(segment.dt, edges)
    u, opening = segment.inputs[: segment.dt.size], kernels(actuator.model).opening
    share = opening(u[:, 0], p.R_0vs, p.R_1vs) + opening(u[:, 1], p.R_0ve, p.R_1ve)
    opened = np.add.reduceat(share * segment.dt, edges)
    volume = p.V_0A + 0.5 * p.A_A * p.y_max
    air = noise.flow * opened * p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / volume
    sigma: FloatArray = np.array([noise.states[name] for name in names]) * np.sqrt(span / SPAN)[:, None]
    at = names.index("p_A")
    sigma[:, at] = np.hypot(sigma[:, at], air)
    return sigma


def link_costs(ends: FloatArray, starts: FloatArray, sigma: FloatArray, outlier: float) -> FloatArray:
    """Cost of the steps from the end of each window to the start of the next; 0 for the last, which has none."""
    return np.append(losses((starts[1:] - ends[:-1]) / sigma[:-1], outlier), 0.0)


def link_rows(
    told: Told, ends: FloatArray, starts: FloatArray, sigma: FloatArray, actuator: Actuator, outlier: float
) -> FloatArray:
    """Rows ``[state | next state | theta | r]`` that tie the `ends` of windows to the next `starts`.

    Shape (windows - 1, n, 2 n + k + 1).
    """
    n = told.states
    rows = np.empty((starts.shape[0] - 1, n, 2 * n + told.to_theta.shape[2] + 1))
    rows[:, :, :n], rows[:, :, n : 2 * n] = -told.to_start[:-1], np.diag(units(actuator))
    rows[:, :, 2 * n : -1], rows[:, :, -1] = -told.to_theta[:-1], starts[1:] - ends[:-1]
    rows /= sigma[:-1, :, None]
    robust(rows.reshape(-1, rows.shape[2]), outlier)
    return rows


def first_rows(
    track: Track, start: FloatArray, seen: View, with_pressure: bool, noise: Noise
) -> tuple[FloatArray, float]:
    """Rows of what is known of the first state of a track, and their cost."""
    names, segment = VARIANTS[seen.actuator.model], track.segment
    spread = dict(START if segment.vented else UNKNOWN_START)
    if with_pressure and np.isfinite(segment.pressure_start):
        spread["p_A"] = max(spread["p_A"] if segment.vented else 0.0, noise.measured["pressure_a"])
    sigma = np.array([spread[name] for name in names])
    known = start_sensitivities(segment, seen.actuator, columns(seen.actuator, seen.bases), estimated=False)
    r = (start - start_state(segment, seen.actuator)) / sigma
    rows = np.zeros((start.size, start.size + seen.size + 1))
    rows[:, : start.size] = np.diag(units(seen.actuator) / sigma)
    rows[:, [start.size + place for place in seen.places]] = -known * seen.slopes / sigma[:, None]
    rows[:, -1] = r
    return rows, float(r @ r)

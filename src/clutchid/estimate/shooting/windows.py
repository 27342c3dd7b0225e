"""Windows of a recording, their simulation, and the rows they put into the least-squares problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from clutchid.estimate.least_squares import Failure, triangular
from clutchid.estimate.shooting.noise import SPAN, START, UNKNOWN_START, Noise
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import VARIANTS
from clutchid.simulation.plan import Plan, Segment
from clutchid.simulation.run import Columns, Numbers, columns, run, run_to_end, start_sensitivities, start_state
from clutchid.simulation.simulation import failure_message

#: Length of a window in s, and time after which the first guess of the states takes the measured position again.
WINDOW, GUESS = 0.1, 0.02

#: Natural size of each state, in SI.
UNITS: Mapping[str, float] = {
    "y": 1e-3, "v": 0.1, "p_A": 1e5, "p_B": 1e4, "z": 1e-4, "T_A": 10.0, "T_B": 10.0, "p_S": 1e5
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One segment of a recording, cut into windows that share their border samples; `log` is its number in the fit."""

    log: int
    measured: Log
    segment: Segment
    windows: tuple[Segment, ...]


def tracks(plans: Sequence[Plan]) -> tuple[Track, ...]:
    """All segments of all recordings, cut into windows.

    Raises
    ------
    Nothing: a recording is checked where it is planned.
    """
    return tuple(
        Track(number, prepared.log, segment, tuple(_windows(segment)))
        for number, prepared in enumerate(plans)
        for segment in prepared.segments
        if len(segment) > 1
    )


def _windows(segment: Segment) -> list[Segment]:
    length = samples(segment, WINDOW)
    edges = [*range(0, len(segment) - 1, length), len(segment) - 1]
    if len(edges) > 2 and edges[-1] - edges[-2] < length // 2:
        edges.pop(-2)
    return [_window(segment, a, b) for a, b in pairwise(edges)]


def samples(segment: Segment, seconds: float) -> int:
    """Number of samples of `segment` in `seconds`, at least 2."""
    return max(2, round(seconds / float(np.median(segment.dt))))


def _window(segment: Segment, a: int, b: int) -> Segment:
    return replace(
        segment,
        start=segment.start + a,
        stop=segment.start + b + 1,
        inputs=np.ascontiguousarray(segment.inputs[a : b + 1]),
        dt=np.ascontiguousarray(segment.dt[a:b]),
        substeps=np.ascontiguousarray(segment.substeps[a:b]),
        jump=np.zeros(b + 1 - a, dtype=np.uint8),
        measured=np.zeros((b + 1 - a, 2)),
    )


def units(actuator: Actuator) -> FloatArray:
    """Natural sizes of the states of the actuator's model."""
    return np.array([UNITS[name] for name in VARIANTS[actuator.model]])


def first_guess(track: Track, actuator: Actuator, with_pressure: bool) -> FloatArray | Failure:
    """States at the start of every window, shape (n, n_states): simulated, with what is measured taken again often.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    states, failed = run(track.segment, Numbers.of(actuator), start_state(track.segment, actuator))
    if failed >= 0:
        return Failure(failure_message(track.measured, track.segment, states, failed, VARIANTS[actuator.model]))
    at = np.array([window.start for window in track.windows])
    guess: FloatArray = states[at - track.segment.start]
    time, position = track.measured.time, track.measured["position"]
    reach = samples(track.segment, 0.016) // 2
    for i, sample in enumerate(at):
        near = slice(max(track.segment.start, sample - reach), min(track.segment.stop, sample + reach + 1))
        known = np.isfinite(position[near])
        if known.sum() > 2:
            guess[i, 0] = np.median(position[near][known])
            t = time[near][known] - time[sample]
            guess[i, 1] = np.polyfit(t, position[near][known], 1)[0]
        if with_pressure and np.isfinite(track.measured["pressure_a"][near]).any():
            guess[i, 2] = np.nanmedian(track.measured["pressure_a"][near])
    return guess


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """What a window says: `own` rows ``[state | theta | r]``, its end with derivatives to start and theta, its cost."""

    own: FloatArray
    end: FloatArray
    to_start: FloatArray
    to_theta: FloatArray
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """How theta looks from one recording: its actuator, kernel columns, and their places and slopes in theta."""

    actuator: Actuator
    numbers: Numbers
    which: Columns
    bases: tuple[str, ...]
    places: tuple[int, ...]
    slopes: FloatArray
    size: int


def view(actuator: Actuator, bases: Sequence[str], places: Sequence[int], slopes: FloatArray, size: int) -> View:
    """The view of a recording in which theta's `places` are the parameters `bases`, with dSI/dtheta `slopes`."""
    states = [f"start of {name}" for name in VARIANTS[actuator.model]]
    which = columns(actuator, [*bases, *states])
    return View(actuator, Numbers.of(actuator), which, tuple(bases), tuple(places), slopes, size)


def window_rows(
    track: Track, window: Segment, start: FloatArray, seen: View, measure: Sequence[str], noise: Noise
) -> Rows | Failure:
    """Simulate a window from `start` and compare it with what was measured.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    n, k = start.size, len(seen.bases)
    S = np.zeros((n, k + n))
    S[:, k:] = np.diag(units(seen.actuator))
    out, sens, end, failed = run_to_end(window, seen.numbers, (start, S), seen.which, (0, 1, 2))
    if failed >= 0 or not np.isfinite(end).all():
        return _failure(track, window, out, failed, seen)
    stop = _compared_samples(track, window)
    local = np.vstack([_compared(track, window, out[:stop], sens[:stop], seen, name, noise) for name in measure])
    cost = robust(local, noise.outlier)
    rows = np.zeros((local.shape[0], n + seen.size + 1))
    rows[:, :n] = local[:, k:-1]
    rows[:, [n + place for place in seen.places]] = local[:, :k] * seen.slopes
    rows[:, -1] = local[:, -1]
    to_theta = np.zeros((n, seen.size))
    to_theta[:, list(seen.places)] = end[:, :k] * seen.slopes
    return Rows(triangular(rows), out[-1], end[:, k:], to_theta, cost)


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
    none = np.zeros((stop, 2, 0))
    rows = [_compared(track, window, out[:stop], none, replace(seen, bases=()), name, noise) for name in measure]
    return out[-1], sum(robust(block, noise.outlier) for block in rows)


def _compared_samples(track: Track, window: Segment) -> int:
    """Samples of a window that are compared: the border belongs to the next one."""
    return len(window) if window.stop == track.segment.stop else len(window) - 1


def _failure(track: Track, window: Segment, out: FloatArray, failed: int, seen: View) -> Failure:
    return Failure(failure_message(track.measured, window, out, max(failed, 0), VARIANTS[seen.actuator.model]))


def _compared(
    track: Track, window: Segment, out: FloatArray, sens: FloatArray, seen: View, name: str, noise: Noise
) -> FloatArray:
    """Rows ``[parameters | start | r]`` of one measured column, missing samples left out."""
    p, scale = seen.actuator.parameters, noise.measured[name]
    if name == "position":
        lag, offset, value, rate = p.tau_y, p.e_y, out[:, 0], out[:, 1]
        J = sens[:, 0] - lag * sens[:, 1]
        own = {"tau_y": -rate, "e_y": np.ones_like(rate)}
    else:
        lag, offset, value = p.tau_p, p.e_p, out[:, 2]
        rate = np.gradient(value, window.dt[0]) if value.size > 1 else np.zeros_like(value)
        J = sens[:, -1] - (lag * np.gradient(sens[:, -1], window.dt[0], axis=0) if value.size > 1 else 0.0)
        own = {"tau_p": -rate, "e_p": np.ones_like(rate)}
    for base, derivative in own.items():
        if base in seen.bases:
            J[:, seen.bases.index(base)] = derivative
    measured = track.measured[name][window.start : window.start + value.size]
    rows = np.column_stack([J, value - lag * rate + offset - measured]) / scale
    known: FloatArray = rows[np.isfinite(measured)]
    return known


def robust(rows: FloatArray, outlier: float) -> float:
    """Scale `rows` in place so that residuals beyond `outlier` count linearly only (Huber 1964); their cost."""
    r = np.abs(rows[:, -1])
    far = r > outlier
    cost = float(np.sum(rows[:, -1] ** 2))
    if far.any():
        cost += float(np.sum(2 * outlier * r[far] - outlier**2 - r[far] ** 2))
        rows[far] *= np.sqrt(outlier / r[far])[:, None]
    return cost


def link_cost(end: FloatArray, start: FloatArray, sigma: FloatArray, outlier: float) -> float:
    """Cost of the step from the end of a window to the `start` of the next."""
    return robust(((start - end) / sigma)[:, None], outlier)


def link_rows(
    before: Rows, start: FloatArray, sigma: FloatArray, actuator: Actuator, outlier: float
) -> tuple[FloatArray, float]:
    """Rows that tie the end of a window to the `start` of the next, and their cost."""
    joined = np.column_stack([-before.to_start, np.diag(units(actuator)), -before.to_theta, start - before.end])
    rows = joined / sigma[:, None]
    cost = robust(rows, outlier)
    return rows, cost


def link_sigma(window: Segment, actuator: Actuator, noise: Noise) -> FloatArray:
    """Standard deviation of the step from the end of `window` to the next start: the model's own error in it."""
    p, names = actuator.parameters, VARIANTS[actuator.model]
    span = float(window.dt.sum())
    sigma: FloatArray = np.array([noise.states[name] for name in names]) * np.sqrt(span / SPAN)
    low, high = np.array([p.R_0vs, p.R_0ve]), np.array([p.R_1vs, p.R_1ve])
    opened = np.clip((window.inputs[:-1, :2] - low) / (high - low), 0.0, 1.0).sum(axis=1) @ window.dt
    volume = p.V_0A + 0.5 * p.A_A * p.y_max
    air = noise.flow * opened * p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / volume
    at = names.index("p_A")
    sigma[at] = np.hypot(sigma[at], air)
    return sigma


def first_rows(
    track: Track, start: FloatArray, seen: View, with_pressure: bool, noise: Noise
) -> tuple[FloatArray, float]:
    """Rows of what is known of the first state of a track, and their cost."""
    names, segment = VARIANTS[seen.actuator.model], track.segment
    spread = dict(START if segment.vented else UNKNOWN_START)
    if with_pressure and np.isfinite(segment.pressure_start):
        spread["p_A"] = max(spread["p_A"] if segment.vented else 0.0, noise.measured["pressure_a"])
    sigma = np.array([spread[name] for name in names])
    known = start_sensitivities(segment, seen.actuator, seen.which, estimated=False)[:, : len(seen.bases)]
    r = (start - start_state(segment, seen.actuator)) / sigma
    rows = np.zeros((start.size, start.size + seen.size + 1))
    rows[:, : start.size] = np.diag(units(seen.actuator) / sigma)
    rows[:, [start.size + place for place in seen.places]] = -known * seen.slopes / sigma[:, None]
    rows[:, -1] = r
    return rows, float(r @ r)

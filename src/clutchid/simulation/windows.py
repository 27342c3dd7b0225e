"""Windows of a recording, and initial values of their states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from clutchid.log import FloatArray, Log, median, sample_interval
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.plan import Plan, Segment
from clutchid.simulation.run import KernelArrays, run, start_state

#: Length of a window in s, and interval in s between resets of the simulation that gives the initial values.
_WINDOW, RESET_INTERVAL = 0.1, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One segment of a recording, cut into windows that share their border samples.

    `log` is the number of the recording in the fit, `spacing` the interval between measured positions in s.
    """

    log: int
    measured: Log
    segment: Segment
    windows: tuple[Segment, ...]
    spacing: float


def tracks(plans: Sequence[Plan]) -> tuple[Track, ...]:
    """All segments of all recordings, cut into windows."""
    return tuple(
        Track(number, prepared.log, segment, tuple(_windows(segment)), _spacing(prepared.log))
        for number, prepared in enumerate(plans)
        for segment in prepared.segments
        if len(segment) > 1
    )


def _spacing(log: Log) -> float:
    stamps = log.time[np.isfinite(log["position"])]
    return sample_interval(stamps, _WINDOW)


def _windows(segment: Segment) -> list[Segment]:
    length = samples_in(segment, _WINDOW)
    edges = [*range(0, len(segment) - 1, length), len(segment) - 1]
    if len(edges) > 2 and edges[-1] - edges[-2] < length // 2:
        edges.pop(-2)
    return [_window(segment, a, b) for a, b in pairwise(edges)]


def samples_in(segment: Segment, seconds: float) -> int:
    """Number of samples of `segment` in `seconds`, at least 2."""
    return max(2, round(seconds / median(segment.dt)))


def _window(segment: Segment, a: int, b: int) -> Segment:
    return replace(
        segment,
        start=segment.start + a,
        stop=segment.start + b + 1,
        inputs=np.ascontiguousarray(segment.inputs[a : b + 1]),
        dt=np.ascontiguousarray(segment.dt[a:b]),
        open_std=segment.open_std[a:b],
        substeps=np.ascontiguousarray(segment.substeps[a:b]),
        jump=np.zeros(b + 1 - a, dtype=np.uint8),
        measured=np.zeros((b + 1 - a, 2)),
    )


def with_window_steps(track: Track) -> Track:
    """`track` with the integration steps of its windows, which are fewer than those of the plan."""
    substeps = track.segment.substeps.copy()
    for window in track.windows:
        begin = window.start - track.segment.start
        substeps[begin : begin + len(window.substeps)] = window.substeps
    return replace(track, segment=replace(track.segment, substeps=substeps))


def units(actuator: Actuator) -> FloatArray:
    """Natural sizes of the states of the actuator's model."""
    return np.array([row.scale for row in actuator.state_rows.values()])


def initial_states(track: Track, actuator: Actuator, with_pressure: bool) -> FloatArray | Failure:
    """Initial values of the states of every window, shape (n, n_states).

    From a simulation with frequent resets; position, velocity and pressure from the measurement, if available.
    """
    states, failed = run(track.segment, KernelArrays.of(actuator), start_state(track.segment, actuator))
    if failed >= 0:
        return Failure(failure_message(track.measured, track.segment, states, failed, actuator.states))
    at = np.array([window.start for window in track.windows])
    guess: FloatArray = states[at - track.segment.start]
    time, position = track.measured.time, track.measured["position"]
    reach = samples_in(track.segment, 0.016) // 2
    for i, sample in enumerate(at):
        near = slice(max(track.segment.start, sample - reach), min(track.segment.stop, sample + reach + 1))
        recorded = np.isfinite(position[near])
        if recorded.sum() > 2:
            guess[i, 0] = np.median(position[near][recorded])
            t = time[near][recorded] - time[sample]
            guess[i, 1] = np.polyfit(t, position[near][recorded], 1)[0]
        if with_pressure and np.isfinite(track.measured["pressure_a"][near]).any():
            guess[i, 2] = np.nanmedian(track.measured["pressure_a"][near])
    return guess

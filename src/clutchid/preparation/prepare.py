"""Recordings prepared for an actuator: named, checked, on a time grid that resolves pulses, in windows with steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray, Log, sample_interval
from clutchid.model.actuator import Actuator
from clutchid.model.equipment import Equipment
from clutchid.preparation.pulses import FindPhase, find_phase, frequent_resets, pulsed
from clutchid.simulation.plan import Plan, Segment, outside_stroke, plan
from clutchid.simulation.stiffness import TOP_SPEED, local_stiffness, stiffness, substeps
from clutchid.simulation.windows import RESET_INTERVAL, Track, samples_in, tracks
from clutchid.strokes.values import values_of
from clutchid.strokes.vented_rest import other_zeros

#: Factors on the initial stiffness for the integration steps, because a search may make the model stiffer: for a start
#: at the priors, and at calibrated values, which change little.
MARGIN, CALIBRATED_MARGIN = 1.3, 1.05

#: Longest integration step in s: its error is below a hundredth of the process noise of a window.
MAX_STEP = 5e-4

#: Number of parts of the stroke, and classes of speed in m/s, for which the stiffness is computed.
_STROKE_PARTS, _SPEED_CLASSES = 4, (0.05, 0.15, TOP_SPEED)

#: Margins on measured position in m and speed in m/s, and the time in s over which the speed is averaged.
_POSITION_MARGIN, SPEED_MARGIN, _SPEED_WINDOW = 3e-4, 0.03, 8e-3

#: Two positions of a slow recording that are this many intervals apart have others missing between them.
_MISSING = 1.5


#: Advice for a recording without pressure.
FROM_POSITION_ALONE = (
    "From position alone, estimate the load with a calibration: clutchid estimate LOG --start CAL.toml."
)


def check_recordings(logs: Sequence[Log], others: Sequence[Log], measure: Sequence[str], y_max: float) -> None:
    """Refuse, before any work, recordings that lack a column; only the fitted `logs` need all of `measure`.

    Raises
    ------
    DataError
        The text lists the problems of all recordings.
    """
    if not logs:
        raise DataError("no recording given; a fit needs at least one.")
    problems: list[str] = []
    for log, compared in (*((log, measure) for log in logs), *((log, ("position",)) for log in others)):
        needed = dict.fromkeys(("duty_supply", "duty_exhaust", "position", *compared))
        absent = [name for name in needed if name not in log]
        empty = [name for name in compared if name in log and not np.isfinite(log[name]).any()]
        sentences, alien = outside_stroke(log, y_max)
        problems += sentences if alien else ()
        problems += [
            f"{log.name}: no column '{name}'; it has {', '.join(log.columns)}."
            f"{f' {FROM_POSITION_ALONE}' if name == 'pressure_a' else ''}"
            for name in absent
        ]
        problems += [f"{log.name}: column '{name}' has no finite sample; nothing can be compared." for name in empty]
    DataError.raise_for(problems)


def with_duty_cycles(logs: Sequence[Log], equipment: Equipment) -> list[Log]:
    """Logs with distinct names, and with duty cycles for both valves of the model."""
    return [equipment.driven(log) for log in _uniquely_named(list(logs))]


def with_usable_samples(logs: Sequence[Log], actuator: Actuator) -> list[Log]:
    """Logs in which impossible values are missing, with a warning each; see `clutchid.strokes.values`.

    Raises
    ------
    DataError
        If the position of one counts from another zero after a jump.
    """
    all_values = [values_of(log, actuator) for log in logs]
    DataError.raise_for([sentence for values in all_values for sentence in other_zeros(values)])
    return [values.warned for values in all_values]


def _uniquely_named(logs: list[Log]) -> list[Log]:
    """Logs with distinct names: a number is appended if two files have the same stem."""
    taken = {log.name for log in logs}
    used: set[str] = set()
    named = []
    for log in logs:
        name, number = log.name, 2
        while name in used or (name != log.name and name in taken):
            name, number = f"{log.name} ({number})", number + 1
        used.add(name)
        named.append(log if name == log.name else replace(log, name=name))
    return named


def prepare(
    log: Log, actuator: Actuator, measure: Sequence[str], find: FindPhase = find_phase, rate: float | None = None
) -> Plan:
    """Plan of a recording for `actuator`: time grid that resolves the pulses, carrier phase, and integration steps.

    The plan has resets at short intervals, for the initial values of the states.

    Parameters
    ----------
    log : Log
        With both duty cycles and the compared columns.
    actuator : Actuator
        Its carrier is identified; the actuator of the plan has the identified phase.
    measure : 'position', 'pressure_a'
        Measured columns in use.
    find : function
        Estimates the phase of the carrier where only the position shows it.
    rate : 1/s, optional
        Stiffness for the integration steps, where it is known; by default `MARGIN` times that of the actuator.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle, or a column that the phase is estimated from, or is too slow for the edges
        of on/off valves.
    """
    with_pressure = "pressure_a" in measure
    pulsed_log = pulsed(log, actuator, with_pressure, find)
    if pulsed_log.warning:
        raise DataError(pulsed_log.warning)
    step = sample_interval(pulsed_log.log.time, RESET_INTERVAL)
    rate = MARGIN * stiffness(pulsed_log.actuator) if rate is None else rate
    prepared = plan(
        pulsed_log.log, pulsed_log.actuator, rate, frequent_resets(step), with_pressure, pulsed_log.open_std
    )
    identified = prepared.actuator.replace({"T_pwm": actuator.parameters.T_pwm})
    return replace(prepared, actuator=identified, phase_std=pulsed_log.phase_std)


def tracks_with_steps(plans: Sequence[Plan], margin: float) -> tuple[Track, ...]:
    """All segments in windows, each with as few integration steps as are stable.

    Few windows contain the stiffest states of an actuator: a small chamber at a stop, and a piston at full speed. With
    the steps for these, most windows would take twice as long. A window never has more steps than its plan.

    Parameters
    ----------
    plans : several
        Their measured positions give the position of the piston; a window without any keeps its steps.
    margin : 1
        Factor by which a search may make an actuator stiffer.
    """
    return tuple(with_steps(track, plans[track.log].actuator, margin) for track in tracks(plans))


def with_steps(track: Track, actuator: Actuator, margin: float) -> Track:
    """One track of `tracks_with_steps`."""
    edges = np.linspace(0.0, actuator.parameters.y_max, _STROKE_PARTS + 1)
    edges[0], edges[-1] = -np.inf, np.inf

    @cache
    def rate(part: int, speed: float) -> float:
        return margin * local_stiffness(actuator, speed, (float(edges[part]), float(edges[part + 1])))

    position = _between_samples(track)
    return replace(track, windows=tuple(_window_with_steps(position, window, edges, rate) for window in track.windows))


def _between_samples(track: Track) -> FloatArray:
    """Measured position; that of a slow recording interpolated on its time grid, but not where samples are missing."""
    time, position = track.measured.time, track.measured["position"]
    recorded = np.flatnonzero(np.isfinite(position))
    if track.spacing <= _SPEED_WINDOW or recorded.size < 2:
        return position
    between: FloatArray = np.interp(time, time[recorded], position[recorded], np.nan, np.nan)
    after = np.searchsorted(recorded, np.arange(time.size)).clip(1, recorded.size - 1)
    between[np.diff(time[recorded])[after - 1] > _MISSING * track.spacing] = np.nan
    return between


def _window_with_steps(
    of_track: FloatArray, window: Segment, edges: FloatArray, rate: Callable[[int, float], float]
) -> Segment:
    position = of_track[window.start : window.stop]
    far = samples_in(window, _SPEED_WINDOW) - 1
    travel = np.abs(position[far:] - position[:-far])
    if not np.isfinite(travel).all() or travel.size == 0:
        return window
    fastest = float(travel.max()) / _SPEED_WINDOW + SPEED_MARGIN
    speed = next((limit for limit in _SPEED_CLASSES if fastest <= limit), None)
    if speed is None:
        return window
    reach = np.array([position.min() - _POSITION_MARGIN, position.max() + _POSITION_MARGIN])
    first, last = np.searchsorted(edges, reach).clip(1, _STROKE_PARTS) - 1
    stiffest = max(rate(part, speed) for part in range(first, last + 1))
    steps = np.maximum(substeps(window.dt, stiffest), np.ceil(window.dt / MAX_STEP * (1 - 1e-9)).astype(np.int32))
    return replace(window, substeps=np.minimum(window.substeps, steps))

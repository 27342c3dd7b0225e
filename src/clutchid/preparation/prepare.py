"""Recordings made ready for an actuator: named, checked, on a time grid that shows their pulses, cut, with steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.equipment import Equipment
from clutchid.preparation.pulses import pulsed
from clutchid.simulation import Partition
from clutchid.simulation.plan import Plan, Segment, outside_stroke, plan
from clutchid.simulation.stiffness import TOP_SPEED, local_stiffness, stiffness, substeps
from clutchid.simulation.windows import GUESS, Track, samples, tracks

#: The steps of the integration follow this many times the stiffness at the start, for values that make it stiffer; from
#: calibrated values, which hardly move, so many times.
MARGIN, CALIBRATED_MARGIN = 1.3, 1.05

#: Longest integration step in s, which a window that is not stiff takes: its error stays below a hundredth of what the
#: model misjudges in a window.
LONGEST = 5e-4

#: The stroke is looked at in so many parts; speeds in m/s, of which a window has the next higher one.
PARTS, SPEEDS = 4, (0.05, 0.15, TOP_SPEED)

#: What is added to a position in m and a speed in m/s that were measured, over so many s.
BEYOND, FASTER, OVER = 3e-4, 0.03, 8e-3


def check_recordings(logs: Sequence[Log], others: Sequence[Log], measure: Sequence[str], y_max: float) -> None:
    """Refuse, before any work, recordings that lack a column; only the fitted `logs` need all of `measure`.

    Raises
    ------
    DataError
        The text lists the problems of all recordings.
    """
    if not logs:
        raise DataError("no recording given; a fit needs at least one.")
    problems = []
    for log, compared in (*((log, measure) for log in logs), *((log, ("position",)) for log in others)):
        needed = dict.fromkeys(("duty_supply", "duty_exhaust", "position", *compared))
        absent = [name for name in needed if name not in log]
        empty = [name for name in compared if name in log and not np.isfinite(log[name]).any()]
        sentences, alien = outside_stroke(log, y_max)
        problems += sentences if alien else []
        problems += [f"{log.name}: no column '{name}'; it has {', '.join(log.columns)}." for name in absent]
        problems += [f"{log.name}: column '{name}' has no finite sample; nothing can be compared." for name in empty]
    if problems:
        raise DataError("\n".join(problems))


def driven(logs: Sequence[Log], equipment: Equipment) -> list[Log]:
    """Logs with different names, and with duty cycles for both valves of the model."""
    return [equipment.driven(log) for log in _uniquely_named(list(logs))]


def _uniquely_named(logs: list[Log]) -> list[Log]:
    """Logs with different names: a number is added where two files have the same stem."""
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


def prepare(log: Log, actuator: Actuator, measure: Sequence[str]) -> Plan:
    """A recording made ready for `actuator`: on a time grid that shows its pulses, with the carrier's phase and steps.

    The first guess of the states takes the measured position again and again, so the plan has resets.

    Parameters
    ----------
    log : Log
        With both duty cycles and the columns that are compared.
    actuator : Actuator
        Its carrier is looked for; the plan's actuator has the phase that was found.
    measure : 'position', 'pressure_a'
        Measured columns in use.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle, or a column that the phase is read from.
    """
    with_pressure = "pressure_a" in measure
    found = pulsed(log, actuator, with_pressure)
    step = float(np.median(np.diff(found.log.time))) if len(found.log) > 1 else GUESS
    every = Partition(every=max(2, round(GUESS / step)))
    done = plan(found.log, found.actuator, MARGIN * stiffness(found.actuator), every, with_pressure)
    warnings = (*done.warnings, found.warning) if found.warning else done.warnings
    return replace(done, warnings=warnings, phase_std=found.spread)


def paced_tracks(plans: Sequence[Plan], margin: float) -> tuple[Track, ...]:
    """All segments cut into windows, each with as few integration steps as are stable.

    The stiffest places of an actuator, a small chamber at a stop and a piston at full speed, are met in few windows;
    with the steps that these need most windows would take twice as long. A window never takes more than its plan has.

    Parameters
    ----------
    plans : several
        Their measured positions say where the piston is; a window without keeps its steps.
    margin : 1
        By how much stiffer an actuator may become during a search.
    """
    return tuple(paced(track, plans[track.log].actuator, margin) for track in tracks(plans))


def paced(track: Track, actuator: Actuator, margin: float) -> Track:
    """One track of `paced_tracks`."""
    edges = np.linspace(0.0, actuator.parameters.y_max, PARTS + 1)
    edges[0], edges[-1] = -np.inf, np.inf

    @cache
    def rate(part: int, speed: float) -> float:
        return margin * local_stiffness(actuator, speed, (float(edges[part]), float(edges[part + 1])))

    return replace(track, windows=tuple(_paced(track, window, edges, rate) for window in track.windows))


def _paced(track: Track, window: Segment, edges: FloatArray, rate: Callable[[int, float], float]) -> Segment:
    position = track.measured["position"][window.start : window.stop]
    far = samples(window, OVER) - 1
    travel = np.abs(position[far:] - position[:-far])
    if not np.isfinite(travel).all() or travel.size == 0:
        return window
    fastest = float(travel.max()) / OVER + FASTER
    speed = next((limit for limit in SPEEDS if fastest <= limit), None)
    if speed is None:
        return window
    reach = np.array([position.min() - BEYOND, position.max() + BEYOND])
    first, last = np.searchsorted(edges, reach).clip(1, PARTS) - 1
    stiffest = max(rate(part, speed) for part in range(first, last + 1))
    steps = np.maximum(substeps(window.dt, stiffest), np.ceil(window.dt / LONGEST * (1 - 1e-9)).astype(np.int32))
    return replace(window, substeps=np.minimum(window.substeps, steps))

"""Duty cycles of a recording: on/off units, and the time grid on which a control unit updates them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.log import INPUTS, FloatArray, Log, sample_interval

#: Changes of the duty cycles lie on a grid if the mean of their phasors has at least this length; least number of
#: changes, and greatest number that is used; longest period in s.
_MIN_COHERENCE, MIN_CHANGES, _MAX_CHANGES, _MAX_PERIOD = 0.95, 50, 5000, 0.1

#: Fewest samples per carrier period that resolve its phase, and the same for the recorded edges of an on/off unit.
_MIN_SAMPLES, _MIN_SAMPLES_ON_OFF = 2.5, 2.0

#: Longest interval in s between samples that have all changes of duty cycles that a control unit changes every
#: millisecond.
CONTINUOUS_STEP = 1.5e-3


def is_slow(log: Log) -> bool:
    """Whether duty cycles may change between the samples of a recording, so that it lacks edges of the valves.

    Examples
    --------
    >>> [is_slow(Log(step * np.arange(5.0), {})) for step in (1e-3, 1e-2)]
    [False, True]
    """
    return sample_interval(log.time, 0.0) > CONTINUOUS_STEP


def on_off(log: Log) -> bool:
    """Whether the valves are switched on and off (bang-bang), without duty cycles in between.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    between = [(log[name] > 0.0) & (log[name] < 1.0) for name in INPUTS]
    return int(np.logical_or(*between).sum()) < MIN_CHANGES


def resolves_carrier(log: Log, period: float) -> bool:
    """Whether a recording has enough samples per `period` in s of the carrier to resolve it.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    least = _MIN_SAMPLES_ON_OFF if on_off(log) else _MIN_SAMPLES
    return period > (least - 1e-6) * sample_interval(log.time)


def _changes(log: Log) -> FloatArray:
    """Time stamps at which a duty cycle changes: those of its edges, if they are recorded."""
    recorded = [log.edges.get(name, (log.time, log[name])) for name in INPUTS]
    return np.unique(np.concatenate([t[1:][np.abs(np.diff(duty)) > 1e-9] for t, duty in recorded]))


class DutyGrid(NamedTuple):
    """Time grid on which duty cycles change: period in s, and phase in [0, 1) of it; 0 and 0 for none."""

    period: float
    phase: float


def duty_grid(log: Log) -> DutyGrid:
    """The time grid on which the duty cycles change; that of no period if they change at any time.

    All divisors of a period fit as well; the period of the grid is the longest that fits.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    step = sample_interval(log.time)
    at = _changes(log)[:_MAX_CHANGES]
    if at.size < MIN_CHANGES:
        return DutyGrid(0.0, 0.0)
    least = _MIN_SAMPLES_ON_OFF if on_off(log) else np.ceil(_MIN_SAMPLES)
    periods = step * np.arange(least, round(_MAX_PERIOD / step) + 1)
    phasors = np.array([np.exp(2j * np.pi * at / period).mean() for period in periods])
    fitting = np.flatnonzero(np.abs(phasors) > _MIN_COHERENCE)
    if fitting.size == 0:
        return DutyGrid(0.0, 0.0)
    longest = fitting[-1]
    return DutyGrid(float(periods[longest]), float(np.angle(phasors[longest]) / (2 * np.pi) % 1.0))


def duty_period(log: Log) -> float | None:
    """Period in s at which a control unit renews the duty cycles, 0 if they change at any time, None if unknown.

    A recording shows it if it has a sample for every millisecond, and enough changes of the duty cycles.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.

    Examples
    --------
    >>> log = Log(np.arange(0.0, 2.0, 1e-3), {name: np.arange(2000) // 10 % 7 / 10 for name in INPUTS})
    >>> f"{duty_period(log):.3f} s"
    '0.010 s'
    """
    if len(log) < 2 or is_slow(log) or _changes(log).size < MIN_CHANGES:
        return None
    return duty_grid(log).period


def grid_phase(log: Log, period: float) -> float | None:
    """Phase of a carrier of known `period` in s if the duty cycles change on its grid, else None.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    grid, phase = duty_grid(log)
    periods = grid / period
    if periods < 0.5 or abs(periods - round(periods)) > 0.01:
        return None
    return (phase * periods) % 1.0

"""The carrier that switches the valves, found in a recording: from its duty cycles, the pressure or the position.

A control unit takes a new duty cycle at the start of a period. Where the recorded duty cycles change on a grid in time
only, the grid tells the phase exactly; where they change at any time, pressure or position must show it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.numerics.threads import each
from clutchid.simulation.plan import carrier

#: Periods in s that are tried: 200 to 20 Hz, as solenoid valves are driven.
PERIODS = (0.005, 0.008, 0.01, 0.0125, 0.016, 0.02, 0.025, 0.0333, 0.04, 0.05)

#: Phases that are tried, and how much more of the fast part of the pressure's rate the right one must explain than the
#: middling one: what any phase explains is the changing duty cycle, not the carrier.
PHASES, CONTRAST = 20, 0.01

#: The same where the period is known from the duty cycles, so that chance has one try only.
CONTRAST_ON_GRID = 0.001

#: How much more another period must explain than that of the grid: a carrier of half or twice its period, driven by the
#: same duty cycles, explains up to as much as the true one.
OUTDONE = 2.0

#: The duty cycles change on a grid where their changes, as phasors on it, have a mean of this length; how many changes
#: tell that, and the longest period in s that is looked for.
ON_GRID, CHANGES, LONGEST = 0.95, 50, 0.1

#: Samples that a period takes at least for its phase to show, and for edges of an on/off unit, which are recorded.
SEEN, SEEN_ON_OFF = 2.5, 2.0

#: Travel of a valve, in parts of a period, where none is known yet.
ABRUPT = 0.01

#: Longest stretch of a recording that tells the phase, in s.
ENOUGH = 15.0


def on_off(log: Log) -> bool:
    """Whether the valves are opened and closed (bang-bang) and never for a part of a period only.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    between = [(log[name] > 0.0) & (log[name] < 1.0) for name in ("duty_supply", "duty_exhaust")]
    return int(np.logical_or(*between).sum()) < CHANGES


def shows(log: Log, period: float) -> bool:
    """Whether a recording has enough samples in a `period` in s of the carrier to show it.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    least = SEEN_ON_OFF if on_off(log) else SEEN
    return period > (least - 1e-6) * float(np.median(np.diff(log.time)))


def duty_grid(log: Log) -> tuple[float, float]:
    """Period in s of the grid on which the duty cycles change, and its phase; (0, 0) where they change at any time.

    Of a grid's divisors, which fit as well, the grid itself is the longest.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    step = float(np.median(np.diff(log.time)))
    changed = np.zeros(len(log), dtype=bool)
    for name in ("duty_supply", "duty_exhaust"):
        changed[1:] |= np.abs(np.diff(log[name])) > 1e-9
    at = log.time[changed]
    if at.size < CHANGES:
        return 0.0, 0.0
    least = SEEN_ON_OFF if on_off(log) else np.ceil(SEEN)
    periods = step * np.arange(least, round(LONGEST / step) + 1)
    phasors = np.array([np.exp(2j * np.pi * at / period).mean() for period in periods])
    fitting = np.flatnonzero(np.abs(phasors) > ON_GRID)
    if fitting.size == 0:
        return 0.0, 0.0
    longest = fitting[-1]
    return float(periods[longest]), float(np.angle(phasors[longest]) / (2 * np.pi) % 1.0)


def grid_phase(log: Log, period: float) -> float | None:
    """Phase of a carrier of known `period` in s where the duty cycles change on its grid; None where they do not.

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


def find_carrier(log: Log, actuator: Actuator, periods: Sequence[float] = PERIODS) -> tuple[float, float]:
    """Period in s of the carrier in a recording with pressure, and where in it the valves open; (0, 0) without one.

    An open valve changes the pressure at once, so the pressure's rate within a period shows when it is open. For every
    period and phase the rate is compared with the opening that they predict beyond its mean. Periods that show are
    compared by what they explain of one and the same part of the rate: a longer period has more of it to itself. The
    period of the grid on which the duty cycles change needs less evidence than others, and wins unless another explains
    `OUTDONE` times as much. An on/off unit has no carrier: what it shows are the edges of its commands.

    Raises
    ------
    DataError
        If the recording has no pressure.
    """
    step = float(np.median(np.diff(log.time)))
    log = log.slice(0, min(len(log), round(ENOUGH / step)))
    if on_off(log):
        return 0.0, 0.0
    grid, _ = duty_grid(log)
    common = max(1, round(max(periods) / step))
    found: dict[float, tuple[float, float]] = {}
    for period in (*periods, grid) if periods is PERIODS and grid not in PERIODS else periods:
        if not shows(log, period):
            continue
        contrast, phase = _contrast(log, actuator, period, max(1, round(period / step)))
        if contrast > (CONTRAST_ON_GRID if _same(period, grid) else CONTRAST):
            found[period] = (contrast if len(periods) == 1 else _contrast(log, actuator, period, common)[0], phase)
    if not found:
        return 0.0, 0.0
    best = max(found, key=lambda period: found[period][0])
    own = next((period for period in found if _same(period, grid)), best)
    chosen = best if found[best][0] > OUTDONE * found[own][0] else own
    return chosen, found[chosen][1]


def _same(period: float, grid: float) -> bool:
    return abs(period - grid) < 1e-3 * period


def _contrast(log: Log, actuator: Actuator, period: float, length: int) -> tuple[float, float]:
    """How much more the best phase of a period explains than the middling one, and that phase.

    Of the pressure's rate, what `length` samples average to is not looked at.
    """
    rate = np.diff(log["pressure_a"])
    fast = rate - _smooth(rate, length)
    phases = np.arange(PHASES) / PHASES
    tried = [actuator.replace({"T_pwm": period, "s_pwm": centred(float(phase))}) for phase in phases]
    shares = np.array(each(lambda one, _: _explained(log, one, fast, length), tried, phases))
    return float(shares.max() - np.median(shares)), float(phases[np.argmax(shares)])


def _smooth(values: FloatArray, length: int) -> FloatArray:
    return np.convolve(np.nan_to_num(values), np.ones(length) / length, "same")


def _explained(log: Log, actuator: Actuator, fast: FloatArray, length: int) -> float:
    """Share of the variance of the fast part of the pressure's rate that the switching of both valves explains."""
    p = actuator.parameters
    text, clock = kernels(actuator.model), carrier(log.time, p)
    pressure = np.nan_to_num(log["pressure_a"][:-1], nan=p.P_0)
    columns = []
    for duty, low, high, drive in (
        ("duty_supply", p.R_0vs, p.R_1vs, np.ones_like(pressure)),
        ("duty_exhaust", p.R_0ve, p.R_1ve, pressure / p.P_S),
    ):
        share = text.opening(log[duty], low, high)
        # a valve's own phase begins to be searched at the duty cycle where it starts to open
        opened = text.passed_pulses(share, share, *clock, (p.s_pwm + low) % 1.0, ABRUPT)
        switched = np.where(np.isfinite(share), opened, np.nan)[:-1] * drive
        columns.append(switched - _smooth(switched, length))
    A = np.nan_to_num(np.column_stack(columns))
    known = np.isfinite(fast) & (np.abs(A).sum(axis=1) > 0)
    total = float(np.sum(fast[known] ** 2))
    if known.sum() < 100 or total == 0.0:
        return 0.0
    weights, *_ = np.linalg.lstsq(A[known], fast[known], rcond=None)
    return 1.0 - float(np.sum((fast[known] - A[known] @ weights) ** 2)) / total


def centred(phase: float) -> float:
    """The same phase in [-0.5, 0.5)."""
    return (phase + 0.5) % 1.0 - 0.5

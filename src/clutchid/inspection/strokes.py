"""Starts of strokes from rest, with a supply valve that opens wide: when the piston moved, measured and simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.inspection.reading import Reading, spread_over
from clutchid.inspection.signal import IntArray, stretches
from clutchid.log import HOLE, FloatArray

#: Before a stroke the supply valve is closed for so long, in s; the rest is read from the first part of that, up to
#: `BEFORE` s before the command, so that a motion which is stamped early is seen.
CLOSED, BEFORE = 0.25, 0.1

#: A motion is looked for until so long after the command, in s.
AFTER = 0.2

#: Samples at rest that tell its level.
FEWEST = 3

#: Opening of the valve at least, on the mean until the simulated piston moves: a slow start tells no time.
WIDE = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """Time in s from the command to the first motion in each stroke: measured (NaN: none seen) and simulated."""

    measured: FloatArray
    simulated: FloatArray


def starts(reading: Reading) -> Starts:
    """Every start of a stroke that tells a time, of a long recording `MOST` of them.

    Both motions count from where they rise through `level`.
    """
    p, log = reading.actuator.parameters, reading.log
    least = level(reading)
    bottom = float(np.nanquantile(log["position"], 0.005))
    commands = _commands(reading)
    rows = []
    for k in commands[spread_over(commands.size)].tolist():
        now = float(log.time[k])
        begin, end = (int(i) for i in np.searchsorted(log.time, (now - BEFORE, now + AFTER)))
        rest = log["position"][int(np.searchsorted(log.time, now - CLOSED)) : begin]
        rest = rest[np.isfinite(rest)]
        if rest.size < FEWEST or not _resting(rest, bottom, least, reading.noisy("position")):
            continue
        # the carrier of a switched valve looks back one period, so the simulation begins with the rest
        window = log.slice(begin, end)
        time = window.time - now
        motion = _crossing(time, reading.simulated(window, 0.0, p.P_0), least)
        until = begin + int(np.searchsorted(time, np.nan_to_num(motion), side="right"))
        if not motion > 0 or reading.supply[k:until].mean() < WIDE or reading.exhaust[k:until].any():
            continue
        seen = _crossing(time, window["position"] - np.median(rest), least)
        rows.append((seen, motion))
    return Starts(*np.array(rows, dtype=np.float64).reshape(-1, 2).T)


def level(reading: Reading) -> float:
    """Travel in m that shows motion: beyond noise, quantum and the deflection of the seals before they slide."""
    p = reading.actuator.parameters
    return p.F_C / p.K_z + reading.blur("position")


def _resting(rest: FloatArray, bottom: float, least: float, noise: bool) -> bool:
    """Whether positions before a stroke are those of a vented piston: still, and as near its end as friction lets it.

    Where there is noise, samples without it are cut off by the sensor's range.
    """
    still = np.ptp(rest) <= least and not (noise and np.ptp(rest) == 0.0)
    return bool(still and abs(float(np.median(rest)) - bottom) <= 2 * least)


def _commands(reading: Reading) -> IntArray:
    """Samples at which the supply valve opens after `CLOSED` s, with every sample around them there."""
    time = reading.log.time
    first, stop = stretches(reading.supply > 0)
    ended = np.concatenate([[time[0] - CLOSED], time[stop[:-1] - 1]])[: first.size]
    first = first[time[first] - ended > CLOSED]
    known = np.isfinite(reading.log["duty_supply"]) & np.isfinite(reading.log["duty_exhaust"])
    known[1:] &= np.diff(time) <= HOLE * reading.step
    unknown = np.concatenate([[0], np.cumsum(~known)])
    ahead = np.searchsorted(time, time[first] + AFTER)
    behind = np.searchsorted(time, time[first] - CLOSED) + 1
    whole = (ahead < time.size) & (unknown[ahead] == unknown[np.minimum(behind, time.size)])
    result: IntArray = first[whole]
    return result


def _crossing(time: FloatArray, motion: FloatArray, level: float) -> float:
    """When a motion first rises through a level and stays above for a sample; NaN where it does not, or is missing."""
    above = motion > level
    over = np.flatnonzero(above[1:-1] & above[2:] & ~above[:-2])
    if over.size == 0 or not np.isfinite(motion[over[0]]):
        return float("nan")
    i = int(over[0])
    return float(time[i] + (time[i + 1] - time[i]) * (level - motion[i]) / (motion[i + 1] - motion[i]))

"""Delay from command to motion at the start of strokes from rest, measured and simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.inspection.reading import Reading, spread_over
from clutchid.inspection.signal import IntArray, run_ends
from clutchid.log import HOLE, FloatArray

#: Time in s for which the supply valve must be closed before a stroke. The rest level comes from the part that ends
#: `BEFORE` s before the command, so that motion with an early time stamp is detected.
CLOSED, BEFORE = 0.25, 0.1

#: Motion is searched for until this time in s after the command.
AFTER = 0.2

#: Least number of samples for the rest level.
FEWEST = 3

#: Least mean opening of the valve until the simulated piston moves; in a slower start the delay is not well defined.
WIDE = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """Time in s from the command to the first motion in each stroke: measured (NaN: none) and simulated."""

    measured: FloatArray
    simulated: FloatArray


def starts(reading: Reading) -> Starts:
    """Delays of all usable strokes, of a long recording at most `MOST` of them.

    Motion starts where the travel rises through `level`.
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
        # the model of a switched valve needs one period of past inputs, so the simulation begins in the rest
        window = log.slice(begin, end)
        time = window.time - now
        motion = _crossing(time, reading.simulated(window, 0.0, p.P_0), least)
        until = begin + int(np.searchsorted(time, np.nan_to_num(motion), side="right"))
        if not motion > 0 or reading.supply[k:until].mean() < WIDE or reading.exhaust[k:until].any():
            continue
        rows.append((_crossing(time, window["position"] - np.median(rest), least), motion))
    return Starts(*np.array(rows, dtype=np.float64).reshape(-1, 2).T)


def level(reading: Reading) -> float:
    """Least travel in m that counts as motion: above noise, quantisation and the seal deflection before sliding."""
    p = reading.actuator.parameters
    return p.F_C / p.K_z + reading.blur("position")


def _resting(rest: FloatArray, bottom: float, least: float, noise: bool) -> bool:
    """Whether the piston is vented before a stroke: still, and as near its end position as friction allows.

    If the position has noise elsewhere, constant samples are saturated and do not count.
    """
    still = np.ptp(rest) <= least and not (noise and np.ptp(rest) == 0.0)
    return bool(still and abs(float(np.median(rest)) - bottom) <= 2 * least)


def _commands(reading: Reading) -> IntArray:
    """Samples at which the supply valve opens after `CLOSED` s, without missing inputs or holes around them."""
    time = reading.log.time
    first, stop = run_ends(reading.supply > 0)
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
    """Time at which a motion first rises through a level and stays above for a sample; NaN if there is none."""
    above = motion > level
    over = np.flatnonzero(above[1:-1] & above[2:] & ~above[:-2])
    if over.size == 0 or not np.isfinite(motion[over[0]]):
        return float("nan")
    i = int(over[0])
    return float(time[i] + (time[i + 1] - time[i]) * (level - motion[i]) / (motion[i + 1] - motion[i]))

"""What an engineer would call a stroke or a rest, from the course of its position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clutchid.log import FloatArray
from clutchid.parameters import Parameters
from clutchid.strokes.bins import Bins
from clutchid.strokes.borders import PRESSED, runs
from clutchid.strokes.rest_level import BoolArray

#: Parts of the reach: a full stroke goes so far, swings and swings in slip are so large, distinct levels so far apart,
#: slip takes place between these positions.
FULL, SWING, SLIP_SWING, APART, SLIP_ZONE = 0.8, 0.3, 0.02, 0.08, (0.06, 0.6)

#: Reaches a second: slip is slower than `SLOW`, a way back slower than `EASED` is no free one (which makes 4 and more),
#: a level is held below `HOLDS`.
SLOW, EASED, HOLDS = 1.0, 1.5, 0.1

#: Times in s: a ramp takes so long to open or in the upper half back; a level is held; a slip is none below
#: `SHORT_SLIP` and more than that of a gear shift from `LONG_SLIP`.
RAMP, HELD, SHORT_SLIP, LONG_SLIP = 0.8, 0.25, 0.12, 1.2

#: Shares of a stroke's length: bang-bang is still for less than `MOVING`, levels with more slip are no staircase.
MOVING, SLIPPING = 0.25, 0.45

#: A rest with a larger share of its positions missing is none that is known.
MOST_MISSING = 0.5


@dataclass(frozen=True, slots=True)
class Course:
    """What tells manoeuvres apart; positions in parts of the reach, times in s.

    Length; highest position; number of distinct levels held, and of turns after swings of `SWING`; time of slow motion
    while it opens, and in the upper half on the way back from the last time at the top; time of slip on that way, which
    is slow and in `SLIP_ZONE`, and the turns in it; time there that is at least eased; the share of the length that is
    still.
    """

    seconds: float
    peak: float
    levels: int
    swings: int
    opening: float
    upper: float
    slip: float
    slip_swings: int
    eased: float
    still: float


def course(time: FloatArray, y: FloatArray, still: BoolArray) -> Course:
    """The course of a stroke.

    Parameters
    ----------
    time : s
        Bins of about 10 ms, at least two.
    y : 1
        Position above the vented rest in parts of the reach, above 0 somewhere.
    still
        Where the position is still.
    """
    step = np.diff(time, append=time[-1])
    peak = float(y.max())
    top = np.flatnonzero(y >= 0.9 * peak)
    back, before, after = y[top[-1] :], slice(0, top[0]), slice(top[-1], None)
    speed = _slopes(time, y, 5)
    creeps = (np.abs(speed) < SLOW) & (np.abs(speed) > HOLDS)
    zone = (back > SLIP_ZONE[0]) & (back < SLIP_ZONE[1])
    slow = zone & (np.abs(speed[after]) < SLOW)
    return Course(
        seconds=float(time[-1] - time[0]),
        peak=peak,
        levels=_levels(time, y, np.abs(speed) < HOLDS),
        swings=_swings(y, SWING),
        opening=float(step[before][creeps[before] & (speed[before] > 0) & (y[before] > 0.1 * peak)].sum()),
        upper=float(step[after][creeps[after] & (back > 0.5 * peak)].sum()),
        slip=float(step[after][slow].sum()),
        slip_swings=_swings(back[slow], SLIP_SWING),
        eased=float(step[after][zone & (np.abs(speed[after]) < EASED)].sum()),
        still=float(step[still].sum() / max(step.sum(), 1e-9)),
    )


#: Labels of strokes with what tells them, in the order in which they are asked; the last one always holds.
_RULES: tuple[tuple[str, Callable[[Course], bool]], ...] = (
    ("bang-bang", lambda c: c.swings >= 4 and c.still < MOVING),
    ("ramp", lambda c: max(c.opening, c.upper) >= RAMP and c.levels <= 1 and c.swings <= 1),
    ("staircase", lambda c: c.swings >= 3 or (c.levels >= 3 and c.slip < SLIPPING * c.seconds)),
    ("slip control", lambda c: c.slip >= LONG_SLIP and c.slip_swings >= 1),
    ("partial stroke", lambda c: c.peak < FULL),
    ("full stroke", lambda c: c.eased < SHORT_SLIP),
    ("gear shift", lambda c: c.slip < LONG_SLIP),
    ("pull-away", lambda c: True),  # noqa: ARG005
)


def stroke_label(bins: Bins) -> str:
    """Label of a stroke, one of `STROKES`; a stroke of unknown reach, or that stays at the rest, is a partial one."""
    known = np.isfinite(bins.position) & (bins.reach > 0)
    y = (bins.position - bins.level)[known] / bins.reach[known]
    if y.size < 3 or float(y.max()) <= SLIP_ZONE[0]:
        return "partial stroke"
    seen = course(bins.time[known], y, bins.still[known])
    return next(label for label, holds in _RULES if holds(seen))


def rest_label(bins: Bins, *, held: bool, missing: float) -> str:
    """Label of a rest, one of `RESTS`: a rest off the level, or under pressure, is held."""
    if missing > MOST_MISSING:
        return "no position"
    pressure = bins.pressure[np.isfinite(bins.pressure)]
    pressed = pressure.size > 0 and float(np.median(pressure)) > PRESSED * Parameters().P_0
    return "held" if held or pressed or not np.median(bins.inside) else "vented rest"


def _slopes(time: FloatArray, y: FloatArray, half: int) -> FloatArray:
    """Slope over `half` bins before and after, fewer at the ends."""
    if time.size < 2:
        return np.zeros(time.size)
    here = np.arange(time.size)
    a, b = np.maximum(here - half, 0), np.minimum(here + half, time.size - 1)
    slope: FloatArray = (y[b] - y[a]) / (time[b] - time[a])
    return slope


def _levels(time: FloatArray, y: FloatArray, slow: BoolArray) -> int:
    """How many distinct levels are held."""
    off = slow & (y > SLIP_ZONE[0])
    held = [float(np.median(y[a:b])) for a, b in runs(off) if time[b - 1] - time[a] >= HELD]
    count, last = 0, -np.inf
    for level in sorted(held):
        if level > last + APART:
            count, last = count + 1, level
    return count


def _swings(y: FloatArray, size: float) -> int:
    """How often the course turns around by more than `size`."""
    turns, low, high, rising = 0, np.inf, -np.inf, 0
    for value in y.tolist():
        low, high = min(low, value), max(high, value)
        if rising >= 0 and value < high - size:
            turns += rising > 0 or turns > 0
            rising, low = -1, value
        elif rising <= 0 and value > low + size:
            turns += rising < 0
            rising, high = 1, value
    return int(turns)

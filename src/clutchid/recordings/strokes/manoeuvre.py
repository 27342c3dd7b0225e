"""Classify a stroke or a rest by the course of its position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clutchid.log import FloatArray
from clutchid.parameters import Parameters
from clutchid.recordings.signals.sampled import runs
from clutchid.recordings.strokes.bins import Bins
from clutchid.recordings.strokes.borders import PRESSED
from clutchid.recordings.strokes.rest_level import BoolArray

#: Fractions of the reach: least peak of a full stroke, least amplitude of a swing and of a swing in slip, least
#: distance between distinct levels, and the range of positions in which the clutch slips.
FULL, SWING, SLIP_SWING, APART, SLIP_ZONE = 0.8, 0.3, 0.02, 0.08, (0.06, 0.6)

#: Speeds in reaches per second: slip is slower than `SLOW`, a controlled return slower than `EASED` (a free return has
#: 4 or more), a hold slower than `HOLDS`.
SLOW, EASED, HOLDS = 1.0, 1.5, 0.1

#: Least times in s: of a ramp while opening or in the upper half of the return; of a held level; of any slip; and of a
#: slip that is longer than that of a gear shift.
RAMP, HELD, SHORT_SLIP, LONG_SLIP = 0.8, 0.25, 0.12, 1.2

#: Fractions of a stroke's length: bang-bang motion is still for less than `MOVING`, a staircase slips for less than
#: `SLIPPING`.
MOVING, SLIPPING = 0.25, 0.45

#: A rest with a larger fraction of its positions missing is labelled "no position".
MOST_MISSING = 0.5


@dataclass(frozen=True, slots=True)
class MotionFeatures:
    """Features that classify a manoeuvre; positions as fractions of the reach, times in s.

    Length; highest position; number of distinct held levels, and of reversals after swings of `SWING`; time of slow
    motion while opening, and in the upper half of the final return; time of slow motion in `SLIP_ZONE` during that
    return, and the reversals in it; time there below `EASED`; fraction of the length during which the piston is still.
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


def motion_features(time: FloatArray, y: FloatArray, still: BoolArray) -> MotionFeatures:
    """Features of a stroke that classify it.

    Parameters
    ----------
    time : s
        Bins of about 10 ms, at least two.
    y : 1
        Position above the vented rest as a fraction of the reach, above 0 somewhere.
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
    return MotionFeatures(
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


#: Labels of strokes and their conditions; the first condition that holds decides, and the last one always holds.
_RULES: tuple[tuple[str, Callable[[MotionFeatures], bool]], ...] = (
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
    """Label of a stroke, one of `STROKES`; "partial stroke" if it stays at the rest level."""
    known = np.isfinite(bins.position) & (bins.reach > 0)
    y = (bins.position - bins.level)[known] / bins.reach[known]
    if y.size < 3 or float(y.max()) <= SLIP_ZONE[0]:
        return "partial stroke"
    features = motion_features(bins.time[known], y, bins.still[known])
    return next(label for label, holds in _RULES if holds(features))


def rest_label(bins: Bins, *, long_hold: bool, missing: float) -> str:
    """Label of a rest, one of `RESTS`: "held" if it is away from the rest level or under pressure."""
    if missing > MOST_MISSING:
        return "no position"
    pressure = bins.pressure[np.isfinite(bins.pressure)]
    pressed = pressure.size > 0 and float(np.median(pressure)) > PRESSED * Parameters().P_0
    return "held" if long_hold or pressed or not np.median(bins.inside) else "vented rest"


def _slopes(time: FloatArray, y: FloatArray, half: int) -> FloatArray:
    """Slope over `half` bins before and after each bin, fewer at the ends."""
    if time.size < 2:
        return np.zeros(time.size)
    here = np.arange(time.size)
    a, b = np.maximum(here - half, 0), np.minimum(here + half, time.size - 1)
    slope: FloatArray = (y[b] - y[a]) / (time[b] - time[a])
    return slope


def _levels(time: FloatArray, y: FloatArray, slow: BoolArray) -> int:
    """Number of distinct held levels."""
    off = slow & (y > SLIP_ZONE[0])
    levels = [float(np.median(y[a:b])) for a, b in runs(off) if time[b - 1] - time[a] >= HELD]
    count, last = 0, -np.inf
    for level in sorted(levels):
        if level > last + APART:
            count, last = count + 1, level
    return count


def _swings(y: FloatArray, size: float) -> int:
    """Number of reversals after a swing of more than `size`."""
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

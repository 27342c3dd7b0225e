"""Summary of a time axis, updated block by block: ends, intervals, and the first holes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clutchid.log import HOLE, FloatArray
from clutchid.recordings.checks import intervals, usual_interval
from clutchid.recordings.table import SHOWN, Places


@dataclass(frozen=True, slots=True)
class Hole:
    """An interval much longer than the others: the line or row before it, its start and length in s."""

    place: int
    start: float
    length: float


@dataclass(frozen=True, slots=True)
class TimeLook:
    """The time axis in s: first and last sample, shortest, usual and longest interval, and the first holes.

    `repeated` counts time stamps equal to the previous one, `back` those below the previous one.
    """

    first: float
    last: float
    shortest: float
    usual: float
    longest: float
    hole_count: int
    holes: tuple[Hole, ...]
    repeated: int = 0
    back: int = 0

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return self.last - self.first

    @property
    def rate(self) -> float:
        """Samples per second, from the usual interval."""
        return 1 / self.usual


def updated(before: TimeLook | None, time: FloatArray, places: Places) -> TimeLook | None:
    """Update the summary `before` with a further block of time stamps in s; None if there were none so far.

    The usual interval is that of the first block.
    """
    rows = np.flatnonzero(np.isfinite(time))
    if not rows.size:
        return before
    stamps = time[rows]
    joined = stamps if before is None else np.r_[before.last, stamps]
    steps = intervals(joined)
    usual = usual_interval(stamps) if before is None else before.usual
    after = np.flatnonzero(steps > HOLE * usual)
    offset = joined.size - stamps.size  # 1 if the interval to the previous block is included
    shown = tuple(
        Hole(places.number(rows[max(i - offset, 0)]) - (i < offset), float(joined[i]), float(steps[i]))
        for i in after[:SHOWN].tolist()
    )
    ends = (float(stamps[0]) if before is None else before.first, float(stamps[-1]))
    shortest = min(float(steps.min()) if steps.size else math.inf, math.inf if before is None else before.shortest)
    longest = max(float(steps.max()) if steps.size else -math.inf, -math.inf if before is None else before.longest)
    known = TimeLook(0, 0, 0, 0, 0, 0, ()) if before is None else before
    return TimeLook(
        *ends,
        shortest,
        usual,
        longest if math.isfinite(longest) else math.inf,
        known.hole_count + int(after.size),
        (*known.holes, *shown)[:SHOWN],
        known.repeated + int(np.count_nonzero(steps == 0)),
        known.back + int(np.count_nonzero(steps < 0)),
    )

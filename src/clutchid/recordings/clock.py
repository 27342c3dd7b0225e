"""Repair the time stamps of loggers: repeated, out of order, or restarted; every change is reported."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.log import HOLE, FloatArray
from clutchid.recordings.checks import quantity, usual_interval
from clutchid.recordings.columns import SHOWN, listed
from clutchid.recordings.source import Places

#: Gap between two runs that are placed one after the other, in usual intervals; long enough to be a hole.
_APART = 20.0


@dataclass(frozen=True, slots=True)
class Clock:
    """State of the clock after a block: last time stamp as written and as repaired, and usual interval, in s."""

    written: float = -math.inf
    last: float = -math.inf
    shift: float = 0.0
    usual: float = math.inf


@dataclass(frozen=True, eq=False, slots=True)
class RepairedTime:
    """Kept samples of a block, their time stamps in s, messages about changes, and the state of the clock."""

    kept: NDArray[np.bool_]
    time: FloatArray
    messages: tuple[str, ...]
    clock: Clock


def repair(stamps: FloatArray, places: Places, clock: Clock | None = None) -> RepairedTime:
    """Repair time stamps so that they increase strictly.

    A sample without a time stamp is dropped. Of samples with equal time stamps the last is kept. Samples that are out
    of order by up to five usual intervals are dropped. If the clock goes back further, it has restarted: the new run is
    placed after the previous one with a hole between them, so that each is a separate segment.

    Parameters
    ----------
    stamps : s
        As written in the file.
    places
        Location of the samples in the file, for the messages.
    clock
        State of the clock after the previous block.

    Examples
    --------
    A logger that was started twice in one file, and one repeated sample:

    >>> found = repair(np.array([0.0, 0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.0, 0.1]), Places())
    >>> [round(float(t), 6) for t in found.time]
    [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2.6, 2.7]
    >>> print(*found.messages, sep="\\n")
    1 sample repeats the time stamp of another (row 3); the later one is kept.
    the clock restarts at row 9 (0 s after 0.6 s); each run becomes a separate segment, 2 s after the previous one.
    """
    clock = clock or Clock()
    finite = np.flatnonzero(np.isfinite(stamps))
    time = stamps[finite]
    usual = clock.usual if math.isfinite(clock.usual) else usual_interval(time)
    messages = []
    if finite.size < stamps.size:
        missing = np.flatnonzero(~np.isfinite(stamps))
        messages.append(
            f"{_samples(missing.size)} without a time stamp ({places.ranges(missing)}) {_are(missing)} dropped."
        )
    before = np.r_[clock.written, time[:-1]]
    resets = np.flatnonzero(before - time > HOLE * usual) if math.isfinite(usual) else np.empty(0, dtype=np.int64)
    apart = _APART * usual
    shifted, shift = _shifted(time, before, resets, clock, apart)
    if resets.size:
        shown = [
            f"{places.word} {places.number(finite[i])} ({quantity(time[i], 's')} after {quantity(before[i], 's')})"
            for i in resets[:SHOWN].tolist()
        ]
        messages.append(
            f"the clock restarts at {listed(shown, total=resets.size)}; each run becomes a separate segment, "
            f"{quantity(apart, 's')} after the previous one."
        )
    ahead = np.r_[clock.last, np.maximum.accumulate(np.r_[clock.last, shifted])[1:-1]] if time.size else time
    late, same = shifted < ahead, shifted == ahead
    messages = [*_repeats(finite[same], places), *_late(finite[late], places), *messages]
    late |= shifted == clock.last  # the previous block has a sample at this time stamp
    kept = np.zeros(stamps.size, dtype=bool)
    kept[finite[_last_of_each(shifted, late)]] = True
    repaired = np.full(stamps.size, math.nan)
    repaired[finite] = shifted
    last = float(max(clock.last, shifted.max())) if time.size else clock.last
    written = float(time[-1]) if time.size else clock.written
    return RepairedTime(kept, repaired[kept], tuple(messages), Clock(written, last, shift, usual))


def _shifted(
    time: FloatArray, before: FloatArray, resets: NDArray[np.int64], clock: Clock, apart: float
) -> tuple[FloatArray, float]:
    """Time stamps with every run placed after the previous one, and the shift of the last run."""
    jumps = np.zeros(time.size)
    jumps[resets] = before[resets] - time[resets] + apart
    shifts = clock.shift + np.cumsum(jumps)
    return (time + shifts if resets.size or clock.shift else time), float(shifts[-1]) if time.size else clock.shift


def _last_of_each(time: FloatArray, late: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Of the samples that are not late, the last one of each time stamp."""
    rows = np.flatnonzero(~late)
    if not rows.size:
        return rows
    return rows[np.r_[time[rows[1:]] != time[rows[:-1]], True]]


def _repeats(rows: NDArray[np.int64], places: Places) -> list[str]:
    if not rows.size:
        return []
    verb = "repeats the time stamp" if rows.size == 1 else "repeat the time stamps"
    other = "another" if rows.size == 1 else "others"
    return [f"{_samples(rows.size)} {verb} of {other} ({places.ranges(rows)}); the later one is kept."]


def _late(rows: NDArray[np.int64], places: Places) -> list[str]:
    if not rows.size:
        return []
    return [f"{_samples(rows.size)} out of order in time ({places.ranges(rows)}) {_are(rows)} dropped."]


def _are(rows: NDArray[np.int64]) -> str:
    return "is" if rows.size == 1 else "are"


def _samples(count: int) -> str:
    return f"{count:,} sample{'' if count == 1 else 's'}"

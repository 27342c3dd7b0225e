"""Stamps as loggers leave them: repeated, out of order, starting again; mended where that invents nothing, and told."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.io.checks import quantity, usual_interval
from clutchid.io.table import SHOWN, Places, and_more
from clutchid.log import HOLE, FloatArray

#: Between two runs that are put one behind the other, in usual intervals: certainly a hole.
_APART = 20.0


@dataclass(frozen=True, slots=True)
class Clock:
    """Where a clock stands after a block: the last stamp as written and as mended, and the usual interval, in s."""

    written: float = -math.inf
    last: float = -math.inf
    shift: float = 0.0
    usual: float = math.inf


@dataclass(frozen=True, eq=False, slots=True)
class Mended:
    """Which samples of a block are kept, their stamps in s, sentences about the rest, and where the clock stands."""

    kept: NDArray[np.bool_]
    time: FloatArray
    told: tuple[str, ...]
    clock: Clock


def mend(stamps: FloatArray, places: Places, clock: Clock | None = None) -> Mended:
    """Stamps in s that grow from sample to sample.

    A sample without a stamp is left out. Of samples with one stamp the last is kept. Samples up to five usual intervals
    late in the file are out of order and left out. A clock that goes back further has started again: the new run is put
    behind the one before, with a hole between them, so that each is a segment of its own.

    Parameters
    ----------
    stamps : s
        As written.
    places
        Where the samples stand in the file, for the sentences.
    clock
        Where the clock stood after the block before.

    Examples
    --------
    A logger that was started twice in one file, and one sample that came twice:

    >>> found = mend(np.array([0.0, 0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.0, 0.1]), Places())
    >>> [round(float(t), 6) for t in found.time]
    [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2.6, 2.7]
    >>> print(*found.told, sep="\\n")
    1 sample repeats the stamp of another (row 3); the later one is kept.
    the clock starts again at row 9 (0 s after 0.6 s); each run is a segment of its own, 2 s behind the one before.
    """
    clock = clock or Clock()
    finite = np.flatnonzero(np.isfinite(stamps))
    time = stamps[finite]
    usual = clock.usual if math.isfinite(clock.usual) else usual_interval(time)
    told = []
    if finite.size < stamps.size:
        missing = np.flatnonzero(~np.isfinite(stamps))
        told.append(f"{_samples(missing.size)} without a stamp ({places.ranges(missing)}) {_are(missing)} left out.")
    before = np.r_[clock.written, time[:-1]]
    resets = np.flatnonzero(before - time > HOLE * usual) if math.isfinite(usual) else np.empty(0, dtype=np.int64)
    apart = _APART * usual
    shifted, shift = _shifted(time, before, resets, clock, apart)
    if resets.size:
        shown = [
            f"{places.word} {places.number(finite[i])} ({quantity(time[i], 's')} after {quantity(before[i], 's')})"
            for i in resets[:SHOWN].tolist()
        ]
        told.append(
            f"the clock starts again at {and_more(shown, resets.size - len(shown))}; each run is a segment of its own, "
            f"{quantity(apart, 's')} behind the one before."
        )
    ahead = np.r_[clock.last, np.maximum.accumulate(np.r_[clock.last, shifted])[1:-1]] if time.size else time
    late, same = shifted < ahead, shifted == ahead
    told = [*_repeats(finite[same], places), *_late(finite[late], places), *told]
    late |= shifted == clock.last  # the block before has a sample at this stamp
    kept = np.zeros(stamps.size, dtype=bool)
    kept[finite[_last_of_each(shifted, late)]] = True
    mended = np.full(stamps.size, math.nan)
    mended[finite] = shifted
    last = float(max(clock.last, shifted.max())) if time.size else clock.last
    written = float(time[-1]) if time.size else clock.written
    return Mended(kept, mended[kept], tuple(told), Clock(written, last, shift, usual))


def _shifted(
    time: FloatArray, before: FloatArray, resets: NDArray[np.int64], clock: Clock, apart: float
) -> tuple[FloatArray, float]:
    """Stamps with every run behind the one before it, and the shift of the last run."""
    jumps = np.zeros(time.size)
    jumps[resets] = before[resets] - time[resets] + apart
    shifts = clock.shift + np.cumsum(jumps)
    return (time + shifts if resets.size or clock.shift else time), float(shifts[-1]) if time.size else clock.shift


def _last_of_each(time: FloatArray, late: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Of the samples that are not late, the last one of each stamp."""
    rows = np.flatnonzero(~late)
    if not rows.size:
        return rows
    return rows[np.r_[time[rows[1:]] != time[rows[:-1]], True]]


def _repeats(rows: NDArray[np.int64], places: Places) -> list[str]:
    if not rows.size:
        return []
    verb = "repeats the stamp" if rows.size == 1 else "repeat the stamps"
    other = "another" if rows.size == 1 else "others"
    return [f"{_samples(rows.size)} {verb} of {other} ({places.ranges(rows)}); the later one is kept."]


def _late(rows: NDArray[np.int64], places: Places) -> list[str]:
    if not rows.size:
        return []
    return [f"{_samples(rows.size)} out of order in time ({places.ranges(rows)}) {_are(rows)} left out."]


def _are(rows: NDArray[np.int64]) -> str:
    return "is" if rows.size == 1 else "are"


def _samples(count: int) -> str:
    return f"{count:,} sample{'' if count == 1 else 's'}"

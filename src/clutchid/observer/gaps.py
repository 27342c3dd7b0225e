"""Samples that are missing, repeated or rounded: what an observer follows in their place.

Short gaps are bridged: the duty cycles are held, and the flow through the valves is as uncertain as that. A gap is
followed as one interval, see `recursion.move_alone`. The exported C does the same, sample by sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.inference.filter.setup import LONG
from clutchid.log import HOLE, BoolArray, FloatArray, any_of
from clutchid.observer.state import ObserverState, Tail
from clutchid.strokes.stroke import RESOLUTION

#: Longest time in s for which duty cycles are held where they are missing; beyond it a stretch ends. Provenance:
#: docs/derivations_online.md.
BRIDGED = 0.02

#: Standard deviation of the time that a valve is open besides its held duty cycle, as a share of the interval.
#: Provenance: docs/derivations_online.md.
UNKNOWN_SHARE = 0.3

#: Share of the usual interval: in a shorter one a sample repeats the last one, as of a clock too coarse or a task that
#: is called twice.
SHORT = 0.1


class Bridged(NamedTuple):
    """The samples that an observer follows in place of those of a block.

    `rows` (n,) are the places in `samples` of those of the block; a repeated sample has the place of the one before, -1
    without any. `driven` is the time in s of the last sample with both duty cycles, NaN for none.
    """

    samples: Tail
    rows: NDArray[np.int64]
    driven: float


def longest(spacing: float) -> float:
    """Longest time in s from one sample to the next in a stretch; beyond it is a hole."""
    return max(HOLE * spacing, BRIDGED + spacing + 0.5 * RESOLUTION)


def bridged(state: ObserverState, samples: Tail, repeated: BoolArray, ends: BoolArray, spacing: float) -> Bridged:
    """The samples of a block with short gaps bridged.

    Parameters
    ----------
    state
        Before the first of them.
    repeated, ends
        Samples that repeat the one before, and those at which a stretch ends.
    spacing : s
        Usual time from one sample to the next.
    """
    latest, held_before = latest_driven(state), state.known < state.latest
    if not (held_before or any_of(repeated) or any_of(ends) or any_of(np.isnan(samples.duties))):
        time, long = samples.time, LONG * spacing
        if time.size and not (time[0] - latest > long or any_of(time[1:] - time[:-1] > long)):
            return Bridged(samples, np.arange(time.size), float(time[-1]))
    taken = np.flatnonzero(~repeated)
    time, ended = samples.time[taken], ends[taken]
    gap = time - np.append(latest, time[:-1])[: time.size]
    short = (gap > LONG * spacing) & (gap <= longest(spacing))
    lost = np.where(short, np.round(np.where(short, gap, 0.0) / spacing) - 1.0, 0.0)
    duties, held, driven = _held(state, time, np.where(ended[:, None], np.nan, samples.duties[taken]), ended)
    unknown = lost + np.append(_driven(state) and held_before, held[:-1])[: held.size]
    open_std = UNKNOWN_SHARE * spacing * np.sqrt(unknown)
    rows = np.full(repeated.size, -1)
    rows[taken] = np.arange(taken.size)
    bridge = Tail(time, duties, samples.position[taken], samples.supply[taken], open_std)
    return Bridged(bridge, np.maximum.accumulate(rows), driven)


def _driven(state: ObserverState) -> bool:
    """Whether the inputs go on from the last sample of a state."""
    return bool(state.latest - state.known <= BRIDGED + 0.5 * RESOLUTION)


def latest_driven(state: ObserverState) -> float:
    """Time in s of the last sample of a state from which the inputs go on; NaN where they do not."""
    return state.latest if _driven(state) else float("nan")


def repeats(time: FloatArray, latest: float, spacing: float) -> BoolArray:
    """Whether each sample comes so soon after another that it repeats it."""
    shortest = SHORT * spacing - 0.5 * RESOLUTION
    repeated = np.zeros(time.size, dtype=bool)
    if time.size and (time[0] - latest < shortest or any_of(time[1:] - time[:-1] < shortest)):
        for i, stamp in enumerate(time.tolist()):
            repeated[i] = stamp - latest < shortest
            latest = latest if repeated[i] else stamp
    return repeated


def _held(
    state: ObserverState, time: FloatArray, duties: FloatArray, ends: BoolArray
) -> tuple[FloatArray, BoolArray, float]:
    """Duty cycles held where they are missing for a short time, and where that is; `driven` of `Bridged`."""
    if time.size and not (any_of(np.isnan(duties)) or any_of(ends)):
        return duties, np.zeros(time.size, dtype=bool), float(time[-1])
    before = state.known if _driven(state) and state.tail.time.size else np.nan
    first = state.tail.duties[-1:] if np.isfinite(before) else np.full((1, 2), np.nan)
    both, stamps = np.vstack([first, duties]), np.append(before, time)
    place = np.arange(stamps.size)
    missing = np.any(np.isnan(both), axis=1)
    missing[0] = not np.isfinite(before)
    latest = np.maximum.accumulate(np.where(missing, -1, place))
    ended = np.maximum.accumulate(np.where(np.append(False, ends), place, -1))
    since = np.where(latest > ended, stamps[latest], -np.inf)
    held = missing & (stamps - since <= BRIDGED + 0.5 * RESOLUTION)
    if held.any():
        index = np.maximum.accumulate(np.where(np.isnan(both), 0, place[:, None]), axis=0)
        both = np.where(held[:, None], np.take_along_axis(both, index, axis=0), both)
    driven = float(since[-1]) if np.isfinite(since[-1]) else float("nan")
    return both[1:], held[1:], driven

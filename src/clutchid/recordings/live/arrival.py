"""Streams joined to blocks of a recording: the other streams are held until the stamps of the position's."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError
from clutchid.log import HOLE, FloatArray, Log
from clutchid.recordings.alignment import align
from clutchid.recordings.checks import usual_interval
from clutchid.recordings.live.order import (
    Arrived,
    LeftOut,
    Ordered,
    final,
    followed_by,
    none_waiting,
    part,
    sorted_in,
    unconfirmed,
)
from clutchid.recordings.map.channel_map import Pick

#: Samples of the first block at least: as many give the time from one sample to the next.
FIRST = 101


class Piece(NamedTuple):
    """What came together: samples by stream, and lines or frames that could not be read."""

    arrived: Sequence[Arrived]
    unreadable: int = 0


class LeftOutOf(NamedTuple):
    """What was left out since the block before: see `clutchid.observer.health.LIVE_FLAGS`."""

    late: int = 0
    repeated: int = 0
    unreadable: int = 0
    invalid: int = 0


@dataclass(frozen=True, eq=False, slots=True)
class LiveBlock:
    """A block of a recording, and what was left out since the block before."""

    log: Log
    left_out: LeftOutOf


@dataclass(frozen=True, eq=False, slots=True)
class _Join:
    """Samples that are in order: those of the position's stream that no block has had, and the others' about them.

    `longest` is by quantity the time in s for which a sample is held, None before the first block.
    """

    base: Ordered
    others: tuple[Ordered, ...]
    longest: Mapping[str, float] | None = None


def live_blocks(
    pieces: Iterator[Piece], picks: Sequence[Pick], name: str, metadata: Mapping[str, str]
) -> Iterator[LiveBlock]:
    """Blocks of a recording as their samples arrive; the first has at least `FIRST` samples, if there are as many.

    The numbers do not depend on how the samples are cut into pieces. Samples wait
    `clutchid.recordings.live.order.WINDOW` seconds for those that come out of order. Columns of other streams than the
    position's are held.

    Parameters
    ----------
    picks
        The channels of each stream, the position's first.

    Raises
    ------
    DataError
        If there is no sample; if the time goes back for good, after the block before it was given; or as `pieces`.
    """
    found = False
    for block in _all_blocks(pieces, picks, name, metadata):
        found = found or len(block.log) > 0
        if found:
            yield block
    if not found:
        raise DataError(f"{name}: ended before the first sample with a time; nothing can be observed.")


def _all_blocks(
    pieces: Iterator[Piece], picks: Sequence[Pick], name: str, metadata: Mapping[str, str]
) -> Iterator[LiveBlock]:
    """The blocks, and where no sample came what was left out."""
    waiting = none_waiting([[column for column in chosen.columns if column != "time"] for chosen in picks])
    join, left = _Join(waiting.streams[0], waiting.streams[1:]), LeftOutOf()
    trouble: DataError | None = None
    ended = False
    while not ended:
        try:
            piece = next(pieces, None)
        except DataError as error:
            piece, trouble = None, error
        if piece is not None:
            waiting, out = sorted_in(waiting, piece.arrived)
        else:
            waiting, out = unconfirmed(waiting)
        left = _added(left, piece, out)
        lost = not math.isnan(waiting.lost)
        ended = piece is None or lost
        waiting, ready = final(waiting, ended=ended)
        join, block = _joined(join, ready, picks, ended=ended)
        if block.time.size:
            yield LiveBlock(Log(block.time, block.columns, name, metadata), left)
            left = LeftOutOf()
        if lost:
            trouble = DataError(
                f"{name}: the time goes back from {waiting.latest:.6g} to {waiting.lost:.6g} s and stays there: the "
                "clock of the source was set, or had jumped; start again."
            )
    if any(left):
        yield LiveBlock(Log(np.empty(0), block.columns, name, metadata), left)
    if trouble is not None:
        raise trouble


def _added(left: LeftOutOf, piece: Piece | None, out: LeftOut) -> LeftOutOf:
    unreadable, values = (0, 0) if piece is None else (piece.unreadable, sum(one.invalid for one in piece.arrived))
    return LeftOutOf(
        left.late + out.late,
        left.repeated + out.repeated,
        left.unreadable + unreadable,
        left.invalid + out.invalid + values,
    )


def _joined(join: _Join, ready: Sequence[Ordered], picks: Sequence[Pick], *, ended: bool) -> tuple[_Join, Ordered]:
    """Samples of the position's stream with the columns of the others, as far as all of these are final."""
    base = followed_by(join.base, _earlier(ready[0], picks[0].delay))
    others = tuple(
        followed_by(old, _earlier(new, chosen.delay))
        for old, new, chosen in zip(join.others, ready[1:], picks[1:], strict=True)
    )
    count = base.time.size if ended else _settled(base.time, picks)
    if join.longest is None and count < FIRST and not ended:
        return replace(join, base=base, others=others), part(base, 0, 0)
    longest = join.longest or _longest(part(base, 0, FIRST).time, others, picks)
    block = part(base, 0, count)
    columns = dict(block.columns)
    for one in others:
        columns |= {
            name: align(block.time, one.time, values, longest[name], hold=True) for name, values in one.columns.items()
        }
    kept = tuple(_still_needed(one, block.time) for one in others)
    return _Join(part(base, count, base.time.size), kept, longest), Ordered(block.time, columns)


def _earlier(samples: Ordered, delay: float) -> Ordered:
    return samples if delay == 0.0 else Ordered(samples.time - delay, samples.columns)


def _settled(time: FloatArray, picks: Sequence[Pick]) -> int:
    """How many of the samples no other stream can still change: one with a longer delay is final later."""
    behind = max(chosen.delay for chosen in picks) - picks[0].delay
    return int(np.searchsorted(time, time[-1] - behind, side="right")) if time.size else 0


def _longest(time: FloatArray, others: Sequence[Ordered], picks: Sequence[Pick]) -> dict[str, float]:
    """The time in s for which each quantity of the other streams is held, from the first samples."""
    found = {}
    for one, chosen in zip(others, picks[1:], strict=True):
        until = np.searchsorted(one.time, time[-1], side="right") if time.size else 0
        usual = usual_interval(one.time[:until])
        for name, (_, entry) in chosen.columns.items():
            found[name] = HOLE * usual if entry.longest is None else entry.longest
    return found


def _still_needed(samples: Ordered, until: FloatArray) -> Ordered:
    """The samples from the last one on that a later block may hold."""
    if not until.size:
        return samples
    keep = max(int(np.searchsorted(samples.time, until[-1], side="right")) - 1, 0)
    return part(samples, keep, samples.time.size)

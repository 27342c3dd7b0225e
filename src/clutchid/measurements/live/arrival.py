"""Streams joined to blocks of a recording: the other streams are held until the stamps of the position's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray, Log
from clutchid.measurements.clock import usual_interval
from clutchid.measurements.live.order import FIRST, ArrivedBatch, LeftOutCounts, final, none_waiting, sorted_in
from clutchid.measurements.map.channel_map import PickedChannels
from clutchid.measurements.time_axis import SampleBlock, align

#: Entry of the metadata: the stamp of the source in s that is the time 0 of the recording.
ORIGIN = "origin_s"


@dataclass(frozen=True, eq=False, slots=True)
class LiveBlock:
    """A block of a recording, and the counts of samples left out since the block before.

    `log.warnings` say what was done with the clock since the block before; the metadata have the stamp in s that is the
    time 0, as `ORIGIN`, where the clock was moved, and of a bus.
    """

    log: Log
    left_out: LeftOutCounts


def live_blocks(
    batches: Iterator[ArrivedBatch],
    picks: Sequence[PickedChannels],
    name: str,
    metadata: Mapping[str, str],
    word: str = "sample",
    *,
    origin: float | None = None,
    shift: float = 0.0,
) -> Iterator[LiveBlock]:
    """Blocks of a recording as their samples arrive; the first has at least `FIRST` samples, if there are as many.

    The numbers do not depend on how the samples are cut into batches. Samples wait
    `clutchid.measurements.clock.WINDOW` seconds for those that come out of order. Columns of other streams than
    the position's are held.

    Parameters
    ----------
    picks
        The channels of each stream, the position's first.
    word
        What has a stamp, by which sentences about the clock count.
    origin : s
        The stamp that is the time 0 of the batches, None where stamps count from 0.
    shift : s
        By how much the clock is moved before the first sample, in a recording that goes on.

    Raises
    ------
    DataError
        If there is no sample; or as `batches`.
    """
    waiting = none_waiting([[column for column in chosen.columns if column != "time"] for chosen in picks], word, shift)
    unused, left, said = waiting.streams, LeftOutCounts(), tuple[str, ...]()
    longest: Mapping[str, float] = {}
    trouble: DataError | None = None
    begun = ended = False
    while not ended:
        try:
            batch = next(batches, None)
        except DataError as error:
            batch, trouble = None, error
        ended = batch is None
        waiting, out, sentences = sorted_in(waiting, batch or ArrivedBatch(np.empty(0), ()), ended=ended)
        left, said = left.plus(out), (*said, *sentences)
        waiting, ready = final(waiting, ended=ended)
        unused = tuple(
            old.followed_by(new.earlier(chosen.delay)) for old, new, chosen in zip(unused, ready, picks, strict=True)
        )
        count = unused[0].time.size if ended else _settled(unused[0].time, picks)
        if not longest and count < FIRST and not ended:
            continue
        longest = longest or _longest(unused, picks)
        unused, block = _joined(unused, count, longest)
        if block.time.size or (ended and begun and any((*left, *said))):
            moved = waiting.clock.shift
            now = metadata if origin is None and not moved else {**metadata, ORIGIN: repr((origin or 0.0) - moved)}
            yield LiveBlock(Log(block.time, block.columns, name, now, said), left)
            begun, left, said = True, LeftOutCounts(), ()
    if trouble is None and not begun:
        trouble = DataError(f"{name}: ended before the first sample with a time; nothing can be observed.")
    if trouble is not None:
        raise trouble


def _joined(
    streams: Sequence[SampleBlock], count: int, longest: Mapping[str, float]
) -> tuple[tuple[SampleBlock, ...], SampleBlock]:
    """The first `count` samples of the position's stream with the columns of the others, in front of what is left.

    `longest` is by quantity the time in s for which a sample is held.
    """
    base, *others = streams
    block = base.take(slice(count))
    if not count:
        return tuple(streams), block
    columns = dict(block.columns)
    for stream in others:
        columns |= {
            name: align(block.time, stream.time, values, longest[name], hold=True)
            for name, values in stream.columns.items()
        }
    held = (stream.since(float(block.time[-1])) for stream in others)
    return (base.take(slice(count, None)), *held), SampleBlock(block.time, columns)


def _settled(time: FloatArray, picks: Sequence[PickedChannels]) -> int:
    """Number of the samples that no other stream can still change: one with a longer delay is final later."""
    behind = max(chosen.delay for chosen in picks) - picks[0].delay
    return int(np.searchsorted(time, time[-1] - behind, side="right")) if time.size else 0


def _longest(streams: Sequence[SampleBlock], picks: Sequence[PickedChannels]) -> dict[str, float]:
    """The time in s for which each quantity is held, from the first samples."""
    until = streams[0].time[:FIRST].max(initial=-np.inf)
    longest: dict[str, float] = {}
    for stream, chosen in zip(streams, picks, strict=True):
        longest |= chosen.longest(usual_interval(stream.split(float(until))[0].time))
    return longest

"""Streams of channels with common stamps while they arrive, on one clock as in a file, sorted by their stamps.

What follows a jump waits until `clutchid.measurements.clock.JUMP_AHEAD` seconds of it show that it is none of a few
spoiled stamps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray
from clutchid.measurements.checks import in_si, outside_duty
from clutchid.measurements.clock import (
    AT_START,
    LONE,
    WINDOW,
    Clock,
    Run,
    Tolerance,
    joined_runs,
    sentences,
    shifts_of,
    usual_interval,
)
from clutchid.measurements.columns import heading_problems
from clutchid.measurements.conversion import picked, picked_values
from clutchid.measurements.map.channel_map import Channel, ChannelMap, PickedChannels
from clutchid.measurements.source import Places, Raster, Rows, Source, Table, in_contract, no_tables
from clutchid.measurements.time_axis import SampleBlock, no_samples

_ADVICE = (
    "Name the channels as in `time [s],position [m],duty_supply [1],duty_exhaust [1]`, or give a channel map with "
    "--map, as `clutchid look FILE --save MAP.toml` writes it for a recording of the same source."
)


class ArrivedSamples(NamedTuple):
    """Samples of a stream in the order in which they came.

    `rows` (n,), increasing, are the places of their stamps among all that came together, `columns` have n values;
    `invalid` counts the values that were infinite, or duty cycles outside 0 to 1, and are NaN now.
    """

    stream: int
    rows: Rows
    columns: Mapping[str, FloatArray]
    invalid: int = 0

    def take(self, part: slice, moved: int) -> ArrivedSamples:
        """Some of the samples, whose stamps are further on by `moved` places."""
        return self._replace(rows=self.rows[part] + moved, columns={n: v[part] for n, v in self.columns.items()})


class ArrivedBatch(NamedTuple):
    """Stamps in s that came together, samples by stream, and the number of lines or frames that cannot be read."""

    stamps: FloatArray
    arrived: Sequence[ArrivedSamples]
    unreadable: int = 0


def picked_streams(
    name: str, rasters: Sequence[Raster], channels: ChannelMap | None, required: Sequence[str]
) -> tuple[PickedChannels, ...]:
    """The channels of each time grid that the map picks, that of the position first.

    Without a map these are the channels with standard names.

    Raises
    ------
    DataError
        If the map does not fit, or a required quantity has no channel; the text lists all problems.
    """
    source = Source(Path(name), "CSV" if len(rasters) == 1 else "CAN", tuple(rasters), no_tables)
    if channels is None:
        if len(rasters) == 1 and not in_contract(source):
            raise DataError.of(name, [*heading_problems(rasters[0].headings, required), _ADVICE])
        channels = _by_names(rasters)
    picks, problems = picked(source, channels, required)
    if problems:
        raise DataError.of(name, [*problems, _ADVICE])
    return by_position(picks)


def by_position(picks: Iterable[PickedChannels]) -> tuple[PickedChannels, ...]:
    """Picks with that of the position first."""
    return tuple(sorted(picks, key=lambda chosen: "position" not in chosen.columns))


def _by_names(rasters: Sequence[Raster]) -> ChannelMap:
    """A map of the channels with standard names, but for the stamps; the first of several counts."""
    channels: dict[str, Channel] = {}
    for raster in rasters:
        for heading in raster.headings:
            if heading.name not in (None, "time"):
                channels.setdefault(str(heading.name), Channel(heading.text, raster.name or None))
    return ChannelMap(channels)


def arrived(stream: int, chosen: PickedChannels, table: Table, ambient: float, rows: Rows) -> ArrivedSamples:
    """The picked channels of a table in SI, in the order in which they came; of sparse ones, rows that have a value.

    Parameters
    ----------
    ambient : Pa
        Absolute pressure that is added to gauge pressures.
    rows
        The place of each row among all that came together, increasing.
    """
    columns, invalid = {}, 0
    for name, written in picked_values(table, chosen, 0).items():
        values = in_si(chosen.columns[name][0], written, ambient)
        wrong = np.isinf(values)
        if name in INPUTS:
            wrong |= outside_duty(values)
        if wrong.any():
            invalid += int(wrong.sum())
            values = np.where(wrong, np.nan, values)
        columns[name] = values
    del columns["time"]
    if chosen.sparse and not (there := np.isfinite(list(columns.values())).any(axis=0)).all():
        rows, columns = rows[there], {name: values[there] for name, values in columns.items()}
    return ArrivedSamples(stream, rows, columns, invalid)


#: Samples that show the usual interval of the clock.
FIRST = 101


@dataclass(frozen=True, eq=False, slots=True)
class WaitingSamples:
    """Samples by stream that others may still precede, and the clock that all stamps share.

    `stamps` in s in the order of arrival wait for later ones, with their samples `undecided`: the first ones of all,
    and those behind a jump. `count` is the number of the others. A sentence calls what has a stamp a `word`.
    """

    streams: tuple[SampleBlock, ...]
    clock: Clock = AT_START
    tolerance: Tolerance | None = None
    stamps: FloatArray = field(default_factory=lambda: np.empty(0))
    undecided: tuple[ArrivedSamples, ...] = ()
    count: int = 0
    word: str = "sample"


class LeftOutCounts(NamedTuple):
    """Numbers of samples left out, see `clutchid.observer.flags.LIVE_FLAGS`.

    They are too late, have a stamp that a later one repeats, cannot be read, or are invalid, as no later one confirms
    their stamp.
    """

    late: int = 0
    repeated: int = 0
    unreadable: int = 0
    invalid: int = 0

    def plus(self, other: LeftOutCounts) -> LeftOutCounts:
        """The sum of both."""
        return LeftOutCounts(*(count + more for count, more in zip(self, other, strict=True)))


def none_waiting(names: Sequence[Sequence[str]], word: str = "sample", shift: float = 0.0) -> WaitingSamples:
    """No samples yet, of streams with columns of these names; sentences count stamps as `word`.

    `shift` is by how much the clock is moved in s before the first sample.
    """
    return WaitingSamples(tuple(map(no_samples, names)), Clock(shift=shift), word=word)


def sorted_in(
    waiting: WaitingSamples, batch: ArrivedBatch, *, ended: bool = False
) -> tuple[WaitingSamples, LeftOutCounts, tuple[str, ...]]:
    """Waiting samples after some more came, and sentences about their clock; what came together may be cut in any way.

    Stamps are moved as `clutchid.measurements.clock` says. A sample whose stamp is `WINDOW` or more below an earlier
    one is late. Of equal stamps the last counts. A stamp far ahead that none has confirmed at the end is invalid.
    """
    written = np.append(waiting.stamps, batch.stamps)
    stamps, behind, clock, tolerance, said = _decided(waiting, written, ended=ended)
    streams, undecided = list(waiting.streams), []
    left = LeftOutCounts(unreadable=batch.unreadable, invalid=sum(samples.invalid for samples in batch.arrived))
    moved = (samples.take(slice(None), waiting.stamps.size) for samples in batch.arrived)
    for samples in (*waiting.undecided, *moved):
        until = int(np.searchsorted(samples.rows, stamps.size))
        if until < samples.rows.size:
            undecided.append(samples.take(slice(until, None), -stamps.size))
        rows, i = samples.rows[:until], samples.stream
        block = SampleBlock(stamps[rows], {name: values[:until] for name, values in samples.columns.items()})
        used = np.isfinite(block.time)
        streams[i], repeated = _merged(streams[i], block, used)
        late = int(np.count_nonzero(behind[rows]))
        left = left.plus(LeftOutCounts(late, repeated, invalid=int(np.count_nonzero(~used)) - late))
    rest, count = written[stamps.size :], waiting.count + stamps.size
    return WaitingSamples(tuple(streams), clock, tolerance, rest, tuple(undecided), count, waiting.word), left, said


class _DecidedStamps(NamedTuple):
    """The stamps in s that no later one can change, NaN where they are left out, as they are `behind` or ahead."""

    stamps: FloatArray
    behind: NDArray[np.bool_]
    clock: Clock
    tolerance: Tolerance | None
    sentences: tuple[str, ...] = ()


def _decided(waiting: WaitingSamples, written: FloatArray, *, ended: bool) -> _DecidedStamps:
    """Stamps in the order of arrival on one clock."""
    clock, tolerance = waiting.clock, waiting.tolerance
    if tolerance is None:
        if written.size < FIRST and not ended:
            return _DecidedStamps(np.empty(0), np.empty(0, dtype=np.bool_), clock, None)
        usual = usual_interval(written[:FIRST])
        tolerance = Tolerance.of(usual, shared=len(waiting.streams) > 1, late=WINDOW)
    runs = _runs(written, waiting.count, clock.written, tolerance)
    shifts, changes, after = shifts_of(runs, tolerance, clock, whole=False)
    if ended and sum(run.size for run in runs[len(shifts) :]) > (LONE if math.isfinite(after.written) else 0):
        shifts, changes, after = shifts_of(runs, tolerance, clock)
    if ended:  # nothing confirms these any more
        shifts += [math.nan] * (len(runs) - len(shifts))
    moves = np.repeat(shifts, [run.size for run in runs[: len(shifts)]])
    stamps = written[: moves.size] + moves
    greatest = np.fmax.accumulate(np.append(clock.last, stamps))
    behind = stamps <= greatest[:-1] - WINDOW
    stamps[behind] = math.nan
    lone = [change for change in changes if change.kind == "lone"]
    for change in lone:
        row = change.row - waiting.count
        behind[row : row + int(change.amount)] = change.stamp < change.before
    said = tuple(sentences([change for change in changes if change not in lone], Places(waiting.word), tolerance.apart))
    return _DecidedStamps(stamps, behind, replace(after, last=float(greatest[-1])), tolerance, said)


def _runs(written: FloatArray, count: int, before: float, tolerance: Tolerance) -> list[Run]:
    """The runs of stamps, of which the first is sample number `count`, whatever they come with."""
    greatest = np.maximum.accumulate(np.append(before, written))
    steps = written - greatest[:-1]
    if written.size and tolerance.goes_on(steps.min()) and tolerance.goes_on(steps.max()):
        return [Run(count, written.size, float(written[0]), float(greatest[-1]))]
    singles = [Run(count + i, 1, stamp, stamp) for i, stamp in enumerate(written.tolist())]
    if singles and tolerance.goes_on(singles[0].first - before):
        singles[0] = singles[0]._replace(last=max(before, singles[0].last))
    return joined_runs(singles, tolerance)


def _merged(held: SampleBlock, new: SampleBlock, keep: NDArray[np.bool_]) -> tuple[SampleBlock, int]:
    """The samples of a stream with new ones, and the number of those with a stamp that a later one repeats."""
    begin = held.time[-1:]
    if keep.all() and (np.diff(np.append(begin, new.time)) > 0).all():  # as they should come: no need to sort
        return held.followed_by(new), 0
    both = held.followed_by(new.take(keep))
    order = np.argsort(both.time, kind="stable")
    stamps = both.time[order]
    order = order[np.append(stamps[1:] != stamps[:-1], True)] if stamps.size else order
    return both.take(order), stamps.size - order.size


def final(waiting: WaitingSamples, *, ended: bool) -> tuple[WaitingSamples, tuple[SampleBlock, ...]]:
    """Samples that go on waiting, and those that none can precede any more; all of them at the end."""
    until = math.inf if ended else waiting.clock.last - WINDOW
    parts = [stream.split(until) for stream in waiting.streams]
    return replace(waiting, streams=tuple(rest for _, rest in parts)), tuple(ready for ready, _ in parts)

"""Streams of channels with common stamps while they arrive, sorted by their stamps.

A stamp far ahead waits until the next one confirms it, so that one spoiled stamp costs one sample.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray
from clutchid.measurements.checks import in_si, outside_duty
from clutchid.measurements.clock import JUMP, WINDOW
from clutchid.measurements.columns import heading_problems
from clutchid.measurements.map.channel_map import Channel, ChannelMap, PickedChannels
from clutchid.measurements.map.picking import pick
from clutchid.measurements.recording import picked_values
from clutchid.measurements.source import Raster, Rows, Source, Table, in_contract, no_tables
from clutchid.measurements.time_axis import SampleBlock, no_samples

_ADVICE = (
    "Name the channels as in `time [s],position [m],duty_supply [1],duty_exhaust [1]`, or give a channel map with "
    "--map, as `clutchid look FILE --save MAP.toml` writes it for a recording of the same source."
)


class ArrivedSamples(NamedTuple):
    """Samples of a stream in the order in which they came.

    `place` (n,) is the place of each among all that came together, `samples` have n time stamps, in the order of
    arrival; `invalid` counts the values that were infinite, or duty cycles outside 0 to 1, and are NaN now. Samples
    without a time are left out.
    """

    stream: int
    place: Rows
    samples: SampleBlock
    invalid: int = 0

    def take(self, rows: Rows | NDArray[np.bool_]) -> ArrivedSamples:
        """Some of the samples."""
        return self._replace(place=self.place[rows], samples=self.samples.take(rows))


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
    picks, problems = pick(source, channels, required)
    missing = [wanted for wanted in required if wanted not in channels.channels and wanted != "time"]
    problems += (f"no channel is assigned to {', '.join(missing)}.",) if missing else ()
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


def arrived(
    stream: int, chosen: PickedChannels, table: Table, ambient: float, place: Rows, count: int = 0
) -> ArrivedSamples:
    """The picked channels of a table in SI, in the order in which they came.

    Parameters
    ----------
    ambient : Pa
        Absolute pressure that is added to gauge pressures.
    place
        The place of each row among all that came together, increasing.
    done
        Number of rows before, for a time that is counted.
    """
    columns, invalid = {}, 0
    for name, written in picked_values(table, chosen, count).items():
        values = in_si(chosen.columns[name][0], written, ambient)
        wrong = np.isinf(values)
        if name in INPUTS:
            wrong |= outside_duty(values)
        if wrong.any():
            invalid += int(wrong.sum())
            values = np.where(wrong, np.nan, values)
        columns[name] = values
    arrived_samples = ArrivedSamples(stream, place, SampleBlock(columns.pop("time"), columns), invalid)
    valid = np.isfinite(arrived_samples.samples.time)
    if chosen.sparse:
        valid &= np.isfinite(list(columns.values())).any(axis=0)
    return arrived_samples if valid.all() else arrived_samples.take(valid)


#: As many late samples in a row mean that the clock of the source has gone back, or has jumped ahead before.
LOST = 1000


@dataclass(frozen=True, eq=False, slots=True)
class WaitingSamples:
    """Samples by stream that others may still precede; the latest stamp in s; late samples in a row.

    `lost` is the stamp in s at which the clock was found to have gone back, NaN before. `ahead` are samples, one each,
    whose stamps are more than `JUMP` ahead of the latest and wait for the next one.
    """

    streams: tuple[SampleBlock, ...]
    latest: float = -math.inf
    late: int = 0
    lost: float = math.nan
    ahead: tuple[ArrivedSamples, ...] = ()


class LeftOutCounts(NamedTuple):
    """Numbers of samples left out, see `clutchid.observer.health.LIVE_FLAGS`.

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


def none_waiting(names: Sequence[Sequence[str]]) -> WaitingSamples:
    """No samples yet, of streams with columns of these names."""
    return WaitingSamples(tuple(map(no_samples, names)))


def sorted_in(waiting: WaitingSamples, arrivals: Sequence[ArrivedSamples]) -> tuple[WaitingSamples, LeftOutCounts]:
    """Waiting samples after some more came; those that came together may be cut in any way.

    A sample whose stamp is `WINDOW` or more below an earlier stamp is late. Of equal stamps the last counts. After
    `LOST` late samples in a row all others are left out. A sample whose stamp is more than `JUMP` ahead waits: it is
    invalid if the next stamp is `WINDOW` or more below it.
    """
    first = len(waiting.ahead)
    arrivals = [*(held._replace(place=np.array([i - first])) for i, held in enumerate(waiting.ahead)), *arrivals]
    begins = np.cumsum([0, *(arrival.place.size for arrival in arrivals)])
    order = np.argsort(np.concatenate([np.empty(0), *(arrival.place for arrival in arrivals)]), kind="stable")
    stamps = np.concatenate([np.empty(0), *(arrival.samples.time for arrival in arrivals)])[order]
    wait, invalid = _far_ahead(waiting.latest, stamps)
    taken, keep = np.ones(stamps.size, dtype=bool), np.zeros(stamps.size, dtype=bool)
    taken[[*wait, *invalid]] = False
    late, latest, run, end = _late(waiting, stamps[taken])
    keep[order[taken]] = ~late
    streams, repeated, ahead = list(waiting.streams), 0, []
    for arrival, begin in zip(arrivals, begins.tolist(), strict=False):
        part = keep[begin : begin + arrival.place.size]
        streams[arrival.stream], again = _merged(streams[arrival.stream], arrival.samples, part)
        repeated += again
    for at in order[wait].tolist():
        i = int(np.searchsorted(begins, at, side="right")) - 1
        ahead.append(arrivals[i].take(np.array([at - begins[i]])))
    after = replace(waiting, streams=tuple(streams), latest=latest, late=run, lost=end, ahead=tuple(ahead))
    return after, LeftOutCounts(int(late.sum()), repeated, invalid=len(invalid))


def unconfirmed(waiting: WaitingSamples) -> tuple[WaitingSamples, LeftOutCounts]:
    """Waiting samples at the end: a sample far ahead is invalid, unless it is the only one."""
    after = replace(waiting, ahead=())
    if waiting.latest > -math.inf or not waiting.ahead:
        return after, LeftOutCounts(invalid=len(waiting.ahead))
    first = waiting.ahead[0]
    streams = list(waiting.streams)
    streams[first.stream] = streams[first.stream].followed_by(first.samples)
    return replace(after, streams=tuple(streams), latest=float(first.samples.time[0])), LeftOutCounts()


def _far_ahead(latest: float, arrived_stamps: FloatArray) -> tuple[list[int], list[int]]:
    """The samples that still wait for a sample that confirms them, and the invalid ones, in the order of arrival.

    The next stamp confirms those that wait if it is neither `WINDOW` below nor as far ahead again. Of the first ones of
    all, those far below the ones that are confirmed are invalid.
    """
    wait: list[int] = []
    invalid: list[int] = []
    if (arrived_stamps <= np.maximum.accumulate(np.append(latest, arrived_stamps))[:-1] + JUMP).all():
        return wait, invalid
    stamps = arrived_stamps.tolist()
    for i, stamp in enumerate(stamps):
        invalid += [j for j in wait if stamps[j] >= stamp + WINDOW]
        wait = [j for j in wait if stamps[j] < stamp + WINDOW]
        if wait:
            last = stamps[wait[-1]]
            earlier = stamps[wait[-2]] if len(wait) > 1 else latest
            step = stamp - last
            if step <= max(JUMP, 2.0 * (last - earlier) if earlier > -math.inf else 0.0):
                while latest == -math.inf and len(wait) > 1 and last - stamps[wait[0]] > max(JUMP, 2.0 * step):
                    invalid.append(wait.pop(0))
                latest, wait = last, []
        if stamp > latest + JUMP:
            wait.append(i)
        else:
            latest = max(latest, stamp)
    return wait, invalid


def _late(waiting: WaitingSamples, stamps: FloatArray) -> tuple[NDArray[np.bool_], float, int, float]:
    """The late samples as a mask; the latest stamp, the late ones in a row, and the stamp where the clock was lost."""
    if not stamps.size or not math.isnan(waiting.lost):
        return np.ones(stamps.size, dtype=bool), waiting.latest, waiting.late, waiting.lost
    before = np.maximum.accumulate(np.append(waiting.latest, stamps))
    late = stamps <= before[:-1] - WINDOW
    last_good = np.maximum.accumulate(np.where(late, -1 - waiting.late, np.arange(stamps.size)))
    run = np.arange(stamps.size) - last_good
    lost = np.flatnonzero(run >= LOST)
    latest, end = float(before[-1]), math.nan
    if lost.size:
        late[lost[0] :] = True
        latest, end = float(before[lost[0]]), float(stamps[lost[0]])
    return late, latest, int(run[-1]), end


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
    until = math.inf if ended else waiting.latest - WINDOW
    parts = [stream.split(until) for stream in waiting.streams]
    return replace(waiting, streams=tuple(rest for _, rest in parts)), tuple(ready for ready, _ in parts)

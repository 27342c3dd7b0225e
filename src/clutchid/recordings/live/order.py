"""Streams of channels with common stamps while they arrive, sorted by their stamps.

A stamp far ahead waits until the next one confirms it, so that one spoiled stamp costs one sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray
from clutchid.recordings.checks import in_si
from clutchid.recordings.columns import heading_problems
from clutchid.recordings.map.channel_map import COUNTED, Channel, ChannelMap, Pick
from clutchid.recordings.map.picking import pick
from clutchid.recordings.recording import scaled
from clutchid.recordings.source import Raster, Rows, Source, Table, in_contract, no_tables

#: A duty cycle may be as far outside 0 to 1.
_SLACK = 1e-9

_ADVICE = (
    "Name the channels as in `time [s],position [m],duty_supply [1],duty_exhaust [1]`, or give a channel map with "
    "--map, as `clutchid look FILE --save MAP.toml` writes it for a recording of the same source."
)


class Arrived(NamedTuple):
    """Samples of a stream in the order in which they came.

    `place` (n,) is the place of each among all that came together, `time` (n,) in s, `columns` (n,) each in SI;
    `invalid` counts the values that were infinite, or duty cycles outside 0 to 1, and are NaN now. Samples without a
    time are left out.
    """

    stream: int
    place: Rows
    time: FloatArray
    columns: Mapping[str, FloatArray]
    invalid: int = 0


def picked_streams(
    name: str, rasters: Sequence[Raster], channels: ChannelMap | None, required: Sequence[str]
) -> tuple[Pick, ...]:
    """The channels of each time grid that the map picks, that of the position first.

    Without a map these are the channels with standard names.

    Raises
    ------
    DataError
        If the map does not fit, or a required quantity has no channel; the text lists all problems.
    """
    source = Source(Path(name), "CSV" if len(rasters) == 1 else "CAN", tuple(rasters), no_tables)
    problems: list[str] = []
    if channels is None:
        if len(rasters) == 1 and not in_contract(source):
            raise DataError.of(name, [*heading_problems(rasters[0].headings, required), _ADVICE])
        channels = _by_names(rasters)
    picks, found = pick(source, channels, required)
    problems += found
    missing = [wanted for wanted in required if wanted not in channels.channels and wanted != "time"]
    problems += [f"no channel is assigned to {', '.join(missing)}."] if missing else []
    if problems:
        raise DataError.of(name, [*problems, _ADVICE])
    return tuple(sorted(picks, key=lambda chosen: "position" not in chosen.columns))


def _by_names(rasters: Sequence[Raster]) -> ChannelMap:
    """A map of the channels with standard names, but for the stamps; the first of several counts."""
    found: dict[str, Channel] = {}
    for raster in rasters:
        for heading in raster.headings:
            if heading.name not in (None, "time"):
                found.setdefault(str(heading.name), Channel(heading.text, raster.name or None))
    return ChannelMap(found)


def indices(chosen: Pick) -> list[int]:
    """The channels of a time grid that are read, by their index in it."""
    return [heading.index for heading, _ in chosen.columns.values() if heading.index != COUNTED]


def arrived(stream: int, chosen: Pick, table: Table, ambient: float, place: Rows, done: int = 0) -> Arrived:
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
    for name, (heading, entry) in chosen.columns.items():
        if heading.index == COUNTED:
            values = (done + np.arange(table.size)) / float(chosen.rate or 1.0)
        else:
            values = in_si(heading, scaled(table.numbers[heading.index], entry), ambient)
        wrong = np.isinf(values)
        if name in INPUTS:
            wrong |= (values < -_SLACK) | (values > 1.0 + _SLACK)
        if wrong.any():
            invalid += int(wrong.sum())
            values = np.where(wrong, np.nan, values)
        columns[name] = values
    time = columns.pop("time")
    known = np.isfinite(time)
    if not known.all():
        place, time = place[known], time[known]
        columns = {name: values[known] for name, values in columns.items()}
    return Arrived(stream, place, time, columns, invalid)


#: Time in s by which a stamp may lie behind the latest one: as long samples wait for those that come out of order.
WINDOW = 0.05

#: As many late samples in a row mean that the clock of the source has gone back, or has jumped ahead before.
LOST = 1000


#: Time in s by which a stamp may lie ahead of the latest one without a second sample that confirms it.
JUMP = 0.2


class Ordered(NamedTuple):
    """Samples of one stream with increasing stamps: time in s, columns in SI."""

    time: FloatArray
    columns: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False, slots=True)
class Waiting:
    """Samples by stream that others may still precede; the latest stamp in s; late samples in a row.

    `lost` is the stamp in s at which the clock was found to have gone back, NaN before. `ahead` are samples, one each,
    whose stamps are more than `JUMP` ahead of the latest and wait for the next one.
    """

    streams: tuple[Ordered, ...]
    latest: float = -math.inf
    late: int = 0
    lost: float = math.nan
    ahead: tuple[Arrived, ...] = ()


class LeftOut(NamedTuple):
    """Samples that were left out: too late, with a stamp that a later one repeats, or that no later one confirms."""

    late: int = 0
    repeated: int = 0
    invalid: int = 0


def none_waiting(names: Sequence[Sequence[str]]) -> Waiting:
    """Nothing yet, of streams with columns of these names."""
    return Waiting(tuple(Ordered(np.empty(0), {name: np.empty(0) for name in each}) for each in names))


def sorted_in(waiting: Waiting, found: Sequence[Arrived]) -> tuple[Waiting, LeftOut]:
    """What waits after some samples came; those that came together may be cut in any way.

    A sample whose stamp is `WINDOW` or more below one that came before is late. Of equal stamps the last counts. After
    `LOST` late samples in a row all others are left out. A sample whose stamp is more than `JUMP` ahead waits: it is
    invalid if the next stamp is `WINDOW` or more below it.
    """
    found, ahead, invalid = _confirmed(waiting, found)
    late, latest, run, end = _late(waiting, found)
    streams, repeated = list(waiting.streams), 0
    begin = 0
    for one in found:
        keep = ~late[begin : begin + one.time.size]
        begin += one.time.size
        streams[one.stream], again = _merged(streams[one.stream], one, keep)
        repeated += again
    after = replace(waiting, streams=tuple(streams), latest=latest, late=run, lost=end, ahead=ahead)
    return after, LeftOut(int(late.sum()), repeated, invalid)


def unconfirmed(waiting: Waiting) -> tuple[Waiting, LeftOut]:
    """What waits at the end: a sample far ahead is invalid, unless it is the only one."""
    after = replace(waiting, ahead=())
    if waiting.latest > -math.inf or not waiting.ahead:
        return after, LeftOut(invalid=len(waiting.ahead))
    first = waiting.ahead[0]
    streams = list(waiting.streams)
    streams[first.stream] = _joined(streams[first.stream], first.time, first.columns)
    return replace(after, streams=tuple(streams), latest=float(first.time[0])), LeftOut()


def _confirmed(waiting: Waiting, found: Sequence[Arrived]) -> tuple[Sequence[Arrived], tuple[Arrived, ...], int]:
    """The samples that are taken, those that wait because they are far ahead, and the number of invalid ones."""
    held = [one._replace(place=np.array([i - len(waiting.ahead)])) for i, one in enumerate(waiting.ahead)]
    found = [*held, *found]
    place = np.concatenate([np.empty(0, dtype=np.int64), *(one.place for one in found)])
    order = np.argsort(place, kind="stable")
    stamps = np.concatenate([np.empty(0), *(one.time for one in found)])[order]
    before = np.maximum.accumulate(np.append(waiting.latest, stamps))[:-1]
    if not held and (stamps <= before + JUMP).all():
        return found, (), 0
    wait, invalid = _far_ahead(waiting.latest, stamps.tolist())
    taken = np.ones(stamps.size, dtype=bool)
    taken[order[[*wait, *invalid]]] = False
    begins = np.cumsum([0, *(one.time.size for one in found)])
    ahead = []
    for at in order[wait].tolist():
        i = int(np.searchsorted(begins, at, side="right")) - 1
        ahead.append(_rows(found[i], np.array([at - begins[i]])))
    rest = [_rows(one, taken[begin : begin + one.time.size]) for one, begin in zip(found, begins, strict=False)]
    return rest, tuple(ahead), len(invalid)


def _far_ahead(latest: float, stamps: Sequence[float]) -> tuple[list[int], list[int]]:
    """Which samples still wait for one that confirms them, and which are invalid, in the order of arrival.

    The next stamp confirms those that wait if it is neither `WINDOW` below nor as far ahead again. Of the first ones of
    all, those far below the ones that are confirmed are invalid.
    """
    wait: list[int] = []
    invalid: list[int] = []
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


def _rows(samples: Arrived, which: np.ndarray) -> Arrived:
    columns = {name: values[which] for name, values in samples.columns.items()}
    return samples._replace(place=samples.place[which], time=samples.time[which], columns=columns)


def _late(waiting: Waiting, found: Sequence[Arrived]) -> tuple[np.ndarray, float, int, float]:
    """Which samples are late; then the latest stamp, the late ones in a row, and the stamp where the clock was lost."""
    time = np.concatenate([np.empty(0), *(one.time for one in found)])
    if not time.size or not math.isnan(waiting.lost):
        return np.ones(time.size, dtype=bool), waiting.latest, waiting.late, waiting.lost
    order = np.argsort(np.concatenate([one.place for one in found]), kind="stable")
    stamps = time[order]
    before = np.maximum.accumulate(np.append(waiting.latest, stamps))
    late = stamps <= before[:-1] - WINDOW
    last_good = np.maximum.accumulate(np.where(late, -1 - waiting.late, np.arange(stamps.size)))
    run = np.arange(stamps.size) - last_good
    lost = np.flatnonzero(run >= LOST)
    latest, end = float(before[-1]), math.nan
    if lost.size:
        late[lost[0] :] = True
        latest, end = float(before[lost[0]]), float(stamps[lost[0]])
    result = np.empty(stamps.size, dtype=bool)
    result[order] = late
    return result, latest, int(run[-1]), end


def _merged(held: Ordered, new: Arrived, keep: np.ndarray) -> tuple[Ordered, int]:
    """The samples of a stream with new ones, and how many have a stamp that a later one repeats."""
    if (
        keep.all()
        and (new.time[1:] > new.time[:-1]).all()
        and (not held.time.size or not new.time.size or new.time[0] > held.time[-1])
    ):  # as they should come: no need to sort
        return _joined(held, new.time, new.columns), 0
    both = _joined(held, new.time[keep], {name: values[keep] for name, values in new.columns.items()})
    order = np.argsort(both.time, kind="stable")
    stamps = both.time[order]
    order = order[np.append(stamps[1:] != stamps[:-1], True)] if stamps.size else order
    return Ordered(both.time[order], {name: values[order] for name, values in both.columns.items()}), (
        stamps.size - order.size
    )


def _joined(held: Ordered, time: FloatArray, columns: Mapping[str, FloatArray]) -> Ordered:
    return Ordered(
        np.concatenate([held.time, time]),
        {name: np.concatenate([values, columns[name]]) for name, values in held.columns.items()},
    )


def final(waiting: Waiting, *, ended: bool) -> tuple[Waiting, tuple[Ordered, ...]]:
    """What goes on waiting, and the samples that none can precede any more; all of them at the end."""
    until = math.inf if ended else waiting.latest - WINDOW
    ready, rest = [], []
    for one in waiting.streams:
        cut = int(np.searchsorted(one.time, until, side="right"))
        ready.append(part(one, 0, cut))
        rest.append(part(one, cut, one.time.size))
    return replace(waiting, streams=tuple(rest)), tuple(ready)


def part(samples: Ordered, begin: int, end: int) -> Ordered:
    """Some of the samples."""
    return Ordered(samples.time[begin:end], {name: values[begin:end] for name, values in samples.columns.items()})


def followed_by(first: Ordered, then: Ordered) -> Ordered:
    """Samples and those that come after them."""
    return _joined(first, then.time, then.columns)

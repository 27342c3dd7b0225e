"""Convert a file to a recording in SI on one time grid, as a whole or in pieces.

Its channels are assigned by a channel map, or by their names: a table whose columns have the standard names is read as
it stands, and its time must increase; the time stamps of any other file are repaired.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from pathlib import Path

import numpy as np

from clutchid.errors import DataError
from clutchid.log import HOLE, FloatArray, Log, Samples
from clutchid.measurements.checks import check, in_si
from clutchid.measurements.columns import Heading, heading_problems, ignored
from clutchid.measurements.map.channel_map import COUNTED, Channel, ChannelMap, PickedChannels
from clutchid.measurements.opening import MEMORY_VARIABLE, memory
from clutchid.measurements.source import Places, Source, Table, with_unit
from clutchid.measurements.time_axis import (
    AT_START,
    ChannelStream,
    RepairedTime,
    SampleBlock,
    aligned,
    no_samples,
    repair,
    usual_interval,
)

#: Part of the memory limit that the values of a recording may take as a whole: reading holds them up to four times.
_PART = 0.4


@dataclass(slots=True)
class _Messages:
    """Problems and warnings of all streams so far."""

    problems: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def pieces(
    source: Source, channels: ChannelMap | None, ambient: float, required: Sequence[str], rows: int | None
) -> Iterator[Log]:
    """The recording as consecutive logs of about `rows` samples (None: one log), on one time grid.

    Parameters
    ----------
    source, channels
        The file and the assignment of its channels; None for a table whose columns have the standard names.
    ambient : Pa
        Absolute pressure that is added to gauge pressures.
    required
        Quantities that the recording must have.
    rows
        Samples per piece, which limits the memory.

    Raises
    ------
    DataError
        If the map does not match the file, samples are invalid, or the file is too large to be read as a whole; the
        text lists all problems of the block.
    """
    picks, problems = by_names(source, required) if channels is None else picked(source, channels, required)
    messages = _Messages([*source.problems, *problems], [*source.warnings])
    if messages.problems and (channels is not None or not picks):
        raise DataError.of(str(source.path), messages.problems)
    if rows is None:
        longest = max((source.rasters[chosen.raster].size for chosen in picks), default=0)
        _check_size(source.path, longest, sum(len(chosen.columns) for chosen in picks))
    if channels is not None:
        messages.warnings += channels.comments.get("", "").splitlines()
    messages.warnings += [note for chosen in picks for note in chosen.notes]
    if len(picks) == 1 and (channels is None or channels.raster is None):
        base, others = ChannelStream(_blocks(source, picks[0], ambient, rows, messages), {}), list[ChannelStream]()
    else:
        streams = [(*_stream(source, chosen, ambient, rows, messages), chosen) for chosen in picks]
        (usual, base, fastest), *slower = sorted(streams, key=lambda stream: stream[0])
        others = [stream for _, stream, _ in slower]
        if channels is not None and channels.raster is not None:
            clock = _blocks(source, fastest, ambient, rows, _Messages())
            base, others = _uniform(clock, channels.raster, HOLE * usual), [base, *others]
    read = [heading for chosen in picks for heading, _ in chosen.columns.values()]
    edges = source.edges if channels is None else {}
    described = replace(source, metadata=with_unit(source.metadata, read), edges=edges)
    yield from _logs(described, aligned(base, others), messages)


def _check_size(path: Path, samples: int, channels: int) -> None:
    """Check, before a sample is read, that as many `samples` of as many `channels` as the file has fit into memory.

    Raises
    ------
    DataError
        If their values take more than a part of the memory limit.
    """
    size, most = 8 * samples * channels, _PART * memory()
    if size > most:
        raise DataError(
            f"{path}: its {samples:,} samples of {channels} channels take {size / 1e9:.3g} GB in memory, more than the "
            f"{most / 1e9:.3g} GB that are read as a whole; cut out what is needed with `clutchid cut`, or allow more "
            f"with the environment variable {MEMORY_VARIABLE}={math.ceil(size / _PART / 1e9)}GB."
        )


def by_names(source: Source, required: Sequence[str]) -> tuple[tuple[PickedChannels, ...], tuple[str, ...]]:
    """The columns of a table that have standard names, and all problems of its headings."""
    if not source.rasters or source.unnamed:
        return (), ((source.unnamed,) if source.unnamed else ())
    headings = source.rasters[0].headings
    columns = {heading.name: (heading, Channel(heading.text)) for heading in headings if heading.name is not None}
    chosen = PickedChannels(0, columns, notes=tuple(ignored(headings)), increasing=True)
    return (chosen,), tuple(heading_problems(headings, tuple(dict.fromkeys(("time", *required)))))


def picked(
    source: Source, channels: ChannelMap, required: Sequence[str]
) -> tuple[tuple[PickedChannels, ...], tuple[str, ...]]:
    """Channels that the map selects from the file, and all problems of the map, also for `required` quantities."""
    from clutchid.measurements.map.picking import pick

    picks, problems = pick(source, channels, required)
    missing = [name for name in required if name not in channels.channels and name != "time"]
    if missing:
        tables = " and ".join(f"[{name}]" for name in missing)
        problems = (*problems, f"no channel is assigned to {', '.join(missing)}; add {tables} to the map.")
    return picks, problems


def findings(
    source: Source, picks: Sequence[PickedChannels], ambient: float, rows: int | None
) -> tuple[list[str], list[str]]:
    """Problems and warnings that `pieces` has for the samples of these channels."""
    messages = _Messages(warnings=[note for chosen in picks for note in chosen.notes])
    for chosen in [chosen for chosen in picks if "time" in chosen.columns]:
        for _ in _blocks(source, chosen, ambient, rows, messages):
            pass
    return messages.problems, messages.warnings


def _logs(
    source: Source, blocks: Iterator[tuple[SampleBlock, dict[str, Samples]]], messages: _Messages
) -> Iterator[Log]:
    """Blocks as logs; messages since the previous log are attached to the next one."""
    for (time, columns), edges in blocks:
        if messages.problems:
            raise DataError.of(str(source.path), messages.problems)
        warnings, messages.warnings = tuple(dict.fromkeys(messages.warnings)), []
        own = {name: samples for name, samples in source.edges.items() if name in columns}
        yield Log(time, columns, source.name, dict(source.metadata), warnings, own | edges)
    if messages.problems:
        raise DataError.of(str(source.path), messages.problems)


def _stream(
    source: Source, chosen: PickedChannels, ambient: float, rows: int | None, messages: _Messages
) -> tuple[float, ChannelStream]:
    """The channels of a pick as a stream in SI, and their usual interval in s, from the first block."""
    blocks = _blocks(source, chosen, ambient, rows, messages)
    first = list(islice(blocks, 1))
    usual = usual_interval(first[0].time) if first else math.inf
    return usual, ChannelStream(chain(first, blocks), chosen.longest(usual))


def _blocks(
    source: Source, chosen: PickedChannels, ambient: float, rows: int | None, messages: _Messages
) -> Iterator[SampleBlock]:
    """The samples of a pick, block by block, with increasing time stamps."""
    clock, done = AT_START, 0
    columns_read = chosen.indices
    if chosen.increasing:  # of columns with the same name all are checked
        columns_read = [heading.index for heading in source.rasters[chosen.raster].headings if heading.name is not None]
    for table in source.tables(chosen.raster, columns_read, rows):
        if chosen.increasing:
            checked = check(table, ambient)
        else:
            named = _named(table, chosen, done)
            done += table.size
            stamps = in_si(named.headings[0], named.numbers[named.headings[0].index], ambient)
            repaired = repair(stamps, named.places, clock)
            clock = repaired.clock
            messages.warnings += [f"{_where(source, chosen)}{sentence}" for sentence in repaired.messages]
            checked = check(_kept(named, repaired), ambient)
        messages.problems += checked.problems
        messages.warnings += checked.warnings
        if table.problems or (chosen.increasing and messages.problems):
            yield no_samples(name for name in chosen.columns if name != "time")
            return
        columns = dict(checked.columns)
        yield SampleBlock(columns.pop("time"), columns).earlier(chosen.delay)


def _where(source: Source, chosen: PickedChannels) -> str:
    name = source.rasters[chosen.raster].name
    return f"{name}: " if name and len(source.rasters) > 1 else ""


def _named(table: Table, chosen: PickedChannels, done: int) -> Table:
    """The picked columns under the names of their quantities, with sign, factor and offset applied."""
    headings = [heading for heading, _ in chosen.columns.values()]
    return replace(
        table,
        headings=tuple(replace(heading, index=i) for i, heading in enumerate(headings)),
        numbers=dict(enumerate(picked_values(table, chosen, done).values())),
        unread={i: table.unread[heading.index] for i, heading in enumerate(headings) if heading.index in table.unread},
    )


def picked_values(table: Table, chosen: PickedChannels, done: int) -> dict[str, FloatArray]:
    """The picked columns by quantity, in their units, with sign, factor and offset applied; NaN where there is none.

    A time that is counted begins `done` samples after the first one.
    """
    found = {}
    for name, (heading, entry) in chosen.columns.items():
        if heading.index == COUNTED and chosen.rate is not None:
            found[name] = (done + np.arange(table.size)) / chosen.rate
        else:
            written = table.numbers.get(heading.index)
            found[name] = np.full(table.size, np.nan) if written is None else scaled(written, entry)
    return found


def scaled(values: FloatArray, entry: Channel) -> FloatArray:
    """Samples with the sign, factor and offset of a map entry, in its unit; infinite where they overflow."""
    scale = entry.sign * entry.factor
    if (scale, entry.offset) == (1.0, 0.0):
        return values
    with np.errstate(over="ignore", invalid="ignore"):  # `check` says which samples are not finite
        return scale * values + entry.offset


def _kept(table: Table, repaired: RepairedTime) -> Table:
    """The rows of a table that are kept, with repaired time stamps in s."""
    clock, *others = table.headings
    rows, places = repaired.kept, table.places
    if rows.size < table.size:
        places = Places(places.word, numbers=places.each_number(table.size)[rows])
    return replace(
        table,
        headings=(Heading(clock.index, clock.text, "time", "s"), *others),
        numbers={clock.index: repaired.time, **{other.index: table.numbers[other.index][rows] for other in others}},
        size=rows.size,
        places=places,
        unread={index: np.flatnonzero(np.isin(rows, unread)) for index, unread in table.unread.items()},
    )


def _uniform(clock: Iterator[SampleBlock], interval: float, longest: float) -> ChannelStream:
    """Uniform time grid over the time of a stream, without the instants in its holes."""

    def blocks() -> Iterator[SampleBlock]:
        start = last = math.nan
        count = 0
        for time, _ in clock:
            if not time.size:
                continue
            if math.isnan(start):
                start = last = float(time[0])
            end = math.floor((time[-1] - start) / interval + 1e-9) + 1
            instants = _snapped(start + interval * np.arange(count, end), time, 1e-6 * interval)
            stamps = np.r_[last, time]
            before = np.clip(np.searchsorted(stamps, instants, side="right") - 1, 0, stamps.size - 2)
            known = (stamps[before + 1] - stamps[before] <= longest) | (instants == stamps[before])
            yield SampleBlock(instants[known], {})
            count, last = max(count, end), float(time[-1])

    return ChannelStream(blocks(), {})


def _snapped(instants: FloatArray, stamps: FloatArray, slack: float) -> FloatArray:
    """Replace instants that differ from a time stamp by rounding only, so that a held input is not a sample late."""
    after = np.minimum(np.searchsorted(stamps, instants - slack), stamps.size - 1)
    return np.where(np.abs(stamps[after] - instants) <= slack, stamps[after], instants)

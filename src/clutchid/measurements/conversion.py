"""Convert a file to a recording in SI on one time grid, as a whole or in pieces.

Its channels are assigned by a channel map, or by their names; the time stamps of every file are repaired by one law.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, tee
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np

from clutchid.errors import DataError
from clutchid.log import HOLE, BoolArray, FloatArray, Log, Samples
from clutchid.measurements import clock as clock_rules
from clutchid.measurements import time_axis
from clutchid.measurements.checks import check, in_si
from clutchid.measurements.columns import Heading, heading_problems, ignored
from clutchid.measurements.map.channel_map import COUNTED, Channel, ChannelMap, PickedChannels
from clutchid.measurements.opening import MEMORY_VARIABLE, memory
from clutchid.measurements.source import BLOCK, Places, Rows, Source, Table, with_unit
from clutchid.measurements.sparse import by_presence
from clutchid.messages import sample_count

_Item = TypeVar("_Item")

#: The runs of a clock, and the shift of each in s.
_ClockPlan: TypeAlias = tuple[Sequence[clock_rules.Run], Sequence[float]]

#: Part of the memory limit that the values of a recording may take as a whole: reading holds them up to four times.
_PART = 0.4

#: Share of the first samples of a time grid that must have a time stamp of their own; else the time is no time.
_PLACED = 0.1


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
        check_size(source.path, longest, sum(len(chosen.columns) for chosen in picks))
    if channels is not None:
        messages.warnings += channels.comment.splitlines()
    messages.warnings += [note for chosen in picks for note in chosen.notes]
    grids = [grid for several in _grids(source, picks, ambient, rows, messages) for grid in several]
    interval = channels.raster if channels is not None else None
    if len(grids) == 1 and interval is None:
        base, others = time_axis.ChannelStream(grids[0][1], {}), list[time_axis.ChannelStream]()
    else:
        (usual, base), *slower = sorted(
            (_stream(blocks, chosen) for chosen, blocks in grids), key=lambda stream: stream[0]
        )
        others = [stream for _, stream in slower]
        if interval is not None:
            first, again = tee(base.blocks)
            base, others = _uniform(again, interval, HOLE * usual), [replace(base, blocks=first), *others]
    read = [heading for chosen in picks for heading, _ in chosen.columns.values()]
    edges = source.edges if channels is None else {}
    described = replace(source, metadata=with_unit(source.metadata, read), edges=edges)
    yield from _logs(described, time_axis.aligned(base, others), messages)


def check_size(path: Path, samples: int, channels: int) -> None:
    """Check, before a sample is read, that as many `samples` of as many `channels` as the file has fit into memory.

    Raises
    ------
    DataError
        If their values take more than a part of the memory limit.
    """
    size, most = 8 * samples * channels, _PART * memory()
    if size > most:
        raise DataError(
            f"{path}: its {samples:,} samples of {channels} channels take {size / 1e9:.3g} GB in memory, more than "
            f"the {most / 1e9:.3g} GB that clutchid reads as a whole; cut out the part that you need with `clutchid "
            f"cut`, or allow more with the environment variable {MEMORY_VARIABLE}={math.ceil(size / _PART / 1e9)}GB."
        )


def by_names(source: Source, required: Sequence[str]) -> tuple[tuple[PickedChannels, ...], tuple[str, ...]]:
    """The columns of a table that have standard names, and all problems of its headings."""
    if not source.rasters or source.unnamed:
        return (), ((source.unnamed,) if source.unnamed else ())
    headings = source.rasters[0].headings
    columns = {heading.name: (heading, Channel(heading.text)) for heading in headings if heading.name is not None}
    chosen = PickedChannels(0, columns, notes=tuple(ignored(headings)))
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
    source: Source,
    picks: Sequence[PickedChannels],
    ambient: float,
    rows: int | None,
    tables: Iterator[Table] | None = None,
) -> tuple[list[str], list[str]]:
    """Problems and warnings that `pieces` has for the samples of these channels.

    Those of a single pick may be in `tables` that are read for something else as well.
    """
    messages = _Messages(warnings=[note for chosen in picks for note in chosen.notes])
    timed = [chosen for chosen in picks if "time" in chosen.columns]
    for streams in _grids(source, timed, ambient, rows, messages, tables):
        for _, blocks in streams:
            for _ in blocks:
                pass
    return messages.problems, messages.warnings


def _logs(
    source: Source, blocks: Iterator[tuple[time_axis.SampleBlock, dict[str, Samples]]], messages: _Messages
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


def _stream(blocks: Iterator[time_axis.SampleBlock], chosen: PickedChannels) -> tuple[float, time_axis.ChannelStream]:
    """The channels of a pick as a stream in SI, and their usual interval in s, from the first block."""
    first = list(islice(blocks, 1))
    usual = clock_rules.usual_interval(first[0].time) if first and not chosen.on_change else math.inf
    return usual, time_axis.ChannelStream(_again(first, blocks), chosen.longest(usual))


def _again(first: list[_Item], rest: Iterator[_Item]) -> Iterator[_Item]:
    """Items that were taken from an iterator, kept no longer than needed, and the rest of them."""
    while first:
        yield first.pop(0)
    yield from rest


def _grids(
    source: Source,
    picks: Sequence[PickedChannels],
    ambient: float,
    rows: int | None,
    messages: _Messages,
    tables: Iterator[Table] | None = None,
) -> Iterator[list[tuple[PickedChannels, Iterator[time_axis.SampleBlock]]]]:
    """Time grids of each pick with their samples, block by block, with increasing time stamps on one clock.

    A pick is one grid, unless its rows are sparse.
    """
    plans = _plans(source, picks, ambient, messages) if len(picks) > 1 and not source.one_clock else {}
    for chosen in picks:
        every = tables if tables is not None else source.tables(chosen.raster, chosen.indices, rows)
        first = list(islice(every, 1))
        grids = by_presence(chosen, first[0]) if first else [chosen]
        messages.warnings += [note for grid in grids for note in grid.notes if note not in chosen.notes]
        whole = _again(first, every)
        copies = tee(whole, len(grids)) if len(grids) > 1 else (whole,)
        del whole
        plan = plans.get(chosen.raster)
        yield [
            (grid, _blocks(source, grid, copy, ambient, messages, plan))
            for grid, copy in zip(grids, copies, strict=True)
        ]


def _blocks(
    source: Source,
    chosen: PickedChannels,
    tables: Iterator[Table],
    ambient: float,
    messages: _Messages,
    plan: _ClockPlan | None,
) -> Iterator[time_axis.SampleBlock]:
    """The samples of a time grid, block by block, with increasing time stamps."""
    clock = clock_rules.AT_START
    count = 0
    for table in tables:
        named = _named(table, chosen, count)
        said: Sequence[str] = ()
        of_time = next((heading for heading in named.headings if heading.name == "time" and heading.si), None)
        if of_time is not None:
            stamps = in_si(of_time, named.numbers[of_time.index], ambient)
            if plan is not None:
                stamps = clock_rules.moved(stamps, count, *plan)
            mask: BoolArray | None = None
            if chosen.sparse:  # its rows share a clock, whatever is in them
                values = [numbers for index, numbers in named.numbers.items() if index != of_time.index]
                mask = np.any(np.isfinite(np.array(values)), axis=0, keepdims=True)[0]
            shared = source.one_clock or chosen.sparse
            repaired = clock_rules.repair(stamps, named.places, clock, shared=shared, mask=mask)
            said, clock = repaired.messages, repaired.clock
            if count == 0 and not table.problems:
                samples = np.arange(stamps.size) if mask is None else np.flatnonzero(mask)
                messages.problems += _unplaced(of_time, named.places, samples, repaired.rows)
            named = named.take(repaired.rows)
            headings = tuple(
                replace(heading, unit="s") if heading is of_time else heading for heading in named.headings
            )
            named = replace(named, headings=headings, numbers={**named.numbers, of_time.index: repaired.time})
        count += table.size
        columns, problems, warnings = check(named, ambient, holes_end=not chosen.on_change)
        messages.warnings += [f"{_where(source, chosen.raster)}{sentence}" for sentence in said]
        messages.problems += problems
        messages.warnings += [*table.warnings, *warnings]
        if messages.problems:
            yield time_axis.no_samples(name for name in chosen.columns if name != "time")
            return
        yield time_axis.SampleBlock(columns.pop("time"), columns).earlier(chosen.delay)


def _unplaced(clock: Heading, places: Places, samples: Rows, rows: Rows) -> list[str]:
    """Problem of a time that leaves only a few of the first `samples`, those in `rows`."""
    if rows.size >= _PLACED * samples.size:
        return []
    where = places.ranges(np.setdiff1d(samples, rows))
    return [
        f"the time '{clock.text}' gives only {rows.size:,} of {sample_count(samples.size)} a place: the others have no "
        f"time stamp, repeat one or go back ({where}); write an increasing time for every sample, with enough digits."
    ]


def _plans(
    source: Source, picks: Sequence[PickedChannels], ambient: float, messages: _Messages
) -> dict[int, _ClockPlan]:
    """One clock for time grids that have no common order; empty where none changes."""
    clocks: dict[int, list[clock_rules.Run]] = {}
    tolerances: list[clock_rules.Tolerance] = []
    word = "sample"
    for chosen in picks:
        heading, entry = chosen.columns.get("time", (None, None))
        if heading is None or entry is None or heading.index == COUNTED or chosen.raster in clocks:
            continue
        runs: list[clock_rules.Run] = []
        tolerance, before, count = clock_rules.Tolerance.of(math.inf), -math.inf, 0
        for table in source.tables(chosen.raster, [heading.index], BLOCK):
            stamps = in_si(heading, scaled(table.numbers.get(heading.index, np.empty(0)), entry), ambient)
            rows = np.flatnonzero(np.isfinite(stamps))
            if not math.isfinite(tolerance.usual):
                tolerance = clock_rules.Tolerance.of(clock_rules.usual_interval(stamps[rows]))
            runs += clock_rules.runs_of(rows + count, stamps[rows], before, tolerance)
            before = runs[-1].last if runs else before
            count += table.size
            word = table.places.word
        clocks[chosen.raster] = clock_rules.joined_runs(runs, tolerance)
        tolerances.append(tolerance)
    if len(clocks) < 2:
        return {}
    shifts, changes, problem = clock_rules.matched(list(clocks.values()), tolerances)
    messages.problems += [problem] if problem else []
    apart = max(tolerance.apart for tolerance in tolerances)
    for raster, group in zip(clocks, changes, strict=True):
        name = _where(source, raster)
        messages.warnings += [name + sentence for sentence in clock_rules.sentences(group, Places(word), apart)]
    groups = zip(clocks.items(), shifts, strict=not problem)
    return {raster: (runs, moves) for (raster, runs), moves in groups if any(moves)}


def _where(source: Source, raster: int) -> str:
    name = source.rasters[raster].name
    return f"{name}: " if name and len(source.rasters) > 1 else ""


def _named(table: Table, chosen: PickedChannels, count: int) -> Table:
    """The picked columns under the names of their quantities, with sign, factor and offset applied."""
    headings = [heading for heading, _ in chosen.columns.values()]
    return replace(
        table,
        headings=tuple(replace(heading, index=i) for i, heading in enumerate(headings)),
        numbers=dict(enumerate(picked_values(table, chosen, count).values())),
        unread={i: table.unread[heading.index] for i, heading in enumerate(headings) if heading.index in table.unread},
    )


def picked_values(table: Table, chosen: PickedChannels, count: int) -> dict[str, FloatArray]:
    """The picked columns by quantity, in their units, with sign, factor and offset applied; NaN where there is none.

    A time that is counted begins `count` samples after the first one.
    """
    values = {}
    for name, (heading, entry) in chosen.columns.items():
        if heading.index == COUNTED and chosen.rate is not None:
            values[name] = (count + np.arange(table.size)) / chosen.rate
        else:
            written = table.numbers.get(heading.index)
            values[name] = np.full(table.size, np.nan) if written is None else scaled(written, entry)
    return values


def scaled(values: FloatArray, entry: Channel) -> FloatArray:
    """Samples with the sign, factor and offset of a map entry, in its unit; infinite where they overflow."""
    scale = entry.sign * entry.factor
    if (scale, entry.offset) == (1.0, 0.0):
        return values
    with np.errstate(over="ignore", invalid="ignore"):  # `check` says which samples are not finite
        return scale * values + entry.offset


def _uniform(clock: Iterator[time_axis.SampleBlock], interval: float, longest: float) -> time_axis.ChannelStream:
    """Uniform time grid over the time of a stream, without the instants in its holes."""

    def blocks() -> Iterator[time_axis.SampleBlock]:
        start = last = math.nan
        count = 0
        for time, _ in clock:
            if not time.size:
                continue
            if math.isnan(start):
                start = last = float(time[0])
            stamps = np.r_[last, time]
            begins = np.r_[0, np.flatnonzero(np.diff(stamps) > longest) + 1]
            firsts = np.maximum(np.ceil((stamps[begins] - start) / interval - 1e-9), count).astype(np.int64)
            ends = np.floor((stamps[np.r_[begins[1:], stamps.size] - 1] - start) / interval + 1e-9).astype(np.int64) + 1
            sizes = np.maximum(ends - firsts, 0)
            numbers = np.repeat(firsts - np.r_[0, np.cumsum(sizes)[:-1]], sizes) + np.arange(sizes.sum())
            yield time_axis.SampleBlock(_snapped(start + interval * numbers, time, 1e-6 * interval), {})
            count, last = max(count, int(ends[-1])), float(time[-1])

    return time_axis.ChannelStream(blocks(), {})


def _snapped(instants: FloatArray, stamps: FloatArray, slack: float) -> FloatArray:
    """Replace instants that differ from a time stamp by rounding only, so that a held input is not a sample late."""
    after = np.minimum(np.searchsorted(stamps, instants - slack), stamps.size - 1)
    return np.where(np.abs(stamps[after] - instants) <= slack, stamps[after], instants)

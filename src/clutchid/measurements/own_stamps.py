"""Channels with stamps of their own: tables with several time columns, and rows that hold only what arrived.

A column of a table with several time columns belongs to the one that has a word of its name, else to the nearest one
before it. Rows hold only what arrived in outer joins, in the files of loggers that write what changes, and in JSON with
keys missing: a channel of such a table has the stamps of the rows in which it has a value.

Thresholds: benchmarks/results/thresholds.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from clutchid.log import INPUTS, FloatArray
from clutchid.measurements.columns import Heading, is_unit_of
from clutchid.measurements.map.channel_map import COUNTED, PickedChannels
from clutchid.measurements.source import Raster, Rows, Source, Table

#: Words of time columns, in lower case.
_TIMES = frozenset(["t", "time", "zeit", "stamp", "timestamp", "timestamps", "zeitstempel", "tout"])

#: Letters of a word that are enough for its beginning.
_BEGINNING = 3

#: Samples of the time columns that show whether they are times: they increase in this share, and decrease in this.
_SHOWN, _FORWARD, _BACK = 1000, 0.2, 0.05


def with_own_grids(source: Source) -> Source:
    """The source, with a time grid for each time column where its table has several."""
    if len(source.rasters) != 1 or source.problems or source.unnamed:
        return source
    (raster,) = source.rasters
    times = [heading for heading in raster.headings if _is_time(heading)]
    if len(times) < 2:
        return source
    owned = _owned(raster.headings, times)
    if len(owned) < 2 or not _increase(source, list(owned)):
        return source
    texts = dict(raster.others)
    by_index = {heading.index: heading for heading in raster.headings}
    rasters, places = [], []
    for time, columns in owned.items():
        indices = sorted([time, *columns])
        headings = tuple(replace(by_index[index], index=i) for i, index in enumerate(indices))
        others = tuple((heading.text, texts[heading.text]) for heading in headings if heading.text in texts)
        rasters.append(Raster(headings, raster.size, by_index[time].text, indices.index(time), others))
        places.append(indices)
    return replace(source, rasters=tuple(rasters), tables=partial(_tables, source, rasters, places))


def _is_time(heading: Heading) -> bool:
    if heading.name is not None:
        return heading.name == "time"
    return bool(_words(heading.text) & _TIMES) and (heading.unit is None or is_unit_of("time", heading.unit))


def _words(text: str) -> frozenset[str]:
    """
    >>> sorted(_words("ClutchPos_time [s]"))
    ['clutch', 'pos', 'time']
    """
    return frozenset(map(str.casefold, re.findall(r"[^\W\d_]+?(?=[A-Z][a-z])|[^\W\d_]+|\d+", text.partition("[")[0])))


def _owned(headings: Sequence[Heading], times: Sequence[Heading]) -> dict[int, list[int]]:
    """The columns of each time column, by index; time columns without any are left out."""
    words = {time.index: _words(time.text) for time in times}
    common = frozenset.intersection(*words.values())
    owned: dict[int, list[int]] = {time.index: [] for time in times}
    last = times[0].index
    for heading in headings:
        if heading.index in owned:
            last = heading.index
            continue
        parts = _words(heading.text)
        called = [index for index, own in words.items() if any(_alike(a, b) for a in own - common for b in parts)]
        owned[called[0] if len(called) == 1 else last].append(heading.index)
    return {index: columns for index, columns in owned.items() if columns}


def _alike(word: str, other: str) -> bool:
    """Whether a word is another, or its beginning: pos, position."""
    short, long = sorted((word, other), key=len)
    return short == long or (len(short) >= _BEGINNING and long.startswith(short))


def _increase(source: Source, times: Sequence[int]) -> bool:
    """Whether the first samples of all of these columns increase, as times do."""
    table = next(source.tables(0, times, _SHOWN), None)
    if table is None:
        return False
    for index in times:
        stamps = table.numbers.get(index, np.empty(0))
        steps = np.diff(stamps[np.isfinite(stamps)])
        if not steps.size or np.mean(steps > 0) < _FORWARD or np.mean(steps < 0) > _BACK:
            return False
    return True


def _tables(
    source: Source,
    rasters: Sequence[Raster],
    places: Sequence[Sequence[int]],
    raster: int,
    columns: Sequence[int],
    rows: int | None = None,
) -> Iterator[Table]:
    """The tables of a time grid, without the rows behind its end, in which it holds nothing.

    `places` are the columns of each time grid in the file.
    """
    own, inside = rasters[raster], places[raster]
    assert own.clock is not None
    for table in source.tables(0, [inside[i] for i in sorted({*columns, own.clock})], rows):
        there = np.any(np.isfinite(np.array(list(table.numbers.values()))), axis=0, keepdims=True)[0]
        samples = table.take(np.flatnonzero(there))
        numbers = {i: samples.numbers[inside[i]] for i in columns}
        unread = {inside.index(index): rows for index, rows in samples.unread.items()}
        yield replace(samples, headings=own.headings, numbers=numbers, unread=unread)


#: Samples that show that a channel is sparse, the share of rows without it from which on that is looked at, and how
#: many rows its samples usually lie apart at least.
_ENOUGH, _WITHOUT, _BETWEEN = 20, 0.3, 2

#: Rows of a table that may be sparse at least, and rows at its start in which an input that is written where it changes
#: is written first.
_LEAST_ROWS, _FIRST_ROWS = 50, 10

#: Share of the samples of such an input that differ from the one before, but for rounding.
_DIFFERENT = 0.9

#: Samples at one distance are sent at a rate; where fewer than this share are, they are sent when they change.
_REGULAR, _FEW = 0.8, 5


def by_presence(
    chosen: PickedChannels, table: Table, rows: int | None = None, enough: int | None = None
) -> list[PickedChannels]:
    """The pick as several, of channels that are present in the same rows, where any of them is sparse.

    A sparse duty cycle without a rate is recorded where it changes, and held until the next sample.

    Parameters
    ----------
    rows
        Rows of the table that are looked at, by default all.
    enough
        Samples of a channel that show that it is sparse, by default `_ENOUGH`.
    """
    present = {
        name: np.isfinite(table.numbers[heading.index][:rows])
        for name, (heading, _) in chosen.columns.items()
        if name != "time" and heading.index in table.numbers
    }
    sparse, changing = _sparse(chosen, table, present, _ENOUGH if enough is None else enough)
    time = chosen.columns.get("time")
    if not sparse or time is None or time[0].index == COUNTED:
        return [chosen]
    groups: dict[bytes, list[str]] = {}
    for name in present:
        groups.setdefault(sparse[name].tobytes() if name in sparse else b"", []).append(name)
    stamps = table.numbers.get(time[0].index, np.empty(0))
    picks = []
    notes = chosen.notes
    for names in groups.values():
        columns = {name: entry for name, entry in chosen.columns.items() if name in names or name not in present}
        for name in INPUTS:
            if name in names and name in sparse and (name in changing or not _has_rate(stamps[sparse[name]])):
                heading, entry = columns[name]
                columns[name] = (heading, entry if entry.longest is not None else replace(entry, longest=np.inf))
                notes = (*notes, f"{name}: is recorded where it changes; each sample is held until the next one.")
        picks.append(replace(chosen, columns=columns, notes=notes, increasing=False, sparse=True))
        notes = ()
    return picks


def _sparse(
    chosen: PickedChannels, table: Table, present: Mapping[str, NDArray[np.bool_]], enough: int
) -> tuple[dict[str, Rows], set[str]]:
    """The rows of each sparse channel, by its name, and the inputs that are written row by row while they change."""
    sparse: dict[str, Rows] = {}
    changing: set[str] = set()
    for name, there in present.items():
        if there.size >= _LEAST_ROWS and np.count_nonzero(there) <= (1 - _WITHOUT) * there.size:
            places = np.flatnonzero(there)
            values = table.numbers[chosen.columns[name][0].index][places]
            if name in INPUTS and _changes(places, values):
                changing |= {name} if np.mean(np.diff(places) < _BETWEEN) > 1 - _REGULAR else set()
                sparse[name] = places
            elif places.size >= enough and np.median(np.diff(places)) >= _BETWEEN:
                sparse[name] = places
    if any(name in sparse for name in INPUTS):  # an input that never changes is written once
        sparse |= {
            name: np.flatnonzero(present[name])
            for name in INPUTS
            if name in present and np.count_nonzero(present[name]) == 1 and present[name][:_FIRST_ROWS].any()
        }
    return sparse, changing


def _changes(places: Rows, values: FloatArray) -> bool:
    """Whether an input is written where it changes, from the start on."""
    return places.size > 1 and places[0] <= _FIRST_ROWS and bool(np.mean(np.diff(values) != 0.0) >= _DIFFERENT)


def _has_rate(stamps: FloatArray) -> bool:
    """Whether most samples have about the same interval."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    usual = np.median(steps) if steps.size else 0.0
    return steps.size > _FEW and bool(np.mean(np.abs(steps - usual) <= 0.5 * usual) >= _REGULAR)

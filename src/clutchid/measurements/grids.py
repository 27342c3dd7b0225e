"""Tables in which signals have time columns of their own: a time grid for each, of the columns that belong to it.

A column belongs to the time column that has a word of its name, else to the nearest one before it.

Thresholds: benchmarks/results/thresholds.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from clutchid.measurements.columns import Heading, is_unit_of, same_word
from clutchid.measurements.source import Raster, Source, Table

#: Words of time columns, in lower case.
_TIMES = frozenset(["t", "time", "zeit", "stamp", "timestamp", "timestamps", "zeitstempel", "tout"])

#: Samples of the time columns that show whether they are times: they increase in this share, and decrease in this.
_SHOWN, _FORWARD, _BACK = 1000, 0.2, 0.05

#: Two times of a table may have the same unit if neither spans this many times the other: units are a thousand apart.
_ALIKE = 30.0


def with_own_grids(source: Source) -> Source:
    """The source, with a time grid for each time column where its table has several."""
    if len(source.rasters) != 1 or source.problems or source.unnamed:
        return source
    (raster,) = source.rasters
    owned = columns_of_times(raster.headings)
    shown = next(source.tables(0, list(owned), _SHOWN), None) if owned else None
    if shown is None or not increase(shown, list(owned)):
        return source
    texts, warnings = dict(raster.others), source.warnings
    by_index = {heading.index: heading for heading in raster.headings}
    spans = {time: float(np.ptp(shown.numbers[time][np.isfinite(shown.numbers[time])])) for time in owned}
    units = {by_index[time].unit for time in owned} - {None}
    longest = max((spans[time] for time in owned if by_index[time].unit is not None), default=0.0)
    for time in owned:
        alike = longest / _ALIKE < spans[time] < longest * _ALIKE
        if by_index[time].unit is None and len(units) == 1 and alike:
            by_index[time] = replace(by_index[time], unit=next(iter(units)))
            unit = f"[{by_index[time].unit}], the unit of the other times of the table, is guessed"
            warnings = (*warnings, f"time: '{by_index[time].text}' has no unit; {unit}.")
    rasters, times = [], list(owned)
    for time, columns in owned.items():
        headings = tuple(by_index[index] for index in sorted([time, *columns]))
        others = tuple((heading.text, texts[heading.text]) for heading in headings if heading.text in texts)
        rasters.append(Raster(headings, raster.size, by_index[time].text, time, others))

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """The tables of a time grid, without the rows behind its end, in which it holds nothing."""
        for table in source.tables(0, sorted({*columns, times[raster]}), rows):
            there = np.any(np.isfinite(np.array(list(table.numbers.values()))), axis=0, keepdims=True)[0]
            samples = table.take(np.flatnonzero(there))
            numbers = {index: samples.numbers[index] for index in columns}
            yield replace(samples, headings=rasters[raster].headings, numbers=numbers)

    return replace(source, rasters=tuple(rasters), tables=tables, warnings=warnings)


def columns_of_times(headings: Sequence[Heading]) -> dict[int, list[int]]:
    """The columns that belong to each time column of a table, by index; none where fewer than two have columns."""
    times = [heading for heading in headings if _is_time(heading)]
    owned = _owned(headings, times) if len(times) > 1 else {}
    return owned if len(owned) > 1 else {}


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
        called = [index for index, own in words.items() if any(same_word(a, b) for a in own - common for b in parts)]
        owned[called[0] if len(called) == 1 else last].append(heading.index)
    return {index: columns for index, columns in owned.items() if columns}


def increase(table: Table, times: Sequence[int]) -> bool:
    """Whether the first samples of all of these columns increase, as times do."""
    for index in times:
        stamps = table.numbers.get(index, np.empty(0))
        steps = np.diff(stamps[np.isfinite(stamps)])
        if not steps.size or np.mean(steps > 0) < _FORWARD or np.mean(steps < 0) > _BACK:
            return False
    return True

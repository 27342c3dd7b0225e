"""Tables whose rows hold only what arrived: outer joins, loggers that write what changes, JSON with keys missing.

A channel of such a table has stamps of its own: those of the rows in which it has a value.

Thresholds: benchmarks/results/thresholds.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchid.log import INPUTS, FloatArray
from clutchid.measurements.map.channel_map import COUNTED, PickedChannels
from clutchid.measurements.source import Rows, Table

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
        picks.append(replace(chosen, columns=columns, notes=notes, sparse=True))
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

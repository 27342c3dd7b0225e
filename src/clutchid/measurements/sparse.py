"""Tables whose rows hold only what arrived: outer joins, loggers that write what changes, JSON with keys missing.

A channel of such a table has stamps of its own: those of the rows in which it has a value.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchid.log import INPUTS, FloatArray
from clutchid.measurements.map.channel_map import COUNTED, PickedChannels
from clutchid.measurements.source import Rows, Table

#: Samples that show that a channel is sparse, the share of rows without it from which on that is looked at, and how
#: many rows its samples usually lie apart at least.
_ENOUGH, _WITHOUT, _APART = 20, 0.3, 2

#: Samples at one distance are sent at a rate; where fewer than this share are, they are sent when they change.
_REGULAR = 0.8


def by_presence(
    chosen: PickedChannels, table: Table, rows: int | None = None, enough: int = _ENOUGH
) -> list[PickedChannels]:
    """The pick as several, of channels that are present in the same rows, where any of them is sparse.

    A sparse duty cycle without a rate is recorded where it changes, and held until the next sample.

    Parameters
    ----------
    rows
        Rows of the table that are looked at, by default all.
    enough
        Samples of a channel that show that it is sparse.
    """
    present = {
        name: np.isfinite(table.numbers[heading.index][:rows])
        for name, (heading, _) in chosen.columns.items()
        if name != "time" and heading.index in table.numbers
    }
    sparse: dict[str, Rows] = {}
    for name, there in present.items():
        if np.count_nonzero(there) <= (1 - _WITHOUT) * there.size:
            places = np.flatnonzero(there)
            if places.size >= enough and np.median(np.diff(places)) >= _APART:
                sparse[name] = places
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
        columns = dict(chosen.columns)
        for name in present:
            if name not in names:
                del columns[name]
        for name in INPUTS:
            if name in names and name in sparse and not _has_rate(stamps[sparse[name]]):
                heading, entry = columns[name]
                columns[name] = (heading, entry if entry.longest is not None else replace(entry, longest=np.inf))
        picks.append(replace(chosen, columns=columns, notes=notes, increasing=False, sparse=True))
        notes = ()
    return picks


def _has_rate(stamps: FloatArray) -> bool:
    """Whether most samples have about the same interval."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    usual = np.median(steps) if steps.size else 0.0
    return bool(np.mean(np.abs(steps - usual) <= 0.5 * usual) >= _REGULAR)

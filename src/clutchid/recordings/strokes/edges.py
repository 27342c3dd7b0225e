"""Edges of duty cycles between the samples, cut and joined with them, see `clutchid.log.Log`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np

from clutchid.log import FloatArray, Samples

#: Edges of duty cycles by column.
Edges = Mapping[str, Samples]


class Sampled(Protocol):
    """Samples with edges between them."""

    @property
    def time(self) -> FloatArray:
        """Time stamps in s."""

    @property
    def columns(self) -> Mapping[str, FloatArray]:
        """Columns in SI."""

    @property
    def edges(self) -> Edges:
        """Edges of duty cycles."""


def edges_within(edges: Edges, after: float, until: float) -> Edges:
    """Edges later than `after` and not later than `until`, in s."""
    return {
        name: (stamps[inside], values[inside])
        for name, (stamps, values) in edges.items()
        for inside in [(stamps > after) & (stamps <= until)]
    }


def edges_of_part(whole: Sampled, start: int, stop: int) -> Edges:
    """Edges of samples `start` to `stop` (exclusive) and of the interval behind them.

    What is held at a `start` that is not the first sample becomes an edge there.
    """
    begins = float(whole.time[start]) if 0 < start < whole.time.size else -np.inf
    ends = float(whole.time[stop]) if stop < whole.time.size else np.inf
    found = {}
    for name, (stamps, values) in whole.edges.items():
        own = slice(*np.searchsorted(stamps, (begins, ends)))
        found[name] = stamps[own], values[own]
        if np.isfinite(begins) and begins not in stamps[own][:1]:
            found[name] = np.append(begins, stamps[own]), np.append(whole.columns[name][start], values[own])
    return found


def joined_edges(parts: Iterable[Sampled]) -> Edges:
    """Edges of consecutive samples; where a part has none of a column they are its samples, as elsewhere."""
    each = list(parts)
    names = dict.fromkeys(name for part in each for name in part.edges)
    found = {name: [part.edges.get(name, (part.time, part.columns[name])) for part in each] for name in names}
    return {
        name: (np.concatenate([stamps for stamps, _ in edges]), np.concatenate([values for _, values in edges]))
        for name, edges in found.items()
    }

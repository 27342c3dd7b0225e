"""A recording as a stream: blocks of constant size, independent of the pieces, and the stretches between holes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from clutchid.errors import DataError
from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.log import Samples as StampedValues

#: Edges of duty cycles by column.
Edges = Mapping[str, StampedValues]

#: Samples per block. All estimates are updated per block, so the sections do not depend on the lengths of the pieces.
_BLOCK = 2**16


@dataclass(frozen=True, slots=True, eq=False)
class StrokeSamples:
    """Consecutive samples: index of the first one in the recording, time in s, columns in SI, edges as of a `Log`."""

    first: int
    time: FloatArray
    columns: Mapping[str, FloatArray]
    edges: Edges = field(default_factory=dict)

    def __len__(self) -> int:
        return int(self.time.size)

    def part(self, start: int, stop: int) -> StrokeSamples:
        """Samples `start` to `stop` (exclusive), counted from the first, as a view."""
        columns = {name: values[start:stop] for name, values in self.columns.items()}
        return StrokeSamples(self.first + start, self.time[start:stop], columns, self._edges(start, stop))

    def followed_by(self, *others: StrokeSamples) -> StrokeSamples:
        """These samples and the next ones."""
        if not others:
            return self
        parts = (self, *others)
        columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in self.columns}
        return StrokeSamples(self.first, np.concatenate([part.time for part in parts]), columns, joined_edges(parts))

    def _edges(self, start: int, stop: int) -> Edges:
        """Edges of samples `start` to `stop` (exclusive) and of the interval behind them.

        What is held at a `start` that is not the first sample becomes an edge there.
        """
        begins = float(self.time[start]) if 0 < start < self.time.size else -np.inf
        ends = float(self.time[stop]) if stop < self.time.size else np.inf
        edges = {}
        for name, (stamps, values) in self.edges.items():
            own = slice(*np.searchsorted(stamps, (begins, ends)))
            edges[name] = stamps[own], values[own]
            if np.isfinite(begins) and begins not in stamps[own][:1]:
                edges[name] = np.append(begins, stamps[own]), np.append(self.columns[name][start], values[own])
        return edges


def joined_edges(parts: Sequence[Log | StrokeSamples]) -> Edges:
    """Edges of consecutive samples; where a part has none of a column they are its samples, as elsewhere."""
    names = dict.fromkeys(name for part in parts for name in part.edges)
    pieces = {name: [part.edges.get(name, (part.time, part.columns[name])) for part in parts] for name in names}
    return {
        name: (np.concatenate([stamps for stamps, _ in edges]), np.concatenate([values for _, values in edges]))
        for name, edges in pieces.items()
    }


def pieces_of(recording: Log | Iterable[Log]) -> Iterator[Log]:
    """The pieces of a recording, checked to continue each other.

    Raises
    ------
    DataError
        If there is no position, or a piece has other columns than the first or does not follow the one before in time.
    """
    columns: tuple[str, ...] | None = None
    last = -np.inf
    for number, piece in enumerate([recording] if isinstance(recording, Log) else recording, 1):
        where = f"{piece.name}, piece {number}"
        if "position" not in piece:
            raise DataError(f"{where}: no column 'position'; strokes cannot be found without a position.")
        if columns is None:
            columns = tuple(sorted(piece.columns))
        if tuple(sorted(piece.columns)) != columns:
            raise DataError(
                f"{where}: has columns {', '.join(sorted(piece.columns))}; the first piece has {', '.join(columns)}."
            )
        if len(piece):
            if not piece.time[0] > last:
                raise DataError(
                    f"{where}: begins at {piece.time[0]:.6g} s, but the piece before ends at {last:.6g} s; "
                    "time must increase from piece to piece."
                )
            last = float(piece.time[-1])
            yield piece


def blocks(pieces: Iterable[Log]) -> Iterator[StrokeSamples]:
    """The recording in blocks of `_BLOCK` samples, the last one shorter."""
    pending: list[StrokeSamples] = []
    size_pending, count, last = 0, 0, -np.inf
    for piece in pieces:
        until = float(piece.time[-1])
        edges = {
            name: (stamps[new], values[new])
            for name, (stamps, values) in piece.edges.items()
            for new in [(stamps > last) & (stamps <= until)]
        }
        rest = StrokeSamples(count, piece.time, piece.columns, edges)
        count, last = count + len(rest), until
        while size_pending + len(rest) >= _BLOCK:
            pending.append(rest.part(0, _BLOCK - size_pending))
            rest, size_pending = rest.part(_BLOCK - size_pending, len(rest)), 0
            yield pending[0].followed_by(*pending[1:])
            pending = []
        if len(rest):
            pending.append(rest)
            size_pending += len(rest)
    if pending:
        yield pending[0].followed_by(*pending[1:])


def stretches(block: StrokeSamples, before: float, interval: float) -> list[tuple[StrokeSamples, bool]]:
    """Parts of a block without a hole in time or a missing input, each with whether a hole or the beginning precedes.

    Parameters
    ----------
    block
        The samples.
    before : s
        Time of the sample before the block, NaN where there is none or its inputs are missing.
    interval : s
        Usual interval between samples.
    """
    complete = np.ones(len(block), dtype=bool)
    for name in INPUTS:
        if name in block.columns:
            complete &= np.isfinite(block.columns[name])
    linked = complete & (np.diff(block.time, prepend=before) <= HOLE * interval)
    linked[1:] &= complete[:-1]
    begins = complete & ~linked
    begins[0] = complete[0]
    ends = complete & ~np.append(linked[1:], False)
    pairs = zip(np.flatnonzero(begins).tolist(), np.flatnonzero(ends).tolist(), strict=True)
    return [(block.part(first, last + 1), not linked[first]) for first, last in pairs]


def last_known(block: StrokeSamples) -> float:
    """Time of the last sample in s, NaN where its inputs are missing."""
    complete = all(np.isfinite(block.columns[name][-1]) for name in INPUTS if name in block.columns)
    return float(block.time[-1]) if complete else np.nan

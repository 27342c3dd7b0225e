"""A recording as a stream: blocks of constant size, independent of the pieces, and the stretches between holes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from clutchid.errors import DataError
from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.recordings.strokes.section import Edges, edges_of_part, edges_within, joined_edges

#: Samples per block. All estimates are updated per block, so the sections do not depend on the lengths of the pieces.
BLOCK = 2**16


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Consecutive samples: index of the first one in the recording, time in s, columns in SI, edges as of a `Log`."""

    first: int
    time: FloatArray
    columns: Mapping[str, FloatArray]
    edges: Edges = field(default_factory=dict)

    def __len__(self) -> int:
        return int(self.time.size)

    def part(self, start: int, stop: int) -> Samples:
        """Samples `start` to `stop` (exclusive), counted from the first, as a view."""
        columns = {name: values[start:stop] for name, values in self.columns.items()}
        return Samples(self.first + start, self.time[start:stop], columns, edges_of_part(self, start, stop))

    def followed_by(self, other: Samples) -> Samples:
        """These samples and the next ones."""
        return _joined([self, other])


@dataclass(frozen=True, slots=True)
class Stretch:
    """Samples `start` to `stop` of a block, with known inputs; `opens` after a hole or at the beginning."""

    start: int
    stop: int
    opens: bool


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


def blocks(pieces: Iterable[Log], size: int = BLOCK) -> Iterator[Samples]:
    """The recording in blocks of `size` samples, the last one shorter."""
    pending: list[Samples] = []
    size_pending, count, last = 0, 0, -np.inf
    for piece in pieces:
        until = float(piece.time[-1])
        rest = Samples(count, piece.time, piece.columns, edges_within(piece.edges, last, until))
        count, last = count + len(rest), until
        while size_pending + len(rest) >= size:
            pending.append(rest.part(0, size - size_pending))
            rest, size_pending = rest.part(size - size_pending, len(rest)), 0
            yield _joined(pending)
            pending = []
        if len(rest):
            pending.append(rest)
            size_pending += len(rest)
    if pending:
        yield _joined(pending)


def stretches(block: Samples, before: float, interval: float) -> list[Stretch]:
    """Stretches of a block without a hole in time or a missing input.

    Parameters
    ----------
    block
        The samples.
    before : s
        Time of the sample before the block, NaN where there is none or its inputs are missing.
    interval : s
        Usual interval between samples.
    """
    known = np.ones(len(block), dtype=bool)
    for name in INPUTS:
        if name in block.columns:
            known &= np.isfinite(block.columns[name])
    step = np.diff(block.time, prepend=before)
    linked = known & (step <= HOLE * interval)
    linked[1:] &= known[:-1]
    starts = np.flatnonzero(known & ~linked)
    ends = np.flatnonzero(known & ~np.append(linked[1:], True))
    if known[0] and linked[0]:
        starts = np.concatenate([[0], starts])
    if known[-1]:
        ends = np.append(ends, len(block) - 1)
    return [Stretch(a, b + 1, not linked[a]) for a, b in zip(starts.tolist(), ends.tolist(), strict=True)]


def last_known(block: Samples) -> float:
    """Time of the last sample in s, NaN where its inputs are missing."""
    known = all(np.isfinite(block.columns[name][-1]) for name in INPUTS if name in block.columns)
    return float(block.time[-1]) if known else np.nan


def _joined(parts: list[Samples]) -> Samples:
    if len(parts) == 1:
        return parts[0]
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in parts[0].columns}
    return Samples(parts[0].first, np.concatenate([part.time for part in parts]), columns, joined_edges(parts))

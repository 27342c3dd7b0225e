"""The first pass over a CAN log: which messages occur in it, how often, and what is kept of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray
from clutchid.recordings.formats.can.frames import Bytes, FrameLog, Frames, Rows
from clutchid.recordings.formats.can.streams import PIECE, UNKNOWN, Book, Stream, keys, sorted_out

#: Bytes of frames that are kept in memory between the passes over a log: about 15 million classic frames.
KEPT = 1 << 28

_MOST_UNKNOWN = 1 << 16


@dataclass(frozen=True, eq=False, slots=True)
class Piece:
    """Consecutive frames of one stream: stamps as in the log, payload bytes, how many of them are there."""

    stamp: FloatArray
    data: Bytes
    length: Bytes

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.stamp.size)


@dataclass(slots=True)
class Seen:
    """What a log holds, counted while it is read for the first time; `kept` is None when it is too much to keep."""

    origin: float = 0.0
    frames: int = 0
    sizes: Counter[Stream] = field(default_factory=Counter)
    short: Counter[str] = field(default_factory=Counter)
    unknown: Counter[int] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)
    pieces: int = 0
    trouble: str = ""
    kept: dict[Stream, list[Piece]] | None = field(default_factory=dict)
    bytes: int = 0


def _whole(log: FrameLog, seen: Seen | None = None) -> Iterator[Frames]:
    """The blocks of a log up to where it is damaged, without frames whose stamp is no number."""
    try:
        for frames in log.blocks():
            stamped = np.isfinite(frames.stamp)
            if seen is not None:
                seen.left_out.update(frames.left_out)
                seen.left_out.update({"frame without a stamp": int(stamped.size - stamped.sum())})
            yield frames if stamped.all() else frames.take(stamped)
    except DataError as error:
        if seen is not None:
            seen.trouble = str(error)


def scan(log: FrameLog, known: Book) -> Seen:
    """What a log holds, told apart by the messages that are `known`.

    Raises
    ------
    OSError
        If the file cannot be read; what is wrong inside it is in ``Seen.trouble``.
    """
    seen = Seen()
    for frames in _whole(log, seen):
        if seen.frames == 0 and len(frames):
            seen.origin = float(frames.stamp[0])
        seen.frames += len(frames)
        for found, rows in sorted_out(frames, known):
            if found == UNKNOWN:
                _count_unknown(seen, frames.take(rows))
            elif found == PIECE:
                seen.pieces += rows.size
            elif isinstance(found, Stream):
                _count(seen, found, _piece(found, frames, rows))
    return seen


def _count_unknown(seen: Seen, frames: Frames) -> None:
    found, counts = np.unique(keys(frames), return_counts=True)
    seen.unknown.update(dict(zip(found.tolist(), counts.tolist(), strict=True)))
    if len(seen.unknown) > _MOST_UNKNOWN:  # noise: a damaged file can hold any number of them
        seen.unknown = Counter(dict(seen.unknown.most_common(_MOST_UNKNOWN // 2)))


def _count(seen: Seen, stream: Stream, piece: Piece) -> None:
    seen.sizes[stream] += len(piece)
    name = f"{stream.message.name} ({stream.page.name})" if stream.page.name else stream.message.name
    seen.short[name] += int(np.sum(piece.length < min(_bytes(stream), 255)))
    if seen.kept is not None:
        seen.bytes += piece.stamp.nbytes + piece.data.nbytes + piece.length.nbytes
        seen.kept.setdefault(stream, []).append(piece)
        if seen.bytes > KEPT:
            seen.kept = None


def _bytes(stream: Stream) -> int:
    """Payload bytes that the signals of a stream need."""
    return max((signal.bytes for signal in stream.page.signals), default=0)


def _piece(stream: Stream, frames: Frames, rows: Rows) -> Piece:
    data = frames.data[rows, : _bytes(stream)]
    return Piece(frames.stamp[rows], data, frames.length[rows].astype(np.uint8))


def pieces(log: FrameLog, known: Book, stream: Stream) -> Iterator[Piece]:
    """The frames of one stream, from the file.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    for frames in _whole(log):
        for found, rows in sorted_out(frames, known):
            if found == stream:
                yield _piece(stream, frames, rows)

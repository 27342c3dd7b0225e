"""The first pass over a CAN log: which messages occur, how often, and warnings about what is left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray
from clutchid.recordings.columns import shortened
from clutchid.recordings.formats.can.dbc import Message
from clutchid.recordings.formats.can.frames import Bytes, FrameLog, Frames, Rows
from clutchid.recordings.formats.can.j1939 import EVERYBODY
from clutchid.recordings.formats.can.streams import PIECE, UNKNOWN, Book, Stream, keys, parts_of, sorted_out
from clutchid.recordings.source import SHOWN, and_more

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


_LONGEST_NAME = 100


def decoding_problem(seen: Seen, dbc: Sequence[Path]) -> str:
    """Why a log cannot be decoded, in one sentence; empty where it can."""
    if seen.frames == 0:
        return (
            f"{seen.trouble}; copy it again." if seen.trouble else "holds no data frames of a CAN bus; record it again."
        )
    if seen.sizes:
        return ""
    frames = f"{seen.frames:,}"
    if not dbc:
        return f"holds raw frames ({frames}) of {_identifiers(seen)}; give the DBC with --dbc FILE."
    names = ", ".join(Path(file).name for file in dbc)
    pieces = f", and {seen.pieces:,} are pieces of longer messages, which are not put together" if seen.pieces else ""
    common = f" (the commonest: {_commonest(seen.unknown)}{pieces})" if seen.unknown else ""
    return f"none of its {frames} frames{common} holds a signal of {names}; give the DBC of this bus with --dbc FILE."


def scan_warnings(seen: Seen, streams: Sequence[Stream]) -> tuple[str, ...]:
    """What was left out of a log, one sentence each."""
    found = [f"{seen.trouble}; the {seen.frames:,} frames before it are used."] if seen.trouble else []
    found += [f"{_counted(count, what)} left out." for what, count in seen.left_out.items() if count]
    if seen.pieces:
        found.append(
            f"{_counted(seen.pieces, 'frame')} left out: pieces of longer messages (J1939 transport protocol, "
            "NMEA 2000 fast packets)."
        )
    if seen.unknown:
        found.append(
            f"{_counted(sum(seen.unknown.values()), 'frame')} left out, of {_identifiers(seen)} that no DBC knows; "
            f"the commonest: {_commonest(seen.unknown)}."
        )
    short = [f"{count:,} of {name}" for name, count in seen.short.items() if count]
    if short:
        shown = and_more(short[:SHOWN], len(short) - len(short[:SHOWN]))
        found.append(f"some frames are shorter than the DBC says ({shown}): the signals that they lack are missing.")
    return (*found, *_undecodable({stream.message for stream in streams}))


def raster_names(streams: Sequence[Stream]) -> list[str]:
    """What the rasters are called: the message, and what tells it from others of its name."""
    same: dict[str, list[Stream]] = {}
    for stream in streams:
        same.setdefault(stream.message.name, []).append(stream)
    return [_name(stream, same[stream.message.name]) for stream in streams]


def _name(stream: Stream, same: Sequence[Stream]) -> str:
    differ = {
        f"0x{stream.message.identifier:X}": len({other.message for other in same}) > 1,
        f"CAN{stream.bus}": len({other.bus for other in same}) > 1,
        f"from 0x{stream.sender:02X}": len({other.sender for other in same}) > 1,
        f"to 0x{stream.receiver:02X}": len({other.receiver for other in same}) > 1 and stream.receiver != EVERYBODY,
        stream.page.name: bool(stream.page.selectors),
    }
    marks = ", ".join(mark for mark, needed in differ.items() if needed)
    return shortened(f"{stream.message.name} ({marks})" if marks else stream.message.name, _LONGEST_NAME)


def _undecodable(messages: set[Message]) -> list[str]:
    lacking = sorted(f"{name} of {message.name}" for message in messages for name in message.undecodable)
    if not lacking:
        return []
    shown = and_more(lacking[:SHOWN], len(lacking) - len(lacking[:SHOWN]))
    return [f"what is no number of at most 64 bits is left out: {shown}."]


def _counted(count: int, what: str) -> str:
    head, _, tail = what.partition(" without ")
    plural = f"{head}s without {tail}" if tail else f"{what}s"
    return f"1 {what} is" if count == 1 else f"{count:,} {plural} are"


def _identifiers(seen: Seen) -> str:
    count = len({parts_of(key)[:2] for key in seen.unknown})
    return f"{count:,} identifier" + ("" if count == 1 else "s")


def _commonest(unknown: Mapping[int, int]) -> str:
    """The commonest identifiers with their counts, over all buses."""
    counts: Counter[tuple[int, bool]] = Counter()
    for key, count in unknown.items():
        counts[parts_of(key)[:2]] += count
    shown = [f"0x{i:08X}" if extended else f"0x{i:03X}" for (i, extended), _ in counts.most_common(SHOWN)]
    numbers = [count for _, count in counts.most_common(SHOWN)]
    each = [f"{text} ({count:,})" for text, count in zip(shown, numbers, strict=True)]
    return and_more(each, len(counts) - len(each))

"""`Frames`: raw frames of a CAN bus as columns, `FrameLog`, the log that they are read from, and logs as one."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import missing
from clutchid.log import FloatArray
from clutchid.measurements.source import Rows

if TYPE_CHECKING:
    import can

Bytes: TypeAlias = NDArray[np.uint8]
Counts: TypeAlias = NDArray[np.int64]

_Item = TypeVar("_Item")

#: Frames a block when a log is read piece by piece.
FRAMES = 1 << 16

#: Bytes of payload of a classic frame, and of an FD frame.
CLASSIC, FD = 8, 64

#: Buses above this number are counted as this one.
LARGEST_BUS = 0xFFFF


#: Fields of a frame; its payload is the last.
_FIELDS = ("stamp", "bus", "identifier", "extended", "length", "sent", "data")


@dataclass(frozen=True, eq=False, slots=True)
class Frames:
    """A block of frames in the order of the file, one array a field.

    `stamp` counts in s from the log's own zero; `identifier` has 11 bits, or 29 where `extended`; `length` is the
    number of payload bytes, `data` the payload with zeros behind it, at most 64 columns. `left_out` counts what was met
    meanwhile and holds no payload, by what one of it is. `sent` says which frames the logger has sent.
    """

    stamp: FloatArray
    bus: Counts
    identifier: Counts
    extended: NDArray[np.bool_]
    length: Counts
    sent: NDArray[np.bool_]
    data: Bytes
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.stamp.size)

    def take(self, rows: Rows | NDArray[np.bool_] | slice) -> Frames:
        """The frames of `rows`; what was left out is counted only once, so not here."""
        return Frames(*(getattr(self, name)[rows] for name in _FIELDS))


@dataclass(frozen=True, slots=True)
class FrameLog:
    """A log of frames: its format, the clock time of stamp 0 (None: not known), and how its blocks are read.

    Each call of `blocks` reads the file from its start. What is wrong inside raises `DataError` with one sentence,
    after all frames before it were given.
    """

    format: str
    start: datetime | None
    blocks: Callable[[], Iterator[Frames]]
    warnings: tuple[str, ...] = ()


def check_python_can(what: str) -> None:
    """Check that the library that reads `what` is installed.

    Raises
    ------
    MissingExtra
        If it is not.
    """
    try:
        import can  # noqa: F401
    except ImportError as error:
        raise missing(f"reading {what}", "python-can", "can") from error


class Frame(NamedTuple):
    """A frame: stamp in s, bus, identifier, whether that has 29 bits, payload, and whether the logger has sent it."""

    stamp: float
    bus: int
    identifier: int
    extended: bool
    data: bytes
    sent: bool = False


def frame_of(message: can.Message) -> Frame | str:
    """The frame of a message of python-can, whose buses count from 0; a text says what holds no payload."""
    if message.is_error_frame:
        return "error frame"
    if message.is_remote_frame:
        return "remote frame"
    bus = message.channel + 1 if isinstance(message.channel, int) else 0
    data = bytes(message.data)
    return Frame(message.timestamp, bus, message.arbitration_id, message.is_extended_id, data, not message.is_rx)


def in_blocks(frames: Iterable[Frame | str], size: int = FRAMES) -> Iterator[Frames]:
    """Frames in blocks of at most `size`; texts among them are counted as left out.

    Raises
    ------
    Whatever `frames` raises, after the frames before it were given.
    """
    failures: list[Exception] = []
    items = _until_failure(frames, failures)
    while part := list(islice(items, size)):
        rows = [frame for frame in part if isinstance(frame, Frame)]
        yield _block(rows, Counter(text for text in part if isinstance(text, str)) if len(rows) < len(part) else {})
    if failures:
        raise failures[0]


def _until_failure(items: Iterable[_Item], failures: list[Exception]) -> Iterator[_Item]:
    """The items up to an error, which is added to `failures`."""
    try:
        yield from items
    except Exception as error:
        failures.append(error)


def _block(rows: Sequence[Frame], left_out: Mapping[str, int]) -> Frames:
    stamp, bus, identifier, extended, data, sent = zip(*rows, strict=True) if rows else ((),) * 6
    return Frames(
        np.array(stamp, dtype=np.float64),
        np.minimum(np.array(bus, dtype=np.int64), LARGEST_BUS),
        np.array(identifier, dtype=np.int64) & 0x1FFFFFFF,
        np.array(extended, dtype=np.bool_),
        np.minimum(np.array(list(map(len, data)), dtype=np.int64), FD),
        np.array(sent, dtype=np.bool_),
        as_payload(data),
        left_out,
    )


@contextmanager
def quiet(logger: str) -> Iterator[None]:
    """Keeps what a library says about single frames of a damaged file off the screen: it can be one line a frame."""
    chosen = logging.getLogger(logger)
    silence = logging.Filter(name="-")
    chosen.addFilter(silence)
    try:
        yield
    finally:
        chosen.removeFilter(silence)


def as_payload(rows: Sequence[bytes]) -> Bytes:
    """Payloads as rows of 8 bytes, or of 64 where one is longer, with zeros behind them."""
    width = FD if max(map(len, rows), default=0) > CLASSIC else CLASSIC
    joined = b"".join([row[:width].ljust(width, b"\0") for row in rows])
    return np.frombuffer(bytearray(joined), dtype=np.uint8).reshape(len(rows), width)


def merged(parts: Sequence[Iterator[Frames]]) -> Iterator[Frames]:
    """Frames of several groups as one log, by their stamps; the order within a group never changes.

    A stamp that is below one before it in its group keeps its place: it is for the checks to find.

    Raises
    ------
    Whatever `parts` raise, after the frames before it were given.
    """
    if len(parts) == 1:
        yield from parts[0]
        return
    failures: list[Exception] = []
    streams = [_until_failure(part, failures) for part in parts]
    waiting = [next(stream, None) for stream in streams]
    latest = [-np.inf] * len(parts)
    while blocks := {i: block for i, block in enumerate(waiting) if block is not None}:
        keys = {i: np.fmax.accumulate(np.fmax(block.stamp, latest[i])) for i, block in blocks.items()}
        limit = min(key[-1] for key in keys.values())
        taken = []
        for i, block in blocks.items():
            count = int(np.searchsorted(keys[i], limit, side="right"))
            taken.append((keys[i][:count], block.take(slice(count))))
            latest[i] = keys[i][count - 1] if count else latest[i]
            waiting[i] = block.take(slice(count, None)) if count < len(block) else next(streams[i], None)
        yield _together(taken)
    if failures:
        raise failures[0]


def _together(parts: Sequence[tuple[FloatArray, Frames]]) -> Frames:
    """Blocks of frames as one, in the order of their keys, which never fall within a block."""
    order = np.argsort(np.concatenate([key for key, _ in parts]), kind="stable")
    *columns, data = [[getattr(frames, name) for _, frames in parts] for name in _FIELDS]
    joined: list[Any] = [*map(np.concatenate, columns), payloads(data)]
    return Frames(*joined).take(order)


def payloads(parts: Sequence[Bytes]) -> Bytes:
    """Payloads of several blocks as one, with zeros behind those of the narrower ones."""
    width = max(part.shape[1] for part in parts)
    return np.concatenate([np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part in parts])

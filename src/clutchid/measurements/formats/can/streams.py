"""Frames sorted by the message that they carry, the bus and the address that they come from; time grids of these.

A log may have frames twice, as sent by the logger and as received by it again: one of each two is used.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.measurements.clock import WINDOW
from clutchid.measurements.columns import Heading, channel
from clutchid.measurements.formats.can.dbc import Message, Signal, SignalGroup, decode, present
from clutchid.measurements.formats.can.frames import CLASSIC, Bytes, Frames
from clutchid.measurements.formats.can.j1939 import ANYBODY, EVERYBODY, TRANSPORT, addresses, group_number, parameter_at
from clutchid.measurements.source import Raster, Rows
from clutchid.messages import shortened

#: Owners of frames that belong to no stream: unknown messages, fragments of longer ones.
UNKNOWN, FRAGMENT = "unknown", "fragment"

#: Places of the bits of a key above the identifier, of which the first says that it is extended, the others the bus.
_EXTENDED, _BUS = 29, 30

_LONGEST_NAME = 100

#: A message, or one of `UNKNOWN` and `FRAGMENT`; bus, sender, receiver.
_Owner = tuple[Message | str, int, int, int]


@dataclass(frozen=True, slots=True)
class MessageCatalogue:
    """All messages of the DBC files, by identifier, and by group number where they are J1939; the first one counts."""

    messages: Sequence[Message]
    exact: Mapping[tuple[int, bool], Message]
    groups: Mapping[int, Sequence[Message]]

    def find(self, identifier: int, extended: bool) -> Message | None:
        """The message that a frame carries: of several of one group the one from its sender, else the first."""
        if (message := self.exact.get((identifier, extended))) is not None or not extended:
            return message
        candidates = self.groups.get(group_number(identifier), ())
        own = addresses(identifier)
        return min(candidates, key=lambda candidate: _distance(addresses(candidate.identifier), own), default=None)


@dataclass(frozen=True, slots=True)
class FrameStream:
    """Frames of one time grid: a signal group of a message, on one bus, from one sender to one receiver (J1939)."""

    message: Message
    group: SignalGroup
    bus: int
    sender: int = ANYBODY
    receiver: int = EVERYBODY


def _distance(written: tuple[int, int], own: tuple[int, int]) -> int:
    """Mismatch of the addresses that a DBC writes with those of a frame."""
    if written[0] == own[0]:
        return 0 if written[1] == own[1] else 1
    return 2 if written[0] == ANYBODY else 3


def catalogue(written: Sequence[Message]) -> MessageCatalogue:
    """The messages of databases; J1939 are also those alone in their group that are written for any sender (0xFE)."""
    sizes = Counter(group_number(message.identifier) for message in written if message.extended)
    messages = [
        replace(message, j1939=True)
        if message.extended
        and addresses(message.identifier)[0] == ANYBODY
        and sizes[group_number(message.identifier)] == 1
        else message
        for message in written
    ]
    exact: dict[tuple[int, bool], Message] = {}
    groups: dict[int, list[Message]] = defaultdict(list)
    for message in messages:
        exact.setdefault((message.identifier, message.extended), message)
        if message.j1939 and message.extended:
            groups[group_number(message.identifier)].append(message)
    return MessageCatalogue(messages, exact, groups)


def streams_in_order(streams: Iterable[FrameStream], messages: Sequence[Message]) -> list[FrameStream]:
    """The streams by their messages in the order of the DBC files, then by bus, addresses and signal group."""
    order = {message: number for number, message in enumerate(messages)}
    return sorted(
        streams, key=lambda s: (order[s.message], s.bus, s.sender, s.receiver, s.message.groups.index(s.group))
    )


def stream_rasters(streams: Sequence[FrameStream], sizes: Mapping[FrameStream, int]) -> tuple[Raster, ...]:
    """Time grids of the streams: the stamps, then the signals; named by the message and what distinguishes it."""
    same: dict[str, list[FrameStream]] = defaultdict(list)
    for stream in streams:
        same[stream.message.name].append(stream)
    return tuple(
        Raster(_channels(stream), sizes.get(stream, 0), _name(stream, same[stream.message.name]), clock=0)
        for stream in streams
    )


def _channels(stream: FrameStream) -> tuple[Heading, ...]:
    signals = enumerate(stream.group.signals, 1)
    named = (channel(i, signal.name, signal.unit, _comment(stream.message, signal)) for i, signal in signals)
    return (channel(0, "time", "s"), *named)


def _comment(message: Message, signal: Signal) -> str:
    """The comment of the database on a signal, behind its parameter of the standard where it is one."""
    if not message.extended or signal.signed or signal.ieee:
        return signal.comment
    group = group_number(message.identifier)
    parameter = parameter_at(group, signal.begin, signal.length, signal.scale, signal.offset)
    aligned = not signal.motorola or signal.length == 8  # a byte has the same place in both orders
    return "; ".join(filter(None, (parameter.comment, signal.comment))) if parameter and aligned else signal.comment


def _name(stream: FrameStream, same: Sequence[FrameStream]) -> str:
    differ = {
        f"0x{stream.message.identifier:X}": len({other.message for other in same}) > 1,
        f"CAN{stream.bus}": len({other.bus for other in same}) > 1,
        f"from 0x{stream.sender:02X}": len({other.sender for other in same}) > 1,
        f"to 0x{stream.receiver:02X}": len({other.receiver for other in same}) > 1 and stream.receiver != EVERYBODY,
        stream.group.name: bool(stream.group.selectors),
    }
    marks = ", ".join(mark for mark, needed in differ.items() if needed)
    return shortened(f"{stream.message.name} ({marks})" if marks else stream.message.name, _LONGEST_NAME)


def stream_values(
    stream: FrameStream, columns: Iterable[int], stamp: FloatArray, data: Bytes, length: NDArray[np.integer]
) -> dict[int, FloatArray]:
    """Values of some channels of a time grid of `stream_rasters` by index, from stamps and payloads of its frames."""
    whole = length.astype(np.int64)
    return {column: decode(stream.group.signals[column - 1], data, whole) if column else stamp for column in columns}


def identifiers(frames: Frames) -> Rows:
    """One number a frame for its identifier and the kind of it."""
    return frames.identifier | (frames.extended.astype(np.int64) << _EXTENDED)


def identifier_parts(number: int) -> tuple[int, bool]:
    """Identifier, and whether it is extended, of a number of `identifiers`."""
    return number & ((1 << _EXTENDED) - 1), bool(number >> _EXTENDED)


def _keys(frames: Frames) -> Rows:
    """One number a frame for its identifier, the kind of it, and its bus."""
    return identifiers(frames) | (frames.bus << _BUS)


def by_stream(frames: Frames, messages: MessageCatalogue) -> Iterator[tuple[FrameStream | str, Rows]]:
    """The streams that occur in a block with the rows of their frames, and the rows that belong to none.

    Rows stand in the order of the block. Those without a stream come as `UNKNOWN`, and as `FRAGMENT` what is part of a
    longer message: transport protocol, fast packets.
    """
    distinct, places = np.unique(_keys(frames), return_inverse=True)
    owners: dict[_Owner, int] = {}
    numbers = [owners.setdefault(_owner(messages, key), len(owners)) for key in distinct.tolist()]
    owner = np.array(numbers, dtype=np.int64)[places]
    order = np.argsort(owner, kind="stable")
    edges = np.searchsorted(owner[order], np.arange(len(owners) + 1))
    for (message, bus, sender, receiver), number in owners.items():
        rows = order[edges[number] : edges[number + 1]]
        if isinstance(message, str):
            yield message, rows
            continue
        if message.j1939 and message.length > CLASSIC:
            partial = frames.length[rows] < message.length
            yield FRAGMENT, rows[partial]
            rows = rows[~partial]
        for group in message.groups:
            held = rows[present(group, frames.data[rows], frames.length[rows])] if group.selectors else rows
            if held.size:
                yield FrameStream(message, group, bus, sender, receiver), held


def _owner(messages: MessageCatalogue, key: int) -> _Owner:
    (identifier, extended), bus = identifier_parts(key & ((1 << _BUS) - 1)), key >> _BUS
    if extended and messages.groups and group_number(identifier) in TRANSPORT:
        return FRAGMENT, 0, 0, 0
    message = messages.find(identifier, extended)
    if message is None:
        return UNKNOWN, 0, 0, 0
    return (message, bus, *(addresses(identifier) if message.j1939 else (ANYBODY, EVERYBODY)))


#: Share of the frames of one direction that have a twin in the other, from which on they are echoes.
_TWINS = 0.5


def without_echoes(frames: Frames, left_out: dict[int, bool]) -> Frames:
    """The frames without those that are in the log a second time.

    `left_out` has by bus and identifier the direction that is left out, which is decided once, for all blocks of a log.
    """
    sent = frames.sent
    if not (sent.any() or left_out):
        return frames
    keys = _keys(frames)
    for key in np.unique(keys[sent]).tolist():
        if key not in left_out:
            direction = _echo(frames, sent, np.flatnonzero(keys == key))
            left_out |= {} if direction is None else {key: direction}
    echo = np.zeros(len(frames), dtype=np.bool_)
    for key, direction in left_out.items():
        echo |= (keys == key) & (sent == direction)
    return frames.take(~echo) if echo.any() else frames


def _echo(frames: Frames, sent: NDArray[np.bool_], rows: NDArray[np.int64]) -> bool | None:
    """Whether the sent frames of an identifier, or else the received ones, are echoes; None where neither are."""
    way = sent[rows]
    fewer = bool(np.count_nonzero(way) <= way.size / 2)
    if way.all() or not way.any():
        return None
    data, stamp = frames.data[rows], frames.stamp[rows]
    beside = (way[1:] != way[:-1]) & (data[1:] == data[:-1]).all(axis=1) & (np.abs(np.diff(stamp)) <= WINDOW)
    twin = np.append(beside, False) | np.append(False, beside)
    return fewer if np.mean(twin[way == fewer]) >= _TWINS else None

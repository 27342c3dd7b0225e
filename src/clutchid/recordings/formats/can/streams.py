"""Streams: frames sorted by the message that they carry, the bus and the address that they come from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.recordings.columns import Heading, channel
from clutchid.recordings.formats.can.dbc import Message, Page, Signal, present
from clutchid.recordings.formats.can.frames import CLASSIC, Frames, Rows
from clutchid.recordings.formats.can.j1939 import ANYBODY, EVERYBODY, TRANSPORT, addresses, group_number, parameter_at

#: What frames are that belong to no stream.
UNKNOWN, PIECE = "unknown", "piece"

#: Places of the bits of a key above the identifier.
_EXTENDED, _BUS = 29, 30

#: A message, or what the frames are that have none; bus, sender, receiver.
_Owner = tuple[Message | str, int, int, int]


@dataclass(frozen=True, slots=True)
class Book:
    """The messages of all DBC files, by identifier, and by group number where they are J1939; the first one counts."""

    exact: Mapping[tuple[int, bool], Message]
    groups: Mapping[int, tuple[Message, ...]]

    def find(self, identifier: int, extended: bool) -> Message | None:
        """The message that a frame carries: of several of one group the one from its sender, else the first."""
        if (message := self.exact.get((identifier, extended))) is not None or not extended:
            return message
        candidates = self.groups.get(group_number(identifier), ())
        own = addresses(identifier)
        return min(candidates, key=lambda each: _distance(addresses(each.identifier), own), default=None)


@dataclass(frozen=True, slots=True)
class Stream:
    """Frames that become one raster: a page of a message, on one bus, from one sender to one receiver (J1939)."""

    message: Message
    page: Page
    bus: int
    sender: int = ANYBODY
    receiver: int = EVERYBODY


def _distance(written: tuple[int, int], own: tuple[int, int]) -> int:
    """How badly the addresses that a DBC writes fit those of a frame."""
    if written[0] == own[0]:
        return 0 if written[1] == own[1] else 1
    return 2 if written[0] == ANYBODY else 3


def book(messages: Sequence[Message]) -> Book:
    """The messages, ready to be found."""
    exact: dict[tuple[int, bool], Message] = {}
    groups: dict[int, list[Message]] = defaultdict(list)
    for message in messages:
        exact.setdefault((message.identifier, message.extended), message)
        if message.j1939 and message.extended:
            groups[group_number(message.identifier)].append(message)
    return Book(exact, {number: tuple(found) for number, found in groups.items()})


def in_order(streams: Iterable[Stream], messages: Sequence[Message]) -> list[Stream]:
    """The streams by their messages in the order of the DBC files, then by bus and addresses."""
    order = {message: number for number, message in enumerate(messages)}

    def place(one: Stream) -> tuple[int, ...]:
        return order[one.message], one.bus, one.sender, one.receiver, one.message.pages.index(one.page)

    return sorted(streams, key=place)


def channels_of(stream: Stream) -> tuple[Heading, ...]:
    """The channels of a stream: its stamps, then its signals."""
    signals = enumerate(stream.page.signals, 1)
    named = (channel(i, one.name, one.unit, _comment(stream.message, one)) for i, one in signals)
    return (channel(0, "time", "s"), *named)


def _comment(message: Message, signal: Signal) -> str:
    """The comment of the database on a signal, behind its parameter of the standard where it is one."""
    if not message.extended or signal.signed or signal.ieee:
        return signal.comment
    group = group_number(message.identifier)
    found = parameter_at(group, signal.begin, signal.length, signal.scale, signal.offset)
    aligned = not signal.motorola or signal.length == 8  # a byte has the same place in both orders
    return "; ".join(filter(None, (found.comment, signal.comment))) if found and aligned else signal.comment


def keys(frames: Frames) -> Rows:
    """One number a frame for its identifier, the kind of it, and its bus."""
    return frames.identifier | (frames.extended.astype(np.int64) << _EXTENDED) | (frames.bus << _BUS)


def parts_of(key: int) -> tuple[int, bool, int]:
    """Identifier, whether it is extended, and bus of a key."""
    return key & ((1 << _EXTENDED) - 1), bool(key >> _EXTENDED & 1), key >> _BUS


def sorted_out(frames: Frames, messages: Book) -> Iterator[tuple[Stream | str, Rows]]:
    """The streams that occur in a block with the rows of their frames, and the rows that belong to none.

    Rows stand in the order of the block. What belongs to no stream comes as `UNKNOWN`, and as `PIECE` what is part of
    a longer message: transport protocol, fast packets.
    """
    found, places = np.unique(keys(frames), return_inverse=True)
    owners: dict[_Owner, int] = {}
    numbers = [owners.setdefault(_owner(messages, *parts_of(key)), len(owners)) for key in found.tolist()]
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
            yield PIECE, rows[partial]
            rows = rows[~partial]
        for page in message.pages:
            held = rows[present(page, frames.data[rows], frames.length[rows])] if page.selectors else rows
            if held.size:
                yield Stream(message, page, bus, sender, receiver), held


def _owner(messages: Book, identifier: int, extended: bool, bus: int) -> _Owner:
    if extended and messages.groups and group_number(identifier) in TRANSPORT:
        return PIECE, 0, 0, 0
    message = messages.find(identifier, extended)
    if message is None:
        return UNKNOWN, 0, 0, 0
    return (message, bus, *(addresses(identifier) if message.j1939 else (ANYBODY, EVERYBODY)))

"""Which groups of an MDF 4 file hold CAN frames, and where in their records everything stands."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from clutchid.errors import DataError
from clutchid.io.formats.can.frames import Bytes, Counts
from clutchid.io.formats.can.mdf_blocks import HEADER, Block, Blocks, damaged
from clutchid.io.formats.can.signals import Signal, decode
from clutchid.log import FloatArray

_FRAME = "CAN_DataFrame"
_FIELDS = ("ID", "IDE", "BusChannel", "DLC", "DataLength", "DataBytes")

#: Kinds of channels, of data, and of groups.
_VARIABLE, _MASTER, _VIRTUAL = 1, 2, (3, 6)
_MOTOROLA, _SIGNED, _IEEE, _NUMBERS = (1, 3, 5), (2, 3), (4, 5), range(6)
_TIME = 1
_STRINGS = 1

_LINEAR, _TABLES = 1, (4, 5)
#: Bytes of a record of any kind, and of one with a frame.
_LARGEST_RECORD, _LARGEST_FRAME = 1 << 24, 1 << 12
_MOST_CHANNELS = 1 << 14
_WHOLE = float(1 << 62)


@dataclass(frozen=True, eq=False, slots=True)
class Field:
    """A number in a record: a signal, or a constant where it has no bits; looked up in a table, if there is one."""

    signal: Signal
    table: tuple[FloatArray, FloatArray] | None = None

    def values(self, rows: Bytes) -> FloatArray:
        """The number in each record."""
        if self.signal.length == 0:
            return np.full(len(rows), self.signal.offset)
        values = decode(self.signal, rows, np.full(len(rows), rows.shape[1]))
        return values if self.table is None else np.interp(values, *self.table)


@dataclass(frozen=True, eq=False, slots=True)
class Group:
    """The records of CAN frames: `size` bytes each, with the payload in `width` bytes from `payload` on.

    Where payloads are stored apart, they are in the records `strings`, or in the block at `signal_data`.
    """

    size: int
    fields: Mapping[str, Field]
    payload: int
    width: int
    bus: int
    strings: int | None = None
    signal_data: int = 0

    def has(self, name: str) -> bool:
        """Whether the records say it."""
        return name in self.fields

    def values(self, name: str, rows: Bytes) -> FloatArray:
        """A number of each record."""
        return self.fields[name].values(rows)

    def numbers(self, name: str, rows: Bytes) -> Counts:
        """A whole number of each record; what is none becomes 0."""
        values = self.values(name, rows)
        return np.where(np.abs(values) < _WHOLE, values, 0.0).astype(np.int64)


@dataclass(frozen=True, eq=False, slots=True)
class Layout:
    """A data section: records of `groups` by their numbers, `width` bytes of number before each.

    `sizes` are those of all records, None where a record says how long it is.
    """

    data: int
    width: int
    sizes: Mapping[int, int | None]
    groups: Mapping[int, Group]

    def split(self, buffer: bytes) -> tuple[dict[int, list[tuple[int, int]]], int]:
        """Where whole records start and end, by their number, and where the first that is not whole starts.

        Raises
        ------
        DataError
            If a record is of no group.
        """
        places: dict[int, list[tuple[int, int]]] = {number: [] for number in self.sizes}
        position, size = 0, len(buffer)
        while position + self.width < size or (self.width and position + self.width == size):
            start = position + self.width
            number = int.from_bytes(buffer[position:start], "little")
            if number not in places:
                raise DataError(f"is damaged: a record of a group {number:,} that is not there")
            length = self.sizes[number]
            if length is None:
                length = 4 + int.from_bytes(buffer[start : start + 4], "little") if start + 4 <= size else size
                if length > _LARGEST_RECORD and start + 4 <= size:
                    raise DataError(f"is damaged: a record of {length:,} bytes")
            if start + length > size:
                break
            places[number].append((start, start + length))
            position = start + length
        return places, position


def bus_layouts(blocks: Blocks) -> list[Layout]:
    """The data sections that hold CAN frames.

    Raises
    ------
    DataError
        If a block is damaged.
    """
    found = (_layout(blocks, section) for section in blocks.chain(blocks.read(HEADER, b"##HD").link(0), b"##DG"))
    return [layout for layout in found if layout is not None]


def _layout(blocks: Blocks, section: Block) -> Layout | None:
    (width,) = section.unpack("<B")
    heads = list(blocks.chain(section.link(1), b"##CG"))
    if width not in {0, 1, 2, 4, 8} or (width == 0 and len(heads) > 1):
        raise damaged(section.address, f"{len(heads)} groups of records with numbers of {width} bytes")
    sizes: dict[int, int | None] = {}
    strings: dict[int, int] = {}
    for head in heads:
        number, _, flags, _, _, size, invalid = head.unpack("<QQHHLLL")
        number = number if width else 0
        if flags & _STRINGS:
            strings[head.address] = number
        elif size + invalid > _LARGEST_RECORD or (width == 0 and size + invalid == 0):
            raise damaged(head.address, f"records of {size + invalid:,} bytes")
        sizes[number] = None if flags & _STRINGS else size + invalid
    groups: dict[int, Group] = {}
    for head in heads:
        number = head.unpack("<Q")[0] if width else 0
        if (group := _group(blocks, head, sizes[number] or 0, strings)) is not None:
            groups[number] = group
    return Layout(section.link(2), width, sizes, groups) if groups and section.link(2) else None


def _group(blocks: Blocks, head: Block, size: int, strings: Mapping[int, int]) -> Group | None:
    """What the records of a group hold; None where they are no CAN frames.

    `strings` are the numbers of the records of payloads that are stored apart, by the addresses of their groups.
    """
    channels: dict[str, Block] = {}
    for channel in _channels(blocks, head.link(1), set()):
        kind, sync = channel.unpack("<BB")
        name = "stamp" if kind in {_MASTER, 3} and sync == _TIME else blocks.text(channel.link(2))
        channels.setdefault(name.removeprefix(f"{_FRAME}.") if name.startswith(f"{_FRAME}.") else name, channel)
        if name == f"{_FRAME}.ID":
            channels[_FRAME] = channel
    data = channels.get("DataBytes")
    if data is None or not {_FRAME, "stamp", "ID"} <= set(channels):
        return None
    fields = {name: _field(blocks, channels[name]) for name in ("stamp", *_FIELDS) if name in channels}
    kind, _, _, _, first, bits = data.unpack("<BBBBLL")
    apart = kind == _VARIABLE
    if first + bits // 8 > size or size > _LARGEST_FRAME:
        raise damaged(data.address, f"a payload in a record of {size:,} bytes")
    bus = re.search(r"\d{1,4}", blocks.text(head.link(2)))
    number = strings.get(data.link(5)) if apart else None
    if apart and not data.link(5):
        return None
    signal_data = data.link(5) if apart and number is None else 0
    return Group(size, fields, first, bits // 8, int(bus[0]) if bus else 0, number, signal_data)


def _channels(blocks: Blocks, address: int, seen: set[int]) -> Iterator[Block]:
    """The channels from `address` on, and those that they are made of."""
    for channel in blocks.chain(address, b"##CN") if address else ():
        if channel.address in seen or len(seen) > _MOST_CHANNELS:
            raise damaged(channel.address, "a channel that is listed twice")
        seen.add(channel.address)
        yield channel
        if (inner := channel.link(1)) and blocks.read(inner).kind == b"##CN":
            yield from _channels(blocks, inner, seen)


def _field(blocks: Blocks, channel: Block) -> Field:
    kind, _, data, shift, first, bits = channel.unpack("<BBBBLL")
    name = blocks.text(channel.link(2))
    scale, offset, table = _conversion(blocks, channel.link(4))
    if kind in _VIRTUAL:
        return Field(Signal(name, 0, 0, offset=offset))
    if kind == _VARIABLE:
        return Field(Signal(name, 8 * first, 64))
    if data not in _NUMBERS:
        return Field(Signal(name, 8 * first, 8))
    if not 1 <= bits <= 64 or shift > 7 or (data in _IEEE and bits not in {16, 32, 64}):
        raise damaged(channel.address, f"a number of {bits} bits")
    bytes_ = (shift + bits + 7) // 8
    begin = 8 * (first + bytes_) - shift - bits if data in _MOTOROLA else 8 * first + shift
    motorola, signed, ieee = data in _MOTOROLA, data in _SIGNED, data in _IEEE
    return Field(Signal(name, begin, bits, motorola, signed, ieee, scale, offset), table)


def _conversion(blocks: Blocks, address: int) -> tuple[float, float, tuple[FloatArray, FloatArray] | None]:
    """Scale, offset and table of a conversion; others than linear ones and tables do not concern frames."""
    if not address:
        return 1.0, 0.0, None
    block = blocks.read(address, b"##CC")
    kind, _, _, _, count = block.unpack("<BBHHH")
    if kind not in {_LINEAR, *_TABLES} or len(block.data) < 24 + 8 * count:
        return 1.0, 0.0, None
    values = np.array(struct.unpack_from(f"<{count}d", block.data, 24))
    if kind == _LINEAR:
        return (float(values[1]), float(values[0]), None) if count >= 2 else (1.0, 0.0, None)
    keys, found = values[0::2], values[1::2]
    rises = keys.size == found.size and keys.size > 0 and bool(np.all(np.diff(keys) > 0))
    return 1.0, 0.0, (keys, found) if rises else None

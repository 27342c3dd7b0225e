"""MF4 bus logging: raw CAN frames of an MDF 4 file, finished or not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np

from clutchid.errors import DataError
from clutchid.io.formats.can.frames import CLASSIC, FD, LARGEST_BUS, Bytes, FrameLog, Frames
from clutchid.io.formats.can.mdf_blocks import HEADER, Blocks
from clutchid.io.formats.can.merge import merged, together
from clutchid.io.formats.can.mf4_groups import Group, Layout, bus_layouts
from clutchid.io.formats.can.mf4_strings import Strings

#: How a file begins: MDF 4, finished or (a logger that lost its supply) not.
MAGIC = (b"MDF     4", b"UnFinMF 4")

#: Payload bytes by data length code.
_LENGTHS = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64], dtype=np.int64)

_LOCAL, _OFFSETS = 1, 2


def holds_bus_frames(path: Path) -> bool:
    """Whether a file is MDF 4 with groups for the frames of a CAN bus.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        if not file.read(len(MAGIC[0])).startswith(MAGIC):
            return False
        try:
            return bool(bus_layouts(Blocks(file)))
        except DataError:
            return False


def frame_log(path: Path) -> FrameLog:
    """The CAN frames of an MDF 4 file; groups without any are passed over.

    Raises
    ------
    DataError
        If it is no complete MDF file, or has no groups for CAN frames.
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        blocks = Blocks(file)
        if not bus_layouts(blocks):
            raise DataError("is an MDF file that holds no frames of a CAN bus; its channels are read without a DBC.")
        return FrameLog("MF4", _start(blocks), lambda: _blocks(path))


def _start(blocks: Blocks) -> datetime | None:
    nanoseconds, zone, summer, flags = blocks.read(HEADER, b"##HD").unpack("<QhhB")
    try:
        start = datetime(1970, 1, 1) + timedelta(microseconds=(nanoseconds + 500) // 1000)
        if flags & _LOCAL:
            return start
        east = timedelta(minutes=zone + summer) if flags & _OFFSETS else timedelta(0)
        return start.replace(tzinfo=UTC).astimezone(timezone(east))
    except (OverflowError, ValueError):
        return None


def _blocks(path: Path) -> Iterator[Frames]:
    with path.open("rb") as file:
        blocks = Blocks(file)
        yield from merged([_frames(blocks, layout) for layout in bus_layouts(blocks)])


@dataclass(slots=True)
class _Open:
    """A group while its records come in: those that wait for their payload."""

    group: Group
    strings: Strings | None
    waiting: Bytes = field(default_factory=lambda: np.zeros((0, 0), dtype=np.uint8))


def _frames(blocks: Blocks, layout: Layout) -> Iterator[Frames]:
    """The frames of the groups that share a data section, as their records stand in it."""
    strings = {group.strings: Strings() for group in layout.groups.values() if group.strings is not None}
    opened = {}
    for number, group in layout.groups.items():
        own = strings.get(group.strings) if group.strings is not None else None
        opened[number] = _Open(group, own or (Strings(blocks.data(group.signal_data)) if group.signal_data else None))
    rest = b""
    for piece in blocks.data(layout.data):
        buffer = rest + piece
        places, end = layout.split(buffer)
        rest = buffer[end:]
        for number, found in strings.items():
            found.extend(b"".join(buffer[first:last] for first, last in places.get(number, [])))
        parts = [_block(one, _rows(buffer, one.group.size, places.get(number, []))) for number, one in opened.items()]
        parts = [part for part in parts if len(part)]
        if parts:
            yield together([(np.fmax.accumulate(part.stamp), part) for part in parts])
    lost = sum(len(one.waiting) for one in opened.values())
    if lost or rest:
        raise DataError(f"is cut off: its last record is not complete, and {lost:,} frames have no payload")


def _rows(buffer: bytes, size: int, places: list[tuple[int, int]]) -> Bytes:
    """The records at some places, a row each."""
    data = np.frombuffer(buffer, dtype=np.uint8)
    first = np.array([first for first, _ in places], dtype=np.int64)
    rows: Bytes = data[first[:, None] + np.arange(size)]
    return rows


def _block(opened: _Open, rows: Bytes) -> Frames:
    """The frames whose payload is there, in the order of their records; the others go on waiting."""
    group = opened.group
    if len(opened.waiting):
        rows = np.concatenate([opened.waiting, rows])
    if opened.strings is None:
        data = _payload(rows[:, group.payload : group.payload + group.width])
        known = np.full(len(rows), min(group.width, FD))
    else:
        offsets = group.numbers("DataBytes", rows)
        ready = opened.strings.ready(offsets)
        opened.waiting = rows[ready:]
        rows = rows[:ready]
        data, known = opened.strings.payload(offsets[:ready])
    if group.has("DataLength"):
        length = group.numbers("DataLength", rows)
    elif group.has("DLC"):
        length = _LENGTHS[np.clip(group.numbers("DLC", rows), 0, 15)]
    else:
        length = known
    written = group.numbers("ID", rows)
    identifier = written & 0x1FFFFFFF
    extended = group.numbers("IDE", rows) != 0 if group.has("IDE") else (written >> 31 & 1 == 1) | (identifier > 0x7FF)
    bus = group.numbers("BusChannel", rows) if group.has("BusChannel") else np.full(len(rows), group.bus)
    length = np.clip(length, 0, np.minimum(known, data.shape[1]))
    return Frames(group.values("stamp", rows), np.clip(bus, 0, LARGEST_BUS), identifier, extended, length, data)


def _payload(data: Bytes) -> Bytes:
    """Payloads with zeros behind them, 8 or 64 columns."""
    width = FD if data.shape[1] > CLASSIC else CLASSIC
    data = data[:, :width]
    return np.pad(data, ((0, 0), (0, width - data.shape[1]))) if data.shape[1] < width else data

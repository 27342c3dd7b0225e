"""A recording that arrives on a CAN bus through python-can: frames decoded with a DBC, to blocks in SI."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchid.errors import DataError
from clutchid.files import plain_file
from clutchid.measurements.formats.can.dbc import read_dbc
from clutchid.measurements.formats.can.frames import Frames, check_python_can, frame_of, in_blocks, quiet
from clutchid.measurements.formats.can.streams import (
    FrameStream,
    MessageCatalogue,
    by_stream,
    catalogue,
    stream_rasters,
    stream_values,
    streams_in_order,
)
from clutchid.measurements.live.arrival import LiveBlock, live_blocks
from clutchid.measurements.live.bus_name import BusName
from clutchid.measurements.live.feed import PACE, PATIENCE
from clutchid.measurements.live.order import ArrivedBatch, ArrivedSamples, arrived, picked_streams
from clutchid.measurements.map.channel_map import PickedChannels
from clutchid.measurements.source import Table

if TYPE_CHECKING:
    import can

    from clutchid.measurements.map.channel_map import ChannelMap

#: Frames that wait at most: those that arrive while the ones before them are looked at. More stay with the bus.
MOST_WAITING = 1 << 17

_Stopped = Callable[[], bool]


@contextmanager
def _opened_bus(name: BusName) -> Iterator[can.BusABC]:
    """The bus, open; bit rates and the like are those of python-can's own configuration.

    Raises
    ------
    DataError
        If it cannot be opened.
    MissingExtra
        If python-can is not installed.
    """
    check_python_can("a CAN bus")
    import can

    try:
        with quiet("can"):
            bus = can.Bus(channel=name.channel, interface=name.interface)
    except (can.CanError, OSError, ValueError, ImportError) as error:
        raise DataError(
            f"{name}: cannot be opened ({_reason(error)}); name a bus as can:CHANNEL for SocketCAN, such as can:can0, "
            "or as can:INTERFACE:CHANNEL, such as can:pcan:PCAN_USBBUS1."
        ) from error
    try:
        yield bus
    finally:
        bus.shutdown()


#: Longest time in s that the end of a recording waits for the thread that reads the bus.
_CLOSING = 2.0


def from_bus(name: BusName, stopped: _Stopped) -> Iterator[Frames]:
    """Frames of a bus as they arrive, until it is stopped and those that came before were given.

    A thread of its own takes them from the bus, so that none is lost while those before are looked at.

    Raises
    ------
    DataError
        If it cannot be opened, or fails; the frames before were given then.
    MissingExtra
        If python-can is not installed.
    """
    with _opened_bus(name) as bus:
        waiting: deque[can.Message] = deque()
        failures: list[Exception] = []
        closing = threading.Event()
        reader = threading.Thread(target=_read, args=(bus, waiting, failures, stopped, closing), daemon=True)
        reader.start()
        try:
            while reader.is_alive() or waiting:
                yield from in_blocks([frame_of(waiting.popleft()) for _ in range(len(waiting))])
                if not waiting:
                    reader.join(PACE)
        finally:
            closing.set()
            reader.join(_CLOSING)  # a driver may hold on to its last call; the thread ends with the process
    if failures:
        raise DataError(f"{name}: failed ({_reason(failures[0])}).") from failures[0]


def _read(
    bus: can.BusABC,
    waiting: deque[can.Message],
    failures: list[Exception],
    stopped: _Stopped,
    closing: threading.Event,
) -> None:
    """Take messages from a bus until it is stopped, and then those that it has received already."""
    import can

    try:
        while not closing.is_set():
            if len(waiting) >= MOST_WAITING:
                time.sleep(PACE)
                continue
            ending = stopped()
            message = bus.recv(0.0 if ending else PATIENCE)
            if message is not None:
                waiting.append(message)
            elif ending:
                return
    except (can.CanError, OSError, ValueError) as error:
        failures.append(error)


def _reason(error: Exception) -> str:
    return " ".join((getattr(error, "strerror", "") or str(error) or type(error).__name__).split()).rstrip(".")


#: Time in s, by the stamps, in which every message of the recording comes once; for which one is waited at most; and
#: frames in which they all must have come. `SLOW_MESSAGES` is the time for channels of a map that nothing needs:
#: pressures and temperatures are sent once a second.
_LEARNT, SLOW_MESSAGES, _PATIENT, _MOST = 1.0, 3.0, 10.0, 1 << 17

_UNREADABLE = "error frame"


@dataclass(frozen=True, eq=False, slots=True)
class _BusLayout:
    """Layout of a bus: its messages, time grids and picks of the streams that are read, and the first stamp in s."""

    lookup: MessageCatalogue
    rasters: Mapping[FrameStream, int]
    picks: tuple[PickedChannels, ...]
    origin: float


def bus_blocks(
    frames: Iterator[Frames],
    name: str,
    dbc: Sequence[Path],
    channels: ChannelMap | None,
    ambient: float,
    required: Sequence[str],
    origin: float | None = None,
) -> Iterator[LiveBlock]:
    """Blocks of a recording from the frames of a bus, see `clutchid.measurements.live.arrival.live_blocks`.

    The first second shows which messages there are; its samples count. Stamps are in s from the origin. Columns of
    other messages than the position's are held until its stamps.

    Parameters
    ----------
    name
        Of the recording.
    dbc
        DBC files; of two that know the same frame the first counts.
    channels
        The channel map; without it the signals must have standard names.
    ambient : Pa
        Absolute pressure that is added to gauge pressures.
    required
        Quantities that the recording must have.
    origin : s
        The stamp of the bus that is the time 0, by default that of the first frame.

    Raises
    ------
    DataError
        If there is no DBC, a DBC is missing or cannot be read, the signals do not come, or there is no sample.
    MissingExtra
        If cantools is not installed.
    """
    if not dbc:
        raise DataError(f"{name}: a bus carries raw frames; give its DBC with --dbc FILE.")
    messages = tuple(message for file in dbc for message in read_dbc(plain_file(file, "DBC file")))
    first, layout = _learnt(frames, name, catalogue(messages), channels, required)
    layout = layout if origin is None else replace(layout, origin=origin)
    metadata = {"source": name, "ambient_Pa": repr(float(ambient)), "dbc": ", ".join(file.name for file in dbc)}
    batches = (_batch(block, layout, ambient) for block in chain(first, frames))
    yield from live_blocks(batches, layout.picks, name, metadata, "frame", origin=layout.origin)


def _learnt(
    frames: Iterator[Frames],
    name: str,
    lookup: MessageCatalogue,
    channels: ChannelMap | None,
    required: Sequence[str],
) -> tuple[list[Frames], _BusLayout]:
    """The first frames, and the layout of the bus in them: waits for every signal that is needed."""
    first: list[Frames] = []
    streams: dict[FrameStream, None] = {}
    origin, latest = np.nan, -np.inf
    while True:
        block = next(frames, None)
        if block is not None:
            first.append(block)
            stamps = block.stamp[np.isfinite(block.stamp)]
            origin = stamps[0] if np.isnan(origin) and stamps.size else origin
            latest = max(latest, stamps.max(initial=-np.inf))
            streams |= {stream: None for stream, _ in by_stream(block, lookup) if isinstance(stream, FrameStream)}
        waited = latest - origin if sum(map(len, first)) < _MOST else _PATIENT
        if block is not None and not waited >= _LEARNT:
            continue
        late = block is None or waited >= _PATIENT
        wanted = required if late or waited >= SLOW_MESSAGES or channels is None else (*required, *channels.channels)
        if late and not streams:
            raise DataError(
                f"{name}: no frame that the DBC defines has arrived; give the DBC of this bus with --dbc FILE."
            )
        ordered = streams_in_order(streams, lookup.messages)
        try:
            picks = picked_streams(name, stream_rasters(ordered, {}), channels, wanted)
        except DataError:
            if late:
                raise
        else:
            return first, _BusLayout(lookup, {stream: i for i, stream in enumerate(ordered)}, picks, float(origin))


def _batch(frames: Frames, bus: _BusLayout, ambient: float) -> ArrivedBatch:
    """The picked channels of some frames, in SI; frames without a stamp, and error frames, cannot be read."""
    stamped = np.isfinite(frames.stamp)
    unreadable = frames.left_out.get(_UNREADABLE, 0) + int(stamped.size - stamped.sum())
    if not stamped.all():
        frames = frames.take(stamped)
    samples: list[ArrivedSamples] = []
    all_stamps = frames.stamp - bus.origin
    for stream, rows in by_stream(frames, bus.lookup):
        if not isinstance(stream, FrameStream):
            continue
        for i, chosen in enumerate(bus.picks):
            if chosen.raster == bus.rasters.get(stream):
                stamps, data, length = all_stamps[rows], frames.data[rows], frames.length[rows]
                table = Table(numbers=stream_values(stream, chosen.indices, stamps, data, length), size=rows.size)
                samples.append(arrived(i, chosen, table, ambient, rows))
    return ArrivedBatch(all_stamps, samples, unreadable)

"""A recording that arrives on a bus: frames decoded with a DBC, to blocks in SI."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchid.errors import DataError
from clutchid.recordings.files import plain_file
from clutchid.recordings.formats.can import warnings as can_warnings
from clutchid.recordings.formats.can.dbc import Message, read_dbc
from clutchid.recordings.formats.can.frames import Frames, Rows
from clutchid.recordings.formats.can.signals import decode
from clutchid.recordings.formats.can.streams import Book, Stream, book, channels_of, in_order, sorted_out
from clutchid.recordings.live.arrival import LiveBlock, Piece, live_blocks
from clutchid.recordings.live.streams import Arrived, arrived, indices, picked_streams
from clutchid.recordings.map.channel_map import Pick
from clutchid.recordings.source import Raster
from clutchid.recordings.table import Table

if TYPE_CHECKING:
    from clutchid.recordings.map.channel_map import ChannelMap

#: Time in s, by the stamps, in which every message of the recording comes once; for which one is waited at most; and
#: frames in which they all must have come. `SLOW` is the time for channels of a map that nothing needs: pressures and
#: temperatures are sent once a second.
LEARNT, SLOW, PATIENT, MOST = 1.0, 3.0, 10.0, 1 << 17

_UNREADABLE = "error frame"

#: Entry of the metadata: the stamp of the bus in s that is the time 0 of the recording.
ORIGIN = "origin_s"


@dataclass(frozen=True, eq=False, slots=True)
class _Bus:
    """What is known of a bus: its messages, the streams that are read, their picks, and the first stamp in s."""

    known: Book
    rasters: Mapping[Stream, int]
    picks: tuple[Pick, ...]
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
    """Blocks of a recording from the frames of a bus, see `clutchid.recordings.live.arrival.live_blocks`.

    The first second shows which messages there are; its samples count. Stamps are in s from the origin, which the
    metadata have as `ORIGIN`. Columns of other messages than the position's are held until its stamps.

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
        If there is no DBC, a DBC is missing or cannot be read, the signals do not come, there is no sample, or the time
        goes back for good.
    MissingExtra
        If cantools is not installed.
    """
    if not dbc:
        raise DataError(f"{name}: a bus has raw frames; give the DBC of it with --dbc FILE.")
    messages = tuple(message for file in dbc for message in read_dbc(plain_file(file, "DBC file")))
    first, found = _learnt(frames, name, messages, channels, required)
    found = found if origin is None else replace(found, origin=origin)
    metadata = {"source": name, "ambient_Pa": repr(float(ambient)), "dbc": ", ".join(file.name for file in dbc)}
    metadata[ORIGIN] = repr(found.origin)
    pieces = (_piece(each, found, ambient) for each in chain(first, frames))
    yield from live_blocks(pieces, found.picks, name, metadata)


def _learnt(
    frames: Iterator[Frames],
    name: str,
    messages: Sequence[Message],
    channels: ChannelMap | None,
    required: Sequence[str],
) -> tuple[list[Frames], _Bus]:
    """The first frames, and what they show: waits for every signal that is needed."""
    known, first = book(messages), list[Frames]()
    streams: dict[Stream, None] = {}
    origin, latest = np.nan, -np.inf
    while True:
        block = next(frames, None)
        if block is not None:
            first.append(block)
            stamps = block.stamp[np.isfinite(block.stamp)]
            origin = stamps[0] if np.isnan(origin) and stamps.size else origin
            latest = max(latest, stamps.max(initial=-np.inf))
            streams |= {one: None for one, _ in sorted_out(block, known) if isinstance(one, Stream)}
        waited = latest - origin if sum(map(len, first)) < MOST else PATIENT
        if block is not None and not waited >= LEARNT:
            continue
        late = block is None or waited >= PATIENT
        wanted = required if late or waited >= SLOW or channels is None else (*required, *channels.channels)
        try:
            rasters, picks = _picked(name, in_order(streams, messages), channels, wanted)
        except DataError:
            if late:
                raise
        else:
            return first, _Bus(known, rasters, picks, float(origin))


def _picked(
    name: str, streams: Sequence[Stream], channels: ChannelMap | None, required: Sequence[str]
) -> tuple[dict[Stream, int], tuple[Pick, ...]]:
    """The streams by the index of their time grid, and the channels that the map picks."""
    if not streams:
        raise DataError(f"{name}: no frame came that the DBC knows; give the DBC of this bus with --dbc FILE.")
    rasters = [
        Raster(channels_of(stream), 0, title, 0)
        for stream, title in zip(streams, can_warnings.names(streams), strict=True)
    ]
    picks = picked_streams(name, rasters, channels, required)
    return {stream: i for i, stream in enumerate(streams)}, picks


def _piece(frames: Frames, bus: _Bus, ambient: float) -> Piece:
    """The picked channels of some frames, in SI; frames without a stamp, and error frames, cannot be read."""
    stamped = np.isfinite(frames.stamp)
    unreadable = frames.left_out.get(_UNREADABLE, 0) + int(stamped.size - stamped.sum())
    if not stamped.all():
        frames = frames.take(stamped)
    each: list[Arrived] = []
    for found, rows in sorted_out(frames, bus.known):
        raster = bus.rasters.get(found) if isinstance(found, Stream) else None
        for i, chosen in enumerate(bus.picks):
            if isinstance(found, Stream) and chosen.raster == raster:
                each.append(arrived(i, chosen, _table(found, chosen, frames, rows, bus.origin), ambient, rows))
    return Piece(each, unreadable)


def _table(stream: Stream, chosen: Pick, frames: Frames, rows: Rows, origin: float) -> Table:
    data, length = frames.data[rows], frames.length[rows]
    numbers = {
        column: frames.stamp[rows] - origin if column == 0 else decode(stream.page.signals[column - 1], data, length)
        for column in indices(chosen)
    }
    return Table(channels_of(stream), numbers, rows.size)

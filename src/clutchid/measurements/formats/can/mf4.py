"""MF4 bus logging: raw CAN frames of an MDF 4 file, finished or not."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.measurements.formats.can.frames import CLASSIC, FD, LARGEST_BUS, Counts, FrameLog, Frames, merged
from clutchid.measurements.formats.mdf.file import sample_blocks
from clutchid.measurements.formats.mdf.numbers import converted
from clutchid.measurements.formats.mdf.opening import BrokenMdf, opened

#: Payload bytes by data length code.
_LENGTHS = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64], dtype=np.int64)

#: Frames that are read at a time.
_FRAMES = 1 << 18

_FRAME = "CAN_DataFrame"
_FIELDS = ("ID", "IDE", "BusChannel", "DLC", "DataLength", "Dir")
_TIME = 1
_LOCAL = 1
_WHOLE = float(1 << 62)


def mdf_frames(path: Path) -> FrameLog | None:
    """The CAN frames of an MDF file; None where it has no groups for them, or cannot be read.

    Raises
    ------
    MissingExtra
        If asammdf is not installed.
    OSError
        If the file cannot be read.
    """
    try:
        with opened(path) as mdf:
            return FrameLog("MF4", _start(mdf), lambda: _blocks(path)) if _groups(mdf) else None
    except BrokenMdf:
        return None


def _start(mdf: Any) -> datetime | None:
    try:
        start: datetime = mdf.header.start_time
    except (OverflowError, ValueError):
        return None
    return start.replace(tzinfo=None) if mdf.header.time_flags & _LOCAL else start


def _groups(mdf: Any) -> dict[int, dict[str, int]]:
    """The groups of CAN frames: the indices of their fields."""
    groups = {number: _fields(mdf, number) for number in range(len(mdf.groups))}
    return {number: fields for number, fields in groups.items() if {"stamp", "ID", "DataBytes"} <= set(fields)}


def _fields(mdf: Any, number: int) -> dict[str, int]:
    channels = mdf.groups[number].channels
    if not any(channel.name in (_FRAME, f"{_FRAME}.ID") for channel in channels):
        return {}
    fields: dict[str, int] = {}
    for index, channel in enumerate(channels):
        fields.setdefault(channel.name.removeprefix(f"{_FRAME}."), index)
    master = mdf.masters_db.get(number)
    if master is not None and channels[master].sync_type == _TIME:
        fields["stamp"] = master
    return fields


def _blocks(path: Path) -> Iterator[Frames]:
    try:
        with opened(path) as mdf:
            yield from merged([_frames(mdf, number, fields) for number, fields in _groups(mdf).items()])
    except BrokenMdf as error:
        raise DataError(str(error).rstrip(".")) from error


def _frames(mdf: Any, number: int, fields: Mapping[str, int]) -> Iterator[Frames]:
    """The frames of a group."""
    group = mdf.groups[number]
    names = [name for name in ("stamp", *_FIELDS) if name in fields]
    rules = {name: group.channels[fields[name]].conversion for name in names}
    # else asammdf loads all payloads of the file to find the longest: 40 million frames do not fit into 1.5 GB then
    mdf._mdf.vlsd_max_length[number, group.channels[fields["DataBytes"]].name] = CLASSIC
    written = re.search(r"\d{1,4}", group.channel_group.acq_name or "")
    bus = int(written[0]) if written else 0
    wanted = [(number, fields[name]) for name in (*names, "DataBytes")]
    cycles = int(group.channel_group.cycles_nr)
    for first in range(0, cycles, _FRAMES):
        for _, samples in sample_blocks(mdf, wanted, first, min(_FRAMES, cycles - first)):
            *raw, (payload, _) = samples
            values = {
                name: _sent(stored) if name == "Dir" else converted(stored, rules[name], 4)
                for name, (stored, _) in zip(names, raw, strict=True)
            }
            yield _block(values, payload, bus)


def _block(values: Mapping[str, NDArray[np.float64]], payload: NDArray[Any], bus: int) -> Frames:
    written = _whole(values["ID"])
    identifier = written & 0x1FFFFFFF
    extended = values["IDE"] != 0 if "IDE" in values else (written >> 31 & 1 == 1) | (identifier > 0x7FF)
    data = payload[:, :FD]
    width = data.shape[1]
    if "DataLength" in values:
        length = _whole(values["DataLength"])
    elif "DLC" in values:
        length = _LENGTHS[np.clip(_whole(values["DLC"]), 0, 15)]
    else:
        length = np.full(len(data), width)
    buses = _whole(values["BusChannel"]) if "BusChannel" in values else np.full(len(data), bus)
    sent = values.get("Dir", np.zeros(len(data))) == 1
    buses = np.clip(buses, 0, LARGEST_BUS)
    return Frames(values["stamp"], buses, identifier, extended, np.clip(length, 0, width), sent, data)


def _sent(way: NDArray[Any]) -> NDArray[np.float64]:
    """1 for frames that were sent, as numbers or texts say, of which a conversion only makes words."""
    texts = way.dtype.kind == "S"
    sent: NDArray[np.bool_] = np.char.upper(np.char.strip(way)) == b"TX" if texts else way == 1
    return sent.astype(np.float64)


def _whole(values: NDArray[np.float64]) -> Counts:
    """Whole numbers; 0 for NaN and for numbers beyond 62 bits."""
    return np.where(np.abs(values) < _WHOLE, values, 0.0).astype(np.int64)

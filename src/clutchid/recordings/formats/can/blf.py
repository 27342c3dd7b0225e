"""BLF, Vector's binary log: raw frames through python-can."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from clutchid.errors import DataError
from clutchid.recordings.formats.can.frames import FrameLog, Frames, check_python_can, in_blocks, quiet

_HEADER = struct.Struct("<4sL8xQQLL8H")


def frame_log(path: Path) -> FrameLog:
    """The frames of a BLF file.

    Raises
    ------
    MissingExtra
        If python-can is not installed.
    DataError
        If the header is cut off.
    OSError
        If the file cannot be read.
    """
    check_python_can("BLF")
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
    if len(head) < _HEADER.size:
        raise DataError("is no complete BLF file: its header is cut off; copy it again.")
    size, there = _HEADER.unpack(head)[2], path.stat().st_size
    cut = f"is cut off: it says that it has {size:,} bytes and has {there:,}; what is there is used."
    warnings = (cut,) if there < size < 1 << 50 else ()
    return FrameLog("BLF", _start(head), lambda: _blocks(path), warnings)


def _start(head: bytes) -> datetime | None:
    """Clock time of stamp 0; the file does not say in which zone."""
    year, month, _, day, hour, minute, second, milliseconds = _HEADER.unpack(head)[6:]
    try:
        return datetime(year, month, day, hour, minute, second, milliseconds * 1000)
    except ValueError:
        return None


def _blocks(path: Path) -> Iterator[Frames]:
    from can.io.blf import BLFParseError, BLFReader

    with path.open("rb") as file, quiet("can.io.blf"):
        try:
            reader = BLFReader(file)
            reader.start_timestamp = 0.0  # stamps as they are stored: added to a date they would lose nanoseconds
            yield from in_blocks(reader, Counter())
        except (BLFParseError, struct.error, zlib.error, ValueError, LookupError, OverflowError) as error:
            place = "" if file.closed else f" before byte {file.tell():,}"
            raise DataError(f"is damaged{place} ({str(error) or 'no object where one must start'})") from error

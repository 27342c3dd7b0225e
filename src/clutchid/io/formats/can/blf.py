"""BLF, Vector's binary log: raw frames through python-can."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

from clutchid.errors import DataError, MissingExtra
from clutchid.io.formats.can.frames import FrameLog, Frames, in_blocks, quiet

MAGIC = b"LOGG"

_HEADER = struct.Struct("<4sL8xQQLL8H")
_LONGEST_HEADER = 4096
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")
_CONTAINERS, _PLAIN, _DEFLATED = 10, 0, 2
_NO_OBJECT = "no object where one must start"

#: Bytes of one container, unpacked, and of an object in it; Vector's tools write 128 KiB.
_LARGEST = 1 << 24


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
    try:
        import can  # noqa: F401
    except ImportError as error:
        raise MissingExtra("reading BLF needs python-can; install it with pip install 'clutchid[can]'.") from error
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
        stream = _Unpacked(file)
        try:
            reader = BLFReader(stream)  # type: ignore[arg-type]
            reader.start_timestamp = 0.0  # stamps as they are stored: added to a date they would lose nanoseconds
            stream.waiting = lambda: len(getattr(reader, "_tail", b""))
            yield from in_blocks(reader, Counter())
        except (BLFParseError, struct.error, zlib.error, ValueError, LookupError, OverflowError) as error:
            reason = str(error) or _NO_OBJECT
            raise DataError(f"is damaged before byte {file.tell():,} ({reason})") from error


class _Unpacked:
    """A BLF file whose containers are unpacked already, each within bounds, as python-can reads it.

    python-can itself would read and unpack as much as a damaged file asks for.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._pieces = self._objects(file)
        self._buffer = b""
        self.waiting: Callable[[], int] = lambda: 0

    def read(self, size: int) -> bytes:
        """The next `size` bytes, fewer only at the end."""
        if self.waiting() > _LARGEST:
            raise ValueError("an object that never ends")
        while len(self._buffer) < size and (piece := next(self._pieces, b"")):
            self._buffer += piece
        found, self._buffer = self._buffer[: max(size, 0)], self._buffer[max(size, 0) :]
        return found

    def close(self) -> None:
        """Nothing: who opened the file closes it."""

    @staticmethod
    def _objects(file: BinaryIO) -> Iterator[bytes]:
        head = file.read(8)
        size = struct.unpack("<L", head[4:])[0]
        if not _HEADER.size <= size <= _LONGEST_HEADER:
            raise ValueError(f"a header of {size:,} bytes")
        yield head + file.read(size - 8)
        rest = b""
        while len(base := file.read(_OBJECT.size)) == _OBJECT.size:
            signature, _, _, size, kind = _OBJECT.unpack(base)
            if signature != b"LOBJ":
                raise ValueError(_NO_OBJECT)
            if not _OBJECT.size <= size <= _LARGEST:
                raise ValueError(f"an object of {size:,} bytes")
            body = file.read(size - _OBJECT.size)
            file.read(size % 4)
            if kind == _CONTAINERS:
                data = rest + _contents(body)
                end, trouble = _whole_objects(data)
                yield _container(data[:end])
                rest = data[end:]
                if trouble:
                    raise ValueError(trouble)


def _whole_objects(data: bytes) -> tuple[int, str]:
    """Where the last whole object ends, and what is wrong behind it, if anything is.

    On an object without a size python-can would stay for ever.
    """
    end = 0
    while True:
        start = data.find(b"LOBJ", end, end + 8)
        if start < 0:
            return end, _NO_OBJECT if end + 8 <= len(data) else ""
        if start + _OBJECT.size > len(data):
            return end, ""
        size = int.from_bytes(data[start + 8 : start + 12], "little")
        if not _OBJECT.size <= size <= _LARGEST:
            return end, f"an object of {size:,} bytes"
        if start + size > len(data):
            return end, ""
        end = start + size


def _contents(body: bytes) -> bytes:
    """The objects in a container, unpacked."""
    if len(body) < _CONTAINER.size:
        raise ValueError("the file ends inside an object")
    method, data = _CONTAINER.unpack_from(body)[0], body[_CONTAINER.size :]
    if method == _PLAIN:
        return data
    if method != _DEFLATED:
        raise ValueError(f"packed by a method that is not known, {method}")
    unpacking = zlib.decompressobj()
    found = unpacking.decompress(data, _LARGEST)
    if unpacking.unconsumed_tail:
        raise ValueError(f"a container of more than {_LARGEST:,} bytes")
    return found


def _container(data: bytes) -> bytes:
    """A container of objects that is not packed."""
    size = _OBJECT.size + _CONTAINER.size + len(data)
    head = _OBJECT.pack(b"LOBJ", _OBJECT.size, 1, size, _CONTAINERS)
    return head + _CONTAINER.pack(_PLAIN, len(data)) + data + bytes(size % 4)

"""Messages between a worker and the process that started it: parts of any number of bytes.

Their meaning is up to who asks and who answers. Nothing is copied on the way but into the pipe and out of it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import IO, Any

#: A part of a message: bytes, or the memory of an array.
MessagePart = bytes | bytearray | memoryview
MessageParts = Sequence[MessagePart]

_SIZE = struct.Struct("<Q")


def send(stream: IO[bytes], parts: MessageParts) -> None:
    """Write one message.

    Raises
    ------
    OSError
        If the other process has ended.
    """
    views = [memoryview(part).cast("B") if len(part) else memoryview(b"") for part in parts]
    stream.write(b"".join(map(_SIZE.pack, [len(views), *map(len, views)])))
    for view in views:
        stream.write(view)
    stream.flush()


def receive(stream: IO[bytes]) -> list[bytearray]:
    """Read one message.

    Raises
    ------
    EOFError
        If the other process has ended.
    """
    (count,) = _SIZE.unpack(_filled(stream, _SIZE.size))
    sizes = [size for (size,) in _SIZE.iter_unpack(_filled(stream, count * _SIZE.size))]
    return [_filled(stream, size) for size in sizes]


def _filled(stream: IO[bytes], size: int) -> bytearray:
    """The next bytes of a stream."""
    room = bytearray(size)
    view: Any = memoryview(room)
    filled = 0
    while filled < size:
        count = stream.readinto(view[filled:])  # type: ignore[attr-defined]
        if not count:
            raise EOFError
        filled += count
    return room

"""Bytes as they arrive from a pipe."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from clutchid.errors import DataError
from clutchid.files import reason_of
from clutchid.systems import Incoming

#: Time in s for which arriving bytes are collected, so that a block is worth its cost; bytes of a piece at most.
PACE, _MOST_BYTES = 0.02, 1 << 20

#: Time in s after which a feed that waits asks whether it is stopped.
PATIENCE = 0.1

_Stopped = Callable[[], bool]


def from_descriptor(descriptor: int, stopped: _Stopped) -> Iterator[bytes]:
    """Bytes of an open pipe or file as they arrive, until it ends or is stopped.

    Where it ends in an unfinished line, that line is ended; where it is stopped, it is not, and what was read counts.

    Raises
    ------
    DataError
        If it cannot be read.
    """
    last, ended, stopping = b"\n", False, False
    try:
        with Incoming(descriptor) as feed:
            while not ended:
                if stopped():
                    stopping = True
                    feed.close()
                collected, ended = _collected(feed)
                if collected:
                    last = collected[-1:]
                    yield collected
                elif stopping:
                    return
        if last != b"\n" and not stopping:
            yield b"\n"
    except OSError as error:
        raise DataError(f"standard input: cannot be read ({reason_of(error)}).") from error


def _collected(feed: Incoming) -> tuple[bytes, bool]:
    """Bytes that arrive within `PACE` of the first, which is waited for, and whether the feed has ended."""
    parts: list[bytes] = []
    size, until = 0, time.monotonic() + PATIENCE
    while size < _MOST_BYTES and (rest := until - time.monotonic()) > 0.0:
        part = feed.next(rest)
        if part is None:
            break
        if not part:
            return b"".join(parts), True
        if not parts:
            until = time.monotonic() + PACE
        parts.append(part)
        size += len(part)
    return b"".join(parts), False

"""Bytes as they arrive from a pipe, or from a file that grows."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from clutchid.errors import DataError
from clutchid.files import plain_file, reason_of
from clutchid.measurements.formats.kinds import head_of, kind_of
from clutchid.systems import Incoming

#: Time in s for which arriving bytes are collected, so that a block is worth its cost; bytes of a piece at most.
PACE, MOST_BYTES = 0.02, 1 << 20

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
    while size < MOST_BYTES and (rest := until - time.monotonic()) > 0.0:
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


def from_growing_file(path: str | os.PathLike[str], stopped: _Stopped) -> Iterator[bytes]:
    """Bytes of a file from its start, and then those that are appended, until it is stopped and its end is reached.

    Where it is stopped before, it ends within `MOST_BYTES` bytes.

    Raises
    ------
    DataError
        If there is no readable plain file of text, or it becomes shorter or another file, after the rest of the first.
    """
    file = plain_file(path)
    if (kind := kind_of(head_of(file))) not in ("csv", "jsonl"):
        raise DataError(f"{file}: is {kind.upper()}; a file that is followed while it grows is CSV or JSON lines.")
    size = 0
    try:
        with file.open("rb", buffering=0) as stream:
            number = os.fstat(stream.fileno()).st_ino
            while True:
                ending, trouble = stopped(), _trouble(file, number, size)
                part = stream.read(MOST_BYTES)
                size += len(part)
                if part:
                    yield part
                if len(part) < MOST_BYTES and trouble:
                    raise DataError(trouble)
                if ending:
                    return
                if len(part) < MOST_BYTES:
                    time.sleep(PACE)
    except OSError as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{file}: cannot be read any more ({reason_of(error)}).") from error


def _trouble(file: Path, number: int, size: int) -> str:
    """Reason why a file is no longer the one that was begun, empty if it is; the rest of that one is read first."""
    try:
        status = file.stat()
    except OSError as error:
        return f"{file}: cannot be read any more ({reason_of(error)})."
    if status.st_ino == number and status.st_size >= size:
        return ""
    what = "is another file now" if status.st_ino != number else "has become shorter"
    return f"{file}: {what}; samples can only be appended to a file that is followed. Start again."

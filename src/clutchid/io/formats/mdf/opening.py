"""MDF files opened for reading: checked first, finalised in memory where a logger lost its power."""

from __future__ import annotations

import contextlib
import errno
import gc
import io
import logging
import mmap
import re
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from clutchid.errors import MissingExtra
from clutchid.io.columns import shortened
from clutchid.io.formats.mdf.blocks import BUS_EVENT, HEAD, Block, ChannelGroup, Spoiled, Walk, survey
from clutchid.io.formats.mdf.blocks_3 import survey3

if TYPE_CHECKING:
    from asammdf import MDF

FINISHED, UNFINISHED = b"MDF     ", b"UnFinMF "

#: The largest file that is finalised in memory, where two copies of it are needed for a moment.
MENDABLE = 300 << 20

_COUNT_CYCLES = 1
_SMALLEST = 168  # identification and header


def holds_bus_frames(path: Path) -> bool:
    """Whether an MDF 4 file holds frames of a bus; only the heads of its blocks are read.

    False also where the file is no MDF 4 file or damaged. Where a logger lost its power before it counted the frames,
    a group for them is enough.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    try:
        with contextlib.closing(_sound(path)) as stream:
            uncounted = stream.read(8) == UNFINISHED
            return any(group.flags & BUS_EVENT and (uncounted or group.cycles) for group in _surveyed(stream))
    except Spoiled:
        return False


@contextlib.contextmanager
def opened(path: Path) -> Iterator[MDF]:
    """The file at `path` as asammdf sees it, closed at the end, with its temporary files gone.

    Raises
    ------
    Spoiled
        If it is no MDF file or contradicts itself.
    MissingExtra
        If asammdf is not installed.
    OSError
        If the file cannot be read.
    """
    library = asammdf()
    with contextlib.closing(_sound(path)) as stream:
        _surveyed(stream)
        stream.seek(0)
        with quiet():
            mdf, reason = _built(library, stream)
        if mdf is None:
            raise Spoiled(reason)
        with contextlib.closing(mdf), _explained():
            yield mdf


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """No word of asammdf: it prints speeds and tracebacks to standard output and logs what it raises."""
    logger = logging.getLogger("asammdf")
    before, logger.disabled = logger.disabled, True
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        logger.disabled = before


def asammdf() -> Any:
    """The library that reads and writes MDF.

    Raises
    ------
    MissingExtra
        If it is not installed.
    """
    try:
        import asammdf as library
    except ImportError as error:
        raise MissingExtra("reading MDF needs asammdf; install it with pip install 'clutchid[mdf]'") from error
    return library


def _built(library: Any, stream: IO[bytes]) -> tuple[MDF | None, str]:
    """asammdf's object, or the reason why there is none."""
    try:
        return library.MDF(stream, process_bus_logging=False, use_display_names=False), ""
    except Exception as error:
        if _is_the_disk(error):
            raise
        reason = _reason(error)
    # what asammdf left half-made complains while it is collected, so that happens here and unheard
    before, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        gc.collect()
    finally:
        sys.unraisablehook = before
    return None, reason


@contextlib.contextmanager
def _explained() -> Iterator[None]:
    """Whatever is raised on bytes that make no sense, as a sentence."""
    try:
        yield
    except Exception as error:
        if isinstance(error, Spoiled) or _is_the_disk(error):
            raise
        raise Spoiled(_reason(error)) from error


def _is_the_disk(error: Exception) -> bool:
    """Whether an error is one of reading, not of going to a place that no file has (an address of the file's own)."""
    return isinstance(error, OSError) and error.errno != errno.EINVAL


def _reason(error: Exception) -> str:
    what = shortened(f"{type(error).__name__}: {error}", 120)
    return f"is no complete MDF file ({what}); copy it again or convert it to MDF 4.10."


def _surveyed(stream: IO[bytes]) -> tuple[ChannelGroup, ...]:
    """The channel groups of a sound MDF 4 file; none for MDF 3."""
    size = stream.seek(0, io.SEEK_END)
    stream.seek(0)
    if size < _SMALLEST:
        raise Spoiled(f"is cut off: an MDF file has at least {_SMALLEST} bytes, this one {size}; copy it again.")
    with contextlib.ExitStack() as stack, _explained():
        if isinstance(stream, io.BytesIO):
            data: memoryview | mmap.mmap = stack.enter_context(stream.getbuffer())
        else:
            data = stack.enter_context(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))
        version = bytes(data[8:16])
        if not re.fullmatch(rb"[234]\.\d\d[ \0]*", version):
            raise Spoiled(f"is MDF of the version {version!r}; read are 2, 3 and 4, so convert it to MDF 4.10.")
        if version[:1] == b"4":
            return survey(Walk(data, size))
        survey3(Walk(data, size))
        return ()


def _sound(path: Path) -> IO[bytes]:
    """The file; a copy in memory with its lengths and counts set where its logger could not do that any more."""
    stream = path.open("rb")
    start = stream.read(64)
    magic = start[:8]
    if magic == FINISHED and (start[8:9] != b"4" or not any(start[60:62])):
        stream.seek(0)
        return stream
    with stream:
        if magic not in (FINISHED, UNFINISHED):
            raise Spoiled(f"is no MDF file: it begins with {magic!r}; name a file of MDF 2, 3 or 4.")
        size = stream.seek(0, io.SEEK_END)
        if size > MENDABLE:
            raise Spoiled(
                f"was not finalised by its logger and has {size >> 20} MB; finalise it with the logger's tool."
            )
        stream.seek(0)
        data = bytearray(stream.read())
    if len(data) < _SMALLEST or data[8:9] != b"4":
        raise Spoiled("was not finalised by its logger, and only MDF 4 can be mended; finalise it with its tool.")
    with _explained():
        return io.BytesIO(_finalised(data))


def _finalised(data: bytearray) -> bytearray:
    walk = Walk(data, len(data))
    mixed = False
    for data_group in walk.chain(walk.block(64, b"##HD").link(0), b"##DG"):
        start, id_size = data_group.link(2), walk.read(data_group, "<B")[0]
        mixed = mixed or id_size > 0
        if start and data[start : start + 4] == b"##DT":
            length = _reach(data, start) - start
            struct.pack_into("<Q", data, start + 8, length)
            if not id_size and data_group.link(1):
                _count(walk, walk.block(data_group.link(1), b"##CG"), length - HEAD)
    # what remains is to count the records of mixed groups, which asammdf does while it sorts them
    struct.pack_into("<8s", data, 0, UNFINISHED if mixed else FINISHED)
    struct.pack_into("<HH", data, 60, _COUNT_CYCLES if mixed else 0, 0)
    return data


def _reach(data: bytearray, start: int) -> int:
    """Where the data block at `start` ends: as it says, or at the end of the file where it was never closed."""
    length = int(struct.unpack_from("<Q", data, start + 8)[0]) if start + HEAD <= len(data) else 0
    closed = HEAD < length <= len(data) - start
    return start + length if closed else len(data)


def _count(walk: Walk, group: Block, size: int) -> None:
    record = sum(walk.read(group, "<QQHHIII")[5:])
    if record:
        struct.pack_into("<Q", walk.data, group.body + 8, size // record)

"""MDF files opened by asammdf, finalised in a temporary copy where a logger lost its power."""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from clutchid.errors import missing
from clutchid.measurements.formats.mdf.numbers import convertible

if TYPE_CHECKING:
    from asammdf import MDF

#: First bytes of a file that its logger did not finalise; it may also say so in its flags.
_UNFINISHED = b"UnFinMF "
_FLAGS = slice(60, 62)

#: Bytes of the blocks ID and HD at the start of an MDF 4 file.
_HEADER = 64 + 104

#: The largest file that is finalised: asammdf loads it into memory meanwhile, in bytes.
_MENDABLE = 1 << 30


class BrokenMdf(ValueError):
    """A file that cannot be read; the text is the end of the sentence ``FILE: ...``."""


@contextlib.contextmanager
def opened(path: Path) -> Iterator[MDF]:
    """The file at `path` as asammdf reads it, closed at the end; the file itself is never changed.

    Raises
    ------
    BrokenMdf
        If it is no MDF file, or asammdf raises anything while it is open.
    MissingExtra
        If asammdf is not installed.
    OSError
        If the file cannot be read.
    """
    library = asammdf()
    with contextlib.closing(_readable(path)) as stream, _explained(path.stat().st_size):
        with quiet_asammdf():
            mdf = library.MDF(stream, process_bus_logging=False, use_display_names=False)
        with contextlib.closing(mdf):
            if version_of(mdf) == 3:
                _check_end(mdf, path.stat().st_size)
            _drop_clocks(mdf)
            yield mdf


def version_of(mdf: Any) -> int:
    """The generation of an MDF file, 3 (also for 2) or 4."""
    return 4 if str(mdf.version) >= "4" else 3


@contextlib.contextmanager
def quiet_asammdf() -> Iterator[None]:
    """Suppress asammdf's output: it prints speeds and tracebacks to standard output and logs what it raises."""
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
        raise missing("reading MDF", "asammdf", "mdf") from error
    return library


def _readable(path: Path) -> IO[bytes]:
    """The file, or a temporary copy of it that asammdf may finalise."""
    stream = path.open("rb")
    start = stream.read(64)
    stream.seek(0)
    if start[:8] != _UNFINISHED and not (start[8:9] == b"4" and any(start[_FLAGS])):
        return stream
    with stream:
        size = path.stat().st_size
        if start[8:9] != b"4":
            raise BrokenMdf(
                "was not finalised by its logger, and only MDF 4 can be repaired; finalise it with the tool of the "
                "logger."
            )
        if size > _MENDABLE:
            raise BrokenMdf(
                f"was not finalised by its logger and has {size >> 20} MB; finalise it with the logger's tool."
            )
        copy = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
        shutil.copyfileobj(stream, copy)
        copy.seek(0)
        return copy


def _drop_clocks(mdf: Any) -> None:
    """Remove master channels whose conversion gives no numbers: asammdf converts those by itself.

    It evaluates a formula that numexpr refuses as Python, and a file may hold any formula.
    """
    for group, index in tuple(mdf.masters_db.items()):
        if not convertible(mdf.groups[group].channels[index].conversion, version_of(mdf)):
            del mdf.masters_db[group]


def _check_end(mdf: Any, size: int) -> None:
    """Refuse an MDF 3 file whose samples end behind the file, which asammdf does not notice."""
    if mdf.identification.byte_order:
        raise BrokenMdf("is an MDF 3 file in Motorola byte order, which is not read; convert it to MDF 4 first.")
    blocks = (block for group in mdf.groups for block in group.get_data_blocks())
    end = max((block.address + block.original_size for block in blocks), default=0)
    if end > size:
        raise BrokenMdf(f"is cut off: its samples end at byte {end}, the file at {size}; copy it again.")


@contextlib.contextmanager
def _explained(size: int) -> Iterator[None]:
    """Errors on bytes that make no sense, as a sentence."""
    try:
        yield
    except Exception as error:
        if isinstance(error, BrokenMdf | MemoryError) or _is_the_disk(error):
            raise
        raise BrokenMdf(_reason(error, size)) from error


def _is_the_disk(error: Exception) -> bool:
    """Whether an error is one of reading, not of going to a place that no file has (an address of the file's own)."""
    return isinstance(error, OSError) and error.errno != errno.EINVAL


def _reason(error: Exception, size: int) -> str:
    if size < _HEADER:
        return f"is an MDF file that ends within its header, after {size} bytes; copy it again."
    if "Incomplete block" in str(error):
        return "is cut off: a block extends beyond the end of the file; copy it again."
    return (
        "is not a complete MDF file: a block is cut off, damaged, or of a kind that asammdf cannot read; copy it "
        "again or convert it to MDF 4.10."
    )

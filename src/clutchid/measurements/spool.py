"""Write a recording piece by piece while it grows, in constant memory; the file appears whole, at the end.

Until then its pieces lie one behind another in a hidden folder beside its place, each with its length and a checksum;
the file that is made of them takes their size once more, for which room is reserved as they grow. `recovered` makes it
of the pieces of a run that was killed, or whose computer lost its power. A disk that is full costs what comes later.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from itertools import chain, islice
from os import PathLike
from pathlib import Path
from struct import Struct
from typing import BinaryIO, Protocol
from zlib import crc32

from clutchid.errors import ExportError
from clutchid.files import atomic_write, reason_of, writable_target
from clutchid.log import Log, concatenated
from clutchid.measurements.formats.parquet.file import KEY
from clutchid.measurements.source import to_frame
from clutchid.systems import give_memory_back, lock, reserve

#: Numbers in a piece, which holds up a live recording for some 40 ms; and blocks that are joined before: a short one
#: takes more than its numbers.
PIECE, _BLOCKS = 1 << 19, 64

#: Suffixes of files that can be written piece by piece, and the bytes that a number takes in them at most.
SPOOLED = {".parquet": 8, ".csv": 24}

#: Start of the hidden folder's name; in it the pieces, the name of the file that they make, and the room for it.
_PREFIX, _DATA, _TARGET, _RESERVED = ".clutchid-live-", "data", "target", "free"

#: Bytes before each piece: its length and its checksum.
_HEAD = Struct("<QI")


class AddBlock(Protocol):
    """Function that adds a block to a recording; with `now` all blocks so far are on the disk behind it."""

    def __call__(self, block: Log, *, now: bool = False) -> None: ...


@contextmanager
def spooled(path: str | PathLike[str], moved: Callable[[Path], None] | None = None) -> Iterator[AddBlock]:
    """Function that adds a block to a recording, which replaces `path` when the ``with`` block ends without an error.

    On any error in the block what was written is removed, and an existing file stays unchanged. A block without samples
    defines the columns of a recording that stays empty. The metadata are those of the first block. Where the disk is
    full, the function raises, and the file holds what was added before; it must not be called again.

    Parameters
    ----------
    moved
        Called with the place of the file, in the folder for temporary files, where `path` cannot be written at the end.

    Raises
    ------
    ExportError
        If the suffix is not one of `SPOOLED`, or a file cannot be written; at the end `recovered` has the pieces.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SPOOLED:
        raise ExportError(f"{path}: a live recording is written as {' or '.join(SPOOLED)}.")
    target = writable_target(path)
    folder: Path | None = None
    try:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=target.parent))
        with (
            (folder / _TARGET).open("w", encoding="utf-8") as name,
            (folder / _DATA).open("wb+", buffering=0) as data,
            (folder / _RESERVED).open("wb") as free,
        ):
            json.dump(target.name, name)
            name.flush()
            lock(name.fileno())
            spool = _Spool(path, data, free)
            yield spool.add
            try:
                free.truncate(0)
                _make_file(target, spool.parts, folder, moved)
            except OSError as error:
                with suppress(OSError):
                    spool.write()
                place, folder = folder, None
                raise ExportError(
                    f"{error} Its samples are in {place}; the next run makes the file from them."
                ) from error
    except ExportError:
        raise
    except OSError as error:
        raise ExportError(f"{path}: cannot be written ({reason_of(error)}); no file was changed.") from error
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)


class _Spool:
    """Blocks of a recording: the last ones in memory, those before in pieces on the disk."""

    def __init__(self, path: str | PathLike[str], data: BinaryIO, free: BinaryIO) -> None:
        self._path, self._data, self._free = path, data, free
        self._suffix = Path(path).suffix.lower()
        self._blocks: list[Log] = []
        self._size = self._room = 0
        with suppress(OSError):  # a full disk is found with the first piece
            self._reserve(0)

    def add(self, block: Log, *, now: bool = False) -> None:
        """Add a block, see `AddBlock`."""
        numbers = 1 + len(block.columns)
        rows = max(PIECE // numbers, 1)
        try:
            for begin in range(0, len(block) or 1, rows):
                self._add(block.slice(begin, begin + rows), numbers)
            if now or self._suffix == ".csv":
                self.write()
            if now:
                os.fsync(self._data.fileno())
        except OSError as error:
            raise ExportError(f"{self._path}: can no longer be written ({reason_of(error)}).") from error

    def _add(self, block: Log, numbers: int) -> None:
        """Add a block of at most a piece, of so many numbers a sample."""
        size = len(block) * numbers
        if self._size + size > PIECE:
            self.write()
        if size or not (self._blocks or self._data.tell()):
            self._blocks.append(block)
            self._size += size
        if len(self._blocks) >= _BLOCKS:
            self._blocks[:] = [concatenated(self._blocks)]

    def parts(self) -> Iterator[bytes]:
        """The metadata, and the pieces: those on the disk, and what is in memory."""
        yield from _whole_parts(self._data)
        yield from self._parts_of_blocks()

    def write(self) -> None:
        """Write the blocks in memory; where that fails, nothing of them, and they stay in memory."""
        if not self._size:
            return
        begin = self._data.seek(0, os.SEEK_END)
        rest = memoryview(b"".join(_HEAD.pack(len(part), crc32(part)) + part for part in self._parts_of_blocks()))
        try:
            self._reserve(begin + len(rest))
            while rest:
                rest = rest[self._data.write(rest) :]
        except OSError:
            self._data.seek(begin)
            self._data.truncate()
            raise
        self._blocks.clear()
        self._size = 0
        give_memory_back()  # in pools a live recording grows by 20 MiB an hour

    def _parts_of_blocks(self) -> Iterator[bytes]:
        """The blocks in memory as a piece, before the first one the metadata."""
        import polars as pl

        if not self._blocks:
            return
        is_first = not self._data.tell()
        if is_first:
            yield json.dumps({KEY: json.dumps(dict(self._blocks[0].metadata))}).encode()
        frame = to_frame(concatenated(self._blocks))
        if self._suffix == ".csv":
            yield frame.with_columns(pl.all().fill_nan(None)).write_csv(include_header=is_first).encode()
        else:
            stream = BytesIO()
            frame.write_ipc_stream(stream, compression="zstd")
            yield stream.getvalue()

    def _reserve(self, size: int) -> None:
        """Reserve room for a file of so many bytes of pieces and of the next one in memory, and for those after it."""
        piece = PIECE * SPOOLED[self._suffix]
        need = size * 9 // 8 + piece
        if need > self._room:
            reserve(self._free, need + piece // 2)
            self._room = need + piece // 2


def _whole_parts(data: BinaryIO) -> Iterator[bytes]:
    """The parts of a file of pieces up to the first that is torn."""
    data.seek(0)
    while len(head := data.read(_HEAD.size)) == _HEAD.size:
        size, checksum = _HEAD.unpack(head)
        part = data.read(size)
        if not size or crc32(part) != checksum:
            return
        yield part


def _make_file(
    target: Path, parts: Callable[[], Iterator[bytes]], folder: Path, moved: Callable[[Path], None] | None
) -> None:
    """Make the file of its parts; in the folder for temporary files where that cannot be."""
    try:
        _join(target, parts, folder)
    except OSError:
        if moved is None:
            raise
        other = Path(tempfile.mkdtemp(prefix="clutchid-")) / target.name
        _join(other, parts, other.parent)
        moved(other)


def _join(target: Path, parts: Callable[[], Iterator[bytes]], folder: Path) -> None:
    """Make a file of its parts, in constant memory; until it is whole it is in a folder that goes with the pieces.

    Raises
    ------
    ExportError
        If it cannot be written.
    """
    import polars as pl
    from polars.io.plugins import register_io_source

    every = parts()
    metadata, first = next(every, b"{}"), next(every, b"")
    pieces = chain([first], every)

    def frames(*_: object) -> Iterator[pl.DataFrame]:
        return map(pl.read_ipc_stream, pieces)

    with atomic_write(target, folder) as temporary, temporary.open("wb") as file:
        if target.suffix.lower() == ".csv":
            file.writelines(pieces)
        elif first:
            table = register_io_source(frames, schema=pl.read_ipc_stream(first).schema)
            table.sink_parquet(file, metadata=json.loads(metadata))
        file.flush()
        os.fsync(file.fileno())  # before the pieces are removed


def recovered(path: str | PathLike[str]) -> list[Path]:
    """Files made of what earlier runs left that ended without writing `path`; those that still run are left alone.

    They are beside `path`, as ``NAME.recovered.parquet``. What holds no samples is removed.
    """
    target = Path(path).resolve()
    files = []
    for folder in sorted(target.parent.glob(f"{_PREFIX}*")):
        with suppress(OSError):  # with nothing in it: its run could not remove it from a write-protected folder
            folder.rmdir()
        with suppress(OSError, ValueError):
            with (folder / _TARGET).open("r+", encoding="utf-8") as name, (folder / _DATA).open("rb") as data:
                if json.load(name) != target.name or not lock(name.fileno()):
                    continue
                (folder / _RESERVED).unlink(missing_ok=True)
                if len(list(islice(_whole_parts(data), 2))) == 2:  # the metadata, and a piece
                    free = _free_name(target)
                    _join(free, lambda: _whole_parts(data), folder)
                    files.append(free)
            shutil.rmtree(folder)  # once they are closed: Windows removes no open file
    return files


def _free_name(target: Path) -> Path:
    names = (f".{number}" if number else "" for number in range(1000))
    paths = (target.with_name(f"{target.stem}.recovered{number}{target.suffix}") for number in names)
    return next(path for path in paths if not path.exists())

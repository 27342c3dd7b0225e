"""Write a recording piece by piece while it grows, in constant memory; the file appears whole, at the end.

Until then its pieces are in a hidden folder beside its place: `recovered` makes a file of what a run left there that
was killed, or whose computer lost its power. A disk that is full, or a folder that is removed, costs what comes later.
"""

from __future__ import annotations

import json
import mmap
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import BinaryIO, Protocol

from clutchid.errors import ExportError
from clutchid.files import atomic_write, reason_of, writable_target
from clutchid.log import Log, concatenated
from clutchid.measurements.formats.parquet.file import KEY
from clutchid.measurements.formats.parquet.footer import MAGIC, RowGroups, appended, footer_bytes
from clutchid.measurements.source import to_frame
from clutchid.systems import give_memory_back, lock, replace, reserve

#: Numbers in a piece of a Parquet file, which holds up a live recording for some 40 ms; and blocks that are joined
#: before: a short one takes more than its numbers.
PIECE, _BLOCKS = 1 << 19, 64

#: Suffixes of files that can be written piece by piece.
SPOOLED = (".parquet", ".csv")

#: Bytes of the disk that are kept free for the end of the file, and for what is written after it.
_RESERVE = 1 << 22

#: Fewest rows of a piece that are tried where a larger one does not fit on the disk.
_FEWEST = 256

#: Start of the hidden folder's name; in it the data, the footers behind them, and the name of the file that they make.
_PREFIX, _DATA, _FOOTER, _SYNCED, _TARGET, _RESERVED = ".clutchid-live-", "data", "footer", "synced", "target", "free"


class AddBlock(Protocol):
    """Function that adds a block to a recording; with `now` all blocks so far are on the disk behind it."""

    def __call__(self, block: Log, *, now: bool = False) -> None: ...


FileEnd = Callable[[], bytes]


@contextmanager
def spooled(path: str | PathLike[str], moved: Callable[[Path], None] | None = None) -> Iterator[AddBlock]:
    """Function that adds a block to a recording, which replaces `path` when the ``with`` block ends without an error.

    On any error what was written is removed, and an existing file stays unchanged. A block without samples defines the
    columns of a recording that stays empty. The metadata are those of the first block. Where the disk is full, the
    function raises, and the file holds what was written before, if anything was; it must not be called again. The same
    at the end.

    Parameters
    ----------
    moved
        Called with the place of the file, in the folder for temporary files, where `path` cannot be written at the end.

    Raises
    ------
    ExportError
        If the suffix is not one of `SPOOLED`, or a file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SPOOLED:
        raise ExportError(f"{path}: a recording that is not known whole is written as {' or '.join(SPOOLED)}.")
    target = writable_target(path)
    folder: Path | None = None
    try:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=target.parent))
        with (folder / _TARGET).open("w", encoding="utf-8") as name, (folder / _DATA).open("wb+", buffering=0) as data:
            json.dump(target.name, name)
            name.flush()
            lock(name.fileno())
            with suppress(OSError), (folder / _RESERVED).open("wb") as free:  # for the end, where that can be
                reserve(free, _RESERVE)
            add, end = (_as_text if suffix == ".csv" else _as_parquet)(data, folder, path)
            yield add
            trouble = None
            try:
                rest = end()
            except ExportError as error:
                trouble, rest = error, end()
            _release(folder)
            if trouble is not None and data.tell() <= len(MAGIC):
                raise trouble
            _finish(data, rest, folder / _DATA, target, moved)
            if trouble is not None:
                raise trouble
    except ExportError:
        raise
    except OSError as error:
        raise ExportError(f"{path}: cannot be written ({reason_of(error)}); no file was changed.") from error
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)


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
            with (folder / _TARGET).open("r+", encoding="utf-8") as name:
                if json.load(name) != target.name or not lock(name.fileno()):
                    continue
                if _is_whole(folder, target.suffix.lower()):
                    free = _free_name(target)
                    replace(folder / _DATA, free)
                    files.append(free)
            shutil.rmtree(folder)  # once it is closed: Windows removes no open file
    return files


def cut_behind(path: Path, time: float) -> None:
    """Cut a file of a recording before its first sample at or after `time` in s; without any other it is removed.

    Raises
    ------
    ExportError
        If it cannot be written; it is unchanged then.
    """
    import polars as pl

    text = path.suffix.lower() == ".csv"
    try:
        table = pl.scan_csv(path, infer_schema=False) if text else pl.scan_parquet(path)
        earlier = pl.col("time [s]").cast(pl.Float64) < time
        earlier_rows, count = table.select(earlier.sum().alias("kept"), pl.len().alias("count")).collect().row(0)
        if earlier_rows == count:
            return
        if not earlier_rows:
            path.unlink()
            return
        with atomic_write(path) as temporary:
            if text:
                table.filter(earlier).sink_csv(temporary)
            else:
                metadata = {name: value for name, value in pl.read_parquet_metadata(path).items() if name == KEY}
                table.filter(earlier).sink_parquet(temporary, metadata=metadata)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise ExportError(f"{path}: cannot be cut ({error}); it is unchanged.") from error


def _is_whole(folder: Path, suffix: str) -> bool:
    """Whether the data of a run that was killed could be made a file of the samples that are whole."""
    data = folder / _DATA
    if suffix == ".csv":
        if not data.stat().st_size:
            return False
        with data.open("rb+") as file:
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
                end = text.rfind(b"\n") + 1
            file.truncate(end)
        return end > 0
    import polars as pl

    for footer in (folder / _FOOTER, folder / _SYNCED):
        with suppress(OSError, ValueError, pl.exceptions.PolarsError):
            content = footer.read_bytes()
            end = int.from_bytes(content[:8], "little")
            with data.open("rb+") as file:
                if file.seek(0, os.SEEK_END) < end:
                    continue
                file.seek(end)
                file.write(content[8:])
                file.truncate()
            if pl.scan_parquet(data).select(pl.len(), pl.all().sum().name.prefix("sum ")).collect()["len"][0]:
                return True
    return False


def _free_name(target: Path) -> Path:
    names = (f".{number}" if number else "" for number in range(1000))
    paths = (target.with_name(f"{target.stem}.recovered{number}{target.suffix}") for number in names)
    return next(path for path in paths if not path.exists())


def _release(folder: Path) -> None:
    with suppress(OSError):
        (folder / _RESERVED).unlink(missing_ok=True)


def _finish(data: BinaryIO, end: bytes, source: Path, target: Path, moved: Callable[[Path], None] | None) -> None:
    """Write the end of a file, and give it its name; in the folder for temporary files where that cannot be."""
    try:
        _all(data, end)
        os.fsync(data.fileno())
        if target.exists():
            shutil.copymode(target, source)
        else:
            mask = os.umask(0)
            os.umask(mask)
            source.chmod(0o666 & ~mask)
        data.close()  # Windows replaces no open file
        replace(source, target)
    except OSError:
        if moved is None:
            raise
        with source.open("rb") if data.closed else data as written:
            moved(_copied(written, end, target.name))


def _copied(data: BinaryIO, end: bytes, name: str) -> Path:
    """A copy of an open file, with its end, in the folder for temporary files."""
    other = Path(tempfile.mkdtemp(prefix="clutchid-")) / name
    with other.open("wb") as file:
        data.seek(max(data.seek(0, os.SEEK_END) - len(end), 0))
        whole = data.read(len(end)) == end
        data.seek(0)
        shutil.copyfileobj(data, file)
        if not whole:
            file.write(end)
    return other


def _all(file: BinaryIO, content: bytes) -> None:
    """Write all bytes at the place of an unbuffered file; where that fails, none of them."""
    begin, rest = file.tell(), memoryview(content)
    try:
        while rest:
            rest = rest[file.write(rest) :]
    except OSError:
        file.seek(begin)
        file.truncate()
        raise


def _as_text(data: BinaryIO, _folder: Path, path: str | PathLike[str]) -> tuple[AddBlock, FileEnd]:
    import polars as pl

    begun = False

    def add(block: Log, *, now: bool = False) -> None:
        nonlocal begun
        if len(block) or not begun:
            text = to_frame(block).with_columns(pl.all().fill_nan(None)).write_csv(include_header=not begun)
            with _until(path):
                _all(data, text.encode())
            begun = True
        if now:
            with _until(path):
                os.fsync(data.fileno())

    return add, lambda: b""


def _as_parquet(data: BinaryIO, folder: Path, path: str | PathLike[str]) -> tuple[AddBlock, FileEnd]:
    """Blocks are collected to pieces, each a row group behind the ones before."""
    held: list[Log] = []
    metadata: dict[str, str] = {}
    groups, size, stopped = RowGroups(), 0, False
    _all(data, MAGIC)

    def write(log: Log) -> None:
        nonlocal groups
        whole = BytesIO()
        to_frame(log).write_parquet(whole, metadata=metadata)
        after, content = appended(groups, whole.getvalue())
        _all(data, content)
        groups = after
        _note(folder / _FOOTER, groups)

    def write_piece() -> None:
        nonlocal size, stopped
        piece = concatenated(held)
        held.clear()
        size = 0
        try:
            with _until(path):
                write(piece)
        except ExportError:
            stopped = True
            _write_part(write, piece)
            raise
        del piece
        give_memory_back()  # in pools a live recording grows by 20 MiB an hour

    def add(block: Log, *, now: bool = False) -> None:
        nonlocal size
        if not metadata:
            metadata[KEY] = json.dumps(dict(block.metadata))
        if len(block) or not (held or groups.footer):
            held.append(block)
            size += len(block) * (1 + len(block.columns))
        if len(held) >= _BLOCKS:
            held[:] = [concatenated(held)]
        if size >= PIECE or (now and size):
            write_piece()
        if now:
            with _until(path):
                os.fsync(data.fileno())
            _note(folder / _SYNCED, groups, synced=True)

    def end() -> bytes:
        if 8 * size <= _RESERVE // 4:  # a part of what is kept free for the end; a larger piece must leave it
            _release(folder)
        if held and not stopped:
            write_piece()
        return footer_bytes(groups) if groups.footer else b""

    return add, end


def _write_part(write: Callable[[Log], None], piece: Log) -> None:
    """Write as much of a piece as fits."""
    begin, rows = 0, len(piece) // 2
    while rows >= _FEWEST:
        try:
            write(piece.slice(begin, begin + rows))
            begin += rows
        except OSError:
            rows //= 2


def _note(path: Path, groups: RowGroups, *, synced: bool = False) -> None:
    """Note the footer of what is written, for `recovered`; where that cannot be, the recording goes on."""
    with suppress(OSError):
        temporary = path.with_suffix(".new")
        with temporary.open("wb") as file:
            file.write(groups.end.to_bytes(8, "little") + footer_bytes(groups))
            file.flush()
            if synced:
                os.fsync(file.fileno())
        replace(temporary, path)


@contextmanager
def _until(path: str | PathLike[str]) -> Iterator[None]:
    """An error while a file grows, as the sentence about it."""
    try:
        yield
    except OSError as error:
        raise ExportError(f"{path}: cannot be written any further ({reason_of(error)}).") from error

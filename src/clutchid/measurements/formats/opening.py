"""Open a file of any known format in this process: its reader is loaded on demand, a packed file unpacked first."""

from __future__ import annotations

import gzip
import shutil
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from clutchid.errors import DataError
from clutchid.files import reading
from clutchid.measurements.formats.kinds import format_of, function_named, head_of, kind_of, readable_kind
from clutchid.measurements.source import Source, Table
from clutchid.measurements.suffixes import PACKED

#: Bytes to which a packed file may unpack on the disk, and bytes that are unpacked at a time.
_MOST_UNPACKED = 8_000_000_000
_CHUNK = 1 << 20


def opened_here(file: Path, dbc: Sequence[Path], kind: str = "") -> Source:
    """Open a file of any known format in this process; `kind` is its format where that is known already.

    Raises
    ------
    DataError
        If it cannot be read; problems inside a recording are in ``Source.problems``.
    MissingExtra
        If the format needs a library that is not installed.
    """
    with reading(file):
        source = _opened(file, dbc, kind or kind_of(head_of(file)))
    if source.rasters or source.problems:
        return source
    return replace(source, problems=(f"contains no numeric channel. {' '.join(source.warnings)}".strip(),), warnings=())


def _opened(file: Path, dbc: Sequence[Path], kind: str) -> Source:
    """The file as its format is opened, by the frames in it where a DBC is given or there is nothing else."""
    if kind == "gzip":
        return _unpacked(file, dbc)
    row, log = format_of(kind), None
    if row.opener:
        frame_log = function_named(row.frames) if row.frames else lambda _file: None
        log = frame_log(file) if dbc else None
        if log is None:
            source: Source = function_named(row.opener)(file)
            log = None if source.rasters or source.problems else frame_log(file)
            if log is None:
                return source
            dbc = ()
    from clutchid.measurements.formats.can import file as can_file

    return can_file.open_file(file, dbc, kind, log)


def _unpacked(file: Path, dbc: Sequence[Path]) -> Source:
    """The recording in a gzip file, unpacked to a temporary file that is deleted with its reader."""
    folder = tempfile.TemporaryDirectory(prefix="clutchid-")
    name = file.stem if file.suffix.lower() in PACKED else file.name
    inner = Path(folder.name, name)
    with _named(file, inner):
        _unpack(file, inner)
        kind = readable_kind(inner)
        if kind == "gzip":
            raise DataError(f"{file}: is packed twice; unpack it once.")
        source = opened_here(inner, dbc, kind)

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Tables of the unpacked file, see `Tables`; its folder is deleted with this function."""
        with _named(file, Path(folder.name, name)):
            yield from source.tables(raster, columns, rows)

    return replace(source, path=file, tables=tables)


@contextmanager
def _named(file: Path, inner: Path) -> Iterator[None]:
    """Errors in the unpacked file as errors that name the packed one."""
    try:
        yield
    except DataError as error:
        raise DataError(str(error).replace(str(inner), str(file))) from error


def _unpack(file: Path, to: Path) -> None:
    most = min(_MOST_UNPACKED, shutil.disk_usage(to.parent).free // 2)
    try:
        with gzip.open(file, "rb") as packed, to.open("wb") as plain:
            size = 0
            while chunk := packed.read(_CHUNK):
                size += len(chunk)
                if size > most:
                    raise DataError(f"{file}: unpacks to more than {most / 1e9:.3g} GB; unpack and shorten it.")
                plain.write(chunk)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise DataError(f"{file}: is not a complete gzip file ({error}); copy it again.") from error

"""Open a recording: the format is detected from the content, and its reader is loaded on demand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from clutchid.errors import ClutchidError, DataError
from clutchid.io.files import plain_file
from clutchid.io.source import Source

#: Number of bytes at the start of a file that determine its format.
_ENOUGH = 1024


def open_source(path: str | PathLike[str], dbc: Sequence[str | PathLike[str]] = ()) -> Source:
    """Open a file of any known format; `dbc` files decode the frames of a bus log.

    Raises
    ------
    DataError
        If the recording or a DBC file is not a readable plain file; problems inside the recording are in
        ``Source.problems``.
    MissingExtra
        If the format needs a library that is not installed.
    """
    file = plain_file(path)
    try:
        source = _opened(file, [plain_file(name, "DBC file") for name in dbc])
    except OSError as error:
        if isinstance(error, ClutchidError):
            raise
        raise DataError(f"{file}: cannot be read ({error.strerror or error}).") from error
    if source.rasters or source.problems:
        return source
    return replace(source, problems=(f"contains no numeric channel. {' '.join(source.warnings)}".strip(),), warnings=())


def _opened(file: Path, dbc: Sequence[Path]) -> Source:
    with file.open("rb") as stream:
        head = stream.read(_ENOUGH)
    if head[:8] in (b"MDF     ", b"UnFinMF "):
        return _mdf(file, dbc)
    if head[:4] == b"PAR1":
        from clutchid.io.formats.parquet import file as parquet_file

        return parquet_file.open_file(file)
    if head[:4] == b"LOGG":
        return _can(file, dbc)
    if b"\0" in head:  # not text, except UTF-16
        from clutchid.io.formats.mat import file as mat_file

        if mat_file.is_mat(head):
            return mat_file.open_file(file)
    from clutchid.io.formats.can import asc as asc_file
    from clutchid.io.formats.csv import file as csv_file

    return _can(file, dbc) if asc_file.is_asc(head) else csv_file.open_file(file)


def _can(file: Path, dbc: Sequence[Path]) -> Source:
    from clutchid.io.formats.can import file as can_file

    return can_file.open_file(file, dbc)


def _mdf(file: Path, dbc: Sequence[Path]) -> Source:
    """An MDF file with measured channels, or with bus frames if a DBC file is given."""
    from clutchid.io.formats.can import mf4 as mf4_bus
    from clutchid.io.formats.mdf import file as mdf_file

    if dbc and mf4_bus.holds_bus_frames(file):
        return _can(file, dbc)
    source = mdf_file.open_file(file)
    silent = not (source.rasters or source.problems)
    return _can(file, ()) if silent and mf4_bus.holds_bus_frames(file) else source

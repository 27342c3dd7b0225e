"""MDF 4 and MDF 3 through asammdf: a group of channels is a raster, its master the stamps."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import DataError, ExportError
from clutchid.log import FloatArray, Log, name_and_unit
from clutchid.recordings.formats.mdf.layout import Layout, Place, comment_of, layouts, metadata_of
from clutchid.recordings.formats.mdf.numbers import converted
from clutchid.recordings.formats.mdf.opening import Spoiled, asammdf, opened, quiet, version_of
from clutchid.recordings.formats.mdf.raw import blocks
from clutchid.recordings.source import BLOCK, Source, refused
from clutchid.recordings.table import Places, Table

_UNKNOWN_START = datetime.fromtimestamp(0, UTC)
_TRANSPOSED = 2


def open_file(path: Path) -> Source:
    """An MDF file, opened: a raster a channel group that has samples.

    Groups without samples, groups of raw bus frames, and channels that are no single numbers are left out; the warnings
    count them.

    Parameters
    ----------
    path
        The file, MDF 2 to 4, sorted or not, finalised or not.

    Returns
    -------
    source
        `problems` say what is wrong inside the file; then it has no rasters.

    Raises
    ------
    MissingExtra
        If asammdf is not installed.
    OSError
        If the file cannot be read.
    """
    try:
        with opened(path) as mdf:
            found, warnings = layouts(mdf)
            metadata = metadata_of(mdf)
            version = str(mdf.version)
    except Spoiled as error:
        return refused(path, "MDF", str(error))
    rasters = tuple(layout.raster for layout in found)
    return Source(path, f"MDF {version}", rasters, _Reader(path, found), (), warnings, metadata)


def save(log: Log, path: Path) -> None:
    """Write `log` in SI as MDF 4.10 with its metadata; a missing sample is NaN.

    One group, master `time` in s, deflated after transposition. The start of the measurement is the metadata's `start`
    where that is a time in ISO 8601.

    Raises
    ------
    MissingExtra
        If asammdf is not installed.
    ExportError
        If the log has no column beside the time.
    OSError
        If the file cannot be written.
    """
    if not log.columns:
        raise ExportError(f"{path}: the log has no column beside the time, but MDF needs a channel; add one.")
    library = asammdf()
    with contextlib.closing(library.MDF(version="4.10")) as mdf, quiet():
        mdf.header.start_time = _start(log)
        mdf.header.comment = comment_of(log.metadata)
        first = slice(0, BLOCK)
        signals = [
            library.Signal(values[first], log.time[first], unit=unit, name=label)
            for column, values in log.columns.items()
            for label, unit in [name_and_unit(column)]
        ]
        mdf.append(signals, acq_name=log.name, comment="", common_timebase=True)
        for start in range(BLOCK, len(log), BLOCK):
            rows = slice(start, start + BLOCK)
            mdf.extend(0, [(values[rows], None) for values in (log.time, *log.columns.values())])
        with path.open("wb+") as file:  # a name would be given another suffix
            mdf.save(file, compression=_TRANSPOSED)


@dataclass(frozen=True, slots=True)
class _Reader:
    """Reads channels of one raster, block by block; the file is open while a reading goes on."""

    path: Path
    layouts: tuple[Layout, ...]

    def __call__(self, raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        layout = self.layouts[raster]
        places = {column: layout.places[column] for column in columns}
        size = layout.raster.size
        try:
            with opened(self.path) as mdf:
                rules = {i: mdf.groups[place.group].channels[place.index].conversion for i, place in places.items()}
                for first in range(0, size, rows or size):
                    count = min(rows or size, size - first)
                    numbers = _numbers(mdf, places, rules, first, count)
                    yield Table(layout.raster.headings, numbers, count, Places("sample", first + 1))
        except Spoiled as error:
            raise DataError(f"{self.path}: {error}") from error


def _numbers(
    mdf: Any, places: Mapping[int, Place], rules: Mapping[int, Any], first: int, count: int
) -> dict[int, FloatArray]:
    """Samples `first` to `first + count` of the channels at `places`, converted by their `rules`."""
    version = version_of(mdf)
    numbers = {column: np.empty(count) for column in places}
    for column, place in places.items():
        if place.counted:
            numbers[column][:] = converted(np.arange(first, first + count), rules[column], version)
    stored = {column: (place.group, place.index) for column, place in places.items() if not place.counted}
    for rows, samples in blocks(mdf, list(stored.values()), first, count) if stored else ():
        there = slice(rows.start - first, rows.stop - first)
        for column, (raw, invalid) in zip(stored, samples, strict=True):
            numbers[column][there] = converted(raw, rules[column], version)
            if invalid is not None:
                numbers[column][there][invalid] = np.nan
    return numbers


def _start(log: Log) -> datetime:
    """When the measurement started; 1970 where the log does not say it."""
    try:
        return datetime.fromisoformat(log.metadata.get("start", ""))
    except ValueError:
        return _UNKNOWN_START

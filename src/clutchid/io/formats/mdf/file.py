"""MDF 4 and MDF 3 through asammdf: a group of channels is a raster, its master the stamps.

asammdf finds the blocks, sorts mixed records and keeps the conversions; the samples are cut out of the records here,
block by block. Its `get` interpolates, reads a whole channel to return a part of it, and drops what is marked invalid.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError, ExportError
from clutchid.io.formats.mdf.blocks import Spoiled
from clutchid.io.formats.mdf.layout import Layout, Place, comment_of, layouts, metadata_of, version_of
from clutchid.io.formats.mdf.numbers import converted, unpacked, valid
from clutchid.io.formats.mdf.opening import asammdf, holds_bus_frames, opened, quiet
from clutchid.io.source import BLOCK, Source
from clutchid.io.table import Places, Table
from clutchid.log import FloatArray, Log, name_and_unit

__all__ = ["holds_bus_frames", "open_file", "save"]

#: Bytes of records that are in memory at a time.
_CHUNK = 1 << 26

_UNKNOWN_START = datetime.fromtimestamp(0, UTC)
_TRANSPOSED = 2

_Bytes = NDArray[np.uint8]


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
        return Source(path, "MDF", (), _Reader(path, ()), (str(error),))
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
                for first in range(0, size, rows or size):
                    count = min(rows or size, size - first)
                    numbers = _numbers(mdf, places, first, count)
                    yield Table(layout.raster.headings, numbers, count, Places("sample", first + 1))
        except Spoiled as error:
            raise DataError(f"{self.path}: {error}") from error


def _numbers(mdf: Any, places: Mapping[int, Place], first: int, count: int) -> dict[int, FloatArray]:
    """Samples `first` to `first + count` of the channels at `places`."""
    numbers = {column: np.empty(count) for column in places}
    for number in {place.group for place in places.values()}:
        filled = 0
        for records, invalid in _records(mdf, number, first, count):
            rows = slice(filled, filled + len(records))
            for column, place in places.items():
                if place.group == number:
                    numbers[column][rows] = _values(mdf, place, records, invalid, first + filled)
            filled += len(records)
        if filled < count:
            raise Spoiled(f"is cut off: group {number + 1} ends after sample {first + filled}; copy it again.")
    return numbers


def _values(mdf: Any, place: Place, records: _Bytes, invalid: _Bytes | None, first: int) -> FloatArray:
    bits = place.bits
    raw = unpacked(records, bits) if bits.size else np.arange(first, first + len(records))
    values = converted(raw, mdf.groups[place.group].channels[place.index].conversion, version_of(mdf))
    if bits.invalid is None or invalid is None:
        return values
    return np.where(valid(invalid, bits.invalid), values, np.nan)


def _records(mdf: Any, number: int, first: int, count: int) -> Iterator[tuple[_Bytes, _Bytes | None]]:
    """The bytes of consecutive records of a group, and of their invalidation bits where it has some."""
    group, version = mdf.groups[number], version_of(mdf)
    size = int(group.channel_group.samples_byte_nr)
    extra = int(group.channel_group.invalidation_bytes_nr) if version == 4 else 0
    apart = version == 4 and group.uses_ld
    width = size if apart else size + extra
    step = max(1, _CHUNK // width)
    mdf.configure(read_fragment_size=step * width)
    for start in range(first, first + count, step):
        parts = mdf._mdf._load_data(group, record_offset=start, record_count=min(step, first + count - start))
        for part in parts:
            data, marks = (part.data, part.invalidation_data) if version == 4 else (part[0], None)
            table = _table(data, width)
            if apart and extra:
                yield table, _table(marks, extra)
            else:
                yield table[:, :size], table[:, size:] if extra else None


def _table(data: Any, width: int) -> _Bytes:
    rows = len(data) // width
    return np.frombuffer(data, dtype=np.uint8, count=rows * width).reshape(rows, width)


def _start(log: Log) -> datetime:
    """When the measurement started; 1970 where the log does not say it."""
    try:
        return datetime.fromisoformat(log.metadata.get("start", ""))
    except ValueError:
        return _UNKNOWN_START

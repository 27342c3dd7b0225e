"""MDF 4 and MDF 3 through asammdf: a group is a raster, its master the stamps, read block by block."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError, ExportError
from clutchid.log import FloatArray, Log, name_and_unit
from clutchid.measurements.formats.mdf.layout import ChannelPlace, comment_of, layouts, metadata_of
from clutchid.measurements.formats.mdf.numbers import converted, has_texts
from clutchid.measurements.formats.mdf.opening import BrokenMdf, asammdf, opened, quiet_asammdf, version_of
from clutchid.measurements.source import BLOCK, Places, Source, Table, refused

#: Bytes of records that asammdf loads at a time.
_CHUNK = 1 << 24

#: Group and index of a channel; its raw samples, and where they are invalid.
_Channel = tuple[int, int]
_Samples: TypeAlias = tuple[NDArray[Any], NDArray[np.bool_] | None]


def sample_blocks(
    mdf: Any, channels: Sequence[_Channel], first: int, count: int
) -> Iterator[tuple[slice, list[_Samples]]]:
    """Raw samples of `channels` on one time grid in consecutive blocks, each with its place in the file.

    All channels are read in one pass. asammdf's `select` stops silently at what it cannot read and leaves the rest
    undefined, so each call reads one fragment, whose size is checked before: then nothing is undefined.

    Raises
    ------
    BrokenMdf
        If a group has fewer records than it claims.
    """
    groups = {group for group, _ in channels}
    groups |= {mdf.virtual_groups_map[group] for group in groups}
    mixed = any(not mdf.groups[group].sorted for group in groups)
    for group in () if mixed else groups:
        _check(mdf, group, first + count)
    step = max(1, _CHUNK // sum(_width(mdf, group) for group in groups))
    mdf.configure(read_fragment_size=_CHUNK)
    for start in range(first, first + count, count if mixed else step):
        rows = slice(start, first + count if mixed else min(start + step, first + count))
        yield rows, _samples(mdf, channels, rows, mixed)


def _samples(mdf: Any, channels: Sequence[_Channel], rows: slice, mixed: bool) -> list[_Samples]:
    """Raw samples; asammdf reads mixed records of MDF 3 as a whole only."""
    wanted = [(None, group, index) for group, index in channels]
    first, count = (0, None) if mixed else (rows.start, rows.stop - rows.start)
    try:
        with quiet_asammdf():
            signals = mdf.select(wanted, first, raw=True, copy_master=False, record_count=count)
    except KeyError as error:  # it found nothing that it could read
        raise BrokenMdf(f"is damaged within samples {rows.start + 1:,} to {rows.stop:,}; copy it again.") from error
    stored = [(signal.samples, signal.invalidation_bits) for signal in signals]
    return [(samples[rows], None) for samples, _ in stored] if mixed else stored


def _width(mdf: Any, number: int) -> int:
    group = mdf.groups[number].channel_group
    return int(group.samples_byte_nr) + (int(group.invalidation_bytes_nr) if version_of(mdf) == 4 else 0)


def _check(mdf: Any, number: int, needed: int) -> None:
    group = mdf.groups[number]
    size = int(group.channel_group.samples_byte_nr) if group.uses_ld else _width(mdf, number)
    there = sum(int(block.original_size) for block in group.get_data_blocks()) // size
    if there < needed:
        raise BrokenMdf(f"is cut off: group {number + 1} should have {needed} samples and has {there}; copy it again.")


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
            groups, warnings = layouts(mdf)
            metadata = metadata_of(mdf)
            version = str(mdf.version)
    except BrokenMdf as error:
        return refused(path, "MDF", str(error))

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Tables of one time grid; the file is open while they are read."""
        headings, size = groups[raster].raster.headings, groups[raster].raster.size
        places = {column: groups[raster].places[column] for column in columns}
        try:
            with opened(path) as mdf:
                rules = {i: mdf.groups[place.group].channels[place.index].conversion for i, place in places.items()}
                texts = [i for i, rule in rules.items() if has_texts(rule, version_of(mdf))]
                for first in range(0, size, rows or size):
                    count = min(rows or size, size - first)
                    numbers = _numbers(mdf, places, rules, first, count)
                    none = {headings[i].text: n for i in texts if (n := int(np.isnan(numbers[i]).sum()))}
                    said = (
                        f"{name}: {n:,} samples are text instead of numbers and count as missing."
                        for name, n in none.items()
                    )
                    yield Table(headings, numbers, count, Places("sample", first + 1), warnings=tuple(said))
        except BrokenMdf as error:
            raise DataError(f"{path}: {error}") from error

    rasters = tuple(layout.raster for layout in groups)
    return Source(path, f"MDF {version}", rasters, tables, (), warnings, metadata)


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
    with contextlib.closing(library.MDF(version="4.10")) as mdf, quiet_asammdf():
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


def _numbers(
    mdf: Any, places: Mapping[int, ChannelPlace], rules: Mapping[int, Any], first: int, count: int
) -> dict[int, FloatArray]:
    """Samples `first` to `first + count` of the channels at `places`, converted by their `rules`."""
    version = version_of(mdf)
    numbers = {column: np.empty(count) for column in places}
    for column, place in places.items():
        if place.counted:
            numbers[column][:] = converted(np.arange(first, first + count), rules[column], version)
    stored = {column: (place.group, place.index) for column, place in places.items() if not place.counted}
    for rows, samples in sample_blocks(mdf, list(stored.values()), first, count) if stored else ():
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

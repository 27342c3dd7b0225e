"""Samples of an opened MDF file in bulk, block by block, as they are stored: before their conversions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.recordings.formats.mdf.opening import Spoiled, quiet, version_of

#: Bytes of records that asammdf loads at a time.
CHUNK = 1 << 24

#: Group and index of a channel; its raw samples, and where they are invalid.
Channel = tuple[int, int]
Samples = tuple[NDArray[Any], NDArray[np.bool_] | None]


def blocks(mdf: Any, channels: Sequence[Channel], first: int, count: int) -> Iterator[tuple[slice, list[Samples]]]:
    """Raw samples of `channels` on one time grid in consecutive blocks, each with its place in the file.

    All channels are read in one pass. asammdf's `select` stops silently at what it cannot read and leaves the rest
    undefined, so each call reads one fragment, whose size is checked before: then nothing is undefined.

    Raises
    ------
    Spoiled
        If a group has fewer records than it claims.
    """
    groups = {group for group, _ in channels}
    groups |= {mdf.virtual_groups_map[group] for group in groups}
    mixed = any(not mdf.groups[group].sorted for group in groups)
    for group in () if mixed else groups:
        _check(mdf, group, first + count)
    step = max(1, CHUNK // sum(_width(mdf, group) for group in groups))
    mdf.configure(read_fragment_size=CHUNK)
    for start in range(first, first + count, count if mixed else step):
        rows = slice(start, first + count if mixed else min(start + step, first + count))
        yield rows, _samples(mdf, channels, rows, mixed)


def _samples(mdf: Any, channels: Sequence[Channel], rows: slice, mixed: bool) -> list[Samples]:
    """Raw samples; asammdf reads mixed records of MDF 3 as a whole only."""
    wanted = [(None, group, index) for group, index in channels]
    first, count = (0, None) if mixed else (rows.start, rows.stop - rows.start)
    try:
        with quiet():
            signals = mdf.select(wanted, first, raw=True, copy_master=False, record_count=count)
    except KeyError as error:  # it found nothing that it could read
        raise Spoiled(f"is damaged within samples {rows.start + 1:,} to {rows.stop:,}; copy it again.") from error
    found = [(signal.samples, signal.invalidation_bits) for signal in signals]
    return [(samples[rows], None) for samples, _ in found] if mixed else found


def _width(mdf: Any, number: int) -> int:
    group = mdf.groups[number].channel_group
    return int(group.samples_byte_nr) + (int(group.invalidation_bytes_nr) if version_of(mdf) == 4 else 0)


def _check(mdf: Any, number: int, needed: int) -> None:
    group = mdf.groups[number]
    size = int(group.channel_group.samples_byte_nr) if group.uses_ld else _width(mdf, number)
    there = sum(int(block.original_size) for block in group.get_data_blocks()) // size
    if there < needed:
        raise Spoiled(f"is cut off: group {number + 1} claims {needed} samples and holds {there}; copy it again.")

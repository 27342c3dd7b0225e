"""Bins of about 10 ms: median position, state of the supply valve, and position relative to the vented rest."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.recordings.strokes.rest_level import BoolArray, RestLevel, ranges
from clutchid.recordings.strokes.stream import Samples

#: Length of a bin in s: a tenth of the shortest stroke.
BIN = 0.01

#: Up to this duty cycle a valve stays closed: no solenoid responds to less.
CLOSED = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Bins:
    """Bins of consecutive samples, one row each.

    Index of the first sample, time in s and number of samples; median position and pressure (NaN: none); position with
    gaps filled by the last known one; whether the supply is closed, the position is within the band of the vented rest,
    and still; half width of the noise band of a piston at rest, level of the rest and reach at that time, in m.
    """

    first: NDArray[np.int64]
    time: FloatArray
    count: NDArray[np.int64]
    position: FloatArray
    pressure: FloatArray
    filled: FloatArray
    closed: BoolArray
    inside: BoolArray
    still: BoolArray
    near: FloatArray
    level: FloatArray
    reach: FloatArray

    def __len__(self) -> int:
        return int(self.first.size)

    def part(self, start: int, stop: int) -> Bins:
        """Bins `start` to `stop` (exclusive)."""
        return Bins(*(getattr(self, field.name)[start:stop] for field in fields(Bins)))

    def followed_by(self, other: Bins) -> Bins:
        """These bins and the next ones."""
        return Bins(*(np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(Bins)))


@dataclass(frozen=True, slots=True, eq=False)
class RawBins:
    """Bins before the level of the rest is known; `filled` is the position with gaps filled by the last known one."""

    first: NDArray[np.int64]
    time: FloatArray
    count: NDArray[np.int64]
    position: FloatArray
    filled: FloatArray
    pressure: FloatArray
    closed: BoolArray


def samples_in_bin(interval: float) -> int:
    """Number of samples per bin at a sampling interval in s."""
    return max(1, round(BIN / interval)) if interval > 0 else 1


def raw_bins(samples: Samples, width: int, before: float) -> RawBins:
    """Bins of `width` samples, the last one shorter; `before` is the last known position in m before them."""
    n = len(samples)
    edges = np.arange(0, n, width)
    position = _by_bin(samples.columns["position"], width)
    pressure = (
        _by_bin(samples.columns["pressure_a"], width)
        if "pressure_a" in samples.columns
        else np.full(edges.size, np.nan)
    )
    supply = samples.columns.get("duty_supply")
    closed = np.ones(edges.size, dtype=bool) if supply is None else np.maximum.reduceat(supply, edges) <= CLOSED
    return RawBins(
        first=samples.first + edges.astype(np.int64),
        time=samples.time[edges],
        count=np.diff(np.append(edges, n)).astype(np.int64),
        position=position,
        filled=_filled(position, before),
        pressure=pressure,
        closed=closed,
    )


def relative_to_rest(raw: RawBins, rest: RestLevel, width: int) -> Bins:
    """Bins compared with the level of the rest; `width` bins cover the time over which a position counts as still."""
    away = np.abs(raw.filled - rest.level)
    size = raw.first.size
    return Bins(
        raw.first, raw.time, raw.count, raw.position, raw.pressure, raw.filled, raw.closed,
        inside=away <= rest.band,
        still=~(ranges(raw.filled, width) > rest.creep),
        near=np.full(size, rest.near),
        level=np.full(size, rest.level),
        reach=np.full(size, rest.reach),
    )  # fmt: skip


def _by_bin(values: FloatArray, width: int) -> FloatArray:
    full = values.size // width * width
    whole = _median(values[:full].reshape(-1, width))
    return whole if full == values.size else np.append(whole, _median(values[None, full:]))


def _median(rows: FloatArray) -> FloatArray:
    """Median of the finite values of each row, NaN where there are none."""
    if rows.shape[1] == 1:
        return np.where(np.isfinite(rows[:, 0]), rows[:, 0], np.nan)
    if not np.isfinite(rows).all():
        rows = np.where(np.isfinite(rows), rows, np.nan)
    ordered = np.sort(rows, axis=1)
    count = rows.shape[1] - np.count_nonzero(np.isnan(ordered), axis=1)
    row = np.arange(len(rows))
    middle: FloatArray = 0.5 * (ordered[row, np.maximum(count - 1, 0) // 2] + ordered[row, count // 2])
    return middle


def _filled(position: FloatArray, before: float) -> FloatArray:
    """Fill gaps of `position` with the last known value or `before`; at the very beginning with the next value."""
    known = np.isfinite(position)
    if known.all():
        return position
    if not known.any():
        return np.full(position.size, before)
    at = np.maximum.accumulate(np.where(known, np.arange(position.size), -1))
    start = before if np.isfinite(before) else float(position[np.argmax(known)])
    return np.where(at >= 0, position[np.maximum(at, 0)], start)

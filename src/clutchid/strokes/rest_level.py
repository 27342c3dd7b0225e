"""Level of the vented rest, noise and reach, block by block, and bins of 10 ms relative to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from clutchid.log import BoolArray, FloatArray
from clutchid.strokes.stream import StrokeSamples
from clutchid.strokes.stroke import QUICKEST

#: Time in s over which a position counts as still, and shortest rest.
STILL = 0.15

#: Fraction of the windows that counts as calm; the noise estimate is poor if the piston is still for less than that.
CALM = 0.1

#: The piston moves in a block whose positions span more than this many calm windows; noise and vibration span about 3.
_MOVES = 5.0

#: Fractions of the reach: half width of the band that counts as at rest, change within `STILL` s that counts as still,
#: and upper limit of the noise estimate while the piston moves.
REST_BAND, CREEP, _MOST_NOISE = 0.02, 0.01, 0.03

#: The lowest rest is vented only if the piston goes no further below it than this fraction of the reach: a cylinder
#: that cycles may be still at the far end only.
LOW_END = 0.15

#: While the piston moves, windows that range over more than this many standard deviations of the noise are not calm:
#: 15 samples of white noise have 3.5, vibration of 10 Hz has 12, and a cylinder that turns around in a second has 60.
_ROUGH = 10.0

#: Largest factor by which the noise changes from block to block, and forgetting factor of an outlying reach.
_GROWTH, _FADING = 1.25, 0.02

#: After this many moving blocks without a rest at the level, the lowest rest is the new level: the zero has changed.
_LOST = 3


@dataclass(frozen=True, slots=True)
class RestLevel:
    """Estimates so far: level of the vented rest, reach above it (NaN: never moved), noise and quantum, all in m.

    `noise` is the range of the position, smoothed over 10 ms, within `STILL` s of a calm rest; `lost` is the
    number of moving blocks since the last rest at the level.
    """

    level: float
    reach: float
    noise: float
    quantum: float
    lost: int = 0

    @property
    def band(self) -> float:
        """Half width in m of the band that counts as at rest."""
        return max(2.0 * self.noise, 1.5 * self.quantum, self._fraction(REST_BAND))

    @property
    def near(self) -> float:
        """Half width in m of the noise band of a piston at rest."""
        return min(self.band, max(1.2 * self.noise, 1.01 * self.quantum))

    @property
    def creep(self) -> float:
        """Largest range in m over `STILL` s that counts as still."""
        return max(2.0 * self.noise, 2.0 * self.quantum, self._fraction(CREEP))

    def _fraction(self, fraction: float) -> float:
        return fraction * self.reach if np.isfinite(self.reach) else 0.0


def windows_of(seconds: float) -> int:
    """Number of bins of `seconds` s in the time over which a position counts as still."""
    return max(3, round(STILL / seconds))


def ranges(position: FloatArray, width: int) -> FloatArray:
    """Range of the position in a window of `width` bins around each bin."""
    mirrored = np.pad(position, (width // 2, width - 1 - width // 2), mode="symmetric")
    spread: FloatArray = np.ptp(np.lib.stride_tricks.sliding_window_view(mirrored, width), axis=-1)
    return spread


def quantum_of(position: FloatArray) -> float:
    """Quantisation step in m: the smallest change of the position above rounding errors; 0 if it never changes."""
    change = np.abs(np.diff(position))
    top = float(np.nanmax(change, initial=0.0))
    real = change[change > 1e-9 * max(top, float(np.nanmax(np.abs(position), initial=0.0)))]
    return float(real.min()) if real.size else 0.0


def updated_levels(
    before: RestLevel | None, position: FloatArray, closed: BoolArray, width: int, step: float
) -> RestLevel:
    """Estimates after a further block.

    Parameters
    ----------
    before
        Estimates before the block, None at the beginning.
    position : m
        Smoothed positions of the block, none missing.
    closed
        Whether the supply valve is closed.
    width
        Number of bins over which a position counts as still.
    step : m
        Quantisation step of the block's samples.
    """
    if before is not None and position.size < 4 * width:
        return before
    spread = ranges(position, width)
    span = float(np.ptp(position))
    calm = float(np.quantile(spread, CALM))
    moving = span > _MOVES * max(calm, step)
    noise = min(calm, _MOST_NOISE * span, _ROUGH * _roughness(position)) if moving else calm
    if before is not None:
        noise = min(max(noise, before.noise / _GROWTH), max(before.noise, step) * _GROWTH)
    reach = np.nan if before is None else before.reach
    draft = RestLevel(np.nan, max(span, np.nan_to_num(reach)) if moving else reach, noise, step)
    level, lost = _level(before, draft, position, (spread <= draft.creep) & closed, moving)
    if moving:
        travel = float(position.max()) - level
        reach = travel if not np.isfinite(reach) else max(travel, (1 - _FADING) * reach + _FADING * travel)
    return RestLevel(level, reach, noise, step, lost)


def _roughness(position: FloatArray) -> float:
    """Standard deviation in m of white noise with these second differences, which are small in smooth motion."""
    return float(np.median(np.abs(np.diff(position, 2)))) / (0.6745 * math.sqrt(6))


def _level(
    before: RestLevel | None, draft: RestLevel, position: FloatArray, still: BoolArray, moving: bool
) -> tuple[float, int]:
    """Level of the vented rest in a block, and number of moving blocks since the last rest at it."""
    resting = position[still]
    low = float(position.min())
    if moving:
        resting = resting[resting <= low + LOW_END * draft.reach]
    if before is None:
        return (_lowest(resting, draft.band) if resting.size else low), 0
    if resting.size == 0:
        return before.level, before.lost + moving
    at_level = resting[np.abs(resting - before.level) <= draft.band]
    lowest = _lowest(resting, draft.band)
    if lowest < before.level - draft.band or (before.lost + moving > _LOST and at_level.size == 0):
        return lowest, 0
    if at_level.size:
        return float(np.median(at_level)), 0
    return before.level, before.lost + moving


def _lowest(resting: FloatArray, band: float) -> float:
    """Level of the lowest rest: median of the positions near the lower end."""
    low = float(np.quantile(resting, 0.02))
    return float(np.median(resting[np.abs(resting - low) <= band]))


#: Length of a bin in s.
LEVEL_BIN = QUICKEST / 10

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
    return max(1, round(LEVEL_BIN / interval)) if interval > 0 else 1


def raw_bins(samples: StrokeSamples, width: int, before: float) -> RawBins:
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
    finite = np.isfinite(position)
    if finite.all():
        return position
    if not finite.any():
        return np.full(position.size, before)
    at = np.maximum.accumulate(np.where(finite, np.arange(position.size), -1))
    start = before if np.isfinite(before) else float(position[np.argmax(finite)])
    return np.where(at >= 0, position[np.maximum(at, 0)], start)

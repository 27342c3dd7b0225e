"""Level of the vented rest, noise and reach of a recording, estimated block by block from the data."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray

BoolArray = NDArray[np.bool_]

#: Time in s over which a position counts as still, and shortest rest.
STILL = 0.15

#: Fraction of the windows that counts as calm; the noise estimate is poor if the piston is still for less than that.
CALM = 0.1

#: The piston moves in a block whose positions span more than this many calm windows; noise and vibration span about 3.
MOVES = 5.0

#: Fractions of the reach: half width of the band that counts as at rest, change within `STILL` s that counts as still,
#: and upper limit of the noise estimate while the piston moves.
BAND, CREEP, MOST_NOISE = 0.02, 0.01, 0.03

#: The lowest rest is vented only if the piston goes no further below it than this fraction of the reach: a cylinder
#: that cycles may be still at the far end only.
LOW_END = 0.15

#: While the piston moves, windows that range over more than this many standard deviations of the noise are not calm:
#: 15 samples of white noise have 3.5, vibration of 10 Hz has 12, and a cylinder that turns around in a second has 60.
ROUGH = 10.0

#: Largest factor by which the noise changes from block to block, and forgetting factor of an outlying reach.
GROWTH, FADING = 1.25, 0.02

#: After this many moving blocks without a rest at the level, the lowest rest is the new level: the zero has changed.
LOST = 3


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
        return max(2.0 * self.noise, 1.5 * self.quantum, self._fraction(BAND))

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
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    found: FloatArray = maximum_filter1d(position, width) - minimum_filter1d(position, width)
    return found


def quantum_of(position: FloatArray) -> float:
    """Quantisation step in m: the smallest change of the position above rounding errors; 0 if it never changes."""
    change = np.abs(np.diff(position))
    top = float(np.nanmax(change, initial=0.0))
    real = change[change > 1e-9 * max(top, float(np.nanmax(np.abs(position), initial=0.0)))]
    return float(real.min()) if real.size else 0.0


def updated(before: RestLevel | None, position: FloatArray, closed: BoolArray, width: int, step: float) -> RestLevel:
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
    moving = span > MOVES * max(calm, step)
    noise = min(calm, MOST_NOISE * span, ROUGH * _roughness(position)) if moving else calm
    if before is not None:
        noise = min(max(noise, before.noise / GROWTH), max(before.noise, step) * GROWTH)
    reach = np.nan if before is None else before.reach
    draft = RestLevel(np.nan, max(span, np.nan_to_num(reach)) if moving else reach, noise, step)
    level, lost = _level(before, draft, position, (spread <= draft.creep) & closed, moving)
    if moving:
        travel = float(position.max()) - level
        reach = travel if not np.isfinite(reach) else max(travel, (1 - FADING) * reach + FADING * travel)
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
    if lowest < before.level - draft.band or (before.lost + moving > LOST and at_level.size == 0):
        return lowest, 0
    if at_level.size:
        return float(np.median(at_level)), 0
    return before.level, before.lost + moving


def _lowest(resting: FloatArray, band: float) -> float:
    """Level of the lowest rest: median of the positions near the lower end."""
    low = float(np.quantile(resting, 0.02))
    return float(np.median(resting[np.abs(resting - low) <= band]))

"""Innovations of an on-line observer: NIS against chi-square, whiteness, and correlation with the duty cycles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.log import INPUTS, FloatArray
from clutchid.numerics.whiteness import Colour, colour
from clutchid.observer.run import ObservedRecording

#: Length in s over which the NIS is averaged for a curve.
SPAN = 1.0

#: Probabilities of the bounds of a mean NIS.
_BOUNDS = 0.025, 0.975


class MeanNIS(NamedTuple):
    """Mean of the normalised innovations squared of so many `corrections`, NaN of none.

    It is from `low` to `high` in 19 of 20 cases if the innovations are independent and have the variance that the
    filter predicts; its expectation is then 1.
    """

    mean: float
    corrections: int
    low: float
    high: float


class InnovationStatistics(NamedTuple):
    """Statistics of the innovations of a recording, each divided by its predicted standard deviation.

    `moving` and `resting` have the NIS while the piston moves and while it rests; `time` (b,) in s, `nis` (b,), `low`
    (b,) and `high` (b,) its mean over spans of `SPAN` with its bounds, NaN without corrections. `colour` is their
    autocorrelation and their correlation with the duty cycles, from one correction to the next.
    """

    moving: MeanNIS
    resting: MeanNIS
    time: FloatArray
    nis: FloatArray
    low: FloatArray
    high: FloatArray
    colour: Colour


def chi_square_bounds(count: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bounds of the mean of so many squares of independent standard normal numbers, NaN for none.

    Examples
    --------
    >>> low, high = chi_square_bounds(np.array([100.0]))
    >>> f"{low[0]:.2f} to {high[0]:.2f}"
    '0.74 to 1.30'
    """
    from scipy.special import gammaincinv

    some = np.where(count > 0, count, np.nan)
    low, high = (2.0 * gammaincinv(some / 2.0, share) / some for share in _BOUNDS)
    return low, high


def innovation_statistics(run: ObservedRecording) -> InnovationStatistics:
    """Statistics of the innovations of an observed recording; an outlier counts as one at the filter's bound."""
    joint, time = run.observer.joint, run.log.time
    gate, every = float(joint.noise.outlier), joint.settings.every * run.observer.spacing
    z = np.clip(run.samples.innovations[:, 0] / np.sqrt(run.samples.innovations[:, 1]), -gate, gate)
    speed = np.abs(run.samples.states[:, run.observer.actuator.states.index("v")])
    moves, finite = speed > joint.settings.least_speed, np.isfinite(z)
    spans = ((time - time[0]) / SPAN).astype(np.int64)
    count = np.bincount(spans, finite).astype(np.float64)
    total = np.bincount(spans, np.where(finite, z**2, 0.0))
    with np.errstate(invalid="ignore"):
        nis = total / np.where(count > 0, count, np.nan)
    # an interval up to a correction and with it; stamps may be off by a part of a sample
    grid = np.ceil((time - time[0]) / every - 0.5 / joint.settings.every).astype(np.int64)
    # that of a correction stands where it ends, with the last sample before the next one
    begun = grid - 1 if joint.settings.every > 1 else grid
    cells = int(grid[-1]) + 1
    on_grid = _means(np.maximum(begun, 0), z, cells)
    duties = {name: _means(grid, run.log[name], cells) for name in INPUTS}
    return InnovationStatistics(
        _mean_nis(z[finite & moves]),
        _mean_nis(z[finite & ~moves]),
        time[0] + SPAN * (np.arange(nis.size) + 0.5),
        nis,
        *chi_square_bounds(count),
        colour(on_grid, duties, every),
    )


def _mean_nis(z: FloatArray) -> MeanNIS:
    low, high = chi_square_bounds(np.array([float(z.size)]))
    return MeanNIS(float(np.mean(z**2)) if z.size else np.nan, z.size, float(low[0]), float(high[0]))


def _means(places: FloatArray, values: FloatArray, cells: int) -> FloatArray:
    """Means of the values by their place on a grid of some cells, NaN where there is none."""
    finite = np.isfinite(values)
    count = np.bincount(places, finite, cells)
    total = np.bincount(places, np.where(finite, values, 0.0), cells)
    means: FloatArray = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return means

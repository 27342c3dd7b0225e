"""Velocity of a measured position: of noisy samples by means over windows, of smoothed ones by differences."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray, sample_interval


def velocity(time: FloatArray, position: FloatArray, window: float) -> FloatArray:
    """Velocity in m/s: difference of the mean positions over `window` s after and before each sample.

    Missing positions are left out; NaN where a window has none.

    Examples
    --------
    >>> t = np.arange(0.0, 1.0, 0.01)
    >>> velocity(t, 0.02 * t, 0.05).round(6)[[0, 50, 99]].tolist()
    [0.02, 0.02, 0.02]
    """
    n = time.size
    if n < 2:
        return np.full(n, np.nan)
    width = max(1, round(window / sample_interval(time)))
    known = np.isfinite(position)
    number = np.concatenate([[0], np.cumsum(known)])
    sums = [np.concatenate([[0.0], np.cumsum(np.where(known, x, 0.0))]) for x in (position, time - time[0])]
    here = np.arange(n)
    first, last = np.maximum(here - width, 0), np.minimum(here + width + 1, n)
    with np.errstate(invalid="ignore", divide="ignore"):
        after, before = number[last] - number[here], number[here + 1] - number[first]
        moved, passed = ((s[last] - s[here]) / after - (s[here + 1] - s[first]) / before for s in sums)
        result: FloatArray = moved / passed
    return result


def difference_velocity(time: FloatArray, position: FloatArray, steps: int) -> FloatArray:
    """Velocity in m/s: difference of the positions `steps` samples after and before; NaN at the ends.

    For positions that are smooth already, such as medians of bins.

    Examples
    --------
    >>> t = np.arange(0.0, 0.05, 0.01)
    >>> difference_velocity(t, 0.02 * t, 1).round(6).tolist()
    [nan, 0.02, 0.02, 0.02, nan]
    """
    found, across = np.full(time.size, np.nan), 2 * steps
    if time.size > across:
        found[steps:-steps] = (position[across:] - position[:-across]) / (time[across:] - time[:-across])
    return found

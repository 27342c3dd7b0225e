"""Samples of stored columns for a plot: each one where there are few, else least and greatest of every pixel.

A pulse of one sample is seen at any zoom, and what is read does not grow with the length of the recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.stored import BIN, StoredColumn, column_of, extremes_of

#: Index under which the time in s of a time grid is stored: it never decreases.
CLOCK = 1_000_000

#: Most points across a plot.
MOST_WIDTH = 4000


def clock_column(stamps: FloatArray) -> FloatArray:
    """Time stamps in s for plots: not finite ones and steps back stay at the greatest before them."""
    finite = np.where(np.isfinite(stamps), stamps, -np.inf)
    found: FloatArray = np.maximum.accumulate(finite)
    first = found[np.isfinite(found)]
    return np.where(np.isfinite(found), found, first[0] if first.size else 0.0)


def plotted(folder: Path, grid: int, columns: Sequence[int], begin: float, end: float, width: int) -> FloatArray:
    """Time and columns between two times, shape (1 + columns, points).

    Parameters
    ----------
    folder
        Of stored columns, see `clutchid.measurements.stored`, with the time of the grid as the column `CLOCK`.
    grid, columns
        Number of the time grid, and of columns in it.
    begin, end : s
        What is shown; one sample beyond either end is there as well.
    width
        Points across the plot; where there are more than two samples a point, it has the least and the greatest.

    Returns
    -------
    points
        Values as written; NaN where there are none.
    """
    clock = column_of(folder, grid, CLOCK)
    size = clock.size
    first = max(_index(clock, size, begin) - 1, 0)
    last = min(_index(clock, size, end, after=True) + 1, size)
    count, width = max(last - first, 0), min(max(width, 1), MOST_WIDTH)
    several = [column_of(folder, grid, column) for column in columns]
    if count <= 2 * width:
        return np.vstack([clock.read(first, last), *(one.read(first, last) for one in several)])
    step = -(-count // width)
    if step >= 2 * BIN:
        bins = step // BIN
        start, stop = first // BIN, -(-last // BIN)
        ends = [_merged(one.extremes(start, stop), bins) for one in several]
        stamps = clock.extremes(start, stop)[:, 0]  # of the first sample of each bin, as the time never decreases
        half = bins // 2
    else:
        ends = [extremes_of(one.read(first, last), step) for one in several]
        stamps, bins, half = clock.read(first, last), step, step // 2
    begins = np.arange(0, stamps.size, bins)
    times = stamps[np.column_stack([begins, np.minimum(begins + half, stamps.size - 1)]).ravel()]
    return np.vstack([times, *(found.ravel() for found in ends)])


def _merged(ends: FloatArray, bins: int) -> FloatArray:
    """Least and greatest values over several neighbouring bins."""
    begins = np.arange(0, len(ends), bins)
    low = np.fmin.reduceat(ends[:, 0], begins)
    high = np.fmax.reduceat(ends[:, 1], begins)
    return np.column_stack([low, high])


def _index(clock: StoredColumn, size: int, time: float, *, after: bool = False) -> int:
    """Index of the first sample at or after a time, or with `after` behind it; some twenty samples are read."""

    def is_before(index: int) -> bool:
        at = float(clock.read(index, index + 1)[0])
        return at <= time if after else at < time

    low, high = 0, size
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if is_before(middle) else (low, middle)
    return low

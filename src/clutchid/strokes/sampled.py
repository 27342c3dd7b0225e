"""Properties of a sampled column: velocity, noise, quantisation step, and runs in which it does not change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.log import BoolArray, FloatArray, sample_interval

IndexArray: TypeAlias = NDArray[np.intp]

#: Samples per block of the noise estimate, and fraction of the blocks that counts as quiet.
_BLOCK, _QUIET = 32, 0.1

#: Largest number of values used for the quantisation step.
_ENOUGH = 200_000

#: The longest runs are left out of the usual length of a run: they may be the fault that is searched for.
LEFT_OUT = 3


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """Sample ranges (start, stop) in which `mask` is true throughout."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


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
    finite = np.isfinite(position)
    number = np.concatenate([[0], np.cumsum(finite)])
    sums = [np.concatenate([[0.0], np.cumsum(np.where(finite, x, 0.0))]) for x in (position, time - time[0])]
    here = np.arange(n)
    first, last = np.maximum(here - width, 0), np.minimum(here + width + 1, n)
    with np.errstate(invalid="ignore", divide="ignore"):
        after, before = number[last] - number[here], number[here + 1] - number[first]
        moved, passed = ((s[last] - s[here]) / after - (s[here + 1] - s[first]) / before for s in sums)
        result: FloatArray = moved / passed
    return result


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """Runs of at least two samples with the same value: first sample, number of samples, value."""

    start: IndexArray
    length: IndexArray
    value: FloatArray

    def longest(self, among: BoolArray, left_out: int = 0) -> int:
        """Length of the longest run `among` those selected, without the `left_out` longest; 1 if there is none."""
        lengths = np.sort(self.length[among])
        return int(lengths[-1 - left_out]) if lengths.size > left_out else 1


def difference_velocity(time: FloatArray, position: FloatArray, steps: int) -> FloatArray:
    """Velocity in m/s: difference of the positions `steps` samples after and before; NaN at the ends.

    For positions that are smooth already, such as medians of bins.

    Examples
    --------
    >>> t = np.arange(0.0, 0.05, 0.01)
    >>> difference_velocity(t, 0.02 * t, 1).round(6).tolist()
    [nan, 0.02, 0.02, 0.02, nan]
    """
    rate, across = np.full(time.size, np.nan), 2 * steps
    if time.size > across:
        rate[steps:-steps] = (position[across:] - position[:-across]) / (time[across:] - time[:-across])
    return rate


def constant_runs(values: FloatArray) -> Runs:
    """Runs in which a column does not change; a missing sample ends a run.

    Examples
    --------
    >>> found = constant_runs(np.array([0.0, 2.0, 2.0, 2.0, 1.0, np.nan, np.nan]))
    >>> found.start.tolist(), found.length.tolist(), found.value.tolist()
    ([1], [3], [2.0])
    """
    starts, stops = run_ends(values[1:] == values[:-1])
    # two adjacent runs of different values share no pair, so a run of equal pairs has one value
    return Runs(starts, stops - starts + 1, values[starts])


def run_ends(mask: BoolArray) -> tuple[IndexArray, IndexArray]:
    """First samples, and first samples after, of the runs in which `mask` is true.

    Examples
    --------
    >>> [ends.tolist() for ends in run_ends(np.array([True, False, True, True]))]
    [[0, 2], [1, 4]]
    """
    ends: IndexArray = np.array(runs(mask), dtype=np.intp).reshape(-1, 2)
    return ends[:, 0], ends[:, 1]


def noise(values: FloatArray) -> float:
    """Standard deviation of a column where it is quiet, in its unit; NaN with too few samples.

    A straight line is subtracted from each block of samples, so that slow motion does not count as noise. Constant
    blocks are left out, unless most are constant.

    Examples
    --------
    A ramp of 0.25 m/s with 20 um of noise:

    >>> ramp = 2.5e-4 * np.arange(1000) + 2e-5 * np.random.default_rng(0).standard_normal(1000)
    >>> 1.5e-5 < noise(ramp) < 2e-5
    True
    """
    finite = values[np.isfinite(values)]
    count = finite.size // _BLOCK
    if count == 0:
        return float("nan")
    blocks = finite[: count * _BLOCK].reshape(count, _BLOCK)
    line = np.linspace(-1, 1, _BLOCK)
    line /= np.sqrt(line @ line)
    centred = blocks - blocks.mean(axis=1, keepdims=True)
    left = centred - np.outer(centred @ line, line)
    spread = np.sqrt(np.maximum(np.sum(left**2, axis=1), 0.0) / (_BLOCK - 2))
    alive = np.ptp(blocks, axis=1) > 0
    return float(np.quantile(spread[alive] if 2 * alive.sum() > count else spread, _QUIET))


def quantum(values: FloatArray) -> float:
    """Quantisation step of a column, in its unit; 0 if none is visible.

    Examples
    --------
    >>> y = 12e-6 * np.round(np.random.default_rng(0).normal(0, 5, 1000))
    >>> f"{quantum(y) * 1e6:.1f} um", quantum(np.random.default_rng(0).normal(0, 5, 1000))
    ('12.0 um', 0.0)
    """
    finite = values[np.isfinite(values)]
    levels = np.unique(finite[:: -(-finite.size // _ENOUGH) or 1])
    # floating-point rounding errors are not steps
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * np.ptp(levels)] if levels.size > 2 else steps
    if steps.size == 0:
        return 0.0
    least = float(steps.min())
    # a unit conversion with few digits makes the same step vary
    step = float(steps[steps < 1.5 * least].mean())
    few = steps[steps < 4.5 * step] / step
    regular = np.abs(few - np.round(few)) < 0.15
    return step if few.size > 0.5 * steps.size and regular.mean() > 0.9 else 0.0

"""What a sampled column shows of itself: its noise, its quantum, and the runs in which it does not change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray

IntArray = NDArray[np.intp]

#: Samples of a block that tells the noise, and the share of blocks that are taken for quiet.
BLOCK, QUIET = 32, 0.1

#: Values of a column that are looked at for its quantum.
ENOUGH = 200_000

#: The longest runs are left out when the usual length of a run is told: they may be what is looked for.
LEFT_OUT = 3


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """Stretches of at least two samples with one and the same value: first sample, number of samples, value."""

    start: IntArray
    length: IntArray
    value: FloatArray

    def longest(self, among: NDArray[np.bool_], left_out: int = 0) -> int:
        """Samples of the longest run of those `among`, the `left_out` longest ones apart; 1 where there is none."""
        lengths = np.sort(self.length[among])
        return int(lengths[-1 - left_out]) if lengths.size > left_out else 1


def runs(values: FloatArray) -> Runs:
    """Stretches in which a column does not change; a missing sample ends one.

    Examples
    --------
    >>> found = runs(np.array([0.0, 2.0, 2.0, 2.0, 1.0, np.nan, np.nan]))
    >>> found.start.tolist(), found.length.tolist(), found.value.tolist()
    ([1], [3], [2.0])
    """
    starts, stops = stretches(values[1:] == values[:-1])
    # two neighbouring runs of different values share no pair, so a stretch of equal pairs has one value
    return Runs(starts, stops - starts + 1, values[starts])


def stretches(mask: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """First samples, and first samples after, of the stretches in which `mask` holds.

    Examples
    --------
    >>> [ends.tolist() for ends in stretches(np.array([True, False, True, True]))]
    [[0, 2], [1, 4]]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2]


def noise(values: FloatArray) -> float:
    """Standard deviation of a column where it is quiet, in its unit; NaN where too few samples are there.

    A straight line is taken from each block of samples, so that slow motion is no noise. Blocks that do not change at
    all tell nothing, unless most do not.

    Examples
    --------
    A ramp of 0.25 m/s with 20 um of noise:

    >>> ramp = 2.5e-4 * np.arange(1000) + 2e-5 * np.random.default_rng(0).standard_normal(1000)
    >>> 1.5e-5 < noise(ramp) < 2e-5
    True
    """
    finite = values[np.isfinite(values)]
    count = finite.size // BLOCK
    if count == 0:
        return float("nan")
    blocks = finite[: count * BLOCK].reshape(count, BLOCK)
    line = np.linspace(-1, 1, BLOCK)
    line /= np.sqrt(line @ line)
    centred = blocks - blocks.mean(axis=1, keepdims=True)
    left = centred - np.outer(centred @ line, line)
    spread = np.sqrt(np.maximum(np.sum(left**2, axis=1), 0.0) / (BLOCK - 2))
    alive = np.ptp(blocks, axis=1) > 0
    return float(np.quantile(spread[alive] if 2 * alive.sum() > count else spread, QUIET))


def quantum(values: FloatArray) -> float:
    """Step in which a column changes, in its unit; 0 where it has none that shows.

    Examples
    --------
    >>> y = 12e-6 * np.round(np.random.default_rng(0).normal(0, 5, 1000))
    >>> f"{quantum(y) * 1e6:.1f} um", quantum(np.random.default_rng(0).normal(0, 5, 1000))
    ('12.0 um', 0.0)
    """
    finite = values[np.isfinite(values)]
    levels = np.unique(finite[:: -(-finite.size // ENOUGH) or 1])
    # what is left of rounding in floating point is no step
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * np.ptp(levels)] if levels.size > 2 else steps
    if steps.size == 0:
        return 0.0
    least = float(steps.min())
    # a unit conversion with few digits lets one and the same step differ
    step = float(steps[steps < 1.5 * least].mean())
    few = steps[steps < 4.5 * step] / step
    regular = np.abs(few - np.round(few)) < 0.15
    return step if few.size > 0.5 * steps.size and regular.mean() > 0.9 else 0.0

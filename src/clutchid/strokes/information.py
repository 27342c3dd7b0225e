"""Information of strokes about the load: Gram matrix over position, direction and speed, and its log-determinant."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray, sample_interval
from clutchid.signals.velocity import difference_velocity
from clutchid.strokes.bins import raw_bins, samples_in_bin
from clutchid.strokes.borders import LEAD
from clutchid.strokes.describing import SPEED_BINS
from clutchid.strokes.section import Section
from clutchid.strokes.stream import Samples

#: Hat functions (linear B-splines) over the reach, once for each direction and speed range.
HATS = 11

#: Order of the matrix: directions, speed ranges and hats, and one row for the vented rest.
SIZE = 4 * HATS + 1

#: Speeds in reaches per second: below the first the piston stands still (friction holds it), above the second is fast.
STANDS, FAST = 0.05, 1.0

#: Time in s near a position after which further samples there add little information.
ENOUGH = 0.05

#: Weight of a stroke without a vented rest before it, whose initial state must be estimated too.
UNANCHORED = 0.5


def gram(section: Section, reach: float) -> FloatArray:
    """Gram matrix of a section in s.

    .. math:: G = \\sum_k w_k \\Delta t_k \\, b(y_k) b(y_k)^T

    Each bin of 10 ms with motion counts with its length in the block of its direction and speed range, distributed over
    the two hats around its position; the last row is the preceding vented rest, up to `LEAD` s.

    Parameters
    ----------
    section : Section
        A stroke.
    reach : m
        Range of the hats from the level of the vented rest, above 0.
    """
    log, summary = section.log, section.summary
    width = samples_in_bin(sample_interval(log.time, 1.0))
    bins = raw_bins(Samples(0, log.time, log.columns), width, np.nan)
    speed = difference_velocity(bins.time, bins.position, SPEED_BINS) / reach
    place = np.clip((bins.position - summary.level) / reach, 0.0, 1.0) * (HATS - 1)
    lasts = np.diff(bins.time, append=log.time[-1])
    used = np.isfinite(speed) & np.isfinite(place) & (np.abs(speed) > STANDS)
    speed, place, weight = speed[used], place[used], lasts[used]
    weight = weight * (1.0 if summary.vented_rest > 0 else UNANCHORED)
    left = np.minimum(place.astype(np.int64), HATS - 2)
    at = HATS * (2 * (speed < 0) + (np.abs(speed) > FAST)) + left
    right = place - left
    G = np.zeros((SIZE, SIZE))
    np.add.at(G, (at, at), weight * (1 - right) ** 2)
    np.add.at(G, (at + 1, at + 1), weight * right**2)
    np.add.at(G, (at, at + 1), weight * right * (1 - right))
    np.add.at(G, (at + 1, at), weight * right * (1 - right))
    G[-1, -1] = min(summary.vented_rest, LEAD)
    return G


def information(G: FloatArray) -> FloatArray:
    """Information log det(I + G / `ENOUGH`) of Gram matrices in s; 0 for G = 0, increasing with G.

    Parameters
    ----------
    G : s
        One matrix or several, shape (..., `SIZE`, `SIZE`).

    Examples
    --------
    Repeating the same positions adds less than the first time, other positions add the same again:

    >>> once, elsewhere = np.zeros((2, SIZE, SIZE))
    >>> once[0, 0] = elsewhere[1, 1] = 0.05
    >>> [round(float(information(G)), 2) for G in (once, once + once, once + elsewhere)]
    [0.69, 1.1, 1.39]
    """
    value: FloatArray = np.linalg.slogdet(np.eye(SIZE) + G / ENOUGH)[1]
    return value

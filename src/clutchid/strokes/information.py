"""How much strokes tell about the load: a Gram matrix over position, direction and pace, and its log-determinant."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.strokes.bins import raw_bins, samples_in_bin
from clutchid.strokes.borders import LEAD
from clutchid.strokes.describing import velocity
from clutchid.strokes.section import Section
from clutchid.strokes.stream import Samples, usual_interval

#: Hat functions (linear B-splines) over the reach, once for each direction and pace.
HATS = 11

#: Order of the matrix: directions, paces and hats, and the anchor.
SIZE = 4 * HATS + 1

#: Reaches a second: slower than the first nothing moves (friction holds the piston), faster than the second is fast.
STANDS, FAST = 0.05, 1.0

#: Time in s near a position after which more of the same tells little.
ENOUGH = 0.05

#: Weight of a stroke without a vented rest before it, whose start must be estimated too.
UNANCHORED = 0.5


def gram(section: Section, reach: float) -> FloatArray:
    """Gram matrix of a section in s.

    .. math:: G = \\sum_k w_k \\Delta t_k \\, b(y_k) b(y_k)^T

    Each moving 10 ms count with their length in the block of their direction and pace, spread over the two hats around
    their position; the last row is the vented rest before, up to `LEAD` s.

    Parameters
    ----------
    section : Section
        A stroke.
    reach : m
        Range of the hats from the level of the vented rest, above 0.
    """
    log, found = section.log, section.excitation
    width = samples_in_bin(usual_interval(Samples(0, log.time, log.columns), 1.0))
    bins = raw_bins(Samples(0, log.time, log.columns), width, np.nan)
    speed = velocity(bins.time, bins.position) / reach
    place = np.clip((bins.position - found.level) / reach, 0.0, 1.0) * (HATS - 1)
    lasts = np.diff(bins.time, append=log.time[-1])
    used = np.isfinite(speed) & np.isfinite(place) & (np.abs(speed) > STANDS)
    speed, place, weight = speed[used], place[used], lasts[used]
    weight = weight * (1.0 if found.vented_rest > 0 else UNANCHORED)
    left = np.minimum(place.astype(np.int64), HATS - 2)
    at = HATS * (2 * (speed < 0) + (np.abs(speed) > FAST)) + left
    right = place - left
    G = np.zeros((SIZE, SIZE))
    np.add.at(G, (at, at), weight * (1 - right) ** 2)
    np.add.at(G, (at + 1, at + 1), weight * right**2)
    np.add.at(G, (at, at + 1), weight * right * (1 - right))
    np.add.at(G, (at + 1, at), weight * right * (1 - right))
    G[-1, -1] = min(found.vented_rest, LEAD)
    return G


def information(G: FloatArray) -> FloatArray:
    """What Gram matrices in s tell, log det(I + G / `ENOUGH`), without a unit; 0 for nothing, and it only grows.

    Parameters
    ----------
    G : s
        One matrix or several, shape (..., `SIZE`, `SIZE`).

    Examples
    --------
    The second time at the same places tells less than the first, other places as much again:

    >>> once, elsewhere = np.zeros((2, SIZE, SIZE))
    >>> once[0, 0] = elsewhere[1, 1] = 0.05
    >>> [round(float(information(G)), 2) for G in (once, once + once, once + elsewhere)]
    [0.69, 1.1, 1.39]
    """
    value: FloatArray = np.linalg.slogdet(np.eye(SIZE) + G / ENOUGH)[1]
    return value

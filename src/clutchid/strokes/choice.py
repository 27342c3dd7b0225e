"""`choose`: the most informative strokes of a limited total length.

The information of a stroke about the load is a Gram matrix over position, direction and speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray, sample_interval
from clutchid.strokes.borders import LEAD
from clutchid.strokes.rest_level import raw_bins, samples_in_bin
from clutchid.strokes.sampled import difference_velocity
from clutchid.strokes.section import Section
from clutchid.strokes.stream import StrokeSamples
from clutchid.strokes.stroke import QUICKEST

#: A usable stroke has at most this fraction of its positions missing, and travels at least this fraction of the reach.
_MOST_MISSING, _LEAST_REACH = 0.5, 0.05

#: Largest batch of strokes, and of samples in them, that is evaluated at once.
_BATCH, SAMPLES = 64, 2**21


def choose(sections: Iterable[Section], seconds: float) -> tuple[Section, ...]:
    """The strokes with the most information about the load in at most `seconds` of recording, in order of time.

    The information of a set of strokes is log det(I + sum G / tau): G is the Gram matrix of linear B-splines over the
    position, once each for opening and closing, slow and fast, weighted by the time spent moving there, with a further
    row for the vented rest before the stroke (see `gram`). It is the information about a load
    curve of that form, and has diminishing returns: repeating a stroke adds less than a stroke at other positions, at
    another speed or in the other direction. The choice is greedy: each time the stroke that adds most information per
    second. Rests are never chosen, nor strokes that are too short, hardly move, or lack most of their positions.

    The sections may come from a stream: they are evaluated in batches, and only the best set so far is kept.

    Parameters
    ----------
    sections : Sections
        Any number of sections of one recording.
    seconds : s
        Greatest total length of the chosen strokes, above 0.

    Returns
    -------
    chosen : Sections
        Empty if no usable stroke is short enough.

    Raises
    ------
    ParameterError
        If `seconds` is not above 0.

    Examples
    --------
    The second stroke repeats the first, the third goes further:

    >>> from clutchid.log import Log
    >>> from clutchid.strokes.cutting import sections_of
    >>> t = np.arange(0.0, 9.0, 1e-3)
    >>> turns = [1.0, 1.2, 1.8, 2.0, 4.0, 4.2, 4.8, 5.0, 7.0, 7.2, 7.8, 8.0]
    >>> y = np.interp(t, turns, [0, 9e-3, 9e-3, 0] * 2 + [0, 20e-3, 20e-3, 0])
    >>> [round(found.departure, 1) for found in choose(sections_of(Log(t, {"position": y})), 3.2)]
    [1.0, 7.0]
    """
    if not seconds > 0:
        raise ParameterError(f"seconds = {seconds:g}: the total length of the strokes must be above 0 s.")
    best: list[Section] = []
    batch: list[Section] = []
    reach = 0.0
    for section in sections:
        if not _usable(section, seconds):
            continue
        reach = max(reach, section.summary.highest - section.summary.level)
        batch.append(section)
        if len(batch) >= _BATCH or sum(map(len, batch)) >= SAMPLES:
            best, batch = _better(best, batch, seconds, reach), []
    best = _better(best, batch, seconds, reach) if batch else best
    return tuple(sorted(best, key=lambda section: section.first))


def _usable(section: Section, seconds: float) -> bool:
    summary = section.summary
    return (
        section.kind == "stroke"
        and summary.missing <= _MOST_MISSING
        and QUICKEST <= section.seconds <= seconds
        and summary.highest - summary.lowest > _LEAST_REACH * summary.reach
        and summary.highest > summary.level
    )


def _better(best: list[Section], batch: list[Section], seconds: float, reach: float) -> list[Section]:
    """The greedy choice from the best set so far and a further batch, if it has more information than that set."""
    pool = [*best, *batch]
    grams = np.array([gram(section, reach) for section in pool])
    taken = _greedy(grams, np.array([section.seconds for section in pool]), seconds)
    before, after = (float(information_of(G.sum(axis=0))) for G in (grams[: len(best)], grams[taken]))
    return [pool[i] for i in taken] if after > before else best


def _greedy(grams: FloatArray, lengths: FloatArray, seconds: float) -> list[int]:
    """Indices of the chosen sections: each time the one that adds most information per second and still fits.

    The gain of a section can only fall as others are chosen, so old gains are upper bounds: only those at the top are
    computed again.
    """
    total = np.zeros((SIZE, SIZE))
    value, left = 0.0, seconds
    taken: list[int] = []
    bound = np.full(len(grams), math.inf)
    fresh = np.zeros(len(grams), dtype=bool)
    while True:
        bound[lengths > left] = -math.inf
        best = int(np.argmax(bound))
        if bound[best] <= 0:
            return taken
        if not fresh[best]:
            stale = np.flatnonzero(~fresh & (bound >= bound[best]))
            bound[stale] = (information_of(total + grams[stale]) - value) / lengths[stale]
            fresh[stale] = True
            continue
        taken.append(best)
        total = total + grams[best]
        value, left = float(information_of(total)), left - float(lengths[best])
        bound[best] = -math.inf
        fresh[:] = False


#: Hat functions (linear B-splines) over the reach, once for each direction and speed range.
HATS = 11

#: Order of the matrix: directions, speed ranges and hats, and one row for the vented rest.
SIZE = 4 * HATS + 1

#: Speeds in reaches per second: below the first the piston stands still (friction holds it), above the second is fast.
_STANDS, _FAST = 0.05, 1.0

#: Half the number of bins over which a speed is computed: 20 ms before and after.
_SPEED_BINS = 2

#: Time in s near a position after which further samples there add little information.
_ENOUGH = 0.05

#: Weight of a stroke without a vented rest before it, whose initial state must be estimated too.
_UNANCHORED = 0.5


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
    bins = raw_bins(StrokeSamples(0, log.time, log.columns), width, np.nan)
    speed = difference_velocity(bins.time, bins.position, _SPEED_BINS) / reach
    place = np.clip((bins.position - summary.level) / reach, 0.0, 1.0) * (HATS - 1)
    lasts = np.diff(bins.time, append=log.time[-1])
    used = np.isfinite(speed) & np.isfinite(place) & (np.abs(speed) > _STANDS)
    speed, place, weight = speed[used], place[used], lasts[used]
    weight = weight * (1.0 if summary.vented_rest > 0 else _UNANCHORED)
    left = np.minimum(place.astype(np.int64), HATS - 2)
    at = HATS * (2 * (speed < 0) + (np.abs(speed) > _FAST)) + left
    right = place - left
    hats, rows = np.zeros((at.size, SIZE)), np.arange(at.size)
    hats[rows, at], hats[rows, at + 1] = 1 - right, right
    hats *= np.sqrt(weight)[:, None]
    G: FloatArray = hats.T @ hats
    G[-1, -1] = min(summary.vented_rest, LEAD)
    return G


def information_of(G: FloatArray) -> FloatArray:
    """Information log det(I + G / `_ENOUGH`) of Gram matrices in s; 0 for G = 0, increasing with G.

    Parameters
    ----------
    G : s
        One matrix or several, shape (..., `SIZE`, `SIZE`).

    Examples
    --------
    Repeating the same positions adds less than the first time, other positions add the same again:

    >>> once, elsewhere = np.zeros((2, SIZE, SIZE))
    >>> once[0, 0] = elsewhere[1, 1] = 0.05
    >>> [round(float(information_of(G)), 2) for G in (once, once + once, once + elsewhere)]
    [0.69, 1.1, 1.39]
    """
    value: FloatArray = np.linalg.slogdet(np.eye(SIZE) + G / _ENOUGH)[1]
    return value

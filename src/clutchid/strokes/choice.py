"""`choose`: the strokes that tell most about the load in so many seconds."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.strokes.information import SIZE, gram, information
from clutchid.strokes.section import Section

#: A stroke with more of its positions missing, or with less reach than this part of the recording's, is useless.
MOST_MISSING, LEAST_REACH = 0.5, 0.05

#: Shortest stroke that is of use, in s.
SHORTEST = 0.1

#: So many strokes, or samples in them, are looked at together while they come in.
TOGETHER, SAMPLES = 64, 2**21


def choose(sections: Iterable[Section], seconds: float) -> tuple[Section, ...]:
    """The strokes that tell most about the load in at most `seconds` of recording, in order of time.

    What a set of strokes tells is log det(I + sum G / tau): G is the Gram matrix of linear B-splines over the position,
    once each for opening and closing, slow and fast, weighted by the time spent moving there, with a further row for
    the vented rest before the stroke (see `clutchid.strokes.information`). It is the information that a load curve of
    that form would get from the set, and has diminishing returns: a second stroke like one that is there adds less
    than one that goes elsewhere, at another pace or in the other direction. Strokes are taken one by one, each time the
    one that adds most for its length. Rests are never taken, nor strokes that are too short, hardly move, or have most
    of their positions missing.

    The sections may come from a stream: they are looked at in lots, and only the best set so far is kept.

    Parameters
    ----------
    sections : Sections
        In any number, of one recording.
    seconds : s
        Length of what is chosen, above 0.

    Returns
    -------
    chosen : Sections
        None, where no useful stroke is short enough.

    Raises
    ------
    ParameterError
        If `seconds` is not above 0.

    Examples
    --------
    The second stroke is the first again, the third goes further:

    >>> from clutchid.log import Log
    >>> from clutchid.strokes.cutting import cut
    >>> t = np.arange(0.0, 9.0, 1e-3)
    >>> turns = [1.0, 1.2, 1.8, 2.0, 4.0, 4.2, 4.8, 5.0, 7.0, 7.2, 7.8, 8.0]
    >>> y = np.interp(t, turns, [0, 9e-3, 9e-3, 0] * 2 + [0, 20e-3, 20e-3, 0])
    >>> [round(found.departure, 1) for found in choose(cut(Log(t, {"position": y})), 3.2)]
    [1.0, 7.0]
    """
    if not seconds > 0:
        raise ParameterError(f"seconds = {seconds:g}: the length of the strokes to choose is above 0.")
    best: list[Section] = []
    lot: list[Section] = []
    reach = 0.0
    for section in sections:
        if not _useful(section, seconds):
            continue
        reach = max(reach, section.excitation.highest - section.excitation.level)
        lot.append(section)
        if len(lot) >= TOGETHER or sum(map(len, lot)) >= SAMPLES:
            best, lot = _better(best, lot, seconds, reach), []
    best = _better(best, lot, seconds, reach) if lot else best
    return tuple(sorted(best, key=lambda section: section.first))


def _useful(section: Section, seconds: float) -> bool:
    found = section.excitation
    return (
        section.kind == "stroke"
        and found.missing <= MOST_MISSING
        and SHORTEST <= section.seconds <= seconds
        and found.highest - found.lowest > LEAST_REACH * found.reach
        and found.highest > found.level
    )


def _better(best: list[Section], lot: list[Section], seconds: float, reach: float) -> list[Section]:
    """The greedy choice from the best so far and a lot more, if it tells more than the best so far."""
    pool = [*best, *lot]
    grams = np.array([gram(section, reach) for section in pool])
    taken = _greedy(grams, np.array([section.seconds for section in pool]), seconds)
    before, after = (float(information(G.sum(axis=0))) for G in (grams[: len(best)], grams[taken]))
    return [pool[i] for i in taken] if after > before else best


def _greedy(grams: FloatArray, lengths: FloatArray, seconds: float) -> list[int]:
    """Numbers of the sections, each time the one that adds most for its length and still fits.

    What a section adds only falls as others are taken, so old numbers are bounds: only those at the top are renewed.
    """
    total = np.zeros((SIZE, SIZE))
    told, left = 0.0, seconds
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
            bound[stale] = (information(total + grams[stale]) - told) / lengths[stale]
            fresh[stale] = True
            continue
        taken.append(best)
        total = total + grams[best]
        told, left = float(information(total)), left - float(lengths[best])
        bound[best] = -math.inf
        fresh[:] = False

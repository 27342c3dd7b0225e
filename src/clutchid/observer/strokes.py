"""Strokes of the piston, counted sample by sample: the position rises above 2 mm and falls back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.log import FloatArray

#: A stroke begins above the first position in m and ends below the second, so that noise does not count; a shorter one
#: in s is a spike of the sensor.
RISEN, FALLEN, SHORTEST = 2e-3, 1.8e-3, 0.02


class Strokes(NamedTuple):
    """Number of strokes that have ended, and the time in s at which the present one began, None without one."""

    ended: int = 0
    began: float | None = None


#: Before the first stroke.
NO_STROKES = Strokes()


def count_strokes(strokes: Strokes, time: FloatArray, position: FloatArray) -> tuple[Strokes, list[int]]:
    """Strokes after some more samples, and the numbers of those samples at which strokes ended.

    Parameters
    ----------
    strokes : Strokes
        Before the first of the samples.
    time : s
        Increasing, shape (n,).
    position : m
        Shape (n,); NaN is left out.

    Examples
    --------
    >>> position = np.array([0.0, 8e-3, 8e-3, 1e-3, 0.0])
    >>> count_strokes(Strokes(), 0.1 * np.arange(5), position)
    (Strokes(ended=1, began=None), [3])
    """
    side = np.where(position > RISEN, 1, np.where(position < FALLEN, -1, 0))
    known = np.flatnonzero(side)
    before = np.append(-1 if strokes.began is None else 1, side[known[:-1]])
    (ended, began), ends = strokes, []
    for i in known[side[known] != before[: known.size]].tolist():
        if side[i] > 0:
            began = float(time[i])
        else:
            if began is not None and time[i] - began >= SHORTEST:
                ended += 1
                ends.append(i)
            began = None
    return Strokes(ended, began), ends

"""A stroke of the piston: where it begins and ends, its shortest time, and a count sample by sample.

This is the only definition of a stroke: recordings, the observer and the exported C count by it, and what a clutch
wears in a stroke is added where one has been counted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.log import FloatArray, any_of

#: A stroke begins where the position in m, from the vented rest, rises above the first and ends where it falls below
#: the second, so that noise does not count.
BEGINS, ENDS = 2e-3, 1.5e-3

#: A shorter one in s is a spike of the sensor; and the resolution in s of the clock that measures it, as that of a
#: control unit.
SHORTEST, RESOLUTION = 0.02, 1e-6

#: A full stroke reaches this share of the way to the far stop, in this time in s at least.
FULL, QUICKEST = 0.8, 0.1


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
        From the vented rest, shape (n,); NaN is left out.

    Examples
    --------
    >>> position = np.array([0.0, 8e-3, 8e-3, 1e-3, 0.0])
    >>> count_strokes(Strokes(), 0.1 * np.arange(5), position)
    (Strokes(ended=1, began=None), [3])
    """
    if not any_of(position > BEGINS if strokes.began is None else position < ENDS):
        return strokes, []
    side = np.where(position > BEGINS, 1, np.where(position < ENDS, -1, 0))
    sided = np.flatnonzero(side)
    before = np.append(-1 if strokes.began is None else 1, side[sided[:-1]])
    (ended, began), ends = strokes, []
    for i in sided[side[sided] != before[: sided.size]].tolist():
        if side[i] > 0:
            began = float(time[i])
        else:
            if began is not None and time[i] - began > SHORTEST - 0.5 * RESOLUTION:
                ended += 1
                ends.append(i)
            began = None
    return Strokes(ended, began), ends

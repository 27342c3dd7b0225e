"""What an observer knows between two samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from clutchid.inference.filter.joint_filter import JointState
from clutchid.log import FloatArray
from clutchid.observer.strokes import NO_STROKES, Strokes
from clutchid.observer.tail import Tail


class RestWatch(NamedTuple):
    """What is known of the vented rest between two samples.

    `shift` is how far in m it is taken to have moved since the calibration. `lowest` and `returned` are the levels in m
    of the stretch: the lowest, NaN before there is one, and the last ones after a stroke. `window` are the positions
    since the last still window, `vents` the samples with an open exhaust valve since the piston came to rest;
    `stroke` says whether there was a stroke before, `taken` whether the level of the present rest has been.
    """

    shift: float = 0.0
    lowest: float = float("nan")
    returned: tuple[float, ...] = ()
    window: FloatArray = np.empty(0)
    vents: int = 0
    stroke: bool = False
    taken: bool = False


#: Before the first sample.
NOTHING = RestWatch()


@dataclass(frozen=True, slots=True, eq=False)
class ObserverState:
    """What an observer knows between two samples.

    `theta` (k,) and `T` (k, k), a root of their covariance, are what is known of the parameters that adapt; `filter` is
    None before the first sample of a stretch. `deviations` (states,) are those of the last correction, NaN before it.
    `number` counts the samples of the stretch. `sound` are theta and T at the end of the last stroke, to which the
    observer goes back if it diverges; `mismatch` is the present mean of the NIS over the usual one, see `mismatch`;
    `leaking` says whether chamber A leaked at the end of the last stroke; `rest` is what is known of the vented rest,
    and `zero` what is subtracted from the position in m.
    """

    filter: JointState | None
    theta: FloatArray
    T: FloatArray
    tail: Tail
    deviations: FloatArray
    sound: tuple[FloatArray, FloatArray]
    number: int = 0
    strokes: Strokes = NO_STROKES
    mismatch: float = 1.0
    leaking: bool = False
    rest: RestWatch = NOTHING
    zero: float = 0.0

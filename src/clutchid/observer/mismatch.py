"""Ratio of the innovations to those of the calibration recordings: whether a calibration still holds.

The normalised innovation squared (NIS) of a filter that takes ten times the variance of its sensor is far below 1, and
differs from truck to truck, so it is compared with that of the calibration recordings. It says that the model does not
hold, as with a leak or the calibration of another truck; a load that is off because the supply has changed does not
show in it. Innovations of a stroke with a fault of the signals say nothing of the calibration: they count until strokes
have ended without one, and are not stored.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.codegen.records import new_record
from clutchid.log import FloatArray
from clutchid.observer.flags import HEALED

if TYPE_CHECKING:
    from clutchid.observer.configuration import Observer

#: Corrections in motion that the running mean remembers: 10 s of motion at one every 10 ms.
MEMORY = 1000

#: The calibration does not hold where the running mean is larger than the usual one by this factor. Provenance:
#: docs/derivations_online.md.
MISMATCHED = 2.0


class Mismatch:
    """Running means of the NIS over that in the calibration recordings.

    Attributes
    ----------
    running
        Of all strokes.
    sound, stored
        Without strokes with a fault of the signals: at present, and at the end of the last such stroke.
    faulty, strokes
        1 after a fault in the present stroke, and how many have ended without one since.
    """

    running: float
    sound: float
    stored: float
    faulty: int
    strokes: float


def mismatch_from(mean: float) -> Mismatch:
    """The means from one of strokes without a fault."""
    return new_record(Mismatch, running=mean, sound=mean, stored=mean, strokes=HEALED)


def normalised(observer: Observer, states: FloatArray, innovations: FloatArray) -> FloatArray:
    """Innovation squared over its variance at each correction while the piston moves, NaN at other samples, (n,).

    An outlier counts as one at the gate.
    """
    velocity, squares = states[:, observer.actuator.states.index("v")], np.empty(len(states))
    kernels_in("clutchid.observer.mismatch_rule").normalised_squares(
        innovations, velocity, observer.joint.settings.least_speed, observer.joint.noise.outlier, squares
    )
    return squares

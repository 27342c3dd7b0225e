"""Ratio of the innovations to those of the calibration recordings: whether a calibration still holds.

The normalised innovation squared (NIS) of a filter that takes ten times the variance of its sensor is far below 1, and
differs from truck to truck, so it is compared with that of the calibration recordings. It says that the model does not
hold, as with a leak or the calibration of another truck; a load that is off because the supply has changed does not
show in it.
"""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.observer.configuration import Observer

#: Corrections in motion that the running mean remembers: 10 s of motion at one every 10 ms.
MEMORY = 1000

#: The calibration does not hold where the running mean is larger than the usual one by this factor. Provenance:
#: docs/derivations_online.md.
MISMATCHED = 2.0


def normalised(observer: Observer, states: FloatArray, innovations: FloatArray) -> FloatArray:
    """Innovation squared over its variance at each correction while the piston moves, NaN at other samples, (n,).

    An outlier counts as one at the gate.
    """
    speed = np.abs(states[:, observer.actuator.states.index("v")])
    gate = float(observer.joint.noise.outlier) ** 2
    squared = np.minimum(innovations[:, 0] ** 2 / innovations[:, 1], gate)
    return np.where(speed > observer.joint.settings.least_speed, squared, np.nan)


def mismatches(observer: Observer, before: float, states: FloatArray, innovations: FloatArray) -> FloatArray:
    """Running mean of the NIS over that in the calibration recordings, NaN at samples that do not move it, shape (n,).

    Parameters
    ----------
    before : 1
        The running mean before the first sample.
    states, innovations
        As in `Observed`.
    """
    running = np.full(len(states), np.nan)
    nis = normalised(observer, states, innovations) / observer.usual
    share = 1.0 / MEMORY
    at = np.flatnonzero(np.isfinite(nis))
    for i, ratio in zip(at.tolist(), nis[at].tolist(), strict=True):
        before += share * (ratio - before)
        running[i] = before
    return running

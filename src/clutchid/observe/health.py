"""Faults of the signals while they are observed, as seconds by flag."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.observe.observer import Observed, Observer
from clutchid.observe.tail import Mask

#: A position further outside of the stroke than this in m is beyond the stops.
BEYOND = 0.5e-3

#: What each flag means.
FLAGS: Mapping[str, str] = MappingProxyType({
    "position_missing": "the position is missing",
    "position_frozen": "the position did not change for 15 samples or more, and was left out",
    "position_beyond_stops": "the position is more than 0.5 mm outside of the stroke",
    "duty_missing": "a duty cycle is missing, and nothing was estimated",
    "time_missing": "samples are missing in time",
    "outlier": "the innovation is beyond 4 standard deviations, and counts less",
    "diverged": "the filter diverged, and was started again",
})  # fmt: skip


def health(observer: Observer, earlier: FloatArray, log: Log, samples: Observed) -> dict[str, float]:
    """Seconds of each of `FLAGS` in a recording.

    Parameters
    ----------
    earlier : s
        Times of the samples just before the recording; none at the start.
    samples : Observed
        What the observer found in the recording.
    """
    spacing, y_max = observer.spacing, observer.actuator.parameters.y_max
    position = log["position"]
    driven: Mask = np.all([np.isfinite(log[name]) for name in INPUTS], axis=0)
    known = np.isfinite(position)
    followed = np.isfinite(samples.states[:, 0])
    steps = np.diff(np.append(earlier[-1:], log.time))
    innovation, variance = samples.innovations.T
    corrected = np.isfinite(innovation)
    outliers = np.abs(innovation[corrected]) > observer.joint.noise.outlier * np.sqrt(variance[corrected])
    return {
        "position_missing": spacing * int(np.sum(~known)),
        "position_frozen": spacing * int(np.sum(known & followed & ~samples.used)),
        "position_beyond_stops": spacing * int(np.sum((position < -BEYOND) | (position > y_max + BEYOND))),
        "duty_missing": spacing * int(np.sum(~driven)),
        "time_missing": float(np.sum(steps[steps > HOLE * spacing] - spacing)),
        "outlier": spacing * observer.joint.settings.every * int(outliers.sum()),
        "diverged": spacing * int(np.sum(known & driven & ~followed)),
    }

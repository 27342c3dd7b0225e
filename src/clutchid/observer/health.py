"""Faults of the signals while they are observed, as seconds by flag."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchid.log import HOLE, INPUTS, BoolArray, FloatArray, Log
from clutchid.observer import flags
from clutchid.observer.configuration import Observer
from clutchid.observer.flags import FLAGS, LIVE_FLAGS
from clutchid.observer.following import Observed
from clutchid.observer.mismatch import MISMATCHED


def health(observer: Observer, log: Log, samples: Observed) -> dict[str, float]:
    """Seconds of each of `FLAGS` in a recording with these results."""
    single = ~samples.flagged(flags.REPEATED_TIME)
    recorded, followed = np.isfinite(log["position"]), np.isfinite(samples.states[:, 0])
    driven: BoolArray = np.all([np.isfinite(log[name]) for name in INPUTS], axis=0)
    innovation, deviation = samples.innovations[:, 0], np.sqrt(samples.innovations[:, 1])
    excused = samples.flagged(flags.ZERO_UNKNOWN) | samples.contradicted
    by_sample: dict[str, BoolArray] = {  # but those that repeat others
        "position_frozen": recorded & followed & ~samples.used,
        "diverged": recorded & driven & ~followed & ~excused,
        "leak": samples.leaking,
        "contradiction": samples.contradicted,
        "not_learning": samples.partial,
    }
    by_correction = {
        "outlier": np.abs(innovation) > observer.joint.noise.outlier * deviation,
        "unlike_calibration": samples.mismatch > MISMATCHED,
    }
    counts = {name: int(np.count_nonzero(samples.flagged(1 << bit))) for bit, name in enumerate(FLAGS)}
    counts["time_missing"] = int(np.sum(samples.lost))
    counts |= {name: int(np.count_nonzero(mask & single)) for name, mask in by_sample.items()}
    for name, mask in by_correction.items():
        counts[name] = observer.joint.settings.every * int(np.count_nonzero(mask))
    return {name: observer.spacing * count for name, count in counts.items()}


def live_health(observer: Observer, earlier: FloatArray, log: Log, left_out: Mapping[str, int]) -> dict[str, float]:
    """Seconds of each of `LIVE_FLAGS` in a block, and of samples that repeat others before it is sorted.

    Parameters
    ----------
    left_out
        Number of samples by live flag, but for those that are `lost`: these are intervals that are too long, but no
        holes.
    """
    spacing = observer.spacing
    steps = np.diff(np.append(earlier[-1:], log.time))
    lost = np.round(steps[steps <= HOLE * spacing] / spacing) - 1.0
    counts = {"repeated": 0, **left_out, "lost": int(np.sum(np.maximum(lost, 0.0)))}
    return {name: spacing * counts[name] for name in (*LIVE_FLAGS, "repeated")}

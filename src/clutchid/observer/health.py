"""Faults of the signals while they are observed, as seconds by flag."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.codegen.records import record_copy
from clutchid.log import HOLE, INPUTS, BoolArray, FloatArray, IntArray, Log
from clutchid.observer import flags
from clutchid.observer.configuration import Observer
from clutchid.observer.flags import BITS, BY_CORRECTION, FADES, FLAGS, LIVE_FLAGS, Faults
from clutchid.observer.following import Observed
from clutchid.observer.mismatch import MISMATCHED


def raised(observer: Observer, log: Log, samples: Observed) -> IntArray:
    """All flags of each sample of a recording with these results, (n,), by their bits."""
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
        "outlier": np.abs(innovation) > observer.joint.noise.outlier * deviation,
        "unlike_calibration": samples.mismatch > MISMATCHED,
    }
    by_filter = [np.where(mask & single, BITS[name], 0) for name, mask in by_sample.items()]
    flagged: IntArray = np.bitwise_or.reduce([samples.flags, *by_filter])
    return flagged


@lru_cache(maxsize=4)
def weights(observer: Observer) -> FloatArray:
    """Samples that a sample with each flag stands for: those of corrections for all since the last one."""
    return np.array([observer.joint.settings.every if name in BY_CORRECTION else 1.0 for name in FLAGS])


def health(observer: Observer, flagged: IntArray, samples: Observed) -> dict[str, float]:
    """Seconds of each of `FLAGS` in a recording, by the flags of its samples."""
    counts = np.array([np.count_nonzero(flagged & 1 << bit) for bit in range(len(FLAGS))]) * weights(observer)
    seconds = dict(zip(FLAGS, (observer.spacing * counts).tolist(), strict=True))
    return seconds | {"time_missing": observer.spacing * int(np.sum(samples.lost))}


def faults_after(before: Faults, observer: Observer, flagged: IntArray, ends: IntArray) -> Faults:
    """The faults of late after samples with these flags, and with a stroke that ends at some."""
    after, gain = record_copy(before), observer.spacing / FADES
    kernels_in("clutchid.observer.faults_rule").fade_all(after, flagged, ends, gain, weights(observer))
    return after


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

"""Faults of the signals while they are observed, as seconds by flag."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from clutchid.log import HOLE, INPUTS, BoolArray, FloatArray, Log
from clutchid.observer.configuration import Observer
from clutchid.observer.following import Observed, subtracted
from clutchid.observer.mismatch import MISMATCHED
from clutchid.strokes import rule

#: A position further outside of the stroke than this in m is beyond the stops.
OUTSIDE_STOPS = 0.5e-3

#: Meanings of the flags.
FLAGS: Mapping[str, str] = MappingProxyType({
    "position_missing": "the position is missing",
    "position_frozen": "the position did not change for 15 samples or more, and was left out",
    "position_beyond_stops": "the position is more than 0.5 mm outside of the stroke",
    "duty_missing": "a duty cycle is missing: it is held for 20 ms, then nothing is estimated",
    "time_missing": "samples are missing in time",
    "outlier": "the innovation is beyond 4 standard deviations, and counts less",
    "diverged": "the filter left what is possible, and was started again",
    "leak": "chamber A, or what is connected to it, leaks",
    "rest_moved": "the vented rest is not where it was at the calibration: the position sensor has moved, or wear",
    "unlike_calibration": "the innovations are much larger than in the calibration recordings: look for a fault, or "
    "calibrate again",
    "contradiction": "position and duty cycles contradict each other: what they taught is taken back",
    "supply_unlike": "the recorded supply pressure cannot be right, by that of the calibration: it is not used",
    "position_none": "the position is no value, far outside of the stroke, and was left out",
    "position_jumps": "the position jumps as no piston moves, and was left out",
    "zero_unknown": "the position jumped and stayed, and no vented rest has shown its zero since: it was left out",
    "repeated_samples": "the logger repeated its last samples in all channels, and nothing was estimated",
    "late_correction": "a control unit with two rates left out a correction: its slow task is late, or never runs",
    "repeated": "samples repeat the time of others, or follow at once: of those that are sorted the last ones count",
    "not_learning": "a stroke was not followed from its beginning, and nothing is learnt before it ends",
    "air_refused": "the recorded temperature of the air cannot be right: the one before stays in use",
    "air_lost": "no temperature of the air has counted for a minute: the band is that of an unknown one",
    "travel_unlike": "the piston travels further than in the calibration: the gain of its position may be too large",
})  # fmt: skip

#: Meanings of the further flags of a live recording.
LIVE_FLAGS: Mapping[str, str] = MappingProxyType({
    "late": "samples came too late, or with a time that goes back, and were left out",
    "lost": "single samples are missing",
    "unreadable": "lines or frames could not be read",
    "invalid": "a value was infinite, or a duty cycle outside 0 to 1, and counts as missing; or a time was far ahead",
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
    y_max, single = observer.actuator.parameters.y_max, ~samples.repeated
    position = log["position"] - subtracted(observer, samples.rest)
    driven: BoolArray = np.all([np.isfinite(log[name]) for name in INPUTS], axis=0)
    recorded, followed = np.isfinite(position), np.isfinite(samples.states[:, 0])
    innovation, deviation = samples.innovations[:, 0], np.sqrt(samples.innovations[:, 1])
    excused = samples.no_zero | samples.contradicted
    by_sample: dict[str, BoolArray] = {  # but those that repeat others
        "position_missing": ~recorded,
        "position_frozen": recorded & followed & ~samples.used,
        "position_beyond_stops": (position < -OUTSIDE_STOPS) | (position > y_max + OUTSIDE_STOPS),
        "duty_missing": ~driven,
        "diverged": recorded & driven & ~followed & ~excused,
        "leak": samples.leaking,
        "rest_moved": samples.rest != 0.0,
        "contradiction": samples.contradicted,
        "supply_unlike": samples.supply_unlike,
        "position_none": samples.verdicts == rule.BEYOND,
        "position_jumps": np.isin(samples.verdicts, (rule.STEP, rule.SEAM)),
        "zero_unknown": samples.no_zero,
        "repeated_samples": samples.verdicts == rule.REPEATED,
        "not_learning": samples.partial,
        "air_refused": samples.air_refused,
        "air_lost": samples.air_lost,
        "travel_unlike": log["position"] > observer.suspect_from,
    }
    by_correction = {
        "outlier": np.abs(innovation) > observer.joint.noise.outlier * deviation,
        "unlike_calibration": samples.mismatch > MISMATCHED,
    }
    steps = np.diff(np.append(earlier[-1:], log.time))
    counts = {name: int(np.count_nonzero(mask & single)) for name, mask in by_sample.items()}
    for name, mask in by_correction.items():
        counts[name] = observer.joint.settings.every * int(np.count_nonzero(mask))
    counts |= {"repeated": int(np.count_nonzero(samples.repeated)), "late_correction": 0}
    seconds = {name: observer.spacing * count for name, count in counts.items()}
    seconds["time_missing"] = float(np.sum(steps[steps > HOLE * observer.spacing] - observer.spacing))
    return {name: seconds[name] for name in FLAGS}


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

"""Flags of an observer: faults of the signals, what it does about them, and those of late."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated

from clutchid.log import FloatArray

#: Meanings of the flags.
FLAGS: Mapping[str, str] = MappingProxyType({
    "position_missing": "the position is missing",
    "position_frozen": "the position did not change for 15 samples or more, and was left out",
    "position_beyond_stops": "the position is more than 0.5 mm outside of the stroke",
    "duty_missing": "a duty cycle is missing: it is held for 20 ms, then nothing is estimated",
    "time_missing": "samples are missing in time",
    "outlier": "the innovation is beyond 4 standard deviations, and counts less",
    "diverged": "the filter left what is possible, and was started again",
    "leak": "chamber A or its connections leak",
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
    "moves_closed": "the piston moves out with closed valves: its sensor creeps or the supply valve leaks, so that the "
    "pressure is not to be trusted",
    "supply_lost": "no supply pressure has counted for 10 s: the load is the one without a recorded supply",
})  # fmt: skip

#: Meanings of the further flags of a live recording.
LIVE_FLAGS: Mapping[str, str] = MappingProxyType({
    "late": "samples came too late, or with a time that goes back, and were left out",
    "lost": "single samples are missing",
    "unreadable": "lines or frames could not be read",
    "invalid": "a value was infinite, or a duty cycle outside 0 to 1, and counts as missing; or a time was far ahead",
})  # fmt: skip

#: Flags of a correction, which are of all samples since the last one.
BY_CORRECTION = ("outlier", "unlike_calibration")

#: The bit of each flag.
BITS: Mapping[str, int] = MappingProxyType({name: 1 << place for place, name in enumerate(FLAGS)})

#: Bits of the flags that show before a filter takes the sample, by their place in `FLAGS`.
(POSITION_MISSING, POSITION_BEYOND_STOPS, DUTY_MISSING, TIME_MISSING, REST_MOVED, SUPPLY_UNLIKE, POSITION_NONE,
 POSITION_JUMPS, ZERO_UNKNOWN, REPEATED_SAMPLES, REPEATED_TIME, AIR_REFUSED, AIR_LOST, TRAVEL_UNLIKE,
 MOVES_CLOSED, SUPPLY_LOST) = (
    BITS[name] for name in (
        "position_missing", "position_beyond_stops", "duty_missing", "time_missing", "rest_moved", "supply_unlike",
        "position_none", "position_jumps", "zero_unknown", "repeated_samples", "repeated", "air_refused", "air_lost",
        "travel_unlike", "moves_closed", "supply_lost",
    )
)  # fmt: skip

#: Bits of the faults of the signals: innovations beside them say nothing of the calibration.
SIGNAL_FAULTS = sum(
    BITS[name] for name in (
        "position_missing", "position_beyond_stops", "duty_missing", "time_missing", "diverged", "contradiction",
        "supply_unlike", "position_none", "position_jumps", "zero_unknown", "repeated_samples", "moves_closed",
    )
)  # fmt: skip

#: Time in s over which the share of the time of a flag fades (1/e), before that it is of all time; and strokes that
#: must have ended without a flag that counts however short it was. Guesses: a fault of 5 s is over 2 s after it where
#: 20 % of the time count, 30 s after it where 5 % do.
FADES, HEALED = 20.0, 2.0

#: A smaller share is 0.
FORGOTTEN = 1e-6

#: Number of flags.
N_FLAGS = len(FLAGS)


class Faults:
    """1 if a share is not 0; number of samples, share of the last time with each flag, and strokes since."""

    active: int
    samples: float
    share: Annotated[FloatArray, N_FLAGS]
    strokes: Annotated[FloatArray, N_FLAGS]

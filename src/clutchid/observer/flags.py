"""Flags of an observer: faults of the signals, what it does about them, and those of late."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated

from clutchid.log import FloatArray

#: Meanings of the flags.
FLAGS: Mapping[str, str] = MappingProxyType({
    "position_missing": "the position is missing",
    "position_frozen": "the position did not change for 15 samples or more and was left out",
    "position_beyond_stops": "the position is more than 0.5 mm outside the stroke",
    "duty_missing": "a duty cycle is missing: it is held for 20 ms, then nothing is estimated",
    "time_missing": "samples are missing in time",
    "outlier": "the innovation exceeds 4 standard deviations and has less weight",
    "diverged": "the filter left its admissible range and was restarted",
    "leak": "chamber A or its connections leak",
    "rest_moved": (
        "the vented rest has moved since the calibration, because of wear or because the position sensor has moved"
    ),
    "unlike_calibration": "the innovations are much larger than in the calibration recordings: look for a fault, or "
    "calibrate again",
    "contradiction": (
        "position and duty cycles contradict each other: the parameter changes that they caused are undone"
    ),
    "supply_unlike": (
        "the recorded supply pressure is implausible compared with that of the calibration and is not used"
    ),
    "position_none": "the position is far outside the stroke, which is not a valid value, and was left out",
    "position_jumps": "the position jumps faster than a piston can move and was left out",
    "zero_unknown": (
        "the position jumped and stayed there, and was left out because no vented rest has shown its new zero yet"
    ),
    "repeated_samples": "the logger repeated its last samples in all channels; nothing was estimated",
    "late_correction": "a control unit with two rates skipped a correction: its slow task is late or never runs",
    "repeated": "samples have the time of other samples or follow them too closely; the last sample counts",
    "not_learning": "the start of a stroke was missed, so the parameters do not adapt until it ends",
    "air_refused": "the recorded air temperature is implausible; the last plausible value stays in use",
    "air_lost": "no plausible air temperature for a minute: the band is that for an unknown temperature",
    "travel_unlike": "the piston travels further than in the calibration: the gain of its position may be too large",
    "moves_closed": (
        "the piston moves out with closed valves: the position sensor drifts or the supply valve leaks, so the "
        "pressure is unreliable"
    ),
    "supply_lost": "no plausible supply pressure for 10 s: the load is estimated as if the supply were not recorded",
})  # fmt: skip

#: Meanings of the further flags of a live recording.
LIVE_FLAGS: Mapping[str, str] = MappingProxyType({
    "late": "samples came too late or out of order and were left out",
    "lost": "single samples are missing",
    "unreadable": "lines or frames could not be read",
    "invalid": "a value was infinite, a duty cycle was outside 0 to 1 (both count as missing), or a time was far ahead",
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

"""Numbers of the rule for how far the vented rest has moved between two recordings, by its levels."""

from __future__ import annotations

import math

from clutchid.numerics.interval import QUANTILE

#: Standard deviations: of a level between two recordings in m, beside what the quantum of the sensor adds; and of the
#: distance of the rests after a stroke from the stop, as a share of it, which goes with the friction of the seals.
#: `python benchmarks/zero.py`, trucks 0 to 7 of both families: levels at the stop differ by 6 µm rms, and 40 % more
#: friction moves the rests after a stroke by 27 % of their distance in the median.
LEVEL, FRICTION = 5e-6, 0.25

#: A rest this far in m below those after a stroke is at the stop; the usual distance where no recording shows it.
CLEARLY, HELD = 8e-5, 3e-4

#: Largest difference of the moves of rests at the stop and after a stroke, as a multiple of what friction explains; and
#: how far above the stop a recording may begin, as a multiple of the usual distance. Chosen on trucks 0 to 9 of both
#: families (`python benchmarks/zero.py --cuts`): of 651 parts of manoeuvres of trucks 4300 to 4307 one seems to have
#: moved.
UNLIKE, HIGHER = 1.5, 1.25

#: A rest cannot have moved further in m: what lies there is a hold, or another actuator.
FURTHEST = 5e-3

#: What is compared: nothing, rests at the stop, rests after a stroke, or one of each.
NOTHING, AT_STOP, RETURNS, BEGINNING = range(4)


def level_interval(quantum: float) -> float:
    """Half a 95 % interval in m of the difference of two levels, with the step of the sensor in m."""
    return QUANTILE * math.sqrt(2.0) * math.hypot(LEVEL, quantum / math.sqrt(12.0))

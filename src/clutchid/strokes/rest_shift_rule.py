"""Rule for how far the vented rest has moved, by its levels: off line, on line and in the exported C."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.numerics.interval import QUANTILE
from clutchid.strokes.excitation import VENTED_POSITION
from clutchid.strokes.rest_shift import (
    AT_STOP,
    BEGINNING,
    CLEARLY,
    FRICTION,
    FURTHEST,
    HELD,
    HIGHER,
    NOTHING,
    RETURNS,
    UNLIKE,
)


@kernel
def held_above(lowest: float, returned: float, other_lowest: float, other_returned: float) -> float:
    """Distance in m at which friction holds the piston above its stop, by the first recording that shows it."""
    if returned - lowest > CLEARLY:
        return returned - lowest
    if other_returned - other_lowest > CLEARLY:
        return other_returned - other_lowest
    return HELD


@kernel
def moved_apart(before: float, before_returned: float, now: float, returned: float, level: float) -> bool:
    """Whether rests at the stop and after a stroke moved by what no friction explains, where both are known."""
    friction = QUANTILE * FRICTION * (before_returned - before)
    both = before_returned - before > CLEARLY and returned - now > CLEARLY
    apart = (now - before) - (returned - before_returned)
    return bool(both and abs(apart) > UNLIKE * math.sqrt(level * level + friction * friction))


@kernel
def compared_rests(before: float, before_returned: float, now: float, returned: float, level: float) -> int:
    """Kind of levels that can be compared, of the lowest rests and those after a stroke (NaN: none), all in m.

    `level` is half a 95 % interval of the difference of two levels. Rests at the stop are compared where both
    recordings have one. Else it is those after a stroke, which friction holds above the stop, so that they move with
    the friction of the seals too; or one of each, which may be as far apart. Where both moved, but not alike, and no
    friction explains that, one of them is a hold; and a recording may begin with a hold.
    """
    compared = NOTHING
    if before_returned - before > CLEARLY and returned - now > CLEARLY:
        if not moved_apart(before, before_returned, now, returned, level):
            compared = AT_STOP
    elif math.isfinite(returned - before_returned):
        compared = RETURNS
    elif abs(now - before) <= VENTED_POSITION:
        compared = BEGINNING
    shift = returned - before_returned if compared == RETURNS else now - before
    return compared if abs(shift) <= FURTHEST else NOTHING


@kernel
def half_interval(compared: int, level: float, held: float) -> float:
    """Half the 95 % interval in m of a shift, with the distance `held` at which friction holds the piston."""
    if compared == RETURNS:
        return math.sqrt(level * level + (QUANTILE * FRICTION * held) * (QUANTILE * FRICTION * held))
    return level + HIGHER * held if compared == BEGINNING else level

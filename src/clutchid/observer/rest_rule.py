"""Rule that watches the vented rest, sample by sample: on line and in the exported C."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray
from clutchid.observer.rest import AGREEING, APART, BELOW, EARLIER, HOLD, LOW, REMEMBERED, STOPPED, Rest, RestBefore
from clutchid.strokes.rest_level import CLOSED
from clutchid.strokes.rest_shift import CLEARLY, NOTHING, RETURNS
from clutchid.strokes.rest_shift_rule import compared_rests, half_interval, held_above, moved_apart


@kernel
def sort(values: FloatArray, begin: int, end: int) -> None:
    """Sort some of the values."""
    for i in range(begin + 1, end):
        value = values[i]
        j = i
        while j > begin and values[j - 1] > value:
            values[j] = values[j - 1]
            j -= 1
        values[j] = value


@kernel
def middle(values: FloatArray, begin: int, end: int) -> float:
    """The median of some values that are sorted, NaN of none."""
    if end <= begin:
        return math.nan
    low, high = begin + (end - begin - 1) // 2, begin + (end - begin) // 2
    median: float = 0.5 * (values[low] + values[high])
    return median


@kernel
def sort_returned(rest: Rest, begin: int, end: int) -> None:
    """Sort a copy of some of the levels after a stroke."""
    for i in range(begin, end):
        rest.sorted[i] = rest.returned[i]
    sort(rest.sorted, begin, end)


@kernel
def agree(rest: Rest, begin: int, end: int) -> bool:
    """Whether some levels after a stroke, which are sorted, differ by little."""
    return bool(rest.sorted[end - 1] - rest.sorted[begin] <= APART)


@kernel
def forget_rests(rest: Rest, before: RestBefore) -> None:
    """Where the last rests after a stroke agree, and those before, the sensor has moved by what is between them.

    Without earlier ones only where they came down: above a stop that is where it was the piston creeps, or is held.
    """
    count = rest.n_returned
    earlier, step = count - AGREEING, 0.0
    if earlier >= 0:
        sort_returned(rest, 0, count)
        returned, held = middle(rest.sorted, 0, count), before.returned - before.lowest
        sort_returned(rest, earlier, count)
        if agree(rest, earlier, count):
            sort_returned(rest, 0, earlier)
            if earlier >= EARLIER and agree(rest, 0, earlier):
                step = middle(rest.sorted, earlier, count) - middle(rest.sorted, 0, earlier)
            moved, came_down = abs(step) > APART, held <= HOLD and returned < before.returned
            apart = moved_apart(before.lowest, before.returned, rest.lowest, returned, before.level)
            if moved or (came_down and apart):
                for i in range(AGREEING):
                    rest.returned[i] = rest.returned[earlier + i]
                rest.n_returned = AGREEING
                rest.lowest = rest.lowest + step if moved else math.nan


@kernel
def believed_shift(rest: Rest, before: RestBefore) -> float:
    """The shift in m after a new level: as before unless the interval of the new one excludes that.

    Where the calibration has holds the stop alone counts; and the sensor has not moved up where the stop has not.
    """
    sort_returned(rest, 0, rest.n_returned)
    returned, held = middle(rest.sorted, 0, rest.n_returned), before.returned - before.lowest
    at_stop = returned - rest.lowest > CLEARLY
    if held > HOLD:
        if not at_stop:
            return rest.shift
        returned = rest.lowest + held
    compared = compared_rests(before.lowest, before.returned, rest.lowest, returned, before.level)
    value = returned - before.returned if compared == RETURNS else rest.lowest - before.lowest
    of_friction = held_above(before.lowest, before.returned, rest.lowest, returned)
    half = half_interval(compared, before.level, of_friction)
    stays = at_stop and rest.lowest - before.lowest <= CLEARLY and not held > CLEARLY
    if compared == NOTHING or abs(rest.shift - value) <= half or (stays and value > 0.0):
        return rest.shift
    return value if abs(value) > half else 0.0


@kernel
def remember(rest: Rest, level: float) -> None:
    """Remember a level after a stroke, of the last ones."""
    if rest.n_returned == REMEMBERED:
        for i in range(1, REMEMBERED):
            rest.returned[i - 1] = rest.returned[i]
        rest.n_returned -= 1
    rest.returned[rest.n_returned] = level
    rest.n_returned += 1


@kernel
def take_level(rest: Rest, before: RestBefore, level: float, stopped: bool) -> bool:
    """Take the level of a still and vented window; whether the shift is known anew.

    It counts once a rest, where the piston has stopped. A level below the stop, as it is taken to be, says that this is
    wrong, also while the piston creeps.
    """
    first, shift, counts = math.isnan(rest.lowest), rest.shift, rest.taken == 0 and stopped
    below = before.returned - before.lowest > CLEARLY and level < before.lowest + rest.shift - BELOW
    if not counts and not below:
        return False
    rest.lowest = rest.lowest if rest.lowest <= level else level
    if counts:
        if rest.excursion == 1:
            remember(rest, level)
        forget_rests(rest, before)
        rest.taken = 1
    rest.shift = believed_shift(rest, before)
    return bool(first or rest.shift != shift)


@kernel
def new_stretch(rest: Rest, exchanged: bool) -> None:
    """After a hole, in which a sensor may have been exchanged: then the shift alone stays, until the next rest."""
    rest.n_bin, rest.n_medians = 0, 0
    rest.vents, rest.excursion, rest.taken = 0, 0, 0
    if exchanged:
        rest.lowest, rest.n_returned = math.nan, 0


@kernel
def watch_rest(
    rest: Rest, before: RestBefore, bin: FloatArray, medians: FloatArray, position: float, supply: float, exhaust: float
) -> bool:
    """Follow the vented rest with a recorded position in m and both duty cycles; whether its shift is known anew.

    A new level changes the shift only where its interval excludes it, so that recordings without a rest at the stop
    keep what an earlier one showed. `bin` and `medians` are memory for a bin and a window.
    """
    if not (position <= LOW and supply <= CLOSED):
        rest.n_bin, rest.n_medians, rest.vents = 0, 0, 0
        if position > LOW:
            rest.excursion, rest.taken = 1, 0
        return False
    bin[rest.n_bin] = position
    rest.n_bin += 1
    if exhaust > CLOSED:
        rest.vents += 1
    if rest.n_bin < before.bin:
        return False
    sort(bin, 0, before.bin)
    medians[rest.n_medians] = middle(bin, 0, before.bin)
    rest.n_bin = 0
    rest.n_medians += 1
    if rest.n_medians < before.bins:
        return False
    rest.n_medians = 0
    half = before.bins // 2
    sort(medians, 0, half)
    sort(medians, half, before.bins)
    drift = middle(medians, half, before.bins) - middle(medians, 0, half)
    sort(medians, 0, before.bins)
    if medians[before.bins - 1] - medians[0] > before.range:
        rest.vents = 0
        return False
    if rest.vents < before.vents and rest.excursion == 1:
        return False
    return take_level(rest, before, middle(medians, 0, before.bins), abs(drift) <= STOPPED)

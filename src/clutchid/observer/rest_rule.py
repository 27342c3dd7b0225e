"""Rule that watches the vented rest, sample by sample: on line and in the exported C."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray
from clutchid.observer.rest import AGREEING, APART, EARLIER, LOW, REMEMBERED, Rest, RestBefore
from clutchid.strokes.rest_level import CLOSED
from clutchid.strokes.rest_shift import NOTHING, RETURNS
from clutchid.strokes.rest_shift_rule import compared_rests, half_interval, held_above, moved_apart


@kernel
def sort(values: FloatArray, n: int) -> None:
    """Sort the first n values."""
    for i in range(1, n):
        value = values[i]
        j = i
        while j > 0 and values[j - 1] > value:
            values[j] = values[j - 1]
            j -= 1
        values[j] = value


@kernel
def middle(values: FloatArray, n: int) -> float:
    """The median of n sorted values, NaN of none."""
    if n == 0:
        return math.nan
    half = n // 2
    median: float = values[half] if n % 2 == 1 else 0.5 * (values[half - 1] + values[half])
    return median


@kernel
def sort_returned(rest: Rest, begin: int, end: int) -> None:
    """Sort some of the levels after a stroke."""
    for i in range(begin, end):
        rest.sorted[i - begin] = rest.returned[i]
    sort(rest.sorted, end - begin)


@kernel
def agree(rest: Rest, n: int) -> bool:
    """Whether the first n sorted levels differ by little."""
    return bool(rest.sorted[n - 1] - rest.sorted[0] <= APART)


@kernel
def forget_rests(rest: Rest, before: RestBefore) -> None:
    """Where the last rests after a stroke agree, and those before, the sensor has moved by what is between them."""
    earlier, returned, last, step = rest.n_returned - AGREEING, 0.0, 0.0, 0.0
    if earlier >= 0:
        sort_returned(rest, 0, rest.n_returned)
        returned = middle(rest.sorted, rest.n_returned)
        sort_returned(rest, earlier, rest.n_returned)
        last = middle(rest.sorted, AGREEING)
        if agree(rest, AGREEING):
            sort_returned(rest, 0, earlier)
            if earlier >= EARLIER and agree(rest, earlier):
                step = last - middle(rest.sorted, earlier)
            moved = abs(step) > APART
            if moved or moved_apart(before.lowest, before.returned, rest.lowest, returned, before.level):
                for i in range(AGREEING):
                    rest.returned[i] = rest.returned[earlier + i]
                rest.n_returned = AGREEING
                rest.lowest = rest.lowest + step if moved else math.nan


@kernel
def believed_shift(rest: Rest, before: RestBefore) -> float:
    """The shift in m after a new level: as before unless the interval of the new one excludes that."""
    sort_returned(rest, 0, rest.n_returned)
    returned = middle(rest.sorted, rest.n_returned)
    compared = compared_rests(before.lowest, before.returned, rest.lowest, returned, before.level)
    held = held_above(before.lowest, before.returned, rest.lowest, returned)
    value = returned - before.returned if compared == RETURNS else rest.lowest - before.lowest
    half = half_interval(compared, before.level, held)
    if compared == NOTHING or abs(rest.shift - value) <= half:
        return rest.shift
    return value if abs(value) > half else 0.0


@kernel
def take_level(rest: Rest, before: RestBefore, level: float) -> bool:
    """Take the level of a vented rest; whether the shift is known anew."""
    first, shift = math.isnan(rest.lowest), rest.shift
    if rest.excursion == 1:
        if rest.n_returned == REMEMBERED:
            for i in range(1, REMEMBERED):
                rest.returned[i - 1] = rest.returned[i]
            rest.n_returned -= 1
        rest.returned[rest.n_returned] = level
        rest.n_returned += 1
    rest.lowest = rest.lowest if rest.lowest <= level else level
    forget_rests(rest, before)
    rest.taken = 1
    rest.shift = believed_shift(rest, before)
    return bool(first or rest.shift != shift)


@kernel
def new_stretch(rest: Rest) -> None:
    """After a hole a sensor may have been exchanged: the shift stays until the next rest."""
    rest.lowest = math.nan
    rest.n_returned, rest.n_bin, rest.n_medians = 0, 0, 0
    rest.vents, rest.excursion, rest.taken = 0, 0, 0


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
    sort(bin, before.bin)
    medians[rest.n_medians] = middle(bin, before.bin)
    rest.n_bin = 0
    rest.n_medians += 1
    if rest.n_medians < before.bins:
        return False
    rest.n_medians = 0
    sort(medians, before.bins)
    if medians[before.bins - 1] - medians[0] > before.range:
        rest.vents = 0
        return False
    if rest.taken == 1 or (rest.vents < before.vents and rest.excursion == 1):
        return False
    return take_level(rest, before, middle(medians, before.bins))

"""Saturation: a measured column that stays at its extreme value without noise."""

from __future__ import annotations

from clutchid.inspection.check import Check
from clutchid.inspection.reading import Reading, shown
from clutchid.inspection.signal import LEFT_OUT, Runs

#: A constant run counts as saturation above this multiple of the longest usual run, and above this number of samples.
LONGER, SHORTEST = 5, 5


def saturation(reading: Reading, name: str) -> Check:
    """Whether the column `name` is cut off at its largest or smallest value.

    At an end stop the noise remains, so runs of equal values are no longer there than elsewhere. Without visible noise,
    the check is undetermined.
    """
    title, found, (low, high) = f"saturation of {name}", reading.runs[name], reading.ends[name]
    if not reading.noisy(name):
        return Check(title, "-", "undetermined", no_noise(name))
    cut = []
    for level, side in ((low, "smallest"), (high, "largest")):
        at = found.value == level
        usual = found.longest((found.value != low) & (found.value != high), LEFT_OUT)
        longest = found.longest(at)
        if longest > max(LONGER * usual, SHORTEST):
            cut.append((level, side, _total(found, level, LONGER * usual) * reading.step, longest))
    if not cut:
        value = f"{shown(low, name)} to {shown(high, name)}"
        return Check(title, value, "good", f"{name} has noise at both ends of its range, so it is not saturated.")
    level, side, seconds, _ = max(cut, key=lambda one: one[2])
    sentence = (
        f"{name} stays at its {side} value, {shown(level, name)}, without noise for {seconds:.3g} s in total: the "
        "sensor or its channel saturates there. A fit would take this limit for an end stop and distort the load "
        "before it; extend the range of the channel, or leave these samples empty."
    )
    return Check(title, f"{seconds:.3g} s at {shown(level, name)}", "bad", sentence)


def no_noise(name: str) -> str:
    """The sentence for a column without visible noise."""
    return f"{name} has no noise above its quantisation step, so repeated values have no meaning."


def _total(found: Runs, level: float, longer: int) -> int:
    """Number of samples in the long runs at one level."""
    return int(found.length[(found.value == level) & (found.length > longer)].sum())

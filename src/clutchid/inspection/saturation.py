"""Saturation: a measured column that sits on its extreme value without noise."""

from __future__ import annotations

from clutchid.inspection.finding import Finding
from clutchid.inspection.reading import Reading, shown
from clutchid.inspection.signal import LEFT_OUT, Runs

#: A run that is this many times as long as the usual longest one, and has this many samples, is no chance.
LONGER, SHORTEST = 5, 5


def saturation(reading: Reading, name: str) -> Finding:
    """Whether the column `name` is cut off at its largest or smallest value.

    At an end stop the noise goes on, so equal values stand side by side no longer there than anywhere else. A column
    without noise, or with steps that hide it, cannot tell.
    """
    check, found, (low, high) = f"saturation of {name}", reading.runs[name], reading.ends[name]
    if not reading.noisy(name):
        return Finding(check, "-", "not tellable", no_noise(name))
    cut = []
    for level, side in ((low, "smallest"), (high, "largest")):
        at = found.value == level
        usual = found.longest((found.value != low) & (found.value != high), LEFT_OUT)
        longest = found.longest(at)
        if longest > max(LONGER * usual, SHORTEST):
            cut.append((level, side, _total(found, level, LONGER * usual) * reading.step, longest))
    if not cut:
        value = f"{shown(low, name)} to {shown(high, name)}"
        return Finding(check, value, "good", f"{name} has noise at its ends too, so nothing is cut off.")
    level, side, seconds, _ = max(cut, key=lambda one: one[2])
    sentence = (
        f"{name} stays without noise at its {side} value, {shown(level, name)}, for {seconds:.3g} s in all: the sensor "
        "or its channel ends there, not the motion; a fit takes the ceiling for a stop and bends the load before it; "
        "widen the range of the channel, or leave these samples empty."
    )
    return Finding(check, f"{seconds:.3g} s at {shown(level, name)}", "bad", sentence)


def no_noise(name: str) -> str:
    """The sentence for a column whose noise does not show."""
    return f"{name} shows no noise beside its steps, so equal samples tell nothing."


def _total(found: Runs, level: float, longer: int) -> int:
    """Samples of the long runs at one level."""
    return int(found.length[(found.value == level) & (found.length > longer)].sum())

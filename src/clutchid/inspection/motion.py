"""Motion of the piston: without it a recording says nothing about the load."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.check import Check
from clutchid.inspection.reading import Reading, shown
from clutchid.log import INPUTS, FloatArray

CHECK = "motion"

#: Least reach of the piston as a fraction of its stroke, and length of a recording in s: half of a fast stroke.
REACH, LONG = 0.02, 0.2


def motion(reading: Reading) -> Check:
    """Whether the recording is long enough for a fit, the piston moves far enough, and a valve moves it."""
    log = reading.log
    length = float(log.time[-1] - log.time[0]) if len(log) else 0.0
    if "position" not in reading.measured or length < LONG:
        count = f"{int(np.isfinite(log['position']).sum()):,}"
        sentence = (
            f"the position has {count} samples in {length:.3g} s, less than a stroke, so nothing can be fitted; record "
            "some strokes, and check the unit of the time."
        )
        return Check(CHECK, f"{length:.3g} s", "bad", sentence)
    low, high = (float(q) for q in np.nanquantile(log["position"], (0.005, 0.995)))
    reach = high - low
    value = f"{shown(reach, 'position')} in {length:.3g} s"
    if reach <= max(REACH * reading.actuator.parameters.y_max, reading.blur("position")):
        sentence = (
            f"the position changes by {shown(reach, 'position')} only, so nothing can be learned about the load; "
            "record strokes, and check the channel and the unit of the position."
        )
        return Check(CHECK, value, "bad", sentence)
    if reading.driven and all(_is_constant(log[name]) for name in INPUTS):
        sentence = (
            "the piston moves, but neither duty cycle ever changes, so a fit cannot know what moves it; take the right "
            "channels for duty_supply and duty_exhaust."
        )
        return Check(CHECK, value, "bad", sentence)
    return Check(CHECK, value, "good", f"the piston moves over {value}.")


def _is_constant(values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    return known.size == 0 or bool(known.min() == known.max())

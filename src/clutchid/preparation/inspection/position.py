"""Checks of the position: motion, range, sign, and where the vented rest is."""

from __future__ import annotations

import numpy as np

from clutchid.log import INPUTS, FloatArray
from clutchid.preparation.inspection.reading import Check, Grade, InspectedRecording, shown, spread_over
from clutchid.recordings.strokes.vented_rest import ZeroedLog
from clutchid.simulation.plan import outside_stroke

MOTION = "motion"

#: Least reach of the piston as a fraction of its stroke, and length of a recording in s: half of a fast stroke.
REACH, LONG = 0.02, 0.2


def motion(reading: InspectedRecording) -> Check:
    """Whether the recording is long enough for a fit, the piston moves far enough, and a valve moves it."""
    log = reading.log
    length = float(log.time[-1] - log.time[0]) if len(log) else 0.0
    if "position" not in reading.measured or length < LONG:
        count = f"{int(np.isfinite(log['position']).sum()):,}"
        sentence = (
            f"the position has {count} samples in {length:.3g} s, less than a stroke, so nothing can be fitted; record "
            "some strokes, and check the unit of the time."
        )
        return Check(MOTION, f"{length:.3g} s", "bad", sentence)
    low, high = (float(q) for q in np.nanquantile(log["position"], (0.005, 0.995)))
    reach = high - low
    value = f"{shown(reach, 'position')} in {length:.3g} s"
    if reach <= max(REACH * reading.actuator.parameters.y_max, reading.blur("position")):
        sentence = (
            f"the position changes by {shown(reach, 'position')} only, so nothing can be learned about the load; "
            "record strokes, and check the channel and the unit of the position."
        )
        return Check(MOTION, value, "bad", sentence)
    if reading.driven and all(_is_constant(log[name]) for name in INPUTS):
        sentence = (
            "the piston moves, but neither duty cycle ever changes, so a fit cannot know what moves it; take the right "
            "channels for duty_supply and duty_exhaust."
        )
        return Check(MOTION, value, "bad", sentence)
    return Check(MOTION, value, "good", f"the piston moves over {value}.")


def _is_constant(values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    return known.size == 0 or bool(known.min() == known.max())


def position_range(reading: InspectedRecording) -> Check:
    """Whether the position lies in the stroke, by `clutchid.simulation.plan.outside_stroke`."""
    title, log = "range of position", reading.log
    low, high = (float(q) for q in np.nanquantile(log["position"], (0.005, 0.995)))
    value = f"{shown(low, 'position')} to {shown(high, 'position')}"
    sentences, alien = outside_stroke(log, reading.actuator.parameters.y_max)
    if not sentences:
        return Check(title, value, "good", f"the position ranges from {value}, inside the stroke.")
    return Check(title, value, "bad" if alien else "suspect", sentences[0].removeprefix(f"{log.name}: "))


SIGN = "sign of position"

#: Time in s for which motion continues after a valve has closed.
AFTER = 0.02

#: The sign is right if the net fraction of the motion in the expected direction is above this, wrong if below minus it.
CLEAR = 0.5


def direction(reading: InspectedRecording) -> Check:
    """Whether the piston goes up while the supply valve alone is open and down while the exhaust valve alone is."""
    if not reading.driven or "position" not in reading.measured:
        return Check(SIGN, "-", "undetermined", "the sign check needs a position and both duty cycles.")
    up, down = _moved(reading, True), _moved(reading, False)
    count = up.size + down.size
    if count < 2:
        sentence = "the piston does not move while only one valve is open, so the sign cannot be determined."
        return Check(SIGN, "-", "undetermined", sentence)
    share = float((up.sum() - down.sum()) / (np.abs(up).sum() + np.abs(down).sum()))
    grade: Grade = "good" if share > CLEAR else "bad" if share < -CLEAR else "suspect"
    value = f"{(1 + share) / 2:.0%} of the motion in the expected direction"
    facts = (
        f"the open supply valve changes the position by {up.sum() * 1e3:+.3g} mm in total, the open exhaust valve "
        f"by {down.sum() * 1e3:+.3g} mm"
    )
    advice = {
        "good": ".",
        "suspect": ": position and valves do not match, so a fit cannot estimate the load; check that the channels "
        "belong to one actuator and one time axis.",
        "bad": ": the sign of the position is wrong, or the duty cycles are swapped, so a fit cannot estimate the "
        "load; invert the position (zero where the clutch is engaged), or swap the duty cycles.",
    }
    return Check(SIGN, value, grade, facts + advice[grade])


def _moved(reading: InspectedRecording, supply: bool) -> FloatArray:
    """Changes of the position in m while only one valve is open, those above the noise."""
    starts, stops = reading.open_alone(supply)
    chosen = spread_over(starts.size)
    y, last = reading.log["position"], len(reading.log) - 1
    after = np.minimum(stops[chosen] - 1 + round(AFTER / reading.step), last)
    change = y[after] - y[starts[chosen]]
    return change[np.isfinite(change) & (np.abs(change) > reading.blur("position"))]


VENTED_REST = "vented rest"


def rest_check(rested: ZeroedLog) -> Check:
    """Whether the vented rest is where it was at the calibration."""
    shift = rested.shift
    if shift is None:
        sentence = "the vented rest cannot be compared with that of the calibration: one has none."
        return Check(VENTED_REST, "-", "undetermined", sentence)
    value = str(shift)
    if not shift.moved:
        return Check(VENTED_REST, value, "good", f"it is where it was at the calibration, {value}.")
    causes = "the position sensor or its bracket" if shift.value > 0.0 else "wear or the position sensor"
    sentence = (
        f"it has moved by {value} since the calibration, by {causes}; a reading subtracts that "
        "unless --zero keep is given."
    )
    return Check(VENTED_REST, value, "suspect", sentence)

"""Sign of the position: air into chamber A moves the piston to larger positions."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.check import Check, Grade
from clutchid.inspection.reading import Reading, spread_over
from clutchid.log import FloatArray

CHECK = "sign of position"

#: Time in s for which motion continues after a valve has closed.
AFTER = 0.02

#: The sign is right if the net fraction of the motion in the expected direction is above this, wrong if below minus it.
CLEAR = 0.5


def direction(reading: Reading) -> Check:
    """Whether the piston goes up while the supply valve alone is open and down while the exhaust valve alone is."""
    if not reading.driven or "position" not in reading.measured:
        return Check(CHECK, "-", "undetermined", "the sign check needs a position and both duty cycles.")
    up, down = _moved(reading, True), _moved(reading, False)
    count = up.size + down.size
    if count < 2:
        sentence = "the piston does not move while only one valve is open, so the sign cannot be determined."
        return Check(CHECK, "-", "undetermined", sentence)
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
    return Check(CHECK, value, grade, facts + advice[grade])


def _moved(reading: Reading, supply: bool) -> FloatArray:
    """Changes of the position in m while only one valve is open, those above the noise."""
    starts, stops = reading.open_alone(supply)
    chosen = spread_over(starts.size)
    y, last = reading.log["position"], len(reading.log) - 1
    after = np.minimum(stops[chosen] - 1 + round(AFTER / reading.step), last)
    change = y[after] - y[starts[chosen]]
    return change[np.isfinite(change) & (np.abs(change) > reading.blur("position"))]

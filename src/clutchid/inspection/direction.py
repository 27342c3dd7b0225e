"""Sign of the position against the supply: air into chamber A moves the piston to larger positions."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.finding import Finding, Verdict
from clutchid.inspection.reading import Reading, spread_over
from clutchid.log import FloatArray

CHECK = "sign of position"

#: Motion goes on for so long after a valve has closed, in s.
AFTER = 0.02

#: Share of the motion that goes with the valves where the sign is right; turned round, below minus this it is wrong.
CLEAR = 0.5


def direction(reading: Reading) -> Finding:
    """Whether the piston goes up while the supply valve alone is open and down while the exhaust valve alone is."""
    if not reading.driven or "position" not in reading.measured:
        return Finding(CHECK, "-", "not tellable", "the sign needs a position and both duty cycles.")
    up, down = _moved(reading, True), _moved(reading, False)
    count = up.size + down.size
    if count < 2:
        sentence = "the piston does not move while one of the valves alone is open, so the sign cannot be told."
        return Finding(CHECK, "-", "not tellable", sentence)
    share = float((up.sum() - down.sum()) / (np.abs(up).sum() + np.abs(down).sum()))
    verdict: Verdict = "good" if share > CLEAR else "bad" if share < -CLEAR else "look"
    value = f"{(1 + share) / 2:.0%} of the motion as it should be"
    facts = (
        f"the open supply valve moves the position by {up.sum() * 1e3:+.3g} mm in all and the open exhaust valve by "
        f"{down.sum() * 1e3:+.3g} mm"
    )
    advice = {
        "good": ".",
        "look": ": position and valves do not go together and a fit finds no load; check that the channels belong to "
        "one actuator and one time axis.",
        "bad": ": the sign of the position is wrong, or the duty cycles are interchanged, and a fit finds no load; "
        "turn the position round (its zero where the clutch is engaged), or interchange the duty cycles.",
    }
    return Finding(CHECK, value, verdict, facts + advice[verdict])


def _moved(reading: Reading, supply: bool) -> FloatArray:
    """Change of the position in m in each stretch with one valve open, where it is more than noise."""
    starts, stops = reading.open_alone(supply)
    chosen = spread_over(starts.size)
    y, last = reading.log["position"], len(reading.log) - 1
    after = np.minimum(stops[chosen] - 1 + round(AFTER / reading.step), last)
    change = y[after] - y[starts[chosen]]
    return change[np.isfinite(change) & (np.abs(change) > reading.blur("position"))]

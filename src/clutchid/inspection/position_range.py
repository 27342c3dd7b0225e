"""Range of the position: inside the stroke of the actuator, in the right unit and from the right zero."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.check import Check
from clutchid.inspection.reading import Reading, shown
from clutchid.simulation.plan import outside_stroke


def position_range(reading: Reading) -> Check:
    """Whether the position lies in the stroke, by `clutchid.simulation.plan.outside_stroke`."""
    title, log = "range of position", reading.log
    low, high = (float(q) for q in np.nanquantile(log["position"], (0.005, 0.995)))
    value = f"{shown(low, 'position')} to {shown(high, 'position')}"
    sentences, alien = outside_stroke(log, reading.actuator.parameters.y_max)
    if not sentences:
        return Check(title, value, "good", f"the position ranges from {value}, inside the stroke.")
    return Check(title, value, "bad" if alien else "suspect", sentences[0].removeprefix(f"{log.name}: "))

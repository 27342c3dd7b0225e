"""Range of the position: inside the stroke of the actuator, in its unit and counted from its zero."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.finding import Finding
from clutchid.inspection.reading import Reading, shown
from clutchid.simulation.plan import outside_stroke


def position_range(reading: Reading) -> Finding:
    """Whether the position lies in the stroke; `clutchid.simulation.plan.outside_stroke` says it in the same words."""
    check, log = "range of position", reading.log
    low, high = (float(q) for q in np.nanquantile(log["position"], (0.005, 0.995)))
    value = f"{shown(low, 'position')} to {shown(high, 'position')}"
    sentences, alien = outside_stroke(log, reading.actuator.parameters.y_max)
    if not sentences:
        return Finding(check, value, "good", f"the position runs from {value}, inside the stroke.")
    return Finding(check, value, "bad" if alien else "look", sentences[0].removeprefix(f"{log.name}: "))

"""How many integration steps a window needs: as many as the piston's place and speed there ask for.

The stiffest places of an actuator, a small chamber at a stop and a piston at full speed, are met in few windows. With
the steps that these need, most windows would take twice as long as they have to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.simulation.plan import Segment
from clutchid.simulation.stiffness import TOP_SPEED, local_stiffness, substeps
from clutchid.simulation.windows import Track, samples

#: Longest integration step in s, which a window that is not stiff takes: its error stays below a hundredth of what the
#: model misjudges in a window.
LONGEST = 5e-4

#: The stroke is looked at in so many parts; speeds in m/s, of which a window has the next higher one.
PARTS, SPEEDS = 4, (0.05, 0.15, TOP_SPEED)

#: What is added to a position in m and a speed in m/s that were measured, over so many s.
BEYOND, FASTER, OVER = 3e-4, 0.03, 8e-3


def paced(track: Track, actuator: Actuator, margin: float) -> Track:
    """`track` with as few integration steps in each window as are stable, and never more than it was planned with.

    Parameters
    ----------
    track : Track
        Its measured position says where the piston is; a window without keeps its steps.
    actuator : Actuator
        At the start of a search.
    margin : 1
        By how much stiffer it may become.
    """
    edges = np.linspace(0.0, actuator.parameters.y_max, PARTS + 1)
    edges[0], edges[-1] = -np.inf, np.inf

    @cache
    def rate(part: int, speed: float) -> float:
        return margin * local_stiffness(actuator, speed, (float(edges[part]), float(edges[part + 1])))

    return replace(track, windows=tuple(_paced(track, window, edges, rate) for window in track.windows))


def _paced(track: Track, window: Segment, edges: FloatArray, rate: Callable[[int, float], float]) -> Segment:
    position = track.measured["position"][window.start : window.stop]
    far = samples(window, OVER) - 1
    travel = np.abs(position[far:] - position[:-far])
    if not np.isfinite(travel).all() or travel.size == 0:
        return window
    fastest = float(travel.max()) / OVER + FASTER
    speed = next((limit for limit in SPEEDS if fastest <= limit), None)
    if speed is None:
        return window
    reach = np.array([position.min() - BEYOND, position.max() + BEYOND])
    first, last = np.searchsorted(edges, reach).clip(1, PARTS) - 1
    stiffest = max(rate(part, speed) for part in range(first, last + 1))
    steps = np.maximum(substeps(window.dt, stiffest), np.ceil(window.dt / LONGEST * (1 - 1e-9)).astype(np.int32))
    return replace(window, substeps=np.minimum(window.substeps, steps))

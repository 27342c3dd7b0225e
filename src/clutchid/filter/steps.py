"""Integration steps of an interval, from the state before it."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.filter.joint_arrays import Pace


@kernel
def steps_at(pace: Pace, position: float, speed: float, length: float, planned: int) -> int:
    """Integration steps over an interval of `length` s from a position in m at a speed in m/s.

    Without a pace they are as `planned`.
    """
    positions, speeds, rates = pace
    if rates.size == 0:
        return planned
    i, j = 0, 0
    while i < positions.size and position > positions[i]:
        i += 1
    while j < speeds.size and abs(speed) > speeds[j]:
        j += 1
    steps: int = math.ceil(length * rates[i, j] * (1.0 - 1e-9))
    return max(1, steps)

"""Innovations that contradict the inputs: their excess over what errors of the model explain, summed over time.

Page's cumulative sum (1954). The exported C has the same text, see `clutchid.codegen.kernel_c99`.
"""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: Standard deviations of an innovation that are no excess while the parameters learn, beyond which it is an outlier,
#: and while the piston stands, when nothing is learnt and the load against a worn stop is off for a second; and the
#: largest excess that counts. Provenance: docs/derivations_online.md.
LEARNING, STANDING, LARGEST_EXCESS = 4.0, 16.0, 8.0

#: A sum of the excess in s from which position and duty cycles contradict each other. Provenance:
#: docs/derivations_online.md.
CONTRADICTED = 0.3


@kernel
def excess_after(excess: float, size: float, learns: bool, seconds: float) -> float:
    """The sum of the excess after an innovation, from that before it."""
    allowance = LEARNING if learns else STANDING
    return max(0.0, excess + seconds * min(size - allowance, LARGEST_EXCESS))


@kernel
def first_contradiction(
    excess: FloatArray, errors: FloatArray, states: FloatArray, velocity: int, least_speed: float, seconds: float
) -> int:
    """The first of n samples at whose innovation the sum, (1,), is that of a contradiction; n if there is none.

    Parameters
    ----------
    excess : s, (1,)
        The sum before the first; changed to that after the last that is looked at.
    errors : (n, sensors, 2)
        Innovations with their variances, NaN where nothing was corrected; the first sensor is that of the position.
    states, velocity
        States by sample, (n, states), and the place of the velocity.
    least_speed : m/s
        Above which the parameters learn.
    seconds : s
        From one correction to the next.
    """
    for i in range(len(states)):
        if math.isfinite(errors[i, 0, 0]):
            size = abs(errors[i, 0, 0]) / math.sqrt(errors[i, 0, 1])
            excess[0] = excess_after(excess[0], size, abs(states[i, velocity]) > least_speed, seconds)
            if excess[0] >= CONTRADICTED:
                return i
    return len(states)

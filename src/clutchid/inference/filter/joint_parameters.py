"""The model at the free parameters theta, as every recursion needs it between two samples.

From theta to the arrays of the model, a step of theta, and the integration steps where the piston is.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from clutchid.codegen.kernels import kernel
from clutchid.inference.filter.setup import (
    BOUND_HIGH,
    BOUND_LOW,
    LAG_OF,
    LEAST,
    MEAN,
    MOST,
    OFFSET_OF,
    PARAMETER,
    POSITIVE,
    PRIOR_WIDTH,
    WEIGHT,
    Derived,
    FreeArrays,
    ModelArrays,
)
from clutchid.log import FloatArray, IntArray
from clutchid.simulation.stiffness import Pace


@kernel
def value_in_si(numbers: FloatArray, theta: float) -> float:
    """A free parameter in SI; `numbers` is its row, see `arrays`."""
    step = numbers[PRIOR_WIDTH] * theta
    value = numbers[MEAN] + step
    if numbers[POSITIVE] > 0.0:
        value = numbers[MEAN] * math.exp(min(max(step, -50.0), 50.0))
    return float(min(max(value, numbers[BOUND_LOW]), numbers[BOUND_HIGH]))


@kernel
def combine_load(load: FloatArray, basis: FloatArray, pieces: IntArray, weights: FloatArray) -> None:
    """The table of the load from that of its basis functions, whose pieces outside of `pieces` are 0."""
    load[:] = 0.0
    for b in range(weights.size):
        for s in range(pieces[b, 0], pieces[b, 1] + 1):
            for c in range(4):
                load[s, c] += weights[b] * basis[b, s, c]


@kernel
def refresh(
    prepare: Callable[..., None], theta: FloatArray, free: FreeArrays, derived: Derived, model: ModelArrays
) -> None:
    """Parameters, load and sensors of the model at theta, from theta alone."""
    numbers, places = free.numbers, free.places
    by_weight, by_parameter = False, False
    for j in range(theta.size):
        value = value_in_si(numbers[j], theta[j])
        derived.slopes[j] = numbers[j, PRIOR_WIDTH] * (value if numbers[j, POSITIVE] > 0.0 else 1.0)
        if places[j, WEIGHT] >= 0:
            derived.weights[places[j, WEIGHT]], by_weight = value, True
        else:
            model.p[places[j, PARAMETER]], by_parameter = value, True
        if places[j, LAG_OF] >= 0:
            derived.lags[places[j, LAG_OF]] = value
        if places[j, OFFSET_OF] >= 0:
            derived.of_sensor[places[j, OFFSET_OF], 0] = value
    if by_weight:
        combine_load(model.load, model.basis, free.pieces, derived.weights)
    if by_parameter:
        prepare(model.p, model.fill_slot, model.work)


@kernel
def within(numbers: FloatArray, theta: float) -> float:
    """A coordinate within its bounds; `numbers` is its row."""
    return float(min(max(theta, numbers[LEAST]), numbers[MOST]))


@kernel
def move_parameters(x: FloatArray, S: FloatArray, theta: FloatArray, free: FreeArrays, step: FloatArray) -> None:
    """Move theta by `step`, within its bounds, and x with it along D."""
    numbers = free.numbers
    for j in range(theta.size):
        before = value_in_si(numbers[j], theta[j])
        theta[j] = within(numbers[j], theta[j] + step[j])
        change = value_in_si(numbers[j], theta[j]) - before
        for i in range(x.size):
            x[i] += S[i, j] * change


@kernel
def first_deviations(S: FloatArray, T: FloatArray, slopes: FloatArray, deviations: FloatArray, w: FloatArray) -> None:
    """Standard deviations of the first states, as many as `deviations` (n,) has room for, in SI; w (k,) is scratch."""
    k = T.shape[0]
    for i in range(deviations.size):
        w[:] = 0.0
        for q in range(k):
            by_theta = S[i, q] * slopes[q]
            for j in range(q + 1):
                w[j] += by_theta * T[q, j]
        variance = 0.0
        for j in range(k):
            variance += w[j] * w[j]
        for j in range(k, S.shape[1]):
            variance += S[i, j] * S[i, j]
        deviations[i] = math.sqrt(variance)


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

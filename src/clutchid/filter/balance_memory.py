"""What least squares on the balance of forces remember between samples: positions, intervals, and the window."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: A position further from the last one than this in m for each sample since is left out: faster than any piston.
REACH = 1e-3

#: For each sample without a usable position so many with one must follow before the balance counts again: the pressure
#: in open loop knows nothing of how the piston moved meanwhile, until the chamber is vented. Provenance:
#: docs/derivations_online.md.
RENEWAL = 2.0

#: What stands in `JointState.waiting` behind the late state (size,): usable positions in a row, less than 0 while more
#: have to follow; missing ones in a row; intervals in the window, with what mass times velocity gained, impulse and
#: length; derivatives with respect to the weights (k,); late velocity; the last positions (samples,) and intervals
#: (late + 1, inputs + 1), the oldest first.
AGE, MISSING, IN_WINDOW, MASS_TIMES_SPEED, IMPULSE, SECONDS, HEAD = range(7)


@kernel
def push(memory: FloatArray, first: int, width: int, count: int) -> None:
    """Move `count` rows of `width` numbers up by one: the oldest is lost, the last is free."""
    for i in range(first, first + (count - 1) * width):
        memory[i] = memory[i + width]


@kernel
def take_position(memory: FloatArray, first: int, samples: int, value: float) -> None:
    """Put a position behind the others; one that is missing, or that no piston can have reached, is as the last."""
    last = first + samples - 1
    newest = memory[last]
    push(memory, first, 1, samples)
    usable = not math.isnan(value) and abs(value - newest) <= REACH * (1.0 + memory[MISSING])
    memory[last] = value if usable else newest
    memory[AGE] = memory[AGE] + 1.0 if usable else min(memory[AGE], 0.0) - RENEWAL
    memory[MISSING] = 0.0 if usable else memory[MISSING] + 1.0


@kernel
def smoothed(weights: FloatArray, memory: FloatArray, first: int) -> float:
    """The sum of the last positions with weights."""
    total = 0.0
    for j in range(weights.size):
        total += weights[j] * memory[first + j]
    return total


@kernel
def take_interval(memory: FloatArray, first: int, u: FloatArray, length: float) -> None:
    """Put inputs and length in s of an interval behind the others."""
    width = u.size + 1
    count = (memory.size - first) // width
    push(memory, first, width, count)
    at = first + (count - 1) * width
    memory[at : at + u.size] = u
    memory[at + u.size] = length


@kernel
def add_to_window(memory: FloatArray, h: FloatArray, gained: float, impulse: float, length: float) -> None:
    """Add what mass times velocity gained in an interval, the impulse, and its derivatives, to those of the window."""
    memory[IN_WINDOW] += 1.0
    memory[MASS_TIMES_SPEED] += gained
    memory[IMPULSE] += impulse
    memory[SECONDS] += length
    for j in range(h.size):
        memory[HEAD + j] -= h[j] * length

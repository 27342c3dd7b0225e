"""The end of a search: the free numbers move, the states settle to what they say (variable projection).

Parameters and states that move together are held up by the few windows in which the piston sticks: they are so far from
linear that every step has to be short, and the search seems to have ended where a step of the parameters alone, after
which the states are let go, still gains much. So a step is judged where its states have settled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Literal

import numpy as np

from clutchid.estimate.least_squares import Failure
from clutchid.estimate.shooting.elimination import Eliminated, recover
from clutchid.estimate.shooting.problem import Linear, Shooting, condense, cost_at, linearise
from clutchid.estimate.shooting.windows import units
from clutchid.log import FloatArray

#: Most steps of the free numbers, how often one is tried shorter, and the gain of a whole one that ends the search.
STEPS, SHORTER, SETTLED = 25, 4, 0.1

#: Longest step of a free number in standard deviations of its prior, and by what part it gets shorter. A number whose
#: step is too long to be believed, as that of a stop that the piston hits, does not hold up the others.
LONGEST, PART = 3.0, 0.2

#: Most steps of the states, most trials of one, and the gain that ends them.
STATE_STEPS, TRIALS, CALM = 6, 6, 0.3

States = tuple[FloatArray, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Where the search ended: parameters, window starts of every track, and the problem there."""

    x: FloatArray
    X: States
    at: Linear
    status: Literal["converged", "stalled", "limit"]
    evaluations: int


def project(task: Shooting, x: FloatArray, X: Sequence[FloatArray], tell: Callable[[int], None]) -> Found | Failure:
    """Minimise the cost of `task` by Gauss-Newton steps of the free numbers, each judged where the states have settled.

    Parameters
    ----------
    task : Shooting
        The problem.
    x, X : 1, SI
        Free numbers, within their bounds, and window starts, one array a track.
    tell : function(evaluations)
        Called at each evaluation.

    Returns
    -------
    found : Found
        "converged" where a step gains, or would gain, less than `SETTLED`; "stalled" where no short one gains either.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.

    References
    ----------
    Variable projection: Golub and Pereyra 1973.
    """
    counter = count(1)

    def counted() -> None:
        tell(next(counter))

    def settled(at: FloatArray, states: States, limit: float = np.inf) -> tuple[States, Linear] | Failure:
        """The problem at `at` with its states settled, where that costs less than `limit`."""
        found = settle(task, at, states, counted)
        if isinstance(found, Failure) or found[1] >= limit:
            return found if isinstance(found, Failure) else Failure("the step gains nothing")
        counted()
        there = linearise(task, task.noise, at, found[0])
        return there if isinstance(there, Failure) else (found[0], there)

    begin = settled(x, tuple(X))
    if isinstance(begin, Failure):
        return begin
    settled_X, here = begin
    longest = LONGEST
    for _ in range(STEPS):
        factor, chains = condense(task, here)
        if _gain(factor, bounded_step(task, factor, x)) < SETTLED:
            return Found(x, settled_X, here, "converged", next(counter))
        before = here.cost
        for trial in range(1 + SHORTER):
            step = bounded_step(task, factor, x, longest=longest)
            there = settled(x + step, _moved(task, settled_X, chains, step), before)
            if not isinstance(there, Failure):
                x, (settled_X, here) = x + step, there
                longest = min(longest / PART, LONGEST) if trial == 0 else longest
                break
            longest *= PART
        if here.cost == before:
            return Found(x, settled_X, here, "stalled", next(counter))
        if before - here.cost < SETTLED:
            return Found(x, settled_X, here, "converged", next(counter))
    return Found(x, settled_X, here, "limit", next(counter))


def settle(task: Shooting, x: FloatArray, X: States, tell: Callable[[], None]) -> tuple[States, float] | Failure:
    """States near `X` at which the cost of `task` is least for the free numbers `x`, and that cost.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    tell()
    here = linearise(task, task.noise, x, X, free=False)
    if isinstance(here, Failure):
        return here
    damping = 1e-2
    for _ in range(STATE_STEPS):
        before = here.cost
        X, here, damping = _state_step(task, x, (X, here), damping, tell)
        if before - here.cost < CALM:
            break
    return X, here.cost


def _state_step(
    task: Shooting, x: FloatArray, start: tuple[States, Linear], damping: float, tell: Callable[[], None]
) -> tuple[States, Linear, float]:
    """A step of the states alone that lowers the cost, the problem after it, and the next damping; else no step."""
    X, here = start
    for _ in range(TRIALS):
        _, chains = condense(task, here, damping)
        moved = stepped(task, X, chains, np.zeros(0))
        tell()
        if cost_at(task, task.noise, x, moved) < here.cost:
            there = linearise(task, task.noise, x, moved, free=False)
            if isinstance(there, Linear):
                return moved, there, max(damping / 10, 1e-6)
        damping *= 10
    return X, here, damping


def stepped(task: Shooting, X: Sequence[FloatArray], chains: Sequence[Eliminated], step: FloatArray) -> States:
    """States `X` after their own step that goes with a `step` of the free numbers, empty where those are held.

    Raises
    ------
    Nothing: a chain always determines its states.
    """
    unit = units(task.actuator)
    return tuple(x + recover(chain, step[:, None])[:, :, 0] * unit for x, chain in zip(X, chains, strict=True))


def _moved(task: Shooting, X: States, chains: Sequence[Eliminated], step: FloatArray) -> States:
    """Settled states `X` as they follow a step of the free numbers."""
    unit, both = units(task.actuator), np.column_stack([step, np.zeros_like(step)])
    followed = (recover(chain, both) for chain in chains)
    return tuple(states + (f[:, :, 0] - f[:, :, 1]) * unit for states, f in zip(X, followed, strict=True))


def _gain(factor: FloatArray, step: FloatArray) -> float:
    """By how much the cost falls with a step, were the problem linear."""
    before, after = factor[:, -1], factor[:, :-1] @ step + factor[:, -1]
    return float(before @ before - after @ after)


def bounded_step(
    task: Shooting, factor: FloatArray, x: FloatArray, damping: float = 0.0, longest: float = LONGEST
) -> FloatArray:
    """The damped step of the free numbers from `x` that stays within their bounds.

    Parameters
    ----------
    task : Shooting
        Says the bounds.
    factor : (k + 1, k + 1)
        Triangular factor of all rows on the free numbers, ``[R | q]``.
    x : (k,)
        Where the step begins.
    damping : 1
        Of Levenberg and Marquardt, at least 0.
    longest : 1
        How far each number may move.

    Raises
    ------
    Nothing: what nothing tells does not move.
    """
    R, q = factor[:, :-1], factor[:, -1]
    matrix = np.vstack([R, np.sqrt(damping) * np.diag(np.sqrt(np.sum(R**2, axis=0)))])
    target = -np.concatenate([q, np.zeros(x.size)])
    low, high = task.bounds()
    least, most = np.maximum(low - x, -longest), np.minimum(high - x, longest)
    step = np.linalg.lstsq(matrix, target, rcond=None)[0]
    if np.any(step < least) or np.any(step > most):
        from scipy.optimize import lsq_linear

        box = (np.minimum(least, -1e-12), np.maximum(most, 1e-12))
        step = lsq_linear(matrix, target, bounds=box, method="bvls").x
    clipped: FloatArray = np.clip(x + step, low, high) - x
    return clipped

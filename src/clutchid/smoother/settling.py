"""The states of all windows settle to what the free numbers say.

A few windows in which the piston sticks are so far from linear that a whole step of theirs costs more; all others would
wait for them. So each window is held as firmly as it needs: where it did not do what the linear problem said.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.simulation.windows import units
from clutchid.smoother.elimination import Eliminated, recover
from clutchid.smoother.problem import FitProblem, LinearisedProblem, condense
from clutchid.smoother.trial import Trial, accept, attempt

#: Most steps of the states, most trials of one, and the gain that ends them.
STEPS, TRIALS, CALM = 12, 6, 0.3

#: How firmly windows are held: at first, at least after a step that went wrong, at least; by what factor more or less.
LOOSE, FIRM, LOOSEST, HARDER = 1e-3, 1.0, 1e-6, 10.0

#: A step went wrong in a window where it cost more than was said, by this share of what was hoped for all.
WRONG = 0.05

States = tuple[FloatArray, ...]
Damping = list[FloatArray]


def loose(task: FitProblem) -> Damping:
    """How firmly windows are held before any step: an array a track, which settling changes in place."""
    return [np.full(len(track.windows), LOOSE) for track in task.tracks]


def settle(task: FitProblem, here: LinearisedProblem, damping: Damping, tell: Callable[[], None]) -> LinearisedProblem:
    """The problem of the states alone, from `here`, where it costs least.

    Parameters
    ----------
    task : FitProblem
        The problem.
    here : LinearisedProblem
        With theta held.
    damping : an array a track
        How firmly each window is held; changed in place, for the next time.
    tell : function
        Called at each step.

    Returns
    -------
    settled : LinearisedProblem
        Costs no more than `here`.
    """
    for _ in range(STEPS):
        tell()
        before = here.cost
        here = _step(task, here, damping)
        if before - here.cost < CALM:
            break
    return here


def _step(task: FitProblem, here: LinearisedProblem, damping: Damping) -> LinearisedProblem:
    """A step of the states that lowers the cost, or none."""
    trial: Trial | None = None
    for _ in range(TRIALS):
        _, chains = condense(task, here, damping)
        there = attempt(task, here, here.x, stepped(task, here.X, chains, np.zeros(0)), trial)
        if isinstance(there, Failure):
            damping[:] = [HARDER * held for held in damping]
            continue
        trial = there
        hoped = _learn(here, trial, damping)
        if trial.cost < here.cost:
            reached = accept(task, trial, free=False)
            if isinstance(reached, LinearisedProblem):
                return reached
        if hoped < CALM:
            break
    return here


def _learn(here: LinearisedProblem, trial: Trial, damping: Damping) -> float:
    """Hold windows in which a trial went wrong more firmly, others less where it gains; what was hoped to gain."""
    known = [chain.windows.costs - chain.windows.linearised.cost for chain in here.chains]
    excess = [now - before for now, before in zip(trial.excess, known, strict=True)]
    gain = here.cost - trial.cost
    hoped = gain + sum(float(more.sum()) for more in excess)
    for held, more in zip(damping, excess, strict=True):
        wrong = more > WRONG * max(hoped, CALM)
        held[wrong] = np.maximum(held[wrong] * HARDER, FIRM)
        if gain > 0.0:
            held[~wrong] = np.maximum(held[~wrong] / HARDER, LOOSEST)
    return hoped


def stepped(task: FitProblem, X: Sequence[FloatArray], chains: Sequence[Eliminated], step: FloatArray) -> States:
    """States `X` after their own step that goes with a `step` of the free numbers, empty where those are held."""
    unit = units(task.actuator)
    return tuple(x + recover(chain, step[:, None])[:, :, 0] * unit for x, chain in zip(X, chains, strict=True))


def followed(task: FitProblem, X: Sequence[FloatArray], chains: Sequence[Eliminated], step: FloatArray) -> States:
    """Settled states `X` as they follow a `step` of the free numbers."""
    stay, go = (stepped(task, X, chains, by) for by in (np.zeros_like(step), step))
    return tuple(x + (there - here) for x, here, there in zip(X, stay, go, strict=True))

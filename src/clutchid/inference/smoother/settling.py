"""Minimisation over the states of all windows, with fixed parameters.

A few windows with stiction are strongly nonlinear, so that a full step there raises the cost. A common damping would
slow down all other windows; each window therefore has a damping of its own, raised where the linear prediction failed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from clutchid.inference.smoother.elimination import Eliminated, recover
from clutchid.inference.smoother.problem import FitProblem, LinearisedProblem, condense
from clutchid.inference.smoother.trial import Trial, accept, evaluate_step
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.simulation.windows import units

#: Most steps, most trials of a step, and the decrease of the cost below which the states have converged.
MAX_STEPS, MAX_TRIALS, CONVERGED_GAIN = 12, 6, 0.3

#: Damping of a window: initial, least value after a failed prediction, least value, and factor of a change.
INITIAL_DAMPING, REJECTED_DAMPING, MIN_DAMPING, DAMPING_FACTOR = 1e-3, 1.0, 1e-6, 10.0

#: The prediction failed in a window whose cost exceeds it by more than this fraction of the total predicted gain.
REJECTED_EXCESS = 0.05

States = tuple[FloatArray, ...]
Damping = list[FloatArray]


def initial_damping(problem: FitProblem) -> Damping:
    """Damping of all windows before the first step: one array per track, which the search changes in place."""
    return [np.full(len(track.windows), INITIAL_DAMPING) for track in problem.tracks]


def minimise_states(
    problem: FitProblem, current: LinearisedProblem, damping: Damping, on_evaluation: Callable[[], None]
) -> LinearisedProblem:
    """Minimise the cost over the states, with theta fixed.

    Parameters
    ----------
    problem : FitProblem
        Recordings and noise.
    current : LinearisedProblem
        Start, with theta fixed.
    damping : one array per track
        Damping of each window; changed in place, for the next call.
    on_evaluation : function
        Called at each step.

    Returns
    -------
    minimised : LinearisedProblem
        With a cost of at most that of `current`.
    """
    for _ in range(MAX_STEPS):
        on_evaluation()
        before = current.cost
        current = _step(problem, current, damping)
        if before - current.cost < CONVERGED_GAIN:
            break
    return current


def _step(problem: FitProblem, current: LinearisedProblem, damping: Damping) -> LinearisedProblem:
    """The problem after a step of the states that lowers the cost, or `current`."""
    trial: Trial | None = None
    for _ in range(MAX_TRIALS):
        _, chains = condense(problem, current, damping)
        X = stepped_states(problem, current.X, chains, np.zeros(0))
        candidate = evaluate_step(problem, current, current.x, X, trial)
        if isinstance(candidate, Failure):
            damping[:] = [DAMPING_FACTOR * windows for windows in damping]
            continue
        trial = candidate
        predicted = _update_damping(current, trial, damping)
        if trial.cost < current.cost:
            accepted = accept(problem, trial, free=False)
            if isinstance(accepted, LinearisedProblem):
                return accepted
        if predicted < CONVERGED_GAIN:
            break
    return current


def _update_damping(current: LinearisedProblem, trial: Trial, damping: Damping) -> float:
    """Raise the damping of windows whose prediction failed, lower the others after a gain; the predicted gain."""
    before = [chain.windows.costs - chain.windows.linearised.cost for chain in current.chains]
    excess = [now - then for now, then in zip(trial.excess, before, strict=True)]
    gain = current.cost - trial.cost
    predicted = gain + sum(float(more.sum()) for more in excess)
    for windows, more in zip(damping, excess, strict=True):
        failed = more > REJECTED_EXCESS * max(predicted, CONVERGED_GAIN)
        windows[failed] = np.maximum(windows[failed] * DAMPING_FACTOR, REJECTED_DAMPING)
        if gain > 0.0:
            windows[~failed] = np.maximum(windows[~failed] / DAMPING_FACTOR, MIN_DAMPING)
    return predicted


def stepped_states(
    problem: FitProblem, X: Sequence[FloatArray], chains: Sequence[Eliminated], step: FloatArray
) -> States:
    """States `X` after the Gauss-Newton step that belongs to a `step` of the parameters, empty if those are fixed."""
    unit = units(problem.actuator)
    return tuple(x + recover(chain, step[:, None])[:, :, 0] * unit for x, chain in zip(X, chains, strict=True))


def shifted_states(
    problem: FitProblem, X: Sequence[FloatArray], chains: Sequence[Eliminated], step: FloatArray
) -> States:
    """Minimised states `X` shifted, to first order, with a `step` of the parameters."""
    without, with_step = (stepped_states(problem, X, chains, by) for by in (np.zeros_like(step), step))
    return tuple(x + (after - before) for x, before, after in zip(X, without, with_step, strict=True))

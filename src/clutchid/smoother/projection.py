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

from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.smoother.problem import FitProblem, LinearisedProblem, condense, linearise
from clutchid.smoother.settling import Damping, States, followed, loose, settle
from clutchid.smoother.trial import NO_GAIN, Trial, accept, attempt, with_theta_fixed, with_theta_free

#: Most steps of the free numbers, how often one is tried shorter, and the gain of a whole one that ends the search.
STEPS, SHORTER, SETTLED = 25, 4, 0.1

#: Longest step of a free number in standard deviations of its prior, and by what part it gets shorter. A number whose
#: step is too long to be believed, as that of a stop that the piston hits, does not hold up the others.
LONGEST, PART = 3.0, 0.2

#: Where a step gains less than `SETTLED` although this much is hoped for, derivatives of points nearby may be to blame:
#: all are renewed.
DOUBTED = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class ShootingSolution:
    """Where the search ended: parameters, window starts of every track, and the problem there."""

    x: FloatArray
    X: States
    at: LinearisedProblem
    status: Literal["converged", "stalled", "limit"]
    evaluations: int


def project(
    task: FitProblem, x: FloatArray, X: Sequence[FloatArray], tell: Callable[[int], None]
) -> ShootingSolution | Failure:
    """Minimise the cost of `task` by Gauss-Newton steps of the free numbers, each judged where the states have settled.

    Parameters
    ----------
    task : FitProblem
        The problem.
    x, X : 1, SI
        Free numbers, within their bounds, and window starts, one array a track.
    tell : function(evaluations)
        Called at each evaluation.

    Returns
    -------
    found : ShootingSolution
        "converged" where a step would gain less than `SETTLED`, or gains less where less than `DOUBTED` was hoped for;
        "stalled" where more is hoped for and no short step gains it, even with derivatives renewed.

    References
    ----------
    Variable projection: Golub and Pereyra 1973.
    """
    counter = count(1)
    way = _Way(task, loose(task), lambda: tell(next(counter)))
    begin = way.begin(x, X)
    if isinstance(begin, Failure):
        return begin
    here, longest, renewed = begin, LONGEST, False

    def end(status: Literal["converged", "stalled", "limit"]) -> ShootingSolution:
        return ShootingSolution(here.x, here.X, here, status, next(counter))

    for _ in range(STEPS):
        there, hoped, longest = way.step(here, longest)
        gained, here = here.cost - there.cost, there
        if gained >= SETTLED:
            renewed = False
        elif hoped < (DOUBTED if gained > 0.0 else SETTLED):
            return end("converged")
        elif renewed or hoped < DOUBTED:
            return end("stalled")
        else:
            again = way.begin(here.x, here.X)
            if isinstance(again, Failure):
                return again
            here, longest, renewed = again, LONGEST, True
    return end("limit")


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """The way of a search: its problem, how firmly its windows are held by now, and who is told of each evaluation."""

    task: FitProblem
    damping: Damping
    tell: Callable[[], None]

    def begin(self, x: FloatArray, X: Sequence[FloatArray]) -> LinearisedProblem | Failure:
        """The problem at `x`, its states settled from `X`, with derivatives of its own."""
        self.tell()
        here = linearise(self.task, x, X)
        if isinstance(here, Failure):
            return here
        return with_theta_free(
            self.task, here, settle(self.task, with_theta_fixed(self.task, here), self.damping, self.tell)
        )

    def step(self, here: LinearisedProblem, longest: float) -> tuple[LinearisedProblem, float, float]:
        """The problem after a step, or `here` where none gains; what a whole one would; the longest to try next."""
        factor, chains = condense(self.task, here)
        hoped = _gain(factor, bounded_step(self.task, factor, here.x))
        if hoped < SETTLED:
            return here, hoped, longest
        for trial in range(1 + SHORTER):
            step = bounded_step(self.task, factor, here.x, longest=longest)
            there = self._reached(here, here.x + step, followed(self.task, here.X, chains, step))
            if isinstance(there, LinearisedProblem):
                return there, hoped, min(longest / PART, LONGEST) if trial == 0 else longest
            longest *= PART
        return here, hoped, longest

    def _reached(self, here: LinearisedProblem, x: FloatArray, X: States) -> LinearisedProblem | Failure:
        """The problem at `x`, its states settled from `X`, where that costs less than `here`."""
        self.tell()
        trial = attempt(self.task, here, x, X)
        there = accept(self.task, trial, free=False) if isinstance(trial, Trial) else trial
        if isinstance(there, Failure):
            return there
        settled = settle(self.task, there, self.damping, self.tell)
        if settled.cost >= here.cost:
            return NO_GAIN
        return with_theta_free(self.task, here, settled)


def _gain(factor: FloatArray, step: FloatArray) -> float:
    """By how much the cost falls with a step, were the problem linear."""
    before, after = factor[:, -1], factor[:, :-1] @ step + factor[:, -1]
    return float(before @ before - after @ after)


def bounded_step(
    task: FitProblem, factor: FloatArray, x: FloatArray, damping: float = 0.0, longest: float = LONGEST
) -> FloatArray:
    """The damped step of the free numbers from `x` that stays within their bounds.

    Parameters
    ----------
    task : FitProblem
        Says the bounds.
    factor : (k + 1, k + 1)
        Triangular factor of all rows on the free numbers, ``[R | q]``.
    x : (k,)
        Where the step begins.
    damping : 1
        Of Levenberg and Marquardt, at least 0.
    longest : 1
        How far each number may move.
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

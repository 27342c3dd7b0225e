"""Search in stages (continuation): from a nearly linear problem with inflated standard deviations to the actual one.

The stage without inflation takes Gauss-Newton steps of the parameters by variable projection. Simultaneous steps of
parameters and states are limited by the few windows with stiction, which are strongly nonlinear: every step has to be
short, and the search stalls although a step of the parameters, followed by a minimisation over the states, still lowers
the cost considerably. Each step is therefore judged after its states have been minimised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import LinearisedProblem, condense, linearise
from clutchid.inference.smoother.rows import Eliminated
from clutchid.inference.smoother.trial import (
    NO_GAIN,
    Damping,
    Trial,
    accept,
    evaluate_step,
    initial_damping,
    minimise_states,
    shifted_states,
    stepped_states,
    with_theta_fixed,
    with_theta_free,
)
from clutchid.log import BoolArray, FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import SearchStatus, Solution, bounded_solution
from clutchid.numerics.progress import Progress, Stage, Step

#: Factors on all standard deviations, stage by stage, for a start at the priors and at calibrated values.
STAGES_FROM_PRIOR, STAGES_FROM_CALIBRATION, FINE_STAGE = (30.0, 8.0, 1.0), (8.0, 1.0), (1.0,)

#: Most steps of a coarse stage, and the relative decrease of the cost below which it has converged.
_COARSE_STEPS, _COARSE_TOLERANCE = 5, 1e-2

#: Most steps of the parameters, most reductions of the radius in a step, and the decrease of the cost by a full step
#: below which the search has converged.
MAX_STEPS, _MAX_REDUCTIONS, CONVERGED_GAIN = 100, 4, 0.1

#: Largest trust-region radius in standard deviations of the prior, and the factor of a reduction. The region is a box,
#: so that one parameter with an excessive step, such as that of a stop, does not shorten those of the others.
_MAX_RADIUS, _SHRINK_FACTOR = 3.0, 0.2

#: A predicted decrease that need not be achieved for the search to have converged, and the share of a predicted one
#: below which a step suffers from derivatives that were kept from nearby points: the problem is linearised anew.
_LITTLE_TO_GAIN, _POOR_SHARE = 2.0, 0.3

#: A predicted decrease of the cost per free parameter that two steps in a row need not come close to: the parameters
#: are then off by a third of their standard errors, whose squares add up to 1 per parameter. Provenance:
#: benchmarks/results/calibration.md, `python benchmarks/seconds.py`.
INSIGNIFICANT = 0.1

#: A step that comes to a kink of the cost from above ends this far below it, where derivatives are those below; one
#: from below ends so far above it that windows show those above.
_AT_KINK, _BEYOND_KINK = 1e-6, 0.03


#: Most evaluations of a search, its restarts included: the calibration that needed most had converged after 529.
#: Provenance: `python benchmarks/pairs.py OUT --analyse`, benchmarks/results/changes.md.
MOST_IN_A_SEARCH = 1500


class Effort(NamedTuple):
    """Limits that end a search without progress.

    After `most` evaluations, and after `patience` of them where the solution still costs more than `hopeless`. `whole`
    is the limit of all searches of a fit together.
    """

    most: float = MOST_IN_A_SEARCH
    patience: float = np.inf
    hopeless: float = np.inf
    whole: float = MOST_IN_A_SEARCH

    def is_spent(self, evaluations: int, cost: float) -> bool:
        """Whether to end after so many evaluations at a cost."""
        return evaluations >= (min(self.patience, self.most) if cost > self.hopeless else self.most)

    def after(self, evaluations: int) -> Effort:
        """That of a further search, after so many evaluations in all."""
        return self._replace(most=min(self.most, self.whole - evaluations))


#: That of a search which nothing else limits.
USUAL_EFFORT = Effort()


#: Called at each evaluation with their number and the least cost so far.
OnEvaluation = Callable[[int, float], None]

#: Window starts, one array per track; or the problem, with any prior, linearised at a point nearby, from which they and
#: most derivatives follow.
Begin = Sequence[FloatArray] | LinearisedProblem

#: Solution of a search by multiple shooting: its parameters, and the linearised problem there.
ShootingSolution = Solution[LinearisedProblem]


def search(
    problem: Problem,
    x: FloatArray,
    X: Begin,
    stages: Sequence[float],
    progress: Progress | None = None,
    before: int = 0,
    effort: Effort = USUAL_EFFORT,
) -> ShootingSolution | Failure:
    """Minimise the cost of `problem` from `x` and `X` in stages of decreasing inflation, after `before` evaluations.

    Coarse stages step parameters and states simultaneously. With inflated standard deviations the states follow the
    measurement and the parameters change little, so that a poor start does not lead to a distant local minimum. The
    stage without inflation is `project`, which takes the `effort`.
    """
    solution: ShootingSolution | Failure = Failure("no stage to search in")
    count = before
    for inflation in stages:
        on_evaluation = _counted(progress, inflation, count, effort.whole)
        if inflation == 1.0:
            solution = project(problem, x, X, on_evaluation, effort)
        else:
            starts = X.X if isinstance(X, LinearisedProblem) else X
            solution = _stage(replace(problem, noise=problem.noise.inflated(inflation)), (x, starts), on_evaluation)
        if isinstance(solution, Failure):
            return solution
        x, X, count = solution.x, solution.at.X, count + solution.evaluations
    return replace(solution, evaluations=count) if isinstance(solution, Solution) else solution


def _counted(progress: Progress | None, inflation: float, before: int, most: float) -> OnEvaluation:
    stage: Stage = "fine search" if inflation == 1.0 else "coarse search"
    return lambda count, cost: progress(Step(stage, before + count, cost, most)) if progress else None


def _stage(
    problem: Problem, start: tuple[FloatArray, Sequence[FloatArray]], on_evaluation: OnEvaluation
) -> ShootingSolution | Failure:
    """Levenberg-Marquardt on parameters and states together, for a problem that is nearly linear."""
    begin = linearise(problem, *start)
    if isinstance(begin, Failure):
        return begin
    current, damping, growth, steps = begin, 1e-3, 2.0, _COARSE_STEPS
    for count in range(1, 4 * _COARSE_STEPS):
        on_evaluation(count, current.cost)
        candidate = coarse_step(problem, current, damping)
        if isinstance(candidate, LinearisedProblem):
            converged = current.cost - candidate.cost < _COARSE_TOLERANCE * current.cost
            current = candidate
            damping, growth = max(damping / 5, 1e-7), 2.0
            steps -= 1
            if converged or steps == 0:
                return Solution(current.x, current, "converged" if converged else "limit", count + 1)
        else:
            damping, growth = max(damping * growth, 1e-4), 2 * growth
            if damping > 1e9:
                return Solution(current.x, current, "stalled", count + 1)
    return Solution(current.x, current, "limit", 4 * _COARSE_STEPS)


def coarse_step(problem: Problem, current: LinearisedProblem, damping: float) -> LinearisedProblem | Failure:
    """The problem after a damped step of parameters, within their bounds, and states, where that costs less."""
    factor, chains = condense(problem, current, [np.full(len(track.windows), damping) for track in problem.tracks])
    step = bounded_step(problem.bounds(), factor, current.x, damping)
    trial = evaluate_step(problem, current, current.x + step, stepped_states(problem, current.X, chains, step))
    if isinstance(trial, Failure):
        return trial
    return accept(problem, trial) if trial.cost < current.cost else NO_GAIN


def settled(problem: Problem, solution: ShootingSolution, x: FloatArray) -> ShootingSolution | Failure:
    """`solution` moved to x, with the states that cost least there."""
    at = VariableProjection.of(problem, lambda: False).moved(solution.at, x)
    return at if isinstance(at, Failure) else replace(solution, x=x, at=at)


def project(
    problem: Problem,
    x: FloatArray,
    X: Begin,
    on_evaluation: OnEvaluation,
    effort: Effort = USUAL_EFFORT,
) -> ShootingSolution | Failure:
    """Minimise the cost of `problem` by variable projection.

    Parameters
    ----------
    problem : Problem
        Free parameters, recordings and noise.
    x, X : 1, SI
        Free parameters, within their bounds, and what the search begins with.
    on_evaluation : function(evaluations, cost)
        Called at each evaluation, with the least cost before it.
    effort : Effort
        When the search ends before it has converged.

    Returns
    -------
    solution : ShootingSolution
        "converged" if a step predicts a gain below `CONVERGED_GAIN`, or gains less with a prediction below
        `_LITTLE_TO_GAIN`; "stalled" if a larger predicted gain is not achieved by any reduced step right after a new
        linearisation.

    References
    ----------
    Variable projection: Golub and Pereyra 1973.
    """
    counter = _Counter(on_evaluation, effort.most - 1)  # the last one is that of the solution
    projection = VariableProjection.of(problem, counter)
    start = projection.moved(X, x) if isinstance(X, LinearisedProblem) else projection.start(x, X)
    if isinstance(start, Failure):
        return start
    current, radius, fresh, disappointed = start, _MAX_RADIUS, False, False
    counter.cost = current.cost

    def solution(status: SearchStatus) -> ShootingSolution:
        return Solution(current.x, current, status, counter.number + 1)

    for _ in range(MAX_STEPS):
        candidate, predicted, radius = projection.step(current, radius)
        gain, crossed = current.cost - candidate.cost, projection.crossed(current.x, candidate.x)
        current = candidate
        counter.cost = current.cost
        little, poor = gain < CONVERGED_GAIN, gain < _POOR_SHARE * predicted
        if poor and disappointed and predicted < INSIGNIFICANT * x.size:
            return solution("converged")
        disappointed = poor
        if predicted < CONVERGED_GAIN or (little and predicted < _LITTLE_TO_GAIN and (fresh or gain > 0.0)):
            return solution("converged")
        if counter.number >= counter.most:
            break
        if little and fresh:
            return solution("stalled")
        if effort.is_spent(counter.number, current.cost):
            break
        if crossed or (not fresh and (little or poor)):
            anew = projection.start(current.x, current.X)
            if isinstance(anew, Failure):
                return anew
            # after a kink, which is no failed prediction, the radius is still right
            current, radius, fresh = anew, radius if crossed else _MAX_RADIUS, not crossed
        else:
            fresh = False
    return solution("limit")


@dataclass(slots=True, eq=False)
class _Counter:
    """Counts the evaluations of a search, and reports each; True where there have been `most`, and one more is not."""

    report: OnEvaluation
    most: float
    number: int = 0
    cost: float = math.nan

    def __call__(self) -> bool:
        if self.number >= self.most:
            return True
        self.number += 1
        self.report(self.number, self.cost)
        return False


@dataclass(frozen=True, slots=True, eq=False)
class VariableProjection:
    """Steps of a search: its problem, the present damping of the windows, and a callback for each evaluation.

    The callback returns whether the search has to end instead. `held` (k,) are the parameters that have come to a kink
    of the cost from above.
    """

    problem: Problem
    damping: Damping
    on_evaluation: Callable[[], bool]
    held: BoolArray

    @classmethod
    def of(cls, problem: Problem, on_evaluation: Callable[[], bool]) -> VariableProjection:
        """Before its first step."""
        return cls(problem, initial_damping(problem), on_evaluation, np.zeros(len(problem.coordinates), dtype=bool))

    def start(self, x: FloatArray, X: Sequence[FloatArray]) -> LinearisedProblem | Failure:
        """Linearise at `x` and `X`, and minimise over the states."""
        self.on_evaluation()
        current = linearise(self.problem, x, X)
        if isinstance(current, Failure):
            return current
        states = with_theta_fixed(self.problem, current)
        return with_theta_free(
            self.problem, current, minimise_states(self.problem, states, self.damping, self.on_evaluation)
        )

    def step(self, current: LinearisedProblem, radius: float) -> tuple[LinearisedProblem, float, float]:
        """The problem after a step, or `current` if none gains; predicted gain of a full step; radius of the next."""
        factor, chains = condense(self.problem, current)
        limits = within_kinks(self.problem, current.x, self.held)
        predicted = _predicted_gain(factor, bounded_step(limits, factor, current.x))
        if predicted < CONVERGED_GAIN:
            return current, predicted, radius
        for trial in range(1 + _MAX_REDUCTIONS):
            step = bounded_step(limits, factor, current.x, radius=radius)
            candidate = self.evaluated(current, chains, step, current.cost)
            if isinstance(candidate, LinearisedProblem):
                return candidate, predicted, min(radius / _SHRINK_FACTOR, _MAX_RADIUS) if trial == 0 else radius
            radius *= _SHRINK_FACTOR
        return current, predicted, radius

    def crossed(self, before: FloatArray, after: FloatArray) -> bool:
        """Whether a step of the parameters has crossed a kink of the cost; notes which are held at one."""
        kinks = self.problem.kinks
        down = (before > kinks) & (after <= kinks)
        self.held[:] = down | (self.held & (after == before))
        return bool(np.any((before > kinks) != (after > kinks)))

    def moved(self, near: LinearisedProblem, x: FloatArray) -> LinearisedProblem | Failure:
        """The problem at `x`, minimised over the states, from the problem with any prior at a point nearby."""
        there = self.evaluated(near, condense(self.problem, near)[1], x - near.x)
        return self.start(x, near.X) if isinstance(there, Failure) else there

    def evaluated(
        self, current: LinearisedProblem, chains: Sequence[Eliminated], step: FloatArray, most: float = math.inf
    ) -> LinearisedProblem | Failure:
        """The problem after a step from `current`, minimised over the states, if its cost is below `most`."""
        if self.on_evaluation():
            return NO_GAIN
        X = shifted_states(self.problem, current.X, chains, step)
        trial = evaluate_step(self.problem, current, current.x + step, X)
        candidate = accept(self.problem, trial, free=False) if isinstance(trial, Trial) else trial
        if isinstance(candidate, Failure):
            return candidate
        minimised = minimise_states(self.problem, candidate, self.damping, self.on_evaluation)
        return with_theta_free(self.problem, current, minimised) if minimised.cost < most else NO_GAIN


def within_kinks(problem: Problem, x: FloatArray, held: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Bounds of x for a step of the parameters from x: their own, and kinks of the cost, which no derivative shows.

    Across a kink the derivatives are wrong, so that longer steps fail, and all parameters creep with the one that has
    it. A step ends at the kink instead, on its other side. A parameter that is `held`, as it has come to a kink from
    above, and that the derivatives below it lead up, stays: the cost rises to both sides.
    """
    low, high = problem.bounds()
    kinks = problem.kinks
    above = x > kinks
    low[above] = np.maximum(low, kinks - _AT_KINK)[above]
    high = np.where(above, high, np.fmin(high, np.where(held, x, kinks + _BEYOND_KINK)))
    return low, high


def _predicted_gain(factor: FloatArray, step: FloatArray) -> float:
    """Decrease of the cost by a step according to the linearisation."""
    before, after = factor[:, -1], factor[:, :-1] @ step + factor[:, -1]
    return float(before @ before - after @ after)


def bounded_step(
    limits: tuple[FloatArray, FloatArray],
    factor: FloatArray,
    x: FloatArray,
    damping: float = 0.0,
    radius: float = _MAX_RADIUS,
) -> FloatArray:
    """Damped Gauss-Newton step of the free parameters from `x` within their bounds and the trust region.

    Parameters
    ----------
    limits : (k,), (k,)
        Least and largest values that the step may end at.
    factor : (k + 1, k + 1)
        Triangular factor of all rows in the free parameters, ``[R | q]``.
    x : (k,)
        Start of the step.
    damping : 1
        Of Levenberg and Marquardt, at least 0.
    radius : 1
        Largest step of each parameter.
    """
    R, q = factor[:, :-1], factor[:, -1]
    matrix = np.vstack([R, np.sqrt(damping) * np.diag(np.sqrt(np.sum(R**2, axis=0)))])
    target = -np.concatenate([q, np.zeros(x.size)])
    low, high = limits
    least, most = np.maximum(low - x, -radius), np.minimum(high - x, radius)
    step = bounded_solution(matrix, target, least, most)
    clipped: FloatArray = np.clip(x + step, low, high) - x
    return clipped

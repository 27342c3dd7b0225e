"""Search in stages (continuation): from a nearly linear problem with inflated standard deviations to the actual one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.smoother.problem import FitProblem, LinearisedProblem, condense, linearise
from clutchid.smoother.projection import UNLIMITED, Effort, ShootingSolution, bounded_step, project
from clutchid.smoother.settling import stepped_states
from clutchid.smoother.trial import NO_GAIN, accept, evaluate_step

#: Factors on all standard deviations, stage by stage, for a start at the priors and at calibrated values.
STAGES_FROM_PRIOR, STAGES_FROM_CALIBRATION, FINE_STAGE = (30.0, 8.0, 2.0, 1.0), (8.0, 1.0), (1.0,)

#: Most steps of a coarse stage, and the relative decrease of the cost below which it has converged.
MAX_STEPS, COARSE_TOLERANCE = 5, 1e-2


def search(
    problem: FitProblem,
    x: FloatArray,
    X: Sequence[FloatArray],
    stages: Sequence[float],
    progress: Progress | None = None,
    before: int = 0,
    effort: Effort = UNLIMITED,
) -> ShootingSolution | Failure:
    """Minimise the cost of `problem` from `x` and `X` in stages of decreasing inflation, after `before` evaluations.

    Coarse stages step parameters and states simultaneously. With inflated standard deviations the states follow the
    measurement and the parameters change little, so that a poor start does not lead to a distant local minimum. The
    stage without inflation is `project`, which takes the `effort`.
    """
    solution: ShootingSolution | Failure = Failure("no stage to search in")
    count = before
    for inflation in stages:
        on_evaluation = _counted(progress, inflation, count)
        if inflation == 1.0:
            solution = project(problem, x, X, on_evaluation, effort)
        else:
            solution = _stage(replace(problem, noise=problem.noise.inflated(inflation)), (x, X), on_evaluation)
        if isinstance(solution, Failure):
            return solution
        x, X, count = solution.x, solution.X, count + solution.evaluations
    return replace(solution, evaluations=count) if isinstance(solution, ShootingSolution) else solution


def _counted(progress: Progress | None, inflation: float, before: int) -> Callable[[int], None]:
    name = "fine" if inflation == 1.0 else "coarse"
    return lambda count: progress(name, before + count) if progress else None


def _stage(
    problem: FitProblem, start: tuple[FloatArray, Sequence[FloatArray]], on_evaluation: Callable[[int], None]
) -> ShootingSolution | Failure:
    """Levenberg-Marquardt on parameters and states together, for a problem that is nearly linear."""
    begin = linearise(problem, *start)
    if isinstance(begin, Failure):
        return begin
    current, damping, growth, steps = begin, 1e-3, 2.0, MAX_STEPS
    for count in range(1, 4 * MAX_STEPS):
        on_evaluation(count)
        candidate = coarse_step(problem, current, damping)
        if isinstance(candidate, LinearisedProblem):
            converged = current.cost - candidate.cost < COARSE_TOLERANCE * current.cost
            current = candidate
            damping, growth = max(damping / 5, 1e-7), 2.0
            steps -= 1
            if converged or steps == 0:
                return ShootingSolution(current.x, current.X, current, "converged" if converged else "limit", count + 1)
        else:
            damping, growth = max(damping * growth, 1e-4), 2 * growth
            if damping > 1e9:
                return ShootingSolution(current.x, current.X, current, "stalled", count + 1)
    return ShootingSolution(current.x, current.X, current, "limit", 4 * MAX_STEPS)


def coarse_step(problem: FitProblem, current: LinearisedProblem, damping: float) -> LinearisedProblem | Failure:
    """The problem after a damped step of parameters, within their bounds, and states, where that costs less."""
    factor, chains = condense(problem, current, [np.full(len(track.windows), damping) for track in problem.tracks])
    step = bounded_step(problem, factor, current.x, damping)
    trial = evaluate_step(problem, current, current.x + step, stepped_states(problem, current.X, chains, step))
    if isinstance(trial, Failure):
        return trial
    return accept(problem, trial) if trial.cost < current.cost else NO_GAIN

"""The search: from a problem that is nearly linear, because nothing is trusted much, to the one that is meant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.smoother.problem import FitProblem, LinearisedProblem, condense, linearise
from clutchid.smoother.projection import ShootingSolution, bounded_step, project
from clutchid.smoother.settling import stepped
from clutchid.smoother.trial import NO_GAIN, accept, attempt

#: Factors on all standard deviations, stage by stage: from far away, and from a calibrated start.
FROM_AFAR, FROM_NEAR = (30.0, 8.0, 2.0, 1.0), (8.0, 1.0)

#: Most steps of a coarse stage, which ends when the cost falls by less than this share.
STEPS, ROUGH = 5, 1e-2


def search(
    task: FitProblem,
    x: FloatArray,
    X: Sequence[FloatArray],
    stages: Sequence[float],
    progress: Progress | None = None,
) -> ShootingSolution | Failure:
    """Minimise the cost of `task` from `x` and `X`, in stages of growing trust.

    In coarse stages parameters and states move together. With nothing trusted, the states follow what was measured and
    the parameters move little; so a poor start does not end far away. In the one that is meant, `project`.
    """
    found: ShootingSolution | Failure = Failure("no stage to search in")
    count = 0
    for softness in stages:
        tell = _counted(progress, softness, count)
        if softness == 1.0:
            found = project(task, x, X, tell)
        else:
            found = _stage(replace(task, noise=task.noise.softened(softness)), (x, X), tell)
        if isinstance(found, Failure):
            return found
        x, X, count = found.x, found.X, count + found.evaluations
    return replace(found, evaluations=count) if isinstance(found, ShootingSolution) else found


def _counted(progress: Progress | None, softness: float, before: int) -> Callable[[int], None]:
    name = "fine" if softness == 1.0 else "coarse"
    return lambda count: progress(name, before + count) if progress else None


def _stage(
    task: FitProblem, start: tuple[FloatArray, Sequence[FloatArray]], tell: Callable[[int], None]
) -> ShootingSolution | Failure:
    """Levenberg-Marquardt on parameters and states together, for a problem that is nearly linear."""
    begin = linearise(task, *start)
    if isinstance(begin, Failure):
        return begin
    here, damping, growth, steps = begin, 1e-3, 2.0, STEPS
    for count in range(1, 4 * STEPS):
        tell(count)
        there = _step(task, here, damping)
        if isinstance(there, LinearisedProblem):
            settled = here.cost - there.cost < ROUGH * here.cost
            here = there
            damping, growth = max(damping / 5, 1e-7), 2.0
            steps -= 1
            if settled or steps == 0:
                return ShootingSolution(here.x, here.X, here, "converged" if settled else "limit", count + 1)
        else:
            damping, growth = max(damping * growth, 1e-4), 2 * growth
            if damping > 1e9:
                return ShootingSolution(here.x, here.X, here, "stalled", count + 1)
    return ShootingSolution(here.x, here.X, here, "limit", 4 * STEPS)


def _step(task: FitProblem, here: LinearisedProblem, damping: float) -> LinearisedProblem | Failure:
    """The problem after a damped step of parameters, within their bounds, and states, where that costs less."""
    factor, chains = condense(task, here, [np.full(len(track.windows), damping) for track in task.tracks])
    step = bounded_step(task, factor, here.x, damping)
    trial = attempt(task, here, here.x + step, stepped(task, here.X, chains, step))
    if isinstance(trial, Failure):
        return trial
    return accept(task, trial) if trial.cost < here.cost else NO_GAIN

"""The search: from a problem that is nearly linear, because nothing is trusted much, to the one that is meant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from clutchid.estimate.least_squares import Failure
from clutchid.estimate.search import Progress
from clutchid.estimate.shooting.elimination import recover
from clutchid.estimate.shooting.noise import Noise
from clutchid.estimate.shooting.problem import Linear, Shooting, condense, cost_at, linearise
from clutchid.estimate.shooting.windows import units
from clutchid.log import FloatArray

#: Factors on all standard deviations, stage by stage: from far away, and from a calibrated start.
FROM_AFAR, FROM_NEAR = (30.0, 8.0, 2.0, 1.0), (8.0, 1.0)

#: Most steps of a coarse stage and of the one that is meant; each ends when the cost falls by less than this share.
STEPS, LAST_STEPS = 5, 40
ROUGH, TOLERANCE, CALM = 1e-2, 3e-5, 3

#: Longest step in standard deviations of the prior.
LONGEST = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Where the search ended: parameters, window starts of every track, and the problem there."""

    x: FloatArray
    X: tuple[FloatArray, ...]
    at: Linear
    status: Literal["converged", "stalled", "limit"]
    evaluations: int


def search(
    task: Shooting,
    x: FloatArray,
    X: Sequence[FloatArray],
    stages: Sequence[float],
    progress: Progress | None = None,
) -> Found | Failure:
    """Minimise the cost of `task` from `x` and `X`, in stages of growing trust.

    Levenberg-Marquardt on parameters and states together, the parameters within their bounds. With nothing trusted, the
    states follow what was measured and the parameters move little; so a poor start does not end far away.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    found: Found | Failure = Failure("no stage to search in")
    count = 0
    for softness in stages:
        noise = task.noise.softened(softness)
        ends = (LAST_STEPS, TOLERANCE) if softness == 1.0 else (STEPS, ROUGH)
        found = _stage(task, noise, (x, tuple(X)), ends, _counted(progress, softness, count))
        if isinstance(found, Failure):
            return found
        x, X, count = found.x, found.X, count + found.evaluations
    return replace(found, evaluations=count) if isinstance(found, Found) else found


def _counted(progress: Progress | None, softness: float, before: int) -> Callable[[int], None]:
    name = "fine" if softness == 1.0 else "coarse"
    return lambda count: progress(name, before + count) if progress else None


def _stage(
    task: Shooting,
    noise: Noise,
    start: tuple[FloatArray, tuple[FloatArray, ...]],
    ends: tuple[int, float],
    tell: Callable[[int], None],
) -> Found | Failure:
    (x, X), (steps, tolerance) = start, ends
    here = linearise(task, noise, x, X)
    if isinstance(here, Failure):
        return here
    damping, growth, calm = 1e-3, 2.0, 0
    for count in range(1, 4 * steps):
        tell(count)
        new_x, new_X = _step(task, here, x, X, damping)
        better = cost_at(task, noise, new_x, new_X) < here.cost
        there = linearise(task, noise, new_x, new_X) if better else here
        if better and isinstance(there, Linear):
            # a step that was held short falls little anywhere: only one after the other says that the search is done
            calm = calm + 1 if here.cost - there.cost < tolerance * here.cost else 0
            settled = calm == CALM
            x, X, here = new_x, new_X, there
            damping, growth = max(damping / 5, 1e-7), 2.0
            steps -= 1
            if settled or steps == 0:
                return Found(x, X, here, "converged" if settled else "limit", count + 1)
        else:
            damping, growth = max(damping * growth, 1e-4), 2 * growth
            if damping > 1e9:
                return Found(x, X, here, "stalled", count + 1)
    return Found(x, X, here, "limit", 4 * steps)


def _step(
    task: Shooting, here: Linear, x: FloatArray, X: Sequence[FloatArray], damping: float
) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """The damped step of parameters, within their bounds, and of the states that go with it."""
    factor, chains = condense(task, here, damping)
    R, q = factor[:, :-1], factor[:, -1]
    matrix = np.vstack([R, np.sqrt(damping) * np.diag(np.sqrt(np.sum(R**2, axis=0)))])
    target = -np.concatenate([q, np.zeros(x.size)])
    low, high = task.bounds()
    least, most = np.maximum(low - x, -LONGEST), np.minimum(high - x, LONGEST)
    step = np.linalg.lstsq(matrix, target, rcond=None)[0]
    if np.any(step < least) or np.any(step > most):
        from scipy.optimize import lsq_linear

        box = (np.minimum(least, -1e-12), np.maximum(most, 1e-12))
        step = lsq_linear(matrix, target, bounds=box, method="bvls").x
    unit = units(task.actuator)
    moved = [starts + recover(chain, step[:, None])[:, :, 0] * unit for starts, chain in zip(X, chains, strict=True)]
    return np.clip(x + step, low, high), tuple(moved)

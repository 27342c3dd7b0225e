"""The search of a fit in two stages, as the paper conducts it: coarse from afar, then fine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from clutchid.estimate.simulation_error.problem import Problem, linearise, residuals
from clutchid.log import FloatArray
from clutchid.measured import MEASURED
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, Progress, Solution, minimise

#: Factors on the load weights that the coarse stage tries from the start values.
COARSE_FACTORS = (1.0, 0.6, 0.8, 1.25, 1.6)


def two_stages(task: Problem, progress: Progress | None) -> tuple[Solution | Failure, Mapping[str, float]]:
    """Where the search ends, or why it cannot start, and the noise scales that it ended with.

    The coarse stage tries some factors on the load and stops early; the fine stage goes on from the best with the
    rms residuals as noise scales. The paper conducts the optimisation twice in the same way (Section 3.1).
    """
    scales = {name: MEASURED[name].first_scale for name in task.measure}
    count = 0

    def evaluate(x: FloatArray, stage: str) -> Linearisation | Failure:
        nonlocal count
        count += 1
        if progress:
            progress(stage, count)
        return linearise(task, x, scales)

    begin = _best_start(task, lambda x: evaluate(x, "coarse"))
    if isinstance(begin, Failure):
        return begin, scales
    if not task.moves:
        return Solution(task.x0, begin[1], "converged", count), scales
    coarse = minimise(lambda x: evaluate(x, "coarse"), begin, task.low, task.high, tolerance=1e-3)
    scales = _noise_scales(task, coarse.x, scales)
    again = evaluate(coarse.x, "fine")
    assert isinstance(again, Linearisation)
    fine = minimise(lambda x: evaluate(x, "fine"), (coarse.x, again), task.low, task.high, tolerance=1e-9)
    return replace(fine, evaluations=count), scales


def _best_start(
    task: Problem, evaluate: Callable[[FloatArray], Linearisation | Failure]
) -> tuple[FloatArray, Linearisation] | Failure:
    """The best of some multiples of the load at the start values, where any load weight is free."""
    weights = [i for i, name in enumerate(task.names) if name in task.actuator.load.names]
    best: tuple[FloatArray, Linearisation] | None = None
    failure: Failure | None = None
    for factor in COARSE_FACTORS if weights else (1.0,):
        x = task.x0.copy()
        x[weights] *= factor
        x = np.clip(x, task.low, task.high)
        answer = evaluate(x)
        if isinstance(answer, Failure):
            failure = failure or answer
        elif best is None or answer.cost < best[1].cost:
            best = x, answer
    return best or failure or Failure("there is nothing to simulate")


def _noise_scales(task: Problem, x: FloatArray, scales: Mapping[str, float]) -> dict[str, float]:
    """Rms residual of every measured column, but not below a thousandth of the first scale."""
    sums = {name: [0.0, 0] for name in task.measure}
    for answer in residuals(task, x, scales):
        if isinstance(answer, Failure):
            return dict(scales)
        part, r, _, _ = answer
        log, at = task.plans[part.log].log, slice(part.segment.start, part.segment.stop)
        sizes = [int(np.isfinite(log[name][at]).sum()) for name in task.measure]
        for name, piece in zip(task.measure, np.split(r, np.cumsum(sizes)[:-1]), strict=True):
            sums[name][0] += float(np.sum(piece**2)) * scales[name] ** 2
            sums[name][1] += piece.size
    return {
        name: max(float(np.sqrt(total / max(1, count))), 1e-3 * MEASURED[name].first_scale)
        for name, (total, count) in sums.items()
    }

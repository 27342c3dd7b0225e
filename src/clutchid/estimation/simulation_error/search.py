"""Search in two stages, as in the paper: coarse from the start values, then fine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from clutchid.estimation.simulation_error.problem import Problem, linearise, residuals
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, Progress, Solution, minimise

#: Factors on the initial load weights that the coarse stage tries.
COARSE_FACTORS = (1.0, 0.6, 0.8, 1.25, 1.6)


def two_stages(problem: Problem, progress: Progress | None) -> tuple[Solution | Failure, Mapping[str, float]]:
    """Solution of the search, or a `Failure` of its start, and the final noise scales.

    The coarse stage tries factors on the load and stops early; the fine stage continues from the best with the rms
    residuals as noise scales. The paper also optimises twice (Section 3.1).
    """
    scales = {name: MEASURED[name].first_scale for name in problem.measure}
    count = 0

    def evaluate(x: FloatArray, stage: str) -> Linearisation | Failure:
        nonlocal count
        count += 1
        if progress:
            progress(stage, count)
        return linearise(problem, x, scales)

    begin = _best_start(problem, lambda x: evaluate(x, "coarse"))
    if isinstance(begin, Failure):
        return begin, scales
    if not problem.has_motion:
        return Solution(problem.x0, begin[1], "converged", count), scales
    coarse = minimise(lambda x: evaluate(x, "coarse"), begin, problem.low, problem.high, tolerance=1e-3)
    scales = _rms_residuals(problem, coarse.x, scales)
    again = evaluate(coarse.x, "fine")
    assert isinstance(again, Linearisation)
    fine = minimise(lambda x: evaluate(x, "fine"), (coarse.x, again), problem.low, problem.high, tolerance=1e-9)
    return replace(fine, evaluations=count), scales


def _best_start(
    problem: Problem, evaluate: Callable[[FloatArray], Linearisation | Failure]
) -> tuple[FloatArray, Linearisation] | Failure:
    """The best of several multiples of the initial load, if any load weight is free."""
    weights = [i for i, name in enumerate(problem.names) if name in problem.actuator.load.names]
    best: tuple[FloatArray, Linearisation] | None = None
    failure: Failure | None = None
    for factor in COARSE_FACTORS if weights else (1.0,):
        x = problem.x0.copy()
        x[weights] *= factor
        x = np.clip(x, problem.low, problem.high)
        answer = evaluate(x)
        if isinstance(answer, Failure):
            failure = failure or answer
        elif best is None or answer.cost < best[1].cost:
            best = x, answer
    return best or failure or Failure("no start can be simulated")


def _rms_residuals(problem: Problem, x: FloatArray, scales: Mapping[str, float]) -> dict[str, float]:
    """Rms residual of every measured column, at least a thousandth of the first scale."""
    sums = {name: [0.0, 0] for name in problem.measure}
    for answer in residuals(problem, x, scales):
        if isinstance(answer, Failure):
            return dict(scales)
        part, r, _, _ = answer
        log, at = problem.plans[part.log].log, slice(part.segment.start, part.segment.stop)
        sizes = [int(np.isfinite(log[name][at]).sum()) for name in problem.measure]
        for name, piece in zip(problem.measure, np.split(r, np.cumsum(sizes)[:-1]), strict=True):
            sums[name][0] += float(np.sum(piece**2)) * scales[name] ** 2
            sums[name][1] += piece.size
    return {
        name: max(float(np.sqrt(total / max(1, count))), 1e-3 * MEASURED[name].first_scale)
        for name, (total, count) in sums.items()
    }

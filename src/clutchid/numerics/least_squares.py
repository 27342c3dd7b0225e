"""Bounded nonlinear least squares on compressed linearisations.

The residuals enter as a small triangular matrix, so memory and the cost of a step do not grow with the length of a
recording. A trial point at which the simulation fails is a valid answer, which shortens the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """Residuals r and Jacobian J at a point, compressed by an orthogonal Q to ``Q J = [R; 0]``, ``Q r = [q; rest]``.

    `R` has shape (k, k), `q` (k,); `cost` is half the sum of squares of all residuals, `count` their number.
    """

    R: FloatArray
    q: FloatArray
    cost: float
    count: int


#: End of a search.
SearchStatus = Literal["converged", "stalled", "limit"]
StartStatus = Literal[SearchStatus, "not searched", "failed"]


@dataclass(frozen=True, slots=True)
class Start:
    """A start of a search, and where it ended.

    Attributes
    ----------
    name
        The start: a multiple of the initial load, the initial values, or new states of the windows.
    cost : 1
        Final one: sum of squares of residuals and priors in units of their standard deviations, at the noise scales of
        the result; infinite where nothing could be simulated.
    status
        'converged', 'stalled' or 'limit'; 'not searched' if its cost was compared with that of the others and the
        search went on from another; 'failed' if it could not be simulated.
    """

    name: str
    cost: float
    status: StartStatus


#: Name of the only start, or the first, of a search.
INITIAL_VALUES = "initial values"

PointT = TypeVar("PointT")


@dataclass(frozen=True, slots=True, eq=False)
class Solution(Generic[PointT]):
    """Solution of a search: free parameters x (k,), what the search evaluated there, its end, and its evaluations.

    `starts` are those that it was chosen from.
    """

    x: FloatArray
    at: PointT
    status: SearchStatus
    evaluations: int
    starts: tuple[Start, ...] = ()


Evaluate = Callable[[FloatArray], Linearisation | Failure]


def triangular(matrix: FloatArray) -> FloatArray:
    """Upper triangular factor R of `matrix` = Q R, with at most as many rows as `matrix`."""
    A = np.ascontiguousarray(matrix, dtype=np.float64)
    factor = np.empty((min(A.shape), A.shape[1]))
    kernels_in("clutchid.numerics.householder").triangularise(A, factor)
    return factor


def compress(matrix: FloatArray, rows: int = 1 << 16) -> FloatArray:
    """Upper triangular factor of ``[J r]``, shape (k + 1, k + 1), computed in blocks of `rows`."""
    width = matrix.shape[1]
    factor = np.zeros((0, width))
    for start in range(0, len(matrix), rows):
        part = matrix[start : start + rows]
        factor = triangular(np.vstack([factor, part]) if factor.size else part)
    full = np.zeros((width, width))
    full[: factor.shape[0]] = factor
    return full


def minimise(
    evaluate: Evaluate,
    start: tuple[FloatArray, Linearisation],
    low: FloatArray,
    high: FloatArray,
    *,
    tolerance: float,
    max_evaluations: int = 100,
) -> Solution[Linearisation]:
    """Minimise half the sum of squared residuals with ``low <= x <= high``.

    Levenberg-Marquardt with Marquardt's scaling and Nielsen's damping. Each step solves the damped linear problem with
    bounds exactly, so that bounds become active, and inactive again, as the cost requires.

    Parameters
    ----------
    evaluate : function
        Linearisation at a point, or a `Failure`: the step is then shortened.
    start : point and its linearisation
        Within the bounds.
    tolerance : 1
        Relative decrease of the cost, and relative step, below which the search ends.
    """
    x, current = start
    scale = _norms(current.R)
    damping, growth = 1e-3, 2.0
    for count in range(1, max_evaluations):
        step, predicted = _bounded_step(current, scale, damping, low - x, high - x)
        if predicted <= tolerance * max(current.cost, 1e-300) or _small(step, x, scale, tolerance):
            return Solution(x, current, "converged", count)
        trial = evaluate(np.clip(x + step, low, high))
        gain = (current.cost - trial.cost) / predicted if isinstance(trial, Linearisation) else -np.inf
        if gain > 1e-4 and isinstance(trial, Linearisation):
            x, current = np.clip(x + step, low, high), trial
            scale = np.maximum(0.5 * scale, _norms(current.R))
            damping, growth = damping * max(0.1, 1 - (2 * gain - 1) ** 3), 2.0
        else:
            damping, growth = damping * growth, 2 * growth
            if damping > 1e12:
                return Solution(x, current, "stalled", count + 1)
    return Solution(x, current, "limit", max_evaluations)


def bounded_solution(matrix: FloatArray, target: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Least-squares solution of ``matrix x = target``, of full rank, with ``low <= x <= high``.

    What the solution without bounds exceeds mostly stays at its bound, and the others follow: that is the solution if
    they are within theirs, and the cost rises from those bounds inwards. Else all are searched for.
    """
    x = np.asarray(np.linalg.lstsq(matrix, target, rcond=None)[0])
    below, above = x < low, x > high
    free = ~(below | above)
    if free.all():
        return x
    x = np.clip(x, low, high)
    x[free] = np.linalg.lstsq(matrix[:, free], target - matrix[:, ~free] @ x[~free], rcond=None)[0]
    gradient = matrix.T @ (matrix @ x - target)
    if np.all((x >= low) & (x <= high)) and np.all(gradient[below] >= 0.0) and np.all(gradient[above] <= 0.0):
        return x
    from scipy.optimize import lsq_linear  # slow to import

    box = np.minimum(low, -1e-12), np.maximum(high, 1e-12)
    return np.asarray(lsq_linear(matrix, target, bounds=box, method="bvls", tol=1e-12).x)


def _norms(R: FloatArray) -> FloatArray:
    norms: FloatArray = np.sqrt(np.sum(R**2, axis=0))
    return np.maximum(norms, 1e-9 * max(float(norms.max(initial=0.0)), 1e-300))


def _small(step: FloatArray, x: FloatArray, scale: FloatArray, tolerance: float) -> bool:
    return bool(np.linalg.norm(scale * step) <= tolerance * np.linalg.norm(scale * x))


def _bounded_step(
    current: Linearisation, scale: FloatArray, damping: float, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, float]:
    """Damped step within its bounds, and its predicted decrease of the cost."""
    scaled = current.R / scale
    matrix = np.vstack([scaled, np.sqrt(damping) * np.eye(scale.size)])
    target = -np.concatenate([current.q, np.zeros(scale.size)])
    step = bounded_solution(matrix, target, low * scale, high * scale)
    after = scaled @ step + current.q
    return step / scale, 0.5 * float(current.q @ current.q - after @ after)

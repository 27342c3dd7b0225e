"""Bounded nonlinear least squares on compressed linearisations.

A recording of any length enters as a small triangular matrix, so memory and the cost of a step do not grow with it,
and a trial point at which the simulation fails is an answer like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

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


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where a minimisation ended."""

    x: FloatArray
    at: Linearisation
    status: Literal["converged", "stalled", "limit"]
    evaluations: int


Evaluate = Callable[[FloatArray], Linearisation | Failure]

#: Called with the name of the stage and the number of simulations so far.
Progress = Callable[[str, int], None]


def triangular(matrix: FloatArray) -> FloatArray:
    """Upper triangular factor R of `matrix` = Q R, as many rows as it has."""
    A = np.ascontiguousarray(matrix, dtype=np.float64)
    factor = np.empty((min(A.shape), A.shape[1]))
    kernels_in("clutchid.numerics.householder").triangularise(A, factor)
    return factor


def compress(jacobian: FloatArray, residuals: FloatArray, rows: int = 1 << 16) -> FloatArray:
    """Upper triangular factor of ``[J r]``, shape (k + 1, k + 1), made in blocks of `rows`."""
    width = jacobian.shape[1] + 1
    factor = np.zeros((0, width))
    for start in range(0, residuals.size, rows):
        part = np.column_stack([jacobian[start : start + rows], residuals[start : start + rows]])
        factor = triangular(np.vstack([factor, part]))
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
) -> Solution:
    """Minimise half the sum of squared residuals with ``low <= x <= high``.

    Levenberg-Marquardt with Marquardt's scaling and Nielsen's damping; each step solves the damped linear problem
    within the bounds exactly, so a bound is met exactly and left again when the data ask for it.

    Parameters
    ----------
    evaluate : function
        Linearisation at a point, or why there is none: the step is then shortened.
    start : point and its linearisation
        Within the bounds.
    tolerance : 1
        Relative decrease of the cost, and relative step, below which the search ends.
    """
    x, here = start
    scale = _norms(here.R)
    damping, growth = 1e-3, 2.0
    for count in range(1, max_evaluations):
        step, predicted = _bounded_step(here, scale, damping, low - x, high - x)
        if predicted <= tolerance * max(here.cost, 1e-300) or _small(step, x, scale, tolerance):
            return Solution(x, here, "converged", count)
        there = evaluate(np.clip(x + step, low, high))
        gain = (here.cost - there.cost) / predicted if isinstance(there, Linearisation) else -np.inf
        if gain > 1e-4 and isinstance(there, Linearisation):
            x, here = np.clip(x + step, low, high), there
            scale = np.maximum(0.5 * scale, _norms(here.R))
            damping, growth = damping * max(0.1, 1 - (2 * gain - 1) ** 3), 2.0
        else:
            damping, growth = damping * growth, 2 * growth
            if damping > 1e12:
                return Solution(x, here, "stalled", count + 1)
    return Solution(x, here, "limit", max_evaluations)


def _norms(R: FloatArray) -> FloatArray:
    norms: FloatArray = np.sqrt(np.sum(R**2, axis=0))
    return np.maximum(norms, 1e-9 * max(float(norms.max(initial=0.0)), 1e-300))


def _small(step: FloatArray, x: FloatArray, scale: FloatArray, tolerance: float) -> bool:
    return bool(np.linalg.norm(scale * step) <= tolerance * np.linalg.norm(scale * x))


def _bounded_step(
    here: Linearisation, scale: FloatArray, damping: float, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, float]:
    """The damped step within its bounds, and the decrease of the cost that the linearisation predicts for it."""
    from scipy.optimize import lsq_linear

    scaled = here.R / scale
    matrix = np.vstack([scaled, np.sqrt(damping) * np.eye(scale.size)])
    target = -np.concatenate([here.q, np.zeros(scale.size)])
    free = np.linalg.lstsq(matrix, target, rcond=None)[0]
    if np.any(free < low * scale) or np.any(free > high * scale):
        free = lsq_linear(matrix, target, bounds=(low * scale, high * scale), method="bvls", tol=1e-12).x
    after = scaled @ free + here.q
    return free / scale, 0.5 * float(here.q @ here.q - after @ after)

"""Compiled bound of the spectral radius of several matrices, without eigenvalues."""

from __future__ import annotations

import math

import numpy as np

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: Squarings of a matrix: the bound is the root of the norm of its power 2^8, some 0.5 % above the radius.
_SQUARINGS = 8


@kernel
def row_norm(matrix: FloatArray) -> float:
    """Largest sum of magnitudes of a row; infinite where the matrix is not finite."""
    norm = 0.0
    for row in matrix:
        total = 0.0
        for value in row:
            total += abs(value)
        if not total < math.inf:
            return math.inf
        norm = max(norm, total)
    return norm


@kernel
def square(matrix: FloatArray, factor: float, result: FloatArray) -> None:
    """The square of a matrix times a factor."""
    result[:] = 0.0
    for row in range(len(matrix)):
        for inner in range(len(matrix)):
            share = matrix[row, inner] * factor
            if share != 0.0:
                for column in range(len(matrix)):
                    result[row, column] += share * matrix[inner, column]


@kernel
def radius_bound(power: FloatArray, enough: float, other: FloatArray) -> float:
    """Root of the norm of a high power of a matrix, or of a lower one where it lies below `enough`; overwrites both."""
    norm = row_norm(power)
    bound, logarithm, share = norm, 0.0, 1.0
    for _ in range(_SQUARINGS):
        if bound <= enough or norm == 0.0:
            break
        logarithm, share = 2.0 * (logarithm + math.log(norm)), 0.5 * share
        square(power, 1.0 / norm**2, other)
        power, other = other, power
        norm = row_norm(power)
        if norm > 0.0:
            bound = min(bound, math.exp(share * (logarithm + math.log(norm))))
    return bound if norm > 0.0 else 0.0  # a power that is zero has no eigenvalue but 0


@kernel
def spectral_radius(matrices: FloatArray, scale: FloatArray) -> float:
    """Upper bound of the largest magnitude of an eigenvalue of several matrices, without those that are not finite.

    The bound is the root of the norm of a high power (Gelfand 1941) of the matrix with its states divided by `scale`. A
    matrix whose bound by a lower power lies below the largest so far needs no higher one: the last ones come first, for
    a caller that expects the largest bound there.

    Parameters
    ----------
    matrices : (n, d, d)
    scale : (d,)
        Natural sizes of the states.
    """
    scaled, norms, stiffest = np.empty_like(matrices), np.empty(len(matrices)), 0
    for i in range(len(matrices)):
        for row in range(scale.size):
            for column in range(scale.size):
                scaled[i, row, column] = matrices[i, row, column] * scale[column] / scale[row]
        norms[i] = row_norm(scaled[i])
        if math.inf > norms[i] > norms[stiffest] or norms[stiffest] == math.inf:
            stiffest = i
    largest, other = 0.0, np.empty((scale.size, scale.size))
    for k in range(len(matrices), -1, -1):
        i = stiffest if k == len(matrices) else k
        if largest < norms[i] < math.inf and k != stiffest:
            largest = max(largest, radius_bound(scaled[i], largest, other))
    return largest

"""Triangular square roots of small covariances."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray


@kernel
def triangularise(W: FloatArray) -> None:
    """Make ``[A, B]`` lower triangular in place by Householder reflections of its columns, which keep W W'.

    A has as many columns as rows; B is 0 where the number of the column exceeds that of the row. Slices show
    the compiler that rows do not overlap: it is three times as fast with them.
    """
    n, width = W.shape
    for i in range(n):
        end = min(width, n + i + 1)
        pivot = W[i, i:end]
        square = 0.0
        for c in range(pivot.size):
            square += pivot[c] * pivot[c]
        if square == 0.0:
            continue
        norm = -math.copysign(math.sqrt(square), pivot[0])
        beta = 1.0 / (square - pivot[0] * norm)
        pivot[0] -= norm
        for j in range(i + 1, n):
            row, dot = W[j, i:end], 0.0
            for c in range(pivot.size):
                dot += pivot[c] * row[c]
            dot *= beta
            for c in range(pivot.size):
                row[c] -= dot * pivot[c]
        pivot[0] = norm
        for c in range(1, pivot.size):
            pivot[c] = 0.0

"""A chain of states, eliminated and recovered one by one: the inner loops of `elimination`."""

from __future__ import annotations

import math

import numpy as np

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray


@kernel
def triangularise(A: FloatArray, pivots: int) -> None:
    """Turn the rows of A, in place, until its first columns are upper triangular (Householder)."""
    height, width = A.shape
    dots = np.empty(width)
    for j in range(min(pivots, height)):
        square = 0.0
        for r in range(j, height):
            square += A[r, j] * A[r, j]
        if square == 0.0:
            continue
        norm = -math.copysign(math.sqrt(square), A[j, j])
        beta = 1.0 / (square - A[j, j] * norm)
        A[j, j] -= norm
        dots[:] = 0.0
        for r in range(j, height):
            factor = A[r, j]
            if factor != 0.0:
                for c in range(j + 1, width):
                    dots[c] += factor * A[r, c]
        for r in range(j, height):
            factor = beta * A[r, j]
            if factor != 0.0:
                for c in range(j + 1, width):
                    A[r, c] -= factor * dots[c]
        A[j, j] = norm
        A[j + 1 :, j] = 0.0


@kernel
def eliminate(first: FloatArray, own: FloatArray, links: FloatArray, kept: FloatArray, left: FloatArray) -> None:
    """Eliminate the states of a chain; shapes as in `elimination.eliminate`.

    Parameters
    ----------
    kept : (windows, n, 2 n + k + 1)
        Receives what tells each state once the next one and theta are known.
    left : (windows, m + n, k + 1)
        Receives the rows on theta alone that each elimination leaves, and zeros.
    """
    n, m = first.shape[0], own.shape[1]
    width = kept.shape[2]
    work = np.empty((2 * n + m, width))
    carried = first.copy()
    for i in range(own.shape[0]):
        last = i == own.shape[0] - 1
        height, pivots = (n + m, n) if last else (2 * n + m, 2 * n)
        work[:n, :n], work[:n, 2 * n :] = carried[:, :n], carried[:, n:]
        work[n : n + m, :n], work[n : n + m, 2 * n :] = own[i, :, :n], own[i, :, n:]
        work[: n + m, n : 2 * n] = 0.0
        if not last:
            work[n + m :] = links[i]
        triangularise(work[:height], pivots)
        kept[i] = work[:n]
        left[i, : height - pivots] = work[pivots:height, 2 * n :]
        left[i, height - pivots :] = 0.0
        carried[:] = work[n : 2 * n, n:]


@kernel
def substitute(own: FloatArray, found: FloatArray) -> bool:
    """Solve for every state in place, from the last to the first; False where one is not determined."""
    windows, n, m = found.shape
    for i in range(windows - 1, -1, -1):
        for r in range(n - 1, -1, -1):
            if own[i, r, r] == 0.0:
                return False
            for k in range(m):
                rest = found[i, r, k]
                for c in range(r + 1, n):
                    rest -= own[i, r, c] * found[i, c, k]
                if i < windows - 1:
                    for c in range(n):
                        rest -= own[i, r, n + c] * found[i + 1, c, k]
                found[i, r, k] = rest / own[i, r, r]
    return True

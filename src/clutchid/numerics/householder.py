"""Triangular factors by Householder reflections (1958): of a matrix, and of a chain of states."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray

#: A column whose sum of squares is outside this range is scaled: sensitivities to the start of a window decay to
#: 1e-160, whose squares underflow.
_MIN_SQUARE, _MAX_SQUARE = 1e-280, 1e280


@kernel
def largest(x: FloatArray) -> float:
    """Largest magnitude in x."""
    result = 0.0
    for value in x:
        result = max(result, abs(value))
    return result


@kernel
def reflect(T: FloatArray, pivots: int) -> None:
    """Make the first columns of a matrix upper triangular by Householder reflections, in place.

    T is the transpose, so that the columns are contiguous. Four columns at a time share each load of the reflector. One
    function with slices shows the compiler that the arrays do not overlap.
    """
    width, height = T.shape
    v = np.empty(height)
    for j in range(min(pivots, height)):
        n, square, top = height - j, 0.0, 1.0
        for r in range(n):
            v[r] = T[j, j + r]
            square += v[r] * v[r]
        if square <= _MIN_SQUARE or square >= _MAX_SQUARE:
            top = largest(v[:n])
            if top == 0.0:
                continue
            square = 0.0
            for r in range(n):
                v[r] /= top
                square += v[r] * v[r]
        norm = -math.copysign(math.sqrt(square), v[0])
        beta = 1.0 / (square - v[0] * norm)
        v[0] -= norm
        T[j, j:] = 0.0
        T[j, j] = norm * top
        c = j + 1
        while c + 3 < width:
            t0, t1, t2, t3 = T[c, j:], T[c + 1, j:], T[c + 2, j:], T[c + 3, j:]
            d0, d1, d2, d3 = 0.0, 0.0, 0.0, 0.0
            for r in range(n):
                d0, d1, d2, d3 = d0 + v[r] * t0[r], d1 + v[r] * t1[r], d2 + v[r] * t2[r], d3 + v[r] * t3[r]
            d0, d1, d2, d3 = beta * d0, beta * d1, beta * d2, beta * d3
            for r in range(n):
                t0[r], t1[r], t2[r], t3[r] = t0[r] - d0 * v[r], t1[r] - d1 * v[r], t2[r] - d2 * v[r], t3[r] - d3 * v[r]
            c += 4
        for last in range(c, width):
            t0, d0 = T[last, j:], 0.0
            for r in range(n):
                d0 += v[r] * t0[r]
            d0 *= beta
            for r in range(n):
                t0[r] -= d0 * v[r]


@kernel
def columns_in_use(A: FloatArray) -> NDArray[np.int64]:
    """Columns of A that are not zero throughout."""
    used, count = np.empty(A.shape[1], np.int64), 0
    for c in range(A.shape[1]):
        for r in range(A.shape[0]):
            if A[r, c] != 0.0:
                used[count] = c
                count += 1
                break
    return used[:count]


@kernel
def first_in_use(A: FloatArray, used: NDArray[np.int64]) -> int:
    """The first of some columns of A that is not zero throughout; their number if all are."""
    first = used.size
    for r in range(A.shape[0]):
        c = 0
        while c < first and A[r, used[c]] == 0.0:
            c += 1
        first = c
    return first


@kernel
def triangularise(A: FloatArray, R: FloatArray) -> None:
    """Upper triangular factor of A, written to the rows of R; in blocks that fit the processor's cache.

    Columns of zeros, such as those of parameters of a valve that stays closed, are left out; so are those before the
    first one of a block: for triangles that are stacked row by row a third of the work is left.
    """
    R[:] = 0.0
    used = columns_in_use(A)
    height, width = A.shape[0], used.size
    block, rows = max(8 * width, 256), 0
    for start in range(0, height, block):
        part = A[start : start + block]
        first = first_in_use(part, used)
        above, count = max(rows - first, 0), part.shape[0]
        T = np.empty((width - first, above + count))
        for c in range(first, width):
            for r in range(above):
                T[c - first, r] = R[first + r, used[c]]
            for r in range(count):
                T[c - first, above + r] = part[r, used[c]]
        reflect(T, width - first)
        rows = max(rows, min(width, first + above + count))
        for c in range(first, width):
            for r in range(first, rows):
                R[r, used[c]] = T[c - first, r - first]


@kernel
def eliminate(
    first: FloatArray, windows: FloatArray, links: FloatArray, state_rows: FloatArray, theta_rows: FloatArray
) -> None:
    """Eliminate the states of a chain; shapes as in `clutchid.inference.smoother.rows.eliminate`.

    Parameters
    ----------
    state_rows : (windows, n, 2 n + k + 1)
        Output: rows that give each state for a given next state and theta.
    theta_rows : (windows, m + n, k + 1)
        Output: rows in theta alone that remain after each elimination, and zeros.
    """
    n, m, width = first.shape[0], windows.shape[1], state_rows.shape[2]
    carried = first.copy()
    for i in range(windows.shape[0]):
        last = i == windows.shape[0] - 1
        height, pivots = (n + m, n) if last else (2 * n + m, 2 * n)
        T = np.zeros((width, height))
        for c in range(width - n):
            column = c if c < n else n + c
            _copy(carried[:, c], T[column, :n])
            _copy(windows[i, :, c], T[column, n : n + m])
        for c in range(0 if last else width):
            _copy(links[i, :, c], T[c, n + m :])
        reflect(T, pivots)
        for c in range(width):
            _copy(T[c], state_rows[i, :, c])
        for c in range(0 if last else width - n):
            _copy(T[n + c, n:], carried[:, c])
        theta_rows[i, height - pivots :] = 0.0
        for c in range(width - 2 * n):
            _copy(T[2 * n + c, pivots:], theta_rows[i, : height - pivots, c])


@kernel
def _copy(from_: FloatArray, to: FloatArray) -> None:
    for r in range(to.size):
        to[r] = from_[r]


@kernel
def substitute(state_rows: FloatArray, states: FloatArray) -> bool:
    """Back-substitution of all states, in place, from the last to the first; False if one is not determined."""
    windows, n, m = states.shape
    for i in range(windows - 1, -1, -1):
        for r in range(n - 1, -1, -1):
            if state_rows[i, r, r] == 0.0:
                return False
            for k in range(m):
                rest = states[i, r, k]
                for c in range(r + 1, n):
                    rest -= state_rows[i, r, c] * states[i, c, k]
                if i < windows - 1:
                    for c in range(n):
                        rest -= state_rows[i, r, n + c] * states[i + 1, c, k]
                states[i, r, k] = rest / state_rows[i, r, r]
    return True

"""Columns of the joint filter between two corrections: the transition Phi of the states, and their responses Gamma.

A step moves derivatives D with respect to the parameters and the root L alike and linearly, but for the sources of the
parameters. So between corrections ``D -> Phi D + Gamma`` and ``L -> Phi L`` for all columns at once, where Phi begins
as the identity and Gamma as 0. What moves are as many columns as there are states and outputs of sensors, one for each
free parameter, and those of a window of load weights around the piston: B-splines are local, and the response to all
others is 0. At a correction, and before the piston leaves the window, D and L are brought up to date.
"""

from __future__ import annotations

from clutchid.codegen.kernels import kernel
from clutchid.inference.filter.setup import FilterState, IntArray, Window
from clutchid.log import FloatArray

#: How far the piston may move in a step: a distance in m, and multiples of that at its present speed.
MARGIN, AHEAD = 2e-4, 2.0


@kernel
def place_window(first: int, window: Window, pieces: IntArray, breakpoints: FloatArray) -> None:
    """The window of load weights from the free one number `first`, and the positions in m that it is for."""
    bases, placed, weight_bases = window.bases, window.placed, window.weight_bases
    low, high = 0, breakpoints.size
    for q in range(weight_bases.size):
        b = weight_bases[q]
        if first <= q < first + bases.size:
            bases[q - first] = b
            placed[q - first] = window.weight_columns[q]
        elif q < first:
            low = max(low, pieces[b, 1] + 1)
        else:
            high = min(high, pieces[b, 0] - 1)
    window.within[0] = -1e300 if low == 0 else breakpoints[low - 1]
    window.within[1] = 1e300 if high >= breakpoints.size else breakpoints[high]


@kernel
def centred_window(position: float, window: Window, pieces: IntArray, breakpoints: FloatArray) -> int:
    """Number of the first free load weight of a window with those that act at a position in m in its middle."""
    bases, weight_bases = window.bases, window.weight_bases
    s = 0
    while s < breakpoints.size and breakpoints[s] <= position:
        s += 1
    first, last = weight_bases.size, -1
    for q in range(weight_bases.size):
        if pieces[weight_bases[q], 0] <= s <= pieces[weight_bases[q], 1]:
            first, last = min(first, q), q
    begin = (first + last + 1 - bases.size) // 2 if last >= 0 else 0
    return max(0, min(begin, weight_bases.size - bases.size))


@kernel
def bring_up(
    state: FilterState, window: Window, pieces: IntArray, breakpoints: FloatArray, position: float, before: FloatArray
) -> None:
    """Bring S = [D | L] and E up to date: ``D := Phi D + Gamma``, ``L := Phi L``, ``E := Phi E``.

    Phi and Gamma begin again.

    The window is put around a `position` in m; `before` of the shape of S is scratch.
    """
    S, E, moved, responses = state.S, state.E, state.moved, window.columns.size
    size, columns = S.shape
    for c in range(E.shape[1]):
        for i in range(size):
            before[i, 0] = E[i, c]
        for i in range(size):
            E[i, c] = 0.0
            for q in range(size):
                E[i, c] += moved[i, responses + q] * before[q, 0]
    for i in range(size):
        for j in range(columns):
            before[i, j] = S[i, j]
            S[i, j] = 0.0
    for i in range(size):
        for q in range(size):
            share = moved[i, responses + q]
            for j in range(columns):
                S[i, j] += share * before[q, j]
            moved[i, responses + q] = 1.0 if i == q else 0.0
        for c in range(responses):
            S[i, window.columns[c]] += moved[i, c]
            moved[i, c] = 0.0
    state.first[0] = centred_window(position, window, pieces, breakpoints)
    place_window(state.first[0], window, pieces, breakpoints)

"""Columns of the joint filter between two corrections: the transition Phi of the states, and their responses Gamma.

A step moves derivatives D with respect to the parameters and the root L alike and linearly, but for the sources of the
parameters. So between corrections ``D -> Phi D + Gamma`` and ``L -> Phi L`` for all columns at once, where Phi begins
as the identity and Gamma as 0. What moves are as many columns as there are states and outputs of sensors, one for each
free parameter, and those of a window of load weights around the piston: B-splines are local, and the response to all
others is 0. At a correction D and L are brought up to date, and the window is placed where the piston will be until the
next one.
"""

from __future__ import annotations

from clutchid.codegen.kernels import kernel
from clutchid.inference.filter.setup import FilterState, Window
from clutchid.log import FloatArray, IntArray


@kernel
def place_window(first: int, window: Window) -> None:
    """The window of load weights from the free one number `first`."""
    for q in range(window.bases.size):
        window.bases[q] = window.weight_bases[first + q]
        window.placed[q] = window.weight_columns[first + q]


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
def begin_columns(
    state: FilterState, window: Window, pieces: IntArray, breakpoints: FloatArray, position: float
) -> None:
    """Phi and Gamma begin again, with the window around a position in m."""
    moved, responses = state.moved, window.columns.size
    for i in range(moved.shape[0]):
        for c in range(moved.shape[1]):
            moved[i, c] = 1.0 if c == responses + i else 0.0
    state.first[0] = centred_window(position, window, pieces, breakpoints)
    place_window(state.first[0], window)


@kernel
def bring_up(state: FilterState, moved: FloatArray, columns: IntArray, before: FloatArray) -> None:
    """Bring S = [D | L] and E up to date: ``D := Phi D + Gamma``, ``L := Phi L``, ``E := Phi E``.

    Parameters
    ----------
    moved : (size, responses + size)
        [Gamma | Phi].
    columns : (responses,)
        Columns in S of Gamma.
    before
        Scratch of the shape of S.
    """
    S, E, responses = state.S, state.E, columns.size
    size, width = S.shape
    for c in range(E.shape[1]):
        for i in range(size):
            before[i, 0] = E[i, c]
        for i in range(size):
            E[i, c] = 0.0
            for q in range(size):
                E[i, c] += moved[i, responses + q] * before[q, 0]
    for i in range(size):
        for j in range(width):
            before[i, j] = S[i, j]
            S[i, j] = 0.0
    for i in range(size):
        for q in range(size):
            share = moved[i, responses + q]
            for j in range(width):
                S[i, j] += share * before[q, j]
        for c in range(responses):
            S[i, columns[c]] += moved[i, c]

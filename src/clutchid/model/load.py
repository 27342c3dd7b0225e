r"""Section 2.5: the clutch load on three splines, Eqs. (14)-(21).

`phi_1`, `phi_2` and `phi_3` are held as pieces: (upper end, polynomial in y). The printed formulas, the numbers of
Eq. (21) and the table that the kernels read are all made from them.
"""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr

Pieces = list[tuple[Expr, Expr]]


def xi_1(t_1: Expr, t_2: Expr, t_3: Expr) -> list[Expr]:
    r"""Coefficients (a_1, b_1, c_1) of the quadratic part of phi_1, Eqs. (15) and (18).

    .. math:: \xi_1 = A_1^{-1} B_1

    Parameters
    ----------
    t_1, t_2, t_3 : m
        Knots, strictly increasing.

    Returns
    -------
    xi_1 : 1/m, 1, m

    Examples
    --------
    >>> [f"{float(x):.5g}" for x in xi_1(0, sp.Rational(2, 1000), sp.Rational(85, 10000))]
    ['-76.923', '1.3077', '-0.00030769']
    """
    A_1 = sp.Matrix([[t_2**2, t_2, 1], [2 * t_2, 1, 0], [2 * t_3, 1, 0]])
    B_1 = sp.Matrix([t_2 - t_1, 1, 0])
    return _solved(A_1, B_1)


def xi_2(t_2: Expr, t_3: Expr, phi2_slope: Expr = 1) -> list[Expr]:
    r"""Coefficients (a_2, b_2, c_2, d_2) of phi_2, Eqs. (16) and (18).

    .. math:: \xi_2 = A_2^{-1} B_2, \quad B_2 = (0, 0, t_3, s)^T

    Parameters
    ----------
    t_2, t_3 : m
        Knots, strictly increasing.
    phi2_slope : 1
        Slope s of the quadratic part at t_3: 1 by the stated conditions, 0.001 as published.

    Returns
    -------
    xi_2 : 1/m, 1, m, m

    Notes
    -----
    The printed B_2 has three entries for a 4 x 4 matrix, and the printed xi_2 follows only from the slope 0.001.

    Examples
    --------
    >>> [f"{float(x):.5g}" for x in xi_2(sp.Rational(2, 1000), sp.Rational(85, 10000))]
    ['76.923', '-0.30769', '0.00030769', '-0.00525']
    """
    A_2 = sp.Matrix([[t_2**2, t_2, 1, 0], [2 * t_2, 1, 0, 0], [t_3**2, t_3, 1, -1], [2 * t_3, 1, 0, 0]])
    B_2 = sp.Matrix([0, 0, t_3, phi2_slope])
    return _solved(A_2, B_2)


def xi_3(t_2: Expr, t_4: Expr) -> list[Expr]:
    r"""Coefficients (a_3, ..., h_3) of the two cubic parts of phi_3, Eqs. (17) and (18).

    .. math:: \xi_3 = A_3^{-1} B_3, \quad B_3 = (0, 0, 10^{-3}, 0, 0, 0, 10^{-3}, 0)^T

    Parameters
    ----------
    t_2, t_4 : m
        Knots, strictly increasing; the hump ends at t_5 = 2 t_4 - t_2.

    Returns
    -------
    xi_3 : 1/m², 1/m, 1, m, 1/m², 1/m, 1, m

    Notes
    -----
    The printed A_3 has shifted columns and B_3 is printed as zeros, which would make phi_3 vanish; both follow from
    the eight stated conditions. The two cubics do not share a coefficient, so A_3 is two blocks of 4 x 4.

    Examples
    --------
    >>> [f"{float(x):.6g}" for x in xi_3(sp.Rational(2, 1000), sp.Rational(115, 10000))][:4]
    ['-2332.7', '47.2372', '-0.160956', '0.000151626']
    """

    def value(t: Expr) -> list[Expr]:
        return [t**3, t**2, t, 1]

    def slope(t: Expr) -> list[Expr]:
        return [3 * t**2, 2 * t, 1, 0]

    t_5, height = 2 * t_4 - t_2, sp.Rational(1, 1000)
    rising = sp.Matrix([value(t_2), slope(t_2), value(t_4), slope(t_4)])
    falling = sp.Matrix([value(t_5), slope(t_5), value(t_4), slope(t_4)])
    B = sp.Matrix([0, 0, height, 0])
    return [*_solved(rising, B), *_solved(falling, B)]


def phi_1(y: Expr, t_1: Expr, t_2: Expr, t_3: Expr) -> Pieces:
    """Pieces of phi_1, Eq. (15): rises with slope 1 from t_1, flattens from t_2, constant from t_3; in m."""
    a_1, b_1, c_1 = xi_1(t_1, t_2, t_3)
    return [
        (t_1, sp.Integer(0)),
        (t_2, y - t_1),
        (t_3, a_1 * y**2 + b_1 * y + c_1),
        (sp.oo, a_1 * t_3**2 + b_1 * t_3 + c_1),
    ]


def phi_2(y: Expr, t_2: Expr, t_3: Expr, phi2_slope: Expr = 1) -> Pieces:
    """Pieces of phi_2, Eq. (16): starts at t_2, slope 1 from t_3; in m. With phi_1 it adds up to y - t_1."""
    a_2, b_2, c_2, d_2 = xi_2(t_2, t_3, phi2_slope)
    return [(t_2, sp.Integer(0)), (t_3, a_2 * y**2 + b_2 * y + c_2), (sp.oo, y + d_2)]


def phi_3(y: Expr, t_2: Expr, t_4: Expr) -> Pieces:
    """Pieces of phi_3, Eq. (17): a hump of one millimetre at t_4, zero before t_2 and from t_5 = 2 t_4 - t_2; in m."""
    a_3, b_3, c_3, d_3, e_3, f_3, g_3, h_3 = xi_3(t_2, t_4)
    return [
        (t_2, sp.Integer(0)),
        (t_4, a_3 * y**3 + b_3 * y**2 + c_3 * y + d_3),
        (2 * t_4 - t_2, e_3 * y**3 + f_3 * y**2 + g_3 * y + h_3),
        (sp.oo, sp.Integer(0)),
    ]


def paper_basis(y: Expr, t_1: Expr, t_2: Expr, t_3: Expr, t_4: Expr, phi2_slope: Expr = 1) -> list[Pieces]:
    """The three basis functions of Eq. (14) as pieces."""
    return [phi_1(y, t_1, t_2, t_3), phi_2(y, t_2, t_3, phi2_slope), phi_3(y, t_2, t_4)]


def table_expressions(t_1: Expr, t_2: Expr, t_3: Expr, t_4: Expr, phi2_slope: Expr) -> tuple[list[Expr], list[Expr]]:
    """Breakpoints, and coefficients [basis][segment][power of (y - left breakpoint)], as expressions in the knots.

    The segment before the first breakpoint is expanded about that breakpoint.
    """
    y = sp.Symbol("y", real=True)
    breakpoints = [t_1, t_2, t_3, t_4, 2 * t_4 - t_2]
    expansion_points = [t_1, *breakpoints]
    coefficients = []
    for pieces in paper_basis(y, t_1, t_2, t_3, t_4, phi2_slope):
        ends = [end for end, _ in pieces]
        of_segment = [_piece(pieces, ends, number, breakpoints) for number in range(len(expansion_points))]
        coefficients.append([_taylor(p, y, at) for p, at in zip(of_segment, expansion_points, strict=True)])
    return breakpoints, coefficients


def _piece(pieces: Pieces, ends: list[Expr], segment: int, breakpoints: list[Expr]) -> Expr:
    """The polynomial that holds in `segment`: the first piece whose upper end is not before the segment's end."""
    before = set(breakpoints[:segment])
    return next(polynomial for end, (_, polynomial) in zip(ends, pieces, strict=True) if end not in before)


def _taylor(polynomial: Expr, y: Expr, at: Expr) -> list[Expr]:
    return [sp.factor(sp.diff(polynomial, y, k).subs(y, at) / sp.factorial(k)) for k in range(4)]


def _solved(A: Expr, B: Expr) -> list[Expr]:
    return [sp.factor(x) for x in A.LUsolve(B)]

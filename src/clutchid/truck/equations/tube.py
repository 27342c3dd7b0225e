"""The tube between the dead volume at the valves and chamber A."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr


def tube_flow(p_1: Expr, p_2: Expr, C: Expr, dp: Expr) -> Expr:
    r"""Turbulent flow through a tube from 1 to 2, negative from 2 to 1; linear for small differences.

    .. math:: w = C \sqrt{\max(p_1, p_2)} \, \frac{p_1 - p_2}{\sqrt{|p_1 - p_2| + \Delta p}}

    Parameters
    ----------
    p_1, p_2 : Pa
        Pressures on both sides, above 0.
    C : kg/(Pa·s)
        Conductance, at least 0.
    dp : Pa
        Difference below which the flow is laminar, above 0.

    Returns
    -------
    w : kg/s

    References
    ----------
    Textbook: constant loss coefficient and upstream density.

    Examples
    --------
    >>> f"{tube_flow(5.3e5, 5e5, 1.6e-7, 5e3) * 1e3:.0f} g/s"
    '19 g/s'
    """
    return C * sp.sqrt(sp.Max(p_1, p_2)) * (p_1 - p_2) / sp.sqrt(sp.Abs(p_1 - p_2) + dp)

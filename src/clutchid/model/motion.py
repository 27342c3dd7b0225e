"""Section 2.1: motion of the piston, and the end stops that the printed model lacks."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr


def acceleration(
    p_A: Expr, p_B: Expr, f_l: Expr, f_f: Expr, f_s: Expr, A_A: Expr, A_B: Expr, P_0: Expr, M: Expr
) -> Expr:
    r"""Acceleration of the piston, Eq. (1).

    .. math:: \dot v = \frac{1}{M} (A_A p_A - A_B p_B - A_0 P_0 - f_l - f_f - f_s), \quad A_0 = A_A - A_B

    Parameters
    ----------
    p_A, p_B : Pa
        Absolute pressure in chambers A and B.
    f_l, f_f, f_s : N
        Clutch load, friction, and force of the end stops, each against positive motion.
    A_A, A_B : m²
        Piston areas, above 0.
    P_0 : Pa
        Ambient pressure, above 0.
    M : kg
        Mass, above 0.

    Returns
    -------
    dv : m/s²

    Notes
    -----
    f_s is not in the paper, see `stop_force`.

    Examples
    --------
    The actuator is in balance when both chambers are vented:

    >>> abs(acceleration(1.095e5, 1.095e5, 0, 0, 0, 12.3e-3, 11.848e-3, 1.095e5, 10)) < 1e-9
    True
    """
    return (A_A * p_A - A_B * p_B - (A_A - A_B) * P_0 - f_l - f_f - f_s) / M


def stop_force(d: Expr, d_dot: Expr, K_stop: Expr, D_stop: Expr, d_stop: Expr) -> Expr:
    r"""Force of one end stop at the penetration d; one-sided, smooth and never pulling.

    .. math:: f = \max(0,\; K_{stop} \, g(d) + D_{stop} \, g'(d) \, \dot d), \quad
              g(d) = \begin{cases} 0, & d \le 0 \\ d^2 / (2 d_{stop}), & d < d_{stop} \\
              d - d_{stop}/2, & d \ge d_{stop} \end{cases}

    Parameters
    ----------
    d : m
        Penetration, negative where the piston is free.
    d_dot : m/s
        Rate of penetration.
    K_stop : N/m
        Stiffness, above 0.
    D_stop : N·s/m
        Damping, at least 0.
    d_stop : m
        Penetration over which the stop takes hold, above 0.

    Returns
    -------
    f : N
        Never negative; 0 where d <= 0.

    Notes
    -----
    The printed model has no end stops, and its load falls beyond 8.5 mm, so an open-loop run can leave the stroke.

    Examples
    --------
    The surplus of 6 kN at full pressure and stroke presses the piston 0.25 mm into the stop:

    >>> f"{stop_force(0.25e-3, 0, 3e7, 1e4, 1e-4):.0f} N"
    '6000 N'
    """
    taking_hold = K_stop * d**2 / (2 * d_stop) + D_stop * d / d_stop * d_dot
    firm = K_stop * (d - d_stop / 2) + D_stop * d_dot
    return sp.Piecewise((0, d <= 0), (_pushing(taking_hold), d < d_stop), (_pushing(firm), True))


def _pushing(f: Expr) -> Expr:
    return sp.Piecewise((f, f > 0), (0, True))

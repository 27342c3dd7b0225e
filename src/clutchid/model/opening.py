"""Opening of a valve by a duty cycle: averaged as in Section 2.4, and through the spool of a proportional valve."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr


def opening(u: Expr, R_0: Expr, R_1: Expr) -> Expr:
    r"""Opening degree of an on/off valve at a duty cycle, Eq. (11).

    .. math:: y_{vx} = \mathrm{sat}_{[0,1]} \frac{u - R_0}{R_1 - R_0}

    Parameters
    ----------
    u : 1
        Duty cycle in [0, 1].
    R_0, R_1 : 1
        Duty cycle where the valve starts to open and where it is fully open, R_0 < R_1.

    Returns
    -------
    y_vx : 1
        In [0, 1].

    Examples
    --------
    >>> f"{opening(0.5, 0.07, 0.93):.2f}"
    '0.50'
    """
    degree = (u - R_0) / (R_1 - R_0)
    return sp.Piecewise((0, u <= R_0), (1, u >= R_1), (degree, True))


def port_opening(a: Expr, n: Expr) -> Expr:
    r"""Opening of the port of a valve without a carrier over its stroke.

    .. math:: y = \mathrm{sat}_{[0,1]}(a)^n

    Parameters
    ----------
    a : 1
        Stroke as a part of that which opens the port fully.
    n : 1
        Exponent, above 0.

    Returns
    -------
    y_vx : 1
        In [0, 1].

    Notes
    -----
    Not in the paper, whose Eq. (11) is a line. The port of a proportional spool valve opens with a power of its stroke;
    with a line in its place a calibration lowers the supply pressure by up to 25 % to bend the flow.

    Examples
    --------
    >>> f"{port_opening(0.5, 1.3):.2f}"
    '0.41'
    """
    return sp.Piecewise((0, a <= 0), (1, a >= 1), (sp.Max(a, sp.Float(1e-9)) ** n, True))


def spool_rate(u: Expr, x: Expr, tau: Expr) -> Expr:
    r"""Rate of the spool of a proportional valve, which follows its duty cycle with a lag.

    .. math:: \dot x = \frac{u - x}{\tau}

    Parameters
    ----------
    u : 1
        Duty cycle in [0, 1].
    x : 1
        Position of the spool as the duty cycle that would hold it there.
    tau : s
        Lag, above 0: a spool with a bandwidth of 70 to 160 Hz has 1 to 2.3 ms.

    Returns
    -------
    x_dot : 1/s

    Notes
    -----
    Not in the paper. Without the lag of a spool the fast strokes of a calibration fit with a wrong viscous friction.

    Examples
    --------
    >>> f"{spool_rate(0.5, 0.3, 2e-3):.0f}"
    '100'
    """
    return (u - x) / tau

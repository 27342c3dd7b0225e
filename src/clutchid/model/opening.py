"""Opening of a valve by a duty cycle: averaged (Section 2.4), by a spool, or by the pulses of a carrier."""

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


def pulse_share(u: Expr, R_0: Expr, R_1: Expr, a_0: Expr, e: Expr) -> Expr:
    r"""Share of a period that a switched valve is open, with the short pulses that only lift it in part.

    .. math:: a = \min\left(1, \frac{u - R_0}{e}\right) \left(a_0 + (1 - a_0) \frac{u - R_0}{R_1 - R_0}\right),
              \quad u > R_0

    Parameters
    ----------
    u : 1
        Duty cycle in [0, 1].
    R_0, R_1 : 1
        Duty cycle up to which the valve stays closed, and from which it stays open.
    a_0 : 1
        Share that the line of the full pulses has at R_0, in [0, 1).
    e : 1
        Part of a period that the armature travels, at least 0; with a_0 = e = 0 this is Eq. (11).

    Returns
    -------
    a : 1
        At least 0; above 1 where a pulse outlasts the period.

    Notes
    -----
    The paper has one line from R_0 to R_1. The magnet needs its time before the armature moves, R_0, and the current
    its time to decay before it moves back, a_0. A pulse that ends while the armature rises lifts it in part only. Above
    the pulse that just opens the valve fully each part of a period more of current is one more of opening, below each
    is worth several.

    Examples
    --------
    >>> f"{pulse_share(0.5, 0.07, 0.93, 0.0, 0.1):.2f} {pulse_share(0.1, 0.07, 0.93, 0.2, 0.1):.2f}"
    '0.50 0.07'
    """
    beyond = u - R_0
    full = a_0 + (1 - a_0) * beyond / (R_1 - R_0)
    return sp.Piecewise((0, beyond <= 0), (full * beyond / e, beyond < e), (full, True))


def fall(u: Expr, a_0: Expr, e: Expr) -> Expr:
    r"""Fall of an armature at the beginning of the next pulse.

    .. math:: h = \mathrm{sat}_{[0,1]} \frac{1 - a_0 - u}{e}

    Parameters
    ----------
    u : 1
        Duty cycle of the pulse before.
    a_0 : 1
        Part of a period that the current takes to decay, see `pulse_share`: a shorter gap leaves the valve wide open.
    e : 1
        Part of a period that the armature travels, at least 0.

    Returns
    -------
    h : 1
        In [0, 1]: 0 where the valve is still open, 1 where it has closed.

    Notes
    -----
    Not in the paper.

    Examples
    --------
    >>> [f"{float(fall(u, 0.1, 0.2)):.2f}" for u in (0.95, 0.8, 0.6)]
    ['0.00', '0.50', '1.00']
    """
    gap = 1 - a_0 - u
    return sp.Piecewise((0, gap <= 0), (1, gap >= e), (gap / e, True))


def bridged_share(share: Expr, following: Expr, h: Expr) -> Expr:
    r"""Share of a period that a switched valve is open, with a gap that is too short to close it before the next pulse.

    .. math:: b = 1 - h (1 - a) \quad \text{if } a < 1 \text{ and a pulse follows, else } a

    Parameters
    ----------
    share : 1
        `pulse_share` of the duty cycle.
    following : 1
        Duty cycle of the next period.
    h : 1
        How far the armature falls in between, see `fall`.

    Returns
    -------
    b : 1
        At least `share`.

    Notes
    -----
    Not in the paper. A gap is to a closing valve what a pulse is to an opening one.

    Examples
    --------
    >>> [float(bridged_share(0.9, following, 0.5)) for following in (0.0, 0.1)]
    [0.9, 0.95]
    """
    return sp.Piecewise((share, (following <= 0) | (share >= 1)), (1 - h * (1 - share), True))


def continued_share(share: Expr, u: Expr, late: Expr, h: Expr) -> Expr:
    r"""Share of a period that a switched valve is open where the pulse before has left it so.

    .. math:: a' = a + (1 - h) \max(0, \; u + l - a) \quad \text{if } u > 0, \text{ else } a

    Parameters
    ----------
    share : 1
        `pulse_share` of `u`.
    u : 1
        Duty cycle of the period.
    late : 1
        How much later a valve closes than it opens, in parts of a period: `pulse_share` at 1, less 1.
    h : 1
        How far the armature has fallen since the pulse before, see `fall`.

    Returns
    -------
    a : 1
        At least `share`.

    Notes
    -----
    Not in the paper. A pulse too short to open a valve holds an open one until it ends: after a stroke at full flow the
    last short pulse passes many times what it would alone.

    Examples
    --------
    >>> [f"{continued_share(0.01, 0.095, 0.07, h):.3f}" for h in (1.0, 0.5, 0.0)]
    ['0.010', '0.088', '0.165']
    """
    longer = (1 - h) * (u + late - share)
    return share + sp.Piecewise((longer, (u > 0) & (longer > 0)), (0, True))


def passed_pulses(a: Expr, b: Expr, s: Expr, e: Expr, c: Expr, d: Expr) -> Expr:
    r"""Lift of a switched valve over a sample, in parts of a period: pulses with ramps as edges.

    .. math:: \sum_{k=-2}^{1} \int_c^{c + d} \ell(x - k - s) - \ell(x - k - s - a_k) \, dx, \quad
              \ell(x) = \mathrm{sat}_{[0,1]} \left(\frac{x}{e} + \frac{1}{2}\right), \quad
              a_k = a \; (k \ge 0), \; b \; (k < 0)

    Parameters
    ----------
    a, b : 1
        Share of the period that the valve is open, `pulse_share` of the duty cycle, in this period and the one before.
    s : 1
        Phase of the carrier at which the valve is half open, in [-1, 1].
    e : 1
        Part of a period that the armature travels, above 0.
    c : 1
        Phase of the carrier at the start of the sample, in [0, 1), or from d before the start of the period 0 on.
    d : 1
        Part of a period that the sample lasts, below 1.

    Returns
    -------
    passed : 1
        At least 0; pulses that overlap count twice.

    Notes
    -----
    Not in the paper. A pulse goes on into the next period by as much as it began late and outlasts its own, so the duty
    cycle of the period before matters. A pulse shorter than the travel lifts the armature in part. An edge has a useful
    derivative to `a` and `s`.

    Examples
    --------
    The last pulse before the valve stays closed ends when it ends, not with its period:

    >>> [f"{float(passed_pulses(0.0, 1.0, 0.15, 0.02, c, 0.1)):.2f}" for c in (0.0, 0.1)]
    ['0.10', '0.05']
    """

    def risen(x: Expr) -> Expr:
        ramp = x + e / 2
        return sp.Piecewise((0, ramp <= 0), (x, x >= e / 2), (ramp * ramp / (2 * e), True))

    def lifted(edge: Expr) -> Expr:
        return risen(c + d - edge) - risen(c - edge)

    return sum((lifted(k + s) - lifted(k + s + (a if k >= 0 else b)) for k in (-2, -1, 0, 1)), sp.Integer(0))


def switched_opening(a: Expr, passed: Expr, d: Expr, n: Expr) -> Expr:
    r"""Mean opening over a sample of a valve that is switched by a carrier, in place of the mean over a period.

    .. math:: \bar y = \min(1, \text{passed} / d), \quad \text{without a carrier } \bar y = \min(1, a)^n

    Parameters
    ----------
    a : 1
        Share of the period that the valve is open, `pulse_share` of the duty cycle.
    passed : 1
        Time in which it is open, in parts of a period, see `passed_pulses`.
    d : 1
        Part of a period that the sample lasts; 0 where there is no carrier.
    n : 1
        Exponent of the opening where there is no carrier, above 0.

    Returns
    -------
    y_vx : 1
        In [0, 1].

    Notes
    -----
    The paper averages over the period. An on/off valve at 100 Hz moves the piston by up to 0.35 mm within a period, and
    a recording at 1 kHz sees it.

    Examples
    --------
    A valve that is open for the first quarter of the period is open in half of the sample around its closing:

    >>> f"{float(switched_opening(0.25, passed_pulses(0.25, 0.25, 0.0, 0.02, 0.2, 0.1), 0.1, 1)):.2f}"
    '0.50'

    A proportional valve at half its travel:

    >>> f"{float(switched_opening(0.5, 0, sp.Integer(0), 1.3)):.2f}"
    '0.41'
    """
    return sp.Piecewise((port_opening(a, n), d <= 0), (passed / d, passed < d), (1, True))

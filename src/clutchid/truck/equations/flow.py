"""Air flow through valves, orifices and leaks: ISO 6358 with upstream temperature, a nozzle, and viscous slit flow."""

from __future__ import annotations

from collections.abc import Callable

import sympy as sp

from clutchid.codegen.system import Expr
from clutchid.truck.equations.motion import Definitions
from clutchid.truck.equations.nozzle import nozzle_flow

#: Reference air of ISO 6358: density, pressure and temperature.
_RHO_N, P_N, T_N = 1.185, 1e5, 293.15


def flow_function(r: Expr, b: Expr, m: Expr, r_lam: Expr) -> Expr:
    r"""Flow function of ISO 6358-1:2013, linear near r = 1.

    .. math:: \psi(r) = \begin{cases} 1, & r \le b \\
              \left(1 - \left(\frac{r - b}{1 - b}\right)^2\right)^m, & b < r \le r_{lam} \\
              \psi(r_{lam}) \frac{1 - r}{1 - r_{lam}}, & r_{lam} < r < 1 \\ 0, & r \ge 1 \end{cases}

    Parameters
    ----------
    r : 1
        Ratio of downstream to upstream pressure, at least 0.
    b : 1
        Critical pressure ratio, in [0, r_lam).
    m : 1
        Subsonic index, above 0; 0.5 is the quarter ellipse.
    r_lam : 1
        Pressure ratio above which the flow is laminar, below 1.

    Returns
    -------
    psi : 1
        In [0, 1].

    References
    ----------
    ISO 6358-1:2013 (sonic conductance C, critical ratio b, subsonic index m). The linear part is added: for m < 1 the
    curve has a vertical tangent at r = 1.

    Examples
    --------
    >>> f"{flow_function(0.2, 0.3, 0.5, 0.995):.2f}, {flow_function(0.65, 0.3, 0.5, 0.995):.3f}"
    '1.00, 0.866'
    """

    def subsonic(ratio: Expr) -> Expr:
        return (1 - ((ratio - b) / (1 - b)) ** 2) ** m

    line = subsonic(r_lam) * (1 - r) / (1 - r_lam)
    return sp.Piecewise((1, r <= b), (subsonic(r), r <= r_lam), (line, r < 1), (0, True))


def valve_flow(p_h: Expr, p_l: Expr, T_h: Expr, C: Expr, b: Expr, m: Expr, r_lam: Expr) -> Expr:
    r"""Mass flow through a valve or orifice from `p_h` to `p_l`.

    .. math:: w = \rho_N \, C \, p_h \sqrt{T_N / T_h} \; \psi(p_l / p_h)

    Parameters
    ----------
    p_h, p_l : Pa
        Upstream and downstream pressure, above 0.
    T_h : K
        Upstream temperature, above 0.
    C : m³/(Pa·s)
        Sonic conductance, at least 0.
    b, m, r_lam : 1
        See `flow_function`.

    Returns
    -------
    w : kg/s
        Never negative; 0 where p_l >= p_h.

    References
    ----------
    ISO 6358-1:2013; reference air 1.185 kg/m³ at 1 bar and 293.15 K.

    Examples
    --------
    >>> f"{valve_flow(9e5, 1.013e5, 293.15, 19e-9, 0.3, 0.5, 0.995) * 1e3:.1f} g/s"
    '20.3 g/s'
    """
    return _RHO_N * C * p_h * sp.sqrt(T_N / T_h) * flow_function(p_l / p_h, b, m, r_lam)


def slit_flow(p_1: Expr, p_2: Expr, T: Expr, C: Expr) -> Expr:
    r"""Leakage through a narrow slit from 1 to 2, negative from 2 to 1.

    .. math:: w_{12} = \rho_N \, C \, \frac{p_1^2 - p_2^2}{p_N} \frac{T_N}{T}

    Parameters
    ----------
    p_1, p_2 : Pa
        Pressures on both sides.
    T : K
        Temperature of the wall of the slit and of the air in it, above 0.
    C : m³/(Pa·s)
        Conductance, at least 0.

    Returns
    -------
    w : kg/s

    References
    ----------
    Textbook: isothermal viscous flow of an ideal gas in a slit is proportional to the difference of the squared
    pressures; leakage of this size from the truck specification.

    Examples
    --------
    A new seal at 5 bar loses 0.1 % of a chamber in a second:

    >>> f"{slit_flow(5e5, 1.013e5, 293.15, 1e-12) * 1e6:.1f} mg/s"
    '2.8 mg/s'
    """
    return _RHO_N * C / P_N * (p_1 - p_2) * (p_1 + p_2) * (T_N / T)


def orifice_flow(
    flow: Callable[[Expr, Expr, Expr, int], Expr], p_1: Expr, p_2: Expr, T_1: Expr, T_2: Expr, back: bool = False
) -> Expr:
    r"""Mass flow from 1 to 2 through an orifice that passes flow in both directions, negative from 2 to 1.

    .. math:: w_{12} = \begin{cases} w(p_1, p_2, T_1), & p_1 \ge p_2 \\ -w(p_2, p_1, T_2), & p_1 < p_2 \end{cases}

    Parameters
    ----------
    flow : kg/s
        Flow in one direction, of upstream and downstream pressure, upstream temperature, and its sign.
    p_1, p_2 : Pa
        Pressures on both sides, above 0.
    T_1, T_2 : K
        Temperatures on both sides, above 0.
    back
        Whether equal pressures are a flow from 2 to 1; it is 0 but for rounding.

    Returns
    -------
    w : kg/s

    References
    ----------
    As `valve_flow`.

    Examples
    --------
    >>> through = lambda p_h, p_l, T, sign: sign * valve_flow(p_h, p_l, T, 5e-8, 0.3, 0.5, 0.995)
    >>> round(orifice_flow(through, 1e5, 1.2e5, 293.15, 293.15) * 1e3, 1)
    -4.6
    """
    forth = p_1 > p_2 if back else p_1 >= p_2
    return sp.Piecewise((flow(p_1, p_2, T_1, 1), forth), (flow(p_2, p_1, T_2, -1), True))


def through(b: Definitions, law: str, hole: str, p_h: Expr, p_l: Expr, T_h: Expr, opening: Expr) -> Expr:
    """Mass flow in kg/s through the valve or orifice `hole` of a truck, times a share `opening`.

    By `law` a conductance after ISO 6358 ("iso"), the area of a nozzle ("nozzle"), or either of them: the nozzle where
    the truck's number ``nozzle`` is above 0.
    """
    if law == "iso":
        return opening * valve_flow(p_h, p_l, T_h, b[f"C_{hole}"], b[f"b_{hole}"], b[f"m_{hole}"], b.r_lam)
    if law == "nozzle":
        return opening * nozzle_flow(p_h, p_l, T_h, b[f"A_{hole}"], b.R, b.gamma, b.r_lam)
    nozzle, iso = (through(b, kind, hole, p_h, p_l, T_h, opening) for kind in ("nozzle", "iso"))
    return sp.Piecewise((nozzle, b.nozzle > 0), (iso, True))

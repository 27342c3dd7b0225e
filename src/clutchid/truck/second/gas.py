"""Air of family B: polytropic zones, a nozzle's flow, a tube, and a pressure regulator."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr


def pressure_rate(p: Expr, V: Expr, V_dot: Expr, inflow: Expr, n: Expr, m: Expr, R: Expr, T_w: Expr, tau: Expr) -> Expr:
    r"""Rate of the pressure in a zone whose air changes state polytropically and relaxes to the wall's temperature.

    .. math:: \dot p = \frac{n}{V} \left(R \sum_i T_i w_i - p \dot V\right) + \frac{1}{\tau}
              \left(\frac{m R T_w}{V} - p\right)

    Parameters
    ----------
    p : Pa
        Pressure, above 0.
    V, V_dot : m³, m³/s
        Volume, above 0, and its rate.
    inflow : K·kg/s
        Sum of T w over the flows into the zone, T being the upstream temperature; flow out of it is negative.
    n : 1
        Exponent, between 1 (isothermal) and the ratio of specific heats (adiabatic).
    m : kg
        Mass, above 0.
    R : J/(kg·K)
        Gas constant.
    T_w, tau : K, s
        Temperature of the wall, and time constant at constant volume, above 0.

    Returns
    -------
    p_dot : Pa/s

    References
    ----------
    Textbook: first law of an open system with p V^n in place of the adiabatic exponent; the relaxation is assumed.

    Examples
    --------
    Half a litre at 5 bar that shrinks by 10 % a second gains 0.6 bar a second with n = 1.2:

    >>> f"{pressure_rate(5e5, 5e-4, -5e-5, 0.0, 1.2, 3e-3, 287, 290, float('inf')) / 1e5:.1f}"
    '0.6'
    """
    return n / V * (R * inflow - p * V_dot) + (m * R * T_w / V - p) / tau


def temperature(p: Expr, V: Expr, m: Expr, R: Expr) -> Expr:
    """Temperature in K of an ideal gas: T = p V / (m R).

    Examples
    --------
    >>> round(temperature(1e5, 1e-3, 1.189e-3, 287.05))
    293
    """
    return p * V / (m * R)


def discharge(r: Expr) -> Expr:
    r"""Discharge coefficient of a sharp-edged orifice over the pressure ratio.

    .. math:: C_d = 0.8414 - 0.1002 r + 0.8415 r^2 - 3.9 r^3 + 4.6001 r^4 - 1.6827 r^5

    References
    ----------
    Perry's measurements as a polynomial, usual in pneumatic servo systems (recalled, not verified).

    Examples
    --------
    >>> f"{discharge(0.0):.2f} {discharge(1.0):.2f}"
    '0.84 0.60'
    """
    return 0.8414 + r * (-0.1002 + r * (0.8415 + r * (-3.9 + r * (4.6001 - r * 1.6827))))


def nozzle_function(r: Expr, gamma: Expr, r_lam: Expr) -> Expr:
    r"""Isentropic flow through a nozzle, 1 when choked; linear near r = 1.

    .. math:: \psi = \sqrt{\frac{r^{2/\gamma} - r^{(\gamma+1)/\gamma}}{r_c^{2/\gamma} - r_c^{(\gamma+1)/\gamma}}},
              \quad r_c = \left(\frac{2}{\gamma + 1}\right)^{\gamma / (\gamma - 1)}

    Parameters
    ----------
    r : 1
        Ratio of downstream to upstream pressure, at least 0.
    gamma : 1
        Ratio of specific heats, above 1.
    r_lam : 1
        Ratio above which the flow is laminar, between the critical one and 1.

    Returns
    -------
    psi : 1
        In [0, 1].

    References
    ----------
    Textbook, de Saint-Venant and Wantzel; the linear part is added.

    Examples
    --------
    >>> f"{nozzle_function(0.3, 1.4, 0.995):.2f} {nozzle_function(0.9, 1.4, 0.995):.2f}"
    '1.00 0.62'
    """
    critical = (2 / (gamma + 1)) ** (gamma / (gamma - 1))

    def flow(ratio: Expr) -> Expr:
        return sp.sqrt(ratio ** (2 / gamma) - ratio ** ((gamma + 1) / gamma))

    line = flow(r_lam) / flow(critical) * (1 - r) / (1 - r_lam)
    return sp.Piecewise((1, r <= critical), (flow(r) / flow(critical), r <= r_lam), (line, r < 1), (0, True))


def nozzle_flow(p_h: Expr, p_l: Expr, T_h: Expr, A: Expr, R: Expr, gamma: Expr, r_lam: Expr) -> Expr:
    r"""Mass flow through a sharp-edged orifice.

    .. math:: w = C_d A p_h \sqrt{\frac{\gamma}{R T_h}} \left(\frac{2}{\gamma + 1}\right)^{\frac{\gamma + 1}
              {2 (\gamma - 1)}} \psi(p_l / p_h)

    Parameters
    ----------
    p_h, p_l : Pa
        Upstream and downstream pressure, above 0.
    T_h : K
        Upstream temperature, above 0.
    A : m²
        Area, at least 0.
    R, gamma, r_lam
        See `pressure_rate` and `nozzle_function`.

    Returns
    -------
    w : kg/s
        Never negative; 0 where p_l >= p_h.

    References
    ----------
    As `nozzle_function` and `discharge`.

    Examples
    --------
    >>> f"{nozzle_flow(9e5, 1e5, 293.15, 11.5e-6, 287.05, 1.4, 0.995) * 1e3:.0f} g/s"
    '20 g/s'
    """
    choked = sp.sqrt(gamma / (R * T_h)) * (2 / (gamma + 1)) ** ((gamma + 1) / (2 * (gamma - 1)))
    ratio = p_l / p_h
    return discharge(ratio) * A * p_h * choked * nozzle_function(ratio, gamma, r_lam)


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


def regulator_rate(x: Expr, p: Expr, P_S: Expr, dp: Expr, tau: Expr) -> Expr:
    r"""Rate of the opening of a pressure regulator with droop.

    .. math:: \tau \dot x = \min\left(1, \max\left(0, \frac{P_S - p}{\Delta p}\right)\right) - x

    Parameters
    ----------
    x : 1
        Opening, 0 to 1.
    p, P_S : Pa
        Pressure behind the regulator, and set pressure.
    dp : Pa
        Droop: pressure below the set one at which it is fully open, above 0.
    tau : s
        Time constant, above 0.

    Returns
    -------
    x_dot : 1/s

    References
    ----------
    Textbook: proportional regulator; numbers are assumptions.

    Examples
    --------
    >>> round(regulator_rate(0.0, 8.5e5, 9e5, 1e5, 0.05))
    10
    """
    wanted = (P_S - p) / dp
    return (sp.Piecewise((0, wanted < 0), (wanted, wanted < 1), (1, True)) - x) / tau

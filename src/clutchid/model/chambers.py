"""Section 2.3: pressure in the two chambers."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr

#: Pressure in Pa and temperature in K at which a heat transfer coefficient is given.
P_N, T_N = 1e5, 293.15


def volume_a(y: Expr, V_0A: Expr, A_A: Expr) -> Expr:
    r"""Volume of chamber A, used by Eq. (4).

    .. math:: V_A = V_{0A} + A_A y

    Parameters
    ----------
    y : m
        Piston position.
    V_0A : m³
        Volume at y = 0, above 0.
    A_A : m²
        Piston area, above 0.

    Returns
    -------
    V_A : m³

    Notes
    -----
    Not defined in the paper.

    Examples
    --------
    >>> f"{volume_a(0.025, 0.148e-3, 12.3e-3) * 1e3:.4f} l"
    '0.4555 l'
    """
    return V_0A + A_A * y


def volume_b(y: Expr, V_0B: Expr, A_B: Expr, y_max: Expr) -> Expr:
    r"""Volume of chamber B, used by Eq. (5).

    .. math:: V_B = V_{0B} + A_B (y_{max} - y)

    Parameters
    ----------
    y : m
        Piston position.
    V_0B : m³
        Dead volume at full stroke, above 0.
    A_B : m²
        Piston area, above 0.
    y_max : m
        Stroke, above 0.

    Returns
    -------
    V_B : m³

    Notes
    -----
    Not defined in the paper. Its Appendix calls V_0B the volume at y = 0; read so, V_B is negative beyond 10.13 mm.

    Examples
    --------
    >>> f"{volume_b(0.025, 1.2e-4, 11.848e-3, 0.025) * 1e3:.4f} l"
    '0.1200 l'
    """
    return V_0B + A_B * (y_max - y)


def pressure_rate(p: Expr, V: Expr, V_dot: Expr, w: Expr, R: Expr, T_0: Expr) -> Expr:
    r"""Rate of the pressure of an isothermal chamber, Eqs. (4) and (5).

    .. math:: \dot p = - \frac{\dot V}{V} p + \frac{R T_0}{V} w

    Parameters
    ----------
    p : Pa
        Absolute pressure, above 0.
    V : m³
        Volume, above 0.
    V_dot : m³/s
        Its rate: A_A v in chamber A, -A_B v in chamber B.
    w : kg/s
        Mass flow into the chamber.
    R : J/(kg·K)
        Gas constant, above 0.
    T_0 : K
        Temperature, above 0.

    Returns
    -------
    p_dot : Pa/s

    Examples
    --------
    The open supply valve raises the pressure in the empty chamber A by 11 bar in a tenth of a second:

    >>> f"{pressure_rate(1.095e5, 0.148e-3, 0, 0.02013, 288, 293) / 1e6:.1f} bar/100 ms"
    '11.5 bar/100 ms'
    """
    return -V_dot / V * p + R * T_0 / V * w


def wall_area(V: Expr, A: Expr) -> Expr:
    r"""Area of the wall of a cylindrical chamber: both lids and the liner.

    .. math:: S = 2 A + 2 \sqrt{\pi / A} \, V

    Parameters
    ----------
    V : m³
        Volume, above 0.
    A : m²
        Piston area, above 0.

    Returns
    -------
    S : m²

    Notes
    -----
    Not in the paper. The rod is neglected; the heat transfer coefficient is estimated with it.

    Examples
    --------
    >>> f"{wall_area(0.3e-3, 12.3e-3) * 1e4:.0f} cm²"
    '342 cm²'
    """
    return 2 * A + 2 * sp.sqrt(sp.pi / A) * V


def heat_flow(p: Expr, T: Expr, T_w: Expr, S: Expr, h: Expr) -> Expr:
    r"""Heat from the wall of a chamber into its air.

    .. math:: Q = h \sqrt{\frac{p \, T}{p_N \, T_N}} \, S \, (T_w - T)

    Parameters
    ----------
    p, T : Pa, K
        Pressure and temperature of the air, above 0.
    T_w : K
        Temperature of the wall.
    S : m²
        Area of the wall, see `wall_area`.
    h : W/(m²·K)
        Heat transfer coefficient at p_N = 1 bar and T_N = 293.15 K, at least 0.

    Returns
    -------
    Q : W

    Notes
    -----
    Not in the paper. A constant coefficient, as a calibration finds it at some bar, is three times that at 1 bar.

    References
    ----------
    Eichelberg, Engineering 148 (1939), without its factor for the piston's mean speed.

    Examples
    --------
    >>> f"{heat_flow(4e5, 293.15, 303.15, 0.03, 50.0):.0f} W"
    '30 W'
    """
    # a trial of a search may pass through pressures below 0
    denser = sp.Piecewise((sp.sqrt(p * T / (P_N * T_N)), p * T > 0), (0, True))
    return h * denser * S * (T_w - T)


def heated_pressure_rate(p: Expr, V: Expr, V_dot: Expr, H: Expr, Q: Expr, gamma: Expr) -> Expr:
    r"""Rate of the pressure of a chamber by the energy balance, in place of Eqs. (4) and (5).

    .. math:: \dot p = \frac{(\gamma - 1)(H + Q) - \gamma p \dot V}{V}

    Parameters
    ----------
    p : Pa
        Absolute pressure, above 0.
    V, V_dot : m³, m³/s
        Volume, above 0, and its rate.
    H : W
        Enthalpy that flows in: c_p T w, with the temperature of where the air comes from.
    Q : W
        Heat that the wall gives.
    gamma : 1
        Ratio of specific heats, above 1.

    Returns
    -------
    p_dot : Pa/s

    Notes
    -----
    The paper keeps the temperature constant, its largest structural error: 1 mm and 0.17 bar in a fast stroke.

    References
    ----------
    First law for an open system of ideal gas, U = p V / (gamma - 1); kinetic energy is neglected.

    Examples
    --------
    A sealed chamber that is squeezed heats up, so its pressure rises 1.4 times as fast as at constant temperature:

    >>> f"{heated_pressure_rate(1e5, 1e-3, -1e-4, 0, 0, 1.4) / pressure_rate(1e5, 1e-3, -1e-4, 0, 288, 293):.2f}"
    '1.40'
    """
    return ((gamma - 1) * (H + Q) - gamma * p * V_dot) / V


def temperature_rate(T: Expr, p: Expr, p_dot: Expr, V: Expr, V_dot: Expr, w: Expr, R: Expr) -> Expr:
    r"""Rate of the temperature of a chamber, the ideal gas law p V = m R T differentiated.

    .. math:: \dot T = T \left(\frac{\dot p}{p} + \frac{\dot V}{V} - \frac{R T w}{p V}\right)

    Parameters
    ----------
    T : K
        Temperature, above 0.
    p, p_dot : Pa, Pa/s
        Absolute pressure, above 0, and its rate, see `heated_pressure_rate`.
    V, V_dot : m³, m³/s
        Volume, above 0, and its rate.
    w : kg/s
        Mass flow into the chamber.
    R : J/(kg·K)
        Gas constant, above 0.

    Returns
    -------
    T_dot : K/s

    Notes
    -----
    Not in the paper.

    Examples
    --------
    At constant pressure and without flow, air that grows by a tenth warms by a tenth:

    >>> temperature_rate(300.0, 1e5, 0.0, 1e-3, 1e-4, 0.0, 288)
    30.0
    """
    return T * (p_dot / p + V_dot / V - R * T * w / (p * V))

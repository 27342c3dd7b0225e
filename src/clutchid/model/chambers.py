"""Section 2.3: pressure in the two chambers."""

from __future__ import annotations

from clutchid.codegen.system import Expr


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

    Raises
    ------
    Nothing: numbers are checked where they enter.

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

    Raises
    ------
    Nothing: numbers are checked where they enter.

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

    Raises
    ------
    Nothing: numbers are checked where they enter.

    Examples
    --------
    The open supply valve raises the pressure in the empty chamber A by 11 bar in a tenth of a second:

    >>> f"{pressure_rate(1.095e5, 0.148e-3, 0, 0.02013, 288, 293) / 1e6:.1f} bar/100 ms"
    '11.5 bar/100 ms'
    """
    return -V_dot / V * p + R * T_0 / V * w

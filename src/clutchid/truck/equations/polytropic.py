"""Air in a zone that changes state polytropically and relaxes to the wall: mass and pressure are the states."""

from __future__ import annotations

from clutchid.codegen.system import Expr
from clutchid.truck.equations.motion import Definitions, Zone


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


def air(b: Definitions, zone: Zone) -> None:
    """Temperature T of a zone with the states m and p."""
    X = zone.name
    b[f"T_{X}"] = temperature(b[f"p_{X}"], zone.V, b[f"m_{X}"], b.R)


def heat(b: Definitions, zone: Zone) -> Expr:
    """Heat flow in W into a zone by the relaxation; that of an exponent below the adiabatic one is not counted."""
    X = zone.name
    return (b[f"m_{X}"] * b.R * b.T_w - b[f"p_{X}"] * zone.V) / (b.tau_w * (b.gamma - 1))


def rates(b: Definitions, zone: Zone, w: Expr, h: Expr) -> tuple[Expr, Expr]:
    """Rates of m and p for the mass flow `w` and the sum `h` of T w into a zone."""
    X = zone.name
    return w, pressure_rate(b[f"p_{X}"], zone.V, zone.V_dot, h, b.n_p, b[f"m_{X}"], b.R, b.T_w, b.tau_w)

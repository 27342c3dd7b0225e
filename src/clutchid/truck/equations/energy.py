"""Air in a chamber: mass and internal energy are the states, so any integration method conserves both."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr
from clutchid.truck.equations.flow import P_N, T_N
from clutchid.truck.equations.motion import Definitions, Zone


def pressure(U: Expr, V: Expr, gamma: Expr) -> Expr:
    r"""Pressure of an ideal gas from its internal energy.

    .. math:: p = (\gamma - 1) \, U / V

    Parameters
    ----------
    U : J
        Internal energy, above 0.
    V : m³
        Volume, above 0.
    gamma : 1
        Ratio of specific heats, above 1.

    Returns
    -------
    p : Pa

    References
    ----------
    Textbook: U = m c_v T, p V = m R T, c_v = R / (gamma - 1).

    Examples
    --------
    A quarter of a litre at 5 bar contains 312 J:

    >>> f"{pressure(312.5, 0.25e-3, 1.4) / 1e5:.2f} bar"
    '5.00 bar'
    """
    return (gamma - 1) * U / V


def temperature(U: Expr, m: Expr, R: Expr, gamma: Expr) -> Expr:
    r"""Temperature of an ideal gas from its internal energy.

    .. math:: T = (\gamma - 1) \, U / (m R)

    Parameters
    ----------
    U : J
        Internal energy, above 0.
    m : kg
        Mass, above 0.
    R : J/(kg·K)
        Gas constant, above 0.
    gamma : 1
        Ratio of specific heats, above 1.

    Returns
    -------
    T : K

    References
    ----------
    Textbook, as in `pressure`.

    Examples
    --------
    >>> f"{temperature(312.5, 1.486e-3, 287.05, 1.4):.0f} K"
    '293 K'
    """
    return (gamma - 1) * U / (m * R)


def wall_area(V: Expr, A: Expr) -> Expr:
    r"""Heat transfer area of a cylindrical chamber: two end faces and the liner.

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

    References
    ----------
    Geometry: perimeter 2 sqrt(pi A) times length V / A. The rod in chamber B is neglected.

    Examples
    --------
    >>> f"{wall_area(0.3e-3, 12.3e-3) * 1e4:.0f} cm2"
    '342 cm2'
    """
    return 2 * A + 2 * sp.sqrt(sp.pi / A) * V


def heat_flow(p: Expr, T: Expr, T_w: Expr, S: Expr, h: Expr, p_N: Expr, T_N: Expr) -> Expr:
    r"""Heat from the wall into the air.

    .. math:: Q = h \sqrt{\frac{p T}{p_N T_N}} \, S \, (T_w - T)

    Parameters
    ----------
    p : Pa
        Pressure, above 0.
    T, T_w : K
        Temperature of air and wall, above 0.
    S : m²
        Area, see `wall_area`.
    h : W/(m²·K)
        Heat transfer coefficient in the reference state, at least 0.
    p_N, T_N : Pa, K
        Reference state.

    Returns
    -------
    Q : W

    References
    ----------
    Eichelberg's dependence on pressure and temperature, without piston speed, as usual for servo-pneumatic cylinders
    (not verified); 20 to 150 W/(m²·K) from the truck specification.

    Examples
    --------
    Air of 6 bar and 340 K loses 98 W to a wall at 293 K:

    >>> f"{heat_flow(6e5, 340.0, 293.15, 342e-4, 23, 1e5, 293.15):.0f} W"
    '-97 W'
    """
    return h * sp.sqrt(p * T / (p_N * T_N)) * S * (T_w - T)


def energy_rate(H: Expr, Q: Expr, p: Expr, V_dot: Expr) -> Expr:
    r"""First law for an open chamber.

    .. math:: \dot U = H + Q - p \dot V

    Parameters
    ----------
    H : W
        Enthalpy flow into the chamber, c_p T w with the upstream temperature.
    Q : W
        Heat flow into the chamber.
    p : Pa
        Pressure.
    V_dot : m³/s
        Rate of the volume.

    Returns
    -------
    U_dot : W

    References
    ----------
    Textbook energy balance; kinetic energy of the air is neglected.

    Examples
    --------
    >>> energy_rate(0.0, 0.0, 5e5, 1e-3)
    -500.0
    """
    return H + Q - p * V_dot


def air(b: Definitions, zone: Zone) -> None:
    """Pressure p, temperature T and heat Q from the wall of a zone with the states m and U."""
    X = zone.name
    b[f"p_{X}"] = pressure(b[f"U_{X}"], zone.V, b.gamma)
    b[f"T_{X}"] = temperature(b[f"U_{X}"], b[f"m_{X}"], b.R, b.gamma)
    b[f"Q_{X}"] = heat_flow(b[f"p_{X}"], b[f"T_{X}"], b.T_w, zone.S, zone.h, P_N, T_N)


def heat(b: Definitions, zone: Zone) -> Expr:
    """Heat flow in W into a zone."""
    return b[f"Q_{zone.name}"]


def rates(b: Definitions, zone: Zone, w: Expr, h: Expr) -> tuple[Expr, Expr]:
    """Rates of m and U for the mass flow `w` and the sum `h` of T w into a zone."""
    X = zone.name
    return w, energy_rate(b.c_p * h, b[f"Q_{X}"], b[f"p_{X}"], zone.V_dot)

"""Motion of the piston between its stops, and named expressions of a plant, from which its system is made."""

from __future__ import annotations

from typing import NamedTuple

import sympy as sp

from clutchid.codegen.system import Expr


class Definitions:
    """Named expressions in order of definition: ``b["p_A"] = value`` adds one, ``b["p_A"]`` or ``b.p_A`` is its symbol.

    A name that is used without a definition is given: a state, an input or a parameter.
    """

    def __init__(self) -> None:
        self.given: dict[str, Expr] = {}
        self.rows: dict[Expr, Expr] = {}

    def __setitem__(self, name: str, value: Expr) -> None:
        if name in self.given:
            raise ValueError(f"{name} is used before it is defined.")
        self.rows[sp.Symbol(name, real=True)] = value

    def __getitem__(self, name: str) -> Expr:
        symbol = sp.Symbol(name, real=True)
        if symbol not in self.rows:
            self.given[name] = symbol
        return symbol

    def __getattr__(self, name: str) -> Expr:
        return self[name]


class Zone(NamedTuple):
    """A volume of air: its letter, volume [m³], the rate of that [m³/s], area [m²] and heat transfer of its wall."""

    name: str
    V: Expr
    V_dot: Expr
    S: Expr
    h: Expr


def acceleration(p_A: Expr, p_B: Expr, f: Expr, A_A: Expr, A_B: Expr, P_0: Expr, M: Expr) -> Expr:
    r"""Newton's second law for the piston and the mass that moves with it.

    .. math:: \dot v = \frac{1}{M} \left(A_A (p_A - P_0) - A_B (p_B - P_0) - f\right)

    Parameters
    ----------
    p_A, p_B : Pa
        Pressure in the chambers.
    f : N
        All forces against positive motion: load, hysteresis, friction, stops.
    A_A, A_B : m²
        Areas of the piston, above 0.
    P_0 : Pa
        Ambient pressure, which acts on the rod.
    M : kg
        Moving mass, above 0.

    Returns
    -------
    dv : m/s²

    References
    ----------
    Textbook.

    Examples
    --------
    >>> acceleration(1e5, 1e5, 0.0, 12.3e-3, 11.8e-3, 1e5, 10)
    0.0
    """
    return (A_A * (p_A - P_0) - A_B * (p_B - P_0) - f) / M


def stop_force(d: Expr, d_dot: Expr, K_stop: Expr, chi: Expr) -> Expr:
    r"""Force of an end stop at the penetration d; one-sided, continuous, never pulling.

    .. math:: f = K_{stop} \, d^{3/2} \max(0, 1 + \chi \dot d) \quad \text{for } d > 0

    Parameters
    ----------
    d, d_dot : m, m/s
        Penetration and its rate.
    K_stop : N/m^1.5
        Stiffness of the contact, above 0.
    chi : s/m
        Damping, at least 0: an impact at speed u loses about the fraction 2/3 chi u of that speed.

    Returns
    -------
    f : N
        Never negative; 0 where d <= 0.

    References
    ----------
    Hunt and Crossley, J. Applied Mechanics 42 (1975).

    Examples
    --------
    Full pressure presses the piston 0.3 mm into the stop:

    >>> f"{stop_force(0.3e-3, 0.0, 1.15e9, 4):.0f} N"
    '5976 N'
    """
    damped = 1 + chi * d_dot
    return sp.Piecewise((K_stop * d * sp.sqrt(d) * sp.Piecewise((damped, damped > 0), (0, True)), d > 0), (0, True))

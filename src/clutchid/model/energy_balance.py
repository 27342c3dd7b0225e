"""The model with an energy balance in both chambers, a supply that varies and a release bearing; beyond the paper."""

from __future__ import annotations

from functools import cache

import sympy as sp

from clutchid.codegen.system import Expr, System
from clutchid.model.assembly import VALVE_INPUTS, Book, assembled, friction_and_stops, gated, openings, spool_openings
from clutchid.model.chambers import heat_flow, heated_pressure_rate, temperature_rate, volume_a, volume_b, wall_area
from clutchid.model.friction import bearing_force, deflection_rate
from clutchid.model.motion import acceleration
from clutchid.model.opening import spool_rate
from clutchid.model.supply import governor_rate, reservoir_rate
from clutchid.model.valves import iso_flow, leak_flow, orifice_flow, thermal_factor

_STATES = ("y", "v", "p_A", "p_B", "z", "T_A", "T_B", "p_S", "p_G", "z_h")
_SPOOLS = ("x_vs", "x_ve")


@cache
def energy_balance(stribeck: bool = False, proportional: bool = False) -> System:
    r"""The paper's model with the energy balance in place of Eqs. (4) and (5), and a supply that sags.

    .. math:: \dot x = f(x, u; p), \quad x = (y, v, p_A, p_B, z, T_A, T_B, p_S, p_G, z_h), \quad
              u = (u_{vs}, u_{ve}, c, d, u_{vs1}, u_{ve1})

    Parameters
    ----------
    stribeck : bool
        Whether friction has static friction and pressed seals, `clutchid.model.friction.stribeck_force`.
    proportional : bool
        Whether the valves are proportional, each with a spool that follows its duty cycle; then x_vs and x_ve are
        states too.

    Returns
    -------
    system : System
        Inputs are the duty cycles, phase and step of the valves' carrier, and the duty cycles one period before; the
        load f_l(y) is a table; jumps take a measured position or pressure.

    Notes
    -----
    Air arrives at T_0 from supply and ambient, and leaves at the temperature of its chamber. A jump keeps temperatures.

    Examples
    --------
    >>> [str(state) for state in energy_balance().states]
    ['y', 'v', 'p_A', 'p_B', 'z', 'T_A', 'T_B', 'p_S', 'p_G', 'z_h']
    """
    states = (*_STATES, *_SPOOLS) if proportional else _STATES
    b = Book(states)
    if proportional:
        spool_openings(b)
    else:
        openings(b, switched=True)
    _flows(b)
    _heat(b)
    friction_and_stops(b, stribeck)
    f_h = b.define("f_h", b["K_h"] * b["z_h"])
    loaded = b["f_l"] + f_h
    slips_at = bearing_force(*b.all("f_l", "F_h", "mu_h"))
    p_A_dot, p_B_dot, T_A_dot, T_B_dot = _gas_rates(b)
    rates = (
        b["v"],
        acceleration(b["p_A"], b["p_B"], loaded, *b.all("f_f", "f_s", "A_A", "A_B", "P_0", "M")),
        p_A_dot,
        p_B_dot,
        b["z_dot"],
        T_A_dot,
        T_B_dot,
        reservoir_rate(*b.all("p_S", "p_G", "tau_S", "w_vs", "V_S", "R", "T_0")),
        governor_rate(*b.all("p_G", "P_S", "tau_G")),
        deflection_rate(b["v"], b["z_h"], b["K_h"], slips_at),
        *(spool_rate(b[f"u_{valve}"], b[f"x_{valve}"], b[f"tau_{valve}"]) for valve in ("vs", "ve") if proportional),
    )
    return assembled(b, "energy_balance" + "_stribeck" * stribeck + "_proportional" * proportional, VALVE_INPUTS, rates)


def _gas_rates(b: Book) -> tuple[Expr, Expr, Expr, Expr]:
    """Rates of the pressures of chambers A and B, and of their temperatures."""
    V_A, V_B, Q_A, Q_B = b.all("V_A", "V_B", "Q_A", "Q_B")
    c_p = b["R"] * b["gamma"] / (b["gamma"] - 1)
    V_A_dot, V_B_dot = b["A_A"] * b["v"], -b["A_B"] * b["v"]
    H_A = c_p * (b["T_0"] * b["w_vs"] - b["T_A"] * (b["w_ve"] + b["w_A0"]))
    H_B = c_p * b["T_r"] * b["w_r"]
    p_A_dot = b.define("p_A_dot", heated_pressure_rate(b["p_A"], V_A, V_A_dot, H_A, Q_A, b["gamma"]))
    p_B_dot = b.define("p_B_dot", heated_pressure_rate(b["p_B"], V_B, V_B_dot, H_B, Q_B, b["gamma"]))
    T_A_dot = temperature_rate(b["T_A"], b["p_A"], p_A_dot, V_A, V_A_dot, b["w_vs"] - b["w_ve"] - b["w_A0"], b["R"])
    T_B_dot = temperature_rate(b["T_B"], b["p_B"], p_B_dot, V_B, V_B_dot, b["w_r"], b["R"])
    return p_A_dot, p_B_dot, T_A_dot, T_B_dot


def _heat(b: Book) -> None:
    """Volumes of the chambers, and the heat from their walls."""
    V_A = b.define("V_A", volume_a(*b.all("y", "V_0A", "A_A")))
    V_B = b.define("V_B", volume_b(*b.all("y", "V_0B", "A_B", "y_max")))
    b.define("Q_A", heat_flow(b["p_A"], b["T_A"], b["T_w"], wall_area(V_A, b["A_A"]), b["h_A"]))
    b.define("Q_B", heat_flow(b["p_B"], b["T_B"], b["T_w"], wall_area(V_B, b["A_B"]), b["h_B"]))


def _flows(b: Book) -> None:
    """Mass flows with the temperature of where the air comes from."""
    air = b.all("rho_0", "B_0", "r_lam")
    b.define("w_vs", gated(b["y_vs"], iso_flow(*b.all("p_S", "p_A", "C_vs", "b_vs", "m_vs", "rho_0", "r_lam"))))
    hot = thermal_factor(*b.all("T_0", "T_A"))
    b.define("w_A0", leak_flow(*b.all("p_A", "P_0", "C_A0", "rho_0")))
    b.define("w_ve", gated(b["y_ve"], hot * iso_flow(*b.all("p_A", "P_0", "C_ve", "b_ve", "m_ve", "rho_0", "r_lam"))))
    w_in = orifice_flow(*b.all("P_0", "p_B", "C_r", "B_in"), *air)
    w_out = thermal_factor(*b.all("T_0", "T_B")) * orifice_flow(*b.all("p_B", "P_0", "C_r", "B_out"), *air)
    breathing_in = b["p_B"] < b["P_0"]
    b.define("w_r", sp.Piecewise((w_in, breathing_in), (-w_out, True)))
    b.define("T_r", sp.Piecewise((b["T_0"], breathing_in), (b["T_B"], True)))

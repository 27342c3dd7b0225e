"""Section 2.6: the assembled fifth-order model, Eqs. (23) and (24)."""

from __future__ import annotations

from functools import cache

import sympy as sp

from clutchid.codegen.system import Expr, Jump, System, Table
from clutchid.model.chambers import pressure_rate, volume_a, volume_b
from clutchid.model.friction import deflection_rate, friction_force
from clutchid.model.motion import acceleration, stop_force
from clutchid.model.valves import breathing_flow, opening, orifice_flow
from clutchid.parameters import Parameters

STATES = ("y", "v", "p_A", "p_B", "z")


@cache
def isothermal() -> System:
    r"""The fifth-order model of the paper, Eq. (23), with the end stops and the resets of partitioned simulation.

    .. math:: \dot x = f(x, u; p), \quad x = (y, v, p_A, p_B, z), \quad u = (u_{vs}, u_{ve})

    Returns
    -------
    system : System
        Inputs are the duty cycles; the load f_l(y) is a table; jumps take a measured position or pressure.

    Raises
    ------
    Nothing: numbers are checked where they enter.

    Notes
    -----
    Every deviation from the print stands where its equation stands.

    Examples
    --------
    >>> [str(state) for state in isothermal().states]
    ['y', 'v', 'p_A', 'p_B', 'z']
    """
    x = {name: sp.Symbol(name, real=True) for name in STATES}
    p = {name: sp.Symbol(name, real=True) for name in Parameters.names()}
    u_vs, u_ve = sp.symbols("u_vs u_ve", real=True)
    f_l = sp.Symbol("f_l", real=True)
    definitions = _definitions(x, p, u_vs, u_ve)
    d = {str(symbol): symbol for symbol, _ in definitions}
    rates = (
        x["v"],
        acceleration(x["p_A"], x["p_B"], f_l, d["f_f"], d["f_s"], p["A_A"], p["A_B"], p["P_0"], p["M"]),
        pressure_rate(x["p_A"], d["V_A"], p["A_A"] * x["v"], d["w_v"], p["R"], p["T_0"]),
        pressure_rate(x["p_B"], d["V_B"], -p["A_B"] * x["v"], d["w_r"], p["R"], p["T_0"]),
        d["z_dot"],
    )
    measured = sp.symbols("y_measured p_A_measured", real=True)
    return System(
        name="isothermal",
        states=tuple(x.values()),
        inputs=(u_vs, u_ve),
        parameters=tuple(p.values()),
        definitions=definitions,
        derivatives=rates,
        table=Table(f_l, x["y"]),
        measured=measured,
        jumps=_jumps(x, p, *measured),
    )


def _definitions(x: dict[str, Expr], p: dict[str, Expr], u_vs: Expr, u_ve: Expr) -> tuple[tuple[Expr, Expr], ...]:
    done: dict[str, Expr] = {}

    def define(name: str, value: Expr) -> Expr:
        symbol = sp.Symbol(name, real=True)
        done[symbol] = value
        return symbol

    y, v, p_A, p_B, z = x.values()
    y_vs = define("y_vs", opening(u_vs, p["R_0vs"], p["R_1vs"]))
    y_ve = define("y_ve", opening(u_ve, p["R_0ve"], p["R_1ve"]))
    air = (p["rho_0"], p["B_0"], p["r_lam"])
    supply = orifice_flow(p["P_S"], p_A, p["C_vs"], p["B_vs"], *air)
    exhaust = orifice_flow(p_A, p["P_0"], p["C_ve"], p["B_ve"], *air)
    w_vs = define("w_vs", sp.Piecewise((y_vs * supply, y_vs > 0), (0, True)))
    w_ve = define("w_ve", sp.Piecewise((y_ve * exhaust, y_ve > 0), (0, True)))
    define("w_v", w_vs - w_ve)
    define("w_r", breathing_flow(p_B, p["P_0"], p["C_r"], p["B_in"], p["B_out"], *air))
    define("V_A", volume_a(y, p["V_0A"], p["A_A"]))
    define("V_B", volume_b(y, p["V_0B"], p["A_B"], p["y_max"]))
    z_dot = define("z_dot", deflection_rate(v, z, p["K_z"], p["F_C"]))
    define("f_f", friction_force(v, z, z_dot, p["D_v"], p["K_z"], p["D_zdot"]))
    stop = (p["K_stop"], p["D_stop"], p["d_stop"])
    define("f_s", stop_force(y - p["y_max"], v, *stop) - stop_force(-y, -v, *stop))
    return tuple(done.items())


def _jumps(x: dict[str, Expr], p: dict[str, Expr], y_measured: Expr, p_A_measured: Expr) -> tuple[Jump, ...]:
    """Resets of partitioned simulation: the pressures (p) or the masses of air (q) go on; docs/deviations.md."""
    y, v, p_A, p_B, z = x.values()
    squeeze_a = volume_a(y, p["V_0A"], p["A_A"]) / volume_a(y_measured, p["V_0A"], p["A_A"])
    squeeze_b = volume_b(y, p["V_0B"], p["A_B"], p["y_max"]) / volume_b(y_measured, p["V_0B"], p["A_B"], p["y_max"])
    return (
        Jump("p", (y_measured, v, p_A, p_B, z)),
        Jump("q", (y_measured, v, p_A * squeeze_a, p_B * squeeze_b, z)),
        Jump("p, pressure", (y_measured, v, p_A_measured, p_B, z)),
        Jump("q, pressure", (y_measured, v, p_A_measured, p_B * squeeze_b, z)),
    )

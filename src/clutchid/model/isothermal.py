"""Section 2.6: the assembled fifth-order model, Eqs. (23) and (24)."""

from __future__ import annotations

from functools import cache

from clutchid.codegen.system import System
from clutchid.model.assembly import Book, assembled, friction_and_stops, gated, openings
from clutchid.model.chambers import pressure_rate, volume_a, volume_b
from clutchid.model.motion import acceleration
from clutchid.model.valves import breathing_flow, orifice_flow

_STATES = ("y", "v", "p_A", "p_B", "z")


@cache
def isothermal(stribeck: bool = False) -> System:
    r"""The fifth-order model of the paper, Eq. (23), with the end stops and the resets of partitioned simulation.

    .. math:: \dot x = f(x, u; p), \quad x = (y, v, p_A, p_B, z), \quad u = (u_{vs}, u_{ve})

    Parameters
    ----------
    stribeck : bool
        Whether friction has static friction and pressed seals, `clutchid.model.friction.stribeck_force`.

    Returns
    -------
    system : System
        Inputs are the duty cycles; the load f_l(y) is a table; jumps take a measured position or pressure.

    Notes
    -----
    Every deviation from the print stands where its equation stands.

    Examples
    --------
    >>> [str(state) for state in isothermal().states]
    ['y', 'v', 'p_A', 'p_B', 'z']
    """
    b = Book(_STATES)
    openings(b)
    air = b.all("rho_0", "B_0", "r_lam")
    w_vs = b.define("w_vs", gated(b["y_vs"], orifice_flow(*b.all("P_S", "p_A", "C_vs", "B_vs"), *air)))
    w_ve = b.define("w_ve", gated(b["y_ve"], orifice_flow(*b.all("p_A", "P_0", "C_ve", "B_ve"), *air)))
    w_v = b.define("w_v", w_vs - w_ve)
    w_r = b.define("w_r", breathing_flow(*b.all("p_B", "P_0", "C_r", "B_in", "B_out"), *air))
    V_A = b.define("V_A", volume_a(*b.all("y", "V_0A", "A_A")))
    V_B = b.define("V_B", volume_b(*b.all("y", "V_0B", "A_B", "y_max")))
    friction_and_stops(b, stribeck)
    rates = (
        b["v"],
        acceleration(*b.all("p_A", "p_B", "f_l", "f_f", "f_s", "A_A", "A_B", "P_0", "M")),
        pressure_rate(b["p_A"], V_A, b["A_A"] * b["v"], w_v, b["R"], b["T_0"]),
        pressure_rate(b["p_B"], V_B, -b["A_B"] * b["v"], w_r, b["R"], b["T_0"]),
        b["z_dot"],
    )
    return assembled(b, "isothermal" + "_stribeck" * stribeck, ("u_vs", "u_ve"), rates)

"""The plant: piston, zones of air, supply, valves and friction as one system of equations."""

from __future__ import annotations

from functools import cache
from importlib import import_module

import sympy as sp

from clutchid.codegen.system import Expr, System, TabulatedFunction
from clutchid.truck.equations import motion
from clutchid.truck.equations.energy import wall_area
from clutchid.truck.equations.flow import orifice_flow, slit_flow, through
from clutchid.truck.equations.motion import Definitions, Zone
from clutchid.truck.equations.tube import tube_flow
from clutchid.truck.structure import LEDGER, Structure


@cache
def plant(structure: Structure, ledger: bool = False) -> System:
    r"""The equations of a virtual truck; with `ledger` also the mass and energy that cross its boundary.

    .. math:: \dot x = f(x, u), \quad x = (y, v, air, supply, friction, x_s, x_e)

    Position y and velocity v of the piston; mass m and internal energy U or pressure p of the air in chamber A, in the
    dead volume D between valves and tube where there is one, and in chamber B; states of the supply and of the
    friction; lifts x_s and x_e of the supply and the exhaust valve.

    Returns
    -------
    system : System
        Inputs are the rates of the lifts, and of the governor's pressure; the load f_l(y) is a table.

    Notes
    -----
    What changes at a rate that is constant over a tick of 0.1 ms, as a lift does, has its kinks at integration steps.
    The ledger does not count the heat that a polytropic exponent below the adiabatic one implies.

    Examples
    --------
    >>> A = Structure("iso", "energy", False, "reservoir", "bristles")
    >>> B = Structure("nozzle", "polytropic", True, "regulator", "slip")
    >>> len(plant(A).states), len(plant(B).states), len(plant(B, ledger=True).states)
    (13, 18, 20)
    """
    modules = (structure.gas, structure.supply, structure.friction)
    gas, supply, friction = (import_module(f"clutchid.truck.equations.{name}") for name in modules)
    b = Definitions()
    b["c_p"] = b.R * b.gamma / (b.gamma - 1)
    zones = _zones(b, structure.tube)
    for zone in zones:
        gas.air(b, zone)
    p_S, T_S = supply.air(b)
    inflows = _flows(b, structure, p_S, T_S)
    seals, hysteresis = friction.forces(b)
    far = motion.stop_force(b.y - b.y_max, b.v, b.K_stop, b.chi)
    b["f_s"] = far - motion.stop_force(b.y_r - b.y, -b.v, b.K_stop, b.chi)
    force = b.f_l + hysteresis + seals + b.f_s
    rates = (
        b.v, motion.acceleration(b.p_A, b.p_B, force, b.A_A, b.A_B, b.P_0, b.M),
        *(rate for zone in zones for rate in gas.rates(b, zone, *inflows[zone.name])), *supply.rates(b),
        *friction.rates(b), b.r_s, b.r_e,
    )  # fmt: skip
    if ledger:
        mass, h, heat = supply.crossing(b)
        fed = "D" if structure.tube else "A"
        enthalpy = b.c_p * (h - b.w_e * b[f"T_{fed}"] + b.T_r * b.w_r - b.T_A0 * b.w_A0)
        work = (force + b.P_0 * (b.A_A - b.A_B)) * b.v
        heat += sum(gas.heat(b, zone) for zone in zones)
        rates = (*rates, mass - b.w_e + b.w_r - b.w_A0, enthalpy + heat - work)
    names = (*structure.states, *(LEDGER if ledger else ()))
    inner = {*names, *structure.inputs, "f_l"}
    return System(
        name=f"truck, {', '.join(structure.words)}{' with ledger' if ledger else ''}",
        states=tuple(b[name] for name in names), inputs=tuple(b[name] for name in structure.inputs),
        parameters=tuple(symbol for name, symbol in b.given.items() if name not in inner),
        definitions=tuple(b.rows.items()), derivatives=rates, table=TabulatedFunction(b.f_l, b.y),
    )  # fmt: skip


def _zones(b: Definitions, tube: bool) -> tuple[Zone, ...]:
    """Chamber A, the dead volume where there is a tube, and chamber B; the dead volume has the walls of a cube."""
    b["V_A"] = b.V_0A + b.A_A * b.y
    b["V_B"] = b.V_0B + b.A_B * (b.y_max - b.y)
    dead = (Zone("D", b.V_D, 0, 6 * b.V_D ** sp.Rational(2, 3), b.h_A),) if tube else ()
    A = Zone("A", b.V_A, b.A_A * b.v, wall_area(b.V_A, b.A_A), b.h_A)
    return A, *dead, Zone("B", b.V_B, -b.A_B * b.v, wall_area(b.V_B, b.A_B), b.h_B)


def _flows(b: Definitions, structure: Structure, p_S: Expr, T_S: Expr) -> dict[str, tuple[Expr, Expr]]:
    """Mass flow and sum of T w into each zone; the flow of a valve is computed only while it is open."""
    law, fed = structure.flow, "D" if structure.tube else "A"
    p, T = b[f"p_{fed}"], b[f"T_{fed}"]
    b["w_s"] = sp.Piecewise((through(b, law, "s", p_S, p, T_S, b.x_s), b.x_s > 0), (0, True))
    b["w_e"] = sp.Piecewise((through(b, law, "e", p, b.P_0, T, b.x_e), b.x_e > 0), (0, True))
    b["w_r"] = orifice_flow(lambda *air: through(b, law, "r", *air), b.P_0, b.p_B, b.T_0, b.T_B, law != "iso")
    b["w_AB"] = slit_flow(b.p_A, b.p_B, b.T_w, b.C_AB)
    b["w_A0"] = slit_flow(b.p_A, b.P_0, b.T_w, b.C_A0)
    b["T_r"] = sp.Piecewise((b.T_0, b.w_r > 0), (b.T_B, True))
    b["T_AB"] = sp.Piecewise((b.T_A, b.w_AB > 0), (b.T_B, True))
    b["T_A0"] = sp.Piecewise((b.T_A, b.w_A0 > 0), (b.T_0, True))
    w, h = b.w_s - b.w_e, b.w_s * T_S - b.w_e * T
    flows = {"B": (b.w_AB + b.w_r, b.T_AB * b.w_AB + b.T_r * b.w_r)}
    if structure.tube:
        b["w_t"] = tube_flow(b.p_D, b.p_A, b.C_t, b.dp_t)
        b["T_t"] = sp.Piecewise((b.T_D, b.w_t > 0), (b.T_A, True))
        flows["D"] = w - b.w_t, h - b.T_t * b.w_t
        w, h = b.w_t, b.T_t * b.w_t
    flows["A"] = w - b.w_AB - b.w_A0, h - b.T_AB * b.w_AB - b.T_A0 * b.w_A0
    return flows

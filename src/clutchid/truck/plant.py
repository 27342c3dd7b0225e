"""The plant: piston, two chambers of air, reservoir, valves and friction as one system of equations."""

from __future__ import annotations

from functools import cache

import sympy as sp

from clutchid.codegen.system import Expr, System
from clutchid.truck import air, flow, friction, motion
from clutchid.truck.motion import Definitions
from clutchid.truck.parameters import INPUTS, PARAMETERS, STATES


@cache
def plant(ledger: bool = False) -> System:
    r"""The equations of the virtual truck; with `ledger` also the mass and energy that cross its boundary.

    .. math:: \dot x = f(x, u), \quad x = (y, v, m_A, U_A, m_B, U_B, m_S, U_S, z, z_h, x_s, x_e, p_G)

    Position y and velocity v of the piston; mass m and internal energy U of the air in chamber A, chamber B and the
    reservoir S; deflection of the seals z and of the release bearing z_h; lift of the supply and the exhaust valve x_s,
    x_e; pressure p_G at the governor.

    Returns
    -------
    system : System
        Inputs are the rates of the lifts and of the governor's pressure; the load f_l(y) is a table.

    Notes
    -----
    Valve lifts and the governor's pressure change at rates that are constant over a tick of 0.1 ms, so every ramp and
    every valve edge coincides with an integration step.

    Examples
    --------
    >>> len(plant().states), len(plant(ledger=True).states)
    (13, 15)
    """
    b = Definitions((*STATES, *INPUTS, *PARAMETERS, "f_l"))
    _air(b)
    _flows(b)
    _forces(b)
    order = (STATES, INPUTS, PARAMETERS)
    return motion.assembled(b, "truck", order, _rates(b), _ledger_rates(b) if ledger else ())


def _air(b: Definitions) -> None:
    """Volumes, pressures and temperatures."""
    b.V_A = b.V_0A + b.A_A * b.y
    b.V_B = b.V_0B + b.A_B * (b.y_max - b.y)
    b.p_A = air.pressure(b.U_A, b.V_A, b.gamma)
    b.p_B = air.pressure(b.U_B, b.V_B, b.gamma)
    b.p_S = air.pressure(b.U_S, b.V_S, b.gamma)
    b.T_A = air.temperature(b.U_A, b.m_A, b.R, b.gamma)
    b.T_B = air.temperature(b.U_B, b.m_B, b.R, b.gamma)
    b.T_S = air.temperature(b.U_S, b.m_S, b.R, b.gamma)
    reference = (flow.P_N, flow.T_N)
    b.Q_A = air.heat_flow(b.p_A, b.T_A, b.T_w, air.wall_area(b.V_A, b.A_A), b.h_A, *reference)
    b.Q_B = air.heat_flow(b.p_B, b.T_B, b.T_w, air.wall_area(b.V_B, b.A_B), b.h_B, *reference)
    b.Q_S = b.UA_S * (b.T_0 - b.T_S)


def _flows(b: Definitions) -> None:
    """Mass flows; the flow of a valve is computed only while it is open."""
    supply = b.x_s * flow.valve_flow(b.p_S, b.p_A, b.T_S, b.C_s, b.b_s, b.m_s, b.r_lam)
    exhaust = b.x_e * flow.valve_flow(b.p_A, b.P_0, b.T_A, b.C_e, b.b_e, b.m_e, b.r_lam)
    b.w_s = sp.Piecewise((supply, b.x_s > 0), (0, True))
    b.w_e = sp.Piecewise((exhaust, b.x_e > 0), (0, True))
    b.w_r = flow.orifice_flow(b.P_0, b.p_B, b.T_0, b.T_B, b.C_r, b.b_r, b.m_r, b.r_lam)
    b.w_AB = flow.slit_flow(b.p_A, b.p_B, b.T_w, b.C_AB)
    b.w_A0 = flow.slit_flow(b.p_A, b.P_0, b.T_w, b.C_A0)
    b.w_G = flow.line_flow(b.p_G, b.p_S, b.G_S)
    b.c_p = b.R * b.gamma / (b.gamma - 1)
    b.T_r = sp.Piecewise((b.T_0, b.w_r > 0), (b.T_B, True))
    b.T_AB = sp.Piecewise((b.T_A, b.w_AB > 0), (b.T_B, True))
    b.T_A0 = sp.Piecewise((b.T_A, b.w_A0 > 0), (b.T_0, True))


def _forces(b: Definitions) -> None:
    """Friction, hysteresis of the load, and end stops: engaged rest, which moves with wear, and far end."""
    b.F_t = friction.coulomb_force(b.p_A, b.p_B, b.F_C, b.c_F)
    b.z_dot = friction.deflection_rate(b.v, b.z, b.K_z, friction.stribeck_force(b.v, b.F_t, b.R_S, b.v_S))
    b.D_T = friction.viscous_friction(b.D_v, b.beta, b.T_w, flow.T_N)
    b.f_f = friction.seal_force(b.v, b.z, b.z_dot, b.K_z, b.D_z, b.v_z, b.D_T)
    b.f_h = b.K_h * b.z_h
    b.f_s = motion.stop_force(b.y - b.y_max, b.v, b.K_stop, b.chi) - motion.stop_force(
        b.y_r - b.y, -b.v, b.K_stop, b.chi
    )


def _rates(b: Definitions) -> tuple[Expr, ...]:
    """Right-hand sides in the order of `STATES`."""
    force = b.f_l + b.f_h + b.f_f + b.f_s
    H_A = b.c_p * (b.T_S * b.w_s - b.T_A * b.w_e - b.T_AB * b.w_AB - b.T_A0 * b.w_A0)
    H_B = b.c_p * (b.T_AB * b.w_AB + b.T_r * b.w_r)
    H_S = b.c_p * (b.T_0 * b.w_G - b.T_S * b.w_s)
    return (
        b.v,
        motion.acceleration(b.p_A, b.p_B, force, b.A_A, b.A_B, b.P_0, b.M),
        b.w_s - b.w_e - b.w_AB - b.w_A0,
        air.energy_rate(H_A, b.Q_A, b.p_A, b.A_A * b.v),
        b.w_AB + b.w_r,
        air.energy_rate(H_B, b.Q_B, b.p_B, -b.A_B * b.v),
        b.w_G - b.w_s,
        air.energy_rate(H_S, b.Q_S, b.p_S, 0),
        b.z_dot,
        friction.deflection_rate(b.v, b.z_h, b.K_h, friction.bearing_force(b.f_l, b.F_h, b.mu_h)),
        b.r_s,
        b.r_e,
        b.r_G,
    )


def _ledger_rates(b: Definitions) -> tuple[Expr, ...]:
    """Mass and energy flows across the boundary around reservoir, both chambers and the moving mass."""
    mass = b.w_G + b.w_r - b.w_e - b.w_A0
    enthalpy = b.c_p * (b.T_0 * b.w_G + b.T_r * b.w_r - b.T_A * b.w_e - b.T_A0 * b.w_A0)
    work = (b.f_l + b.f_h + b.f_f + b.f_s + b.P_0 * (b.A_A - b.A_B)) * b.v
    return mass, enthalpy + b.Q_A + b.Q_B + b.Q_S - work

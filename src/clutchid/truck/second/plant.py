"""The plant of family B: piston, air in two zones and chamber B, regulator, ports and friction as one system."""

from __future__ import annotations

from functools import cache

import sympy as sp

from clutchid.codegen.system import Expr, System
from clutchid.truck import flow, motion
from clutchid.truck.motion import Definitions
from clutchid.truck.second import friction, gas
from clutchid.truck.second.parameters import INPUTS, PARAMETERS, STATES

#: Maxwell slip: share of the stiffness and of the friction of each element; the stiffest slips first.
STIFFNESS, LIMIT = (0.4, 0.3, 0.2, 0.1), (0.16, 0.24, 0.3, 0.3)
#: Stiction of the plastic bristles: velocity in m/s at which their damping has decayed.
V_D = 0.02


@cache
def plant(ledger: bool = False) -> System:
    r"""The equations of a truck of family B; with `ledger` also the mass and energy that cross its boundary.

    .. math:: \dot x = f(x, u), \quad x = (y, v, m_A, p_A, m_D, p_D, m_B, p_B, p_S, x_R, z_1, ..., z_4, z_b, z_f, x_s,
              x_e)

    Position y and velocity v of the piston; mass m and pressure p of the air in chamber A, in the dead volume D between
    valves and tube, and in chamber B; pressure p_S behind the regulator and its opening x_R; deflections of the seals
    z_1 to z_4 (elasto-plastic bristles use z_1), of the release bearing z_b and of the fingers z_f; openings x_s and
    x_e of the ports.

    Returns
    -------
    system : System
        Inputs are the rates of the openings; the load f_l(y) is a table.

    Notes
    -----
    The ledger counts the heat of the relaxation to the walls; the heat that an exponent below the adiabatic one implies
    is not counted, so the books balance for n_p = gamma.

    Examples
    --------
    >>> len(plant().states), len(plant(ledger=True).states)
    (18, 20)
    """
    b = Definitions((*STATES, *INPUTS, *PARAMETERS, "f_l"))
    _air(b)
    _flows(b)
    _forces(b)
    order = (STATES, INPUTS, PARAMETERS)
    return motion.assembled(b, "truck of family B", order, _rates(b), _ledger_rates(b) if ledger else ())


def _air(b: Definitions) -> None:
    """Volumes and temperatures."""
    b.V_A = b.V_0A + b.A_A * b.y
    b.V_B = b.V_0B + b.A_B * (b.y_max - b.y)
    b.T_A = gas.temperature(b.p_A, b.V_A, b.m_A, b.R)
    b.T_D = gas.temperature(b.p_D, b.V_D, b.m_D, b.R)
    b.T_B = gas.temperature(b.p_B, b.V_B, b.m_B, b.R)


def _flows(b: Definitions) -> None:
    """Mass flows, and T w of each with its upstream temperature."""

    def nozzle(p_h: Expr, p_l: Expr, T_h: Expr, A: Expr) -> Expr:
        return gas.nozzle_flow(p_h, p_l, T_h, A, b.R, b.gamma, b.r_lam)

    b.w_s = sp.Piecewise((b.x_s * nozzle(b.p_S, b.p_D, b.T_0, b.A_s), b.x_s > 0), (0, True))
    b.w_e = sp.Piecewise((b.x_e * nozzle(b.p_D, b.P_0, b.T_D, b.A_e), b.x_e > 0), (0, True))
    b.w_t = gas.tube_flow(b.p_D, b.p_A, b.C_t, b.dp_t)
    b.w_r = sp.Piecewise(
        (nozzle(b.P_0, b.p_B, b.T_0, b.A_r), b.p_B < b.P_0), (-nozzle(b.p_B, b.P_0, b.T_B, b.A_r), True)
    )
    b.w_AB = flow.slit_flow(b.p_A, b.p_B, b.T_w, b.C_AB)
    b.w_A0 = flow.slit_flow(b.p_A, b.P_0, b.T_w, b.C_A0)
    b.w_R = sp.Piecewise((b.x_R * nozzle(b.p_T, b.p_S, b.T_0, b.A_R), b.x_R > 0), (0, True))
    b.h_t = b.w_t * sp.Piecewise((b.T_D, b.w_t > 0), (b.T_A, True))
    b.h_r = b.w_r * sp.Piecewise((b.T_0, b.w_r > 0), (b.T_B, True))
    b.h_AB = b.w_AB * sp.Piecewise((b.T_A, b.w_AB > 0), (b.T_B, True))
    b.h_A0 = b.w_A0 * sp.Piecewise((b.T_A, b.w_A0 > 0), (b.T_0, True))
    b.h_D = b.w_s * b.T_0 - b.w_e * b.T_D - b.h_t
    b.h_A = b.h_t - b.h_AB - b.h_A0
    b.h_B = b.h_AB + b.h_r


def _forces(b: Definitions) -> None:
    """Friction of the seals, play of bearing and fingers, end stops."""
    b.F_t = friction.lip_force(b.p_A, b.p_B, b.F_C, b.F_p, b.p_F)
    b.g = friction.breakaway_force(b.v, b.F_t, b.R_S, b.v_S)
    elements = list(zip((b.z_1, b.z_2, b.z_3, b.z_4), STIFFNESS, LIMIT, strict=True))
    b.plastic_rate = friction.bristle_rate(b.v, b.z_1, b.K_z, b.g, b.x_b)
    b.f_z = sp.Piecewise(
        (friction.bristle_force(b.z_1, b.plastic_rate, b.v, b.K_z, b.D_z, V_D), b.plastic > 0),
        (sum(friction.slip_force(z, k * b.K_z, w * b.g) for z, k, w in elements), True),
    )
    b.z_1_rate = sp.Piecewise(
        (b.plastic_rate, b.plastic > 0),
        (friction.slip_rate(b.v, b.z_1, STIFFNESS[0] * b.K_z, LIMIT[0] * b.g), True),
    )
    b.D_T = b.D_v * friction.grease_viscosity(b.T_w, flow.T_N, b.T_V, b.B_V)
    b.f_g = friction.grease_force(b.v, b.D_T, b.v_g)
    b.f_m = sp.Piecewise((b.f_l, b.f_l > 0), (0, True))
    b.W_b = b.F_b + b.mu_b * b.f_m
    b.W_f = b.F_b + b.mu_f * b.f_m
    b.f_h = friction.slip_force(b.z_b, b.K_b, b.W_b) + friction.slip_force(b.z_f, b.K_f, b.W_f)
    b.f_s = motion.stop_force(b.y - b.y_max, b.v, b.K_stop, b.chi) - motion.stop_force(
        b.y_r - b.y, -b.v, b.K_stop, b.chi
    )


def _rates(b: Definitions) -> tuple[Expr, ...]:
    """Right-hand sides in the order of `STATES`."""

    def pressure(p: Expr, V: Expr, V_dot: Expr, inflow: Expr, m: Expr) -> Expr:
        return gas.pressure_rate(p, V, V_dot, inflow, b.n_p, m, b.R, b.T_w, b.tau_w)

    force = b.f_l + b.f_h + b.f_z + b.f_g + b.f_s
    slips = zip((b.z_2, b.z_3, b.z_4), STIFFNESS[1:], LIMIT[1:], strict=True)
    return (
        b.v,
        motion.acceleration(b.p_A, b.p_B, force, b.A_A, b.A_B, b.P_0, b.M),
        b.w_t - b.w_AB - b.w_A0,
        pressure(b.p_A, b.V_A, b.A_A * b.v, b.h_A, b.m_A),
        b.w_s - b.w_e - b.w_t,
        pressure(b.p_D, b.V_D, 0, b.h_D, b.m_D),
        b.w_AB + b.w_r,
        pressure(b.p_B, b.V_B, -b.A_B * b.v, b.h_B, b.m_B),
        b.R * b.T_0 / b.V_S * (b.w_R - b.w_s),
        gas.regulator_rate(b.x_R, b.p_S, b.P_S, b.dp_R, b.tau_R),
        b.z_1_rate,
        *(friction.slip_rate(b.v, z, k * b.K_z, w * b.g) for z, k, w in slips),
        friction.slip_rate(b.v, b.z_b, b.K_b, b.W_b),
        friction.slip_rate(b.v, b.z_f, b.K_f, b.W_f),
        b.r_s,
        b.r_e,
    )


def _ledger_rates(b: Definitions) -> tuple[Expr, ...]:
    """Mass and energy flows across the boundary around both zones, chamber B and the moving mass."""
    mass = b.w_s - b.w_e + b.w_r - b.w_A0
    c_p = b.R * b.gamma / (b.gamma - 1)
    enthalpy = c_p * (b.w_s * b.T_0 - b.w_e * b.T_D + b.h_r - b.h_A0)
    zones = ((b.p_A, b.V_A, b.m_A), (b.p_D, b.V_D, b.m_D), (b.p_B, b.V_B, b.m_B))
    heat = sum((m * b.R * b.T_w - p * V) / (b.tau_w * (b.gamma - 1)) for p, V, m in zones)
    work = (b.f_l + b.f_h + b.f_z + b.f_g + b.f_s + b.P_0 * (b.A_A - b.A_B)) * b.v
    return mass, enthalpy + heat - work

"""Air supply by a pressure regulator with droop: isothermal air in the volume behind it."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr
from clutchid.truck.equations.motion import Definitions
from clutchid.truck.equations.nozzle import nozzle_flow


def regulator_rate(x: Expr, p: Expr, P_S: Expr, dp: Expr, tau: Expr) -> Expr:
    r"""Rate of the opening of a pressure regulator with droop.

    .. math:: \tau \dot x = \min\left(1, \max\left(0, \frac{P_S - p}{\Delta p}\right)\right) - x

    Parameters
    ----------
    x : 1
        Opening, 0 to 1.
    p, P_S : Pa
        Pressure behind the regulator, and set pressure.
    dp : Pa
        Droop: pressure below the set one at which it is fully open, above 0.
    tau : s
        Time constant, above 0.

    Returns
    -------
    x_dot : 1/s

    References
    ----------
    Textbook: proportional regulator; numbers are assumptions.

    Examples
    --------
    >>> round(regulator_rate(0.0, 8.5e5, 9e5, 1e5, 0.05))
    10
    """
    wanted = (P_S - p) / dp
    return (sp.Piecewise((0, wanted < 0), (wanted, wanted < 1), (1, True)) - x) / tau


def air(b: Definitions) -> tuple[Expr, Expr]:
    """Pressure and temperature of the supply."""
    open_ = b.x_R * nozzle_flow(b.p_T, b.p_S, b.T_0, b.A_R, b.R, b.gamma, b.r_lam)
    b["w_R"] = sp.Piecewise((open_, b.x_R > 0), (0, True))
    return b.p_S, b.T_0


def crossing(b: Definitions) -> tuple[Expr, Expr, Expr]:
    """Mass flow, sum of T w, and heat flow in W into the plant, the supply left out."""
    return b.w_s, b.w_s * b.T_0, 0


def rates(b: Definitions) -> tuple[Expr, ...]:
    """Rates of the pressure behind the regulator and of its opening."""
    p_rate = b.R * b.T_0 / b.V_S * (b.w_R - b.w_s)
    return p_rate, regulator_rate(b.x_R, b.p_S, b.P_S, b.dp_R, b.tau_R)

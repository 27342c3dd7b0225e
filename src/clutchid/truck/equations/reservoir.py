"""Air supply by a reservoir that a compressor fills through a line, switched by a governor."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr
from clutchid.truck.equations import energy
from clutchid.truck.equations.motion import Definitions


def line_flow(p_1: Expr, p_2: Expr, G: Expr) -> Expr:
    r"""Flow through a long line with a check valve.

    .. math:: w = G \max(0, p_1 - p_2)

    Parameters
    ----------
    p_1, p_2 : Pa
        Upstream and downstream pressure.
    G : kg/(Pa·s)
        Conductance, at least 0.

    Returns
    -------
    w : kg/s
        Never negative.

    References
    ----------
    Textbook, small pressure difference; the check valve keeps the air in the circuit while the compressor is off.

    Examples
    --------
    >>> f"{line_flow(9e5, 8.8e5, 5e-7) * 1e3:.0f} g/s", line_flow(8.8e5, 9e5, 5e-7)
    ('10 g/s', 0)
    """
    return G * sp.Piecewise((p_1 - p_2, p_1 > p_2), (0, True))


def air(b: Definitions) -> tuple[Expr, Expr]:
    """Pressure and temperature of the supply."""
    b["p_S"] = energy.pressure(b.U_S, b.V_S, b.gamma)
    b["T_S"] = energy.temperature(b.U_S, b.m_S, b.R, b.gamma)
    b["Q_S"] = b.UA_S * (b.T_0 - b.T_S)
    b["w_G"] = line_flow(b.p_G, b.p_S, b.G_S)
    return b.p_S, b.T_S


def crossing(b: Definitions) -> tuple[Expr, Expr, Expr]:
    """Mass flow, sum of T w, and heat flow in W into the plant, the reservoir included."""
    return b.w_G, b.T_0 * b.w_G, b.Q_S


def rates(b: Definitions) -> tuple[Expr, ...]:
    """Rates of mass and internal energy of the reservoir, and of the governor's pressure."""
    h = b.T_0 * b.w_G - b.T_S * b.w_s
    return b.w_G - b.w_s, energy.energy_rate(b.c_p * h, b.Q_S, b.p_S, 0), b.r_G

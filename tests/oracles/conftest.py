"""The slow, plain twins of the model: typed from the paper and its errata, know nothing of `clutchid.model`.

Scalars and `math` only, the printed letters, one branch a line of print. SciPy's Radau integrates them at 1e-10 and
starts anew at every edge of an input. The rich twin counts mass and internal energy of the air, not pressure and
temperature, so that it shares no form with the code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

#: Appendix A, typed again; below the line what the errata add.
APPENDIX = {
    "A_A": 12.3e-3, "A_B": 11.848e-3, "V_0A": 0.148e-3, "V_0B": 1.2e-4, "P_0": 1.095e5, "T_0": 293.0, "R": 288.0,
    "M": 10.0, "P_S": 9e5, "D_v": 5000.0, "K_z": 1e6, "D_zdot": 5000.0, "F_C": 200.0, "R_0vs": 0.07, "R_0ve": 0.07,
    "R_1vs": 0.93, "R_1ve": 0.93, "B_vs": 0.1, "B_ve": -0.7, "C_vs": 19e-9, "C_ve": 21.4e-9, "C_r": 5e-8,
    "B_0": 0.582, "B_in": 0.5, "B_out": 0.5,
    "rho_0": 1.185, "y_max": 25e-3, "r_lam": 0.999, "K_stop": 3e7, "D_stop": 1e4, "d_stop": 1e-4,
}  # fmt: skip

#: What the energy balance and the Stribeck friction add.
BEYOND = {
    "gamma": 1.4, "T_w": 293.0, "h_A": 50.0, "h_B": 50.0, "V_S": 10e-3, "tau_S": 0.6, "tau_G": 10.0, "R_S": 1.3,
    "v_S": 0.01, "c_F": 1.5e-4, "b_vs": 0.3, "m_vs": 0.5, "b_ve": 0.3, "m_ve": 0.5, "F_h": 25.0, "mu_h": 0.03,
    "K_h": 5e5, "n_vs": 1.0, "n_ve": 1.0, "tau_vs": 2e-3, "tau_ve": 2e-3,
    "C_A0": 0.0,
}  # fmt: skip


def psi(r: float, B: float, B_0: float, r_lam: float) -> float:
    """Eqs. (6)-(9); straight line from r_lam to 0 at r = 1."""
    if r >= 1:
        return 0.0
    if r > r_lam:
        return psi(r_lam, B, B_0, 1.0) * (1 - r) / (1 - r_lam)
    Omega_0 = math.sqrt(1 - r * r)
    if B > 0:
        Omega_1 = -Omega_0 + (1.0 if r <= B_0 else math.sqrt(1 - ((r - B_0) / (1 - B_0)) ** 2))
    else:
        Omega_1 = Omega_0 - (1 - r)
    return Omega_0 + B * Omega_1


def iso(r: float, b: float, m: float, r_lam: float) -> float:
    """ISO 6358-1:2013, subsonic and choked; straight line from r_lam to 0 at r = 1."""
    if r >= 1:
        return 0.0
    if r > r_lam:
        return iso(r_lam, b, m, 1.0) * (1 - r) / (1 - r_lam)
    return 1.0 if r <= b else (1 - ((r - b) / (1 - b)) ** 2) ** m


def load(y: float, theta: Sequence[float], slope: float = 1.0) -> float:
    """Eq. (14): straight and parabolic pieces written out from their slopes, the hump from its shape."""
    t_1, t_2, t_3, t_4 = 0.0, 2e-3, 8.5e-3, 11.5e-3
    inner = min(max(y - t_2, 0.0), t_3 - t_2)
    outer = max(y - t_3, 0.0)
    parabola = inner**2 / (2 * (t_3 - t_2))
    phi_1 = min(max(y - t_1, 0.0), t_2 - t_1) + inner - parabola
    # the published curve runs on as y + d_2 with slope 1 whatever the slope of the parabola at t_3
    phi_2 = slope * parabola + outer
    s = max(0.0, 1 - abs(y - t_4) / (t_4 - t_2))
    phi_3 = 1e-3 * s * s * (3 - 2 * s)
    return theta[0] * phi_1 + theta[1] * phi_2 + theta[2] * phi_3


def stop(depth: float, rate: float, K: float, D: float, d: float) -> float:
    """One end stop: grows with the square of the depth up to d, then linearly; never pulls."""
    if depth <= 0:
        return 0.0
    force = K * depth**2 / (2 * d) + D * depth / d * rate if depth < d else K * (depth - d / 2) + D * rate
    return max(0.0, force)


def opening(u: float, R_0: float, R_1: float) -> float:
    """Eq. (11)."""
    return min(1.0, max(0.0, (u - R_0) / (R_1 - R_0)))


def rates(x: Sequence[float], u: Sequence[float], theta: Sequence[float], p: dict[str, float]) -> list[float]:
    """Eq. (23) with the errata."""
    q = SimpleNamespace(**p)
    y, v, p_A, p_B, z = (float(value) for value in x)

    def g(p_h: float, p_l: float, C: float, B: float) -> float:
        return q.rho_0 * C * psi(p_l / p_h, B, q.B_0, q.r_lam) * p_h

    w_v = g(q.P_S, p_A, q.C_vs, q.B_vs) * opening(u[0], q.R_0vs, q.R_1vs)
    w_v -= g(p_A, q.P_0, q.C_ve, q.B_ve) * opening(u[1], q.R_0ve, q.R_1ve)
    w_r = g(q.P_0, p_B, q.C_r, q.B_in) - g(p_B, q.P_0, q.C_r, q.B_out)
    V_A, V_B = q.V_0A + q.A_A * y, q.V_0B + q.A_B * (q.y_max - y)
    z_dot = v - q.K_z / q.F_C * abs(v) * z
    f_f = q.D_v * v + q.K_z * z + q.D_zdot * z_dot
    f_s = stop(y - q.y_max, v, q.K_stop, q.D_stop, q.d_stop) - stop(-y, -v, q.K_stop, q.D_stop, q.d_stop)
    force = q.A_A * p_A - q.A_B * p_B - (q.A_A - q.A_B) * q.P_0 - load(y, theta) - f_f - f_s
    return [
        v,
        force / q.M,
        (-q.A_A * v * p_A + q.R * q.T_0 * w_v) / V_A,
        (q.A_B * v * p_B + q.R * q.T_0 * w_r) / V_B,
        z_dot,
    ]


def chamber(m: float, U: float, V: float, q: SimpleNamespace) -> tuple[float, float]:
    """Pressure and temperature of the air in a chamber from its mass and internal energy."""
    return (q.gamma - 1) * U / V, (q.gamma - 1) * U / (m * q.R)


def rich_rates(x: Sequence[float], u: Sequence[float], theta: Sequence[float], p: dict[str, float]) -> list[float]:
    """The energy balance with Stribeck friction; x holds masses and energies of air, see `content`."""
    q = SimpleNamespace(**p)
    y, v, m_A, m_B, z, U_A, U_B, m_S, p_G, z_h = (float(value) for value in x)
    V_A, V_B = q.V_0A + q.A_A * y, q.V_0B + q.A_B * (q.y_max - y)
    p_A, T_A = chamber(m_A, U_A, V_A, q)
    p_B, T_B = chamber(m_B, U_B, V_B, q)
    p_S = m_S * q.R * q.T_0 / q.V_S
    c_p = q.gamma * q.R / (q.gamma - 1)

    def g(p_h: float, p_l: float, T_h: float, C: float, B: float) -> float:
        """Eq. (10), with the density of air at T_h before the orifice as ISO 6358 has it."""
        return q.rho_0 * C * psi(p_l / p_h, B, q.B_0, q.r_lam) * p_h * math.sqrt(q.T_0 / T_h)

    def wall_to_air(h: float, p: float, T: float, S: float) -> float:
        """Eichelberg: the coefficient goes with the root of pressure and temperature; h holds at 1 bar and 20 degC."""
        return h * math.sqrt(p / 1e5) * math.sqrt(T / 293.15) * S * (q.T_w - T)

    w_vs = q.rho_0 * q.C_vs * p_S * iso(p_A / p_S, q.b_vs, q.m_vs, q.r_lam)
    w_vs *= opening(u[0], q.R_0vs, q.R_1vs) ** q.n_vs
    w_ve = q.rho_0 * q.C_ve * p_A * iso(q.P_0 / p_A, q.b_ve, q.m_ve, q.r_lam) * math.sqrt(q.T_0 / T_A)
    w_ve *= opening(u[1], q.R_0ve, q.R_1ve) ** q.n_ve
    # a slit between p_A and P_0, with air of the reference density at 1 bar
    w_leak = q.C_A0 * q.rho_0 * (p_A**2 - q.P_0**2) / 1e5
    w_in, w_out = g(q.P_0, p_B, q.T_0, q.C_r, q.B_in), g(p_B, q.P_0, T_B, q.C_r, q.B_out)
    # a cylinder of length V / A: its round wall and its two ends
    S_A, S_B = (2 * A + 2 * math.sqrt(math.pi * A) * V / A for A, V in ((q.A_A, V_A), (q.A_B, V_B)))
    F = q.F_C + q.c_F * abs(p_A - p_B)
    F *= 1 + (q.R_S - 1) * math.exp(-((v / q.v_S) ** 2))
    z_dot = v - q.K_z / F * abs(v) * z
    f_f = q.D_v * v + q.K_z * z + q.D_zdot * z_dot
    f_s = stop(y - q.y_max, v, q.K_stop, q.D_stop, q.d_stop) - stop(-y, -v, q.K_stop, q.D_stop, q.d_stop)
    f_l = load(y, theta)
    slips = q.F_h + q.mu_h * max(0.0, f_l)  # what the bearing holds at most; then its deflection stays
    force = q.A_A * p_A - q.A_B * p_B - (q.A_A - q.A_B) * q.P_0 - f_l - q.K_h * z_h - f_f - f_s
    return [
        v,
        force / q.M,
        w_vs - w_ve - w_leak,
        w_in - w_out,
        z_dot,
        c_p * (q.T_0 * w_vs - T_A * (w_ve + w_leak)) + wall_to_air(q.h_A, p_A, T_A, S_A) - p_A * q.A_A * v,
        c_p * (q.T_0 * w_in - T_B * w_out) + wall_to_air(q.h_B, p_B, T_B, S_B) + p_B * q.A_B * v,
        (p_G - p_S) / q.tau_S * q.V_S / (q.R * q.T_0) - w_vs,
        (q.P_S - p_G) / q.tau_G,
        v * (1 - q.K_h * z_h / slips) if v > 0 else v * (1 + q.K_h * z_h / slips),
    ]


def content(x: np.ndarray, p: dict[str, float]) -> np.ndarray:
    """(y, v, m_A, m_B, z, U_A, U_B, m_S, p_G, z_h) of the states of the model, shape (10,) or (10, n)."""
    q = SimpleNamespace(**p)
    y, v, p_A, p_B, z, T_A, T_B, p_S, p_G, z_h = x
    V_A, V_B = q.V_0A + q.A_A * y, q.V_0B + q.A_B * (q.y_max - y)
    U_A, U_B = p_A * V_A / (q.gamma - 1), p_B * V_B / (q.gamma - 1)
    masses = p_A * V_A / (q.R * T_A), p_B * V_B / (q.R * T_B)
    return np.array([y, v, *masses, z, U_A, U_B, p_S * q.V_S / (q.R * q.T_0), p_G, z_h])


def state(c: np.ndarray, p: dict[str, float]) -> np.ndarray:
    """The states of `content`, its inverse."""
    q = SimpleNamespace(**p)
    y, v, m_A, m_B, z, U_A, U_B, m_S, p_G, z_h = c
    p_A, T_A = chamber(m_A, U_A, q.V_0A + q.A_A * y, q)
    p_B, T_B = chamber(m_B, U_B, q.V_0B + q.A_B * (q.y_max - y), q)
    return np.array([y, v, p_A, p_B, z, T_A, T_B, m_S * q.R * q.T_0 / q.V_S, p_G, z_h])


def radau(time: np.ndarray, inputs: np.ndarray, x0: Sequence[float], theta: Sequence[float]) -> np.ndarray:
    """States at `time`, shape (n, 5): Radau at 1e-10, a restart at every edge of an input."""
    # a step may be wrong by 1e-10 of the usual size of a state: 10 mm, 0.1 m/s, 1 bar, 1 bar, 0.1 mm
    usual = np.array([1e-2, 1e-1, 1e5, 1e5, 1e-4])
    return integrated(lambda x, u: rates(x, u, theta, APPENDIX), time, inputs, x0, usual)


def rich_radau(time: np.ndarray, inputs: np.ndarray, x0: Sequence[float], theta: Sequence[float]) -> np.ndarray:
    """As `radau`, for the energy balance with Stribeck friction; (y, v, p_A, p_B, z, T_A, T_B, p_S, p_G, z_h)."""
    p = APPENDIX | BEYOND
    usual = content(np.array([1e-2, 1e-1, 1e5, 1e5, 1e-4, 300.0, 300.0, 1e5, 1e5, 1e-4]), p)
    start = content(np.asarray(x0, dtype=float), p)
    return state(integrated(lambda x, u: rich_rates(x, u, theta, p), time, inputs, start, usual).T, p).T


def integrated(
    law: Callable[..., list[float]], time: np.ndarray, inputs: np.ndarray, x0: Sequence[float], usual: np.ndarray
) -> np.ndarray:
    """Solution of dx/dt = law(x, u) at `time`: Radau at 1e-10 of x and of its usual size, anew at every edge of u."""
    edges = np.flatnonzero(np.any(np.diff(inputs, axis=0) != 0, axis=1)) + 1
    bounds = [0, *edges, time.size - 1]
    states = np.empty((time.size, len(x0)))
    states[0] = x0
    for a, b in pairwise(bounds):
        if b == a:
            continue
        solved = solve_ivp(
            lambda t, x, u=inputs[a]: law(x, u),
            (time[a], time[b]), states[a], "Radau", time[a : b + 1], rtol=1e-10, atol=1e-10 * usual,
        )  # fmt: skip
        assert solved.success, solved.message
        states[a : b + 1] = solved.y.T
    return states


@pytest.fixture(scope="session")
def twin() -> SimpleNamespace:
    """The plain twins: `rates`, `load`, `psi`, `opening`, `stop`, `radau`, the rich ones, and all numbers."""
    functions: dict[str, Callable[..., object]] = {
        "rates": rates, "load": load, "psi": psi, "iso": iso, "opening": opening, "stop": stop, "radau": radau,
        "rich_rates": rich_rates, "rich_radau": rich_radau, "content": content, "state": state,
    }  # fmt: skip
    return SimpleNamespace(appendix=APPENDIX, beyond=BEYOND, **functions)

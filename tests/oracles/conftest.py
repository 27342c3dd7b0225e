"""The slow, plain twin of the model: typed from the paper and its errata, knows nothing of `clutchid.model`.

Scalars and `math` only, the printed letters, one branch a line of print. SciPy's Radau integrates it at 1e-10 and
starts anew at every edge of an input.
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


def radau(time: np.ndarray, inputs: np.ndarray, x0: Sequence[float], theta: Sequence[float]) -> np.ndarray:
    """States at `time`, shape (n, 5): Radau at 1e-10, a restart at every edge of an input."""
    edges = np.flatnonzero(np.any(np.diff(inputs, axis=0) != 0, axis=1)) + 1
    bounds = [0, *edges, time.size - 1]
    states = np.empty((time.size, 5))
    states[0] = x0
    # a step may be wrong by 1e-10 of the usual size of a state: 10 mm, 0.1 m/s, 1 bar, 1 bar, 0.1 mm
    atol = 1e-10 * np.array([1e-2, 1e-1, 1e5, 1e5, 1e-4])
    for a, b in pairwise(bounds):
        if b == a:
            continue
        solved = solve_ivp(
            lambda t, x, u=inputs[a]: rates(x, u, theta, APPENDIX),
            (time[a], time[b]), states[a], "Radau", time[a : b + 1], rtol=1e-10, atol=atol,
        )  # fmt: skip
        assert solved.success, solved.message
        states[a : b + 1] = solved.y.T
    return states


@pytest.fixture(scope="session")
def twin() -> SimpleNamespace:
    """The plain twin: `rates`, `load`, `psi`, `opening`, `stop`, `radau` and the numbers of the Appendix."""
    functions: dict[str, Callable[..., object]] = {
        "rates": rates, "load": load, "psi": psi, "opening": opening, "stop": stop, "radau": radau,
    }  # fmt: skip
    return SimpleNamespace(appendix=APPENDIX, **functions)

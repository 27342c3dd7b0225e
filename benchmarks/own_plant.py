"""Recordings of a plant that shares no part with `clutchid.truck` or the model, for `readings.py --family own`.

No constant of the estimator was chosen on it. Its valves are pilot-operated poppets whose pilot chambers fill and
empty, so that a lower supply may open them later; nozzles have a discharge coefficient that falls with the pressure
ratio. The air exchanges heat with a liner that warms and cools; the seals are Dahl's with exponents, a lagged Stribeck
curve and a share of the pressure; the load is that of a diaphragm spring against a cushion, seen through yielding
fingers. A reservoir with a slow regulator supplies the air. `own_type` draws a type, `own_drive` records it.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from clutchid.log import FloatArray, Log

#: Smallest and largest of each number of a type, in SI; all of them guesses around the sizes of a truck's actuator.
RANGES: dict[str, tuple[float, float]] = {
    # piston, ambient: areas, dead volumes, far stop, moving mass, pressure and temperature, how much warmer the gearbox
    "A_A": (12.27e-3, 12.33e-3), "A_B": (11.82e-3, 11.88e-3), "V_0A": (1.3e-4, 1.8e-4), "V_0B": (1e-4, 1.5e-4),
    "y_max": (0.0246, 0.0264), "M": (8.0, 13.0), "P_0": (0.97e5, 1.06e5), "T_0": (268.0, 333.0), "dT": (0.0, 15.0),
    # reservoir: set pressure, volume, time of its recovery, lag of the regulator, swing and period of its set pressure
    "P_S": (7.8e5, 10e5), "V_S": (5e-3, 12e-3), "t_S": (0.3, 1.5), "tau_R": (0.03, 0.15), "a_S": (0.02e5, 0.12e5),
    "T_S": (20.0, 60.0),
    # valves: seat areas of supply, exhaust and breather; discharge coefficient and its fall; curvature of the area;
    # in periods, time constants of the pilot chambers and times of the full lift, up and down; pilot levels,
    # and their share that the supply sets, which presses on the poppets, the rest being that of springs
    "A_s": (12.5e-6, 17.5e-6), "A_e": (12e-6, 17e-6), "A_r": (25e-6, 55e-6), "c_d": (0.80, 0.90), "c_r": (0.1, 0.3),
    "k_x": (0.8, 2.2), "tau_s": (0.04, 0.10), "tau_e": (0.04, 0.10), "t_s": (0.05, 0.13), "t_e": (0.05, 0.15),
    "down": (0.9, 1.5), "q_open": (0.50, 0.72), "q_close": (0.2, 0.4), "g_q": (0.0, 1.0),
    # air: leak past the piston seal and to ambient, heat transfer at rest and by speed, liner: capacity and loss
    "C_AB": (2e-13, 2e-12), "C_A0": (1e-13, 1e-12), "h_0": (20.0, 70.0), "h_v": (20.0, 120.0), "C_w": (60.0, 250.0),
    "U_w": (3.0, 15.0),
    # seals: sliding friction, its share by pressure, static ratio, Stribeck speed and lag, stiffness, exponent
    "F_C": (70.0, 170.0), "F_p": (20.0, 140.0), "R_S": (1.15, 1.5), "v_S": (0.004, 0.02), "tau_F": (1e-3, 6e-3),
    "K_z": (0.6e6, 1.4e6), "i_z": (1.0, 1.8),
    # grease: friction over speed at 0.1 m/s, exponent of the speed, activation temperature
    "D_v": (2000.0, 5000.0), "n_v": (0.8, 1.0), "B_v": (900.0, 1300.0),
    # diaphragm: force of its hump, ratio of cone height to thickness, scale of deflection, clamped deflection; cushion:
    # force, compression, exponent; lever; fingers: stiffness, seating and its force
    "P_h": (31e3, 36e3), "eta": (1.70, 1.82), "L": (4.8e-3, 5.1e-3), "l_0": (7.0e-3, 7.7e-3), "F_cu": (27e3, 33e3),
    "c_cu": (0.65e-3, 0.95e-3), "n_cu": (1.9, 2.5), "lever": (5.9, 6.7), "K_f": (1.1e6, 1.9e6), "d_f": (0.5e-4, 4e-4),
    "F_f": (100.0, 400.0),
    # return spring; hysteresis: constant, share of the load, stiffness; end stops: stiffness
    "F_r": (20.0, 80.0), "k_r": (500.0, 3000.0), "F_h": (8.0, 30.0), "mu_h": (0.015, 0.04), "K_h": (3e5, 8e5),
    "K_e": (1.2e7, 2.5e7),
    # age: fall of the rest by wear; rise of friction and leaks and fall of the springs in a million strokes
    "i_w": (0.0, 0.6), "a_F": (0.1, 0.4), "a_C": (0.5, 3.0), "a_H": (0.004, 0.01),
    # position sensor: noise, vibration, lag, bow of its scale, error of its zero; pressure: noise, lag, zero, gain
    "s_y": (0.8e-5, 3e-5), "a_y": (0.5e-5, 4e-5), "tau_y": (0.5e-3, 2e-3), "b_y": (-5e-5, 5e-5), "e_y": (-2e-5, 2e-5),
    "s_p": (2000.0, 5000.0), "tau_p": (1e-3, 2e-3), "e_p": (-2000.0, 2000.0), "g_p": (-0.003, 0.003),
}  # fmt: skip

#: Periods of the pulses in s, from which one is drawn, and steps of the timer of a period.
PERIODS, TIMER = (0.02, 0.01, 0.01, 0.01, 0.005), 250

#: Numbers of a type: those of `RANGES`, its period, pressure for which its pilots are made and what its age does.
Kind = namedtuple("Kind", [*RANGES, "period", "P_N", "rest", "relaxed"])

#: Time step and sampling interval in s, steps of a sample; pitch of the load in m; gas constant; quanta of sensors.
DT, SAMPLE, STEPS, PITCH, R = 2e-5, 1e-3, 50, 2e-5, 287.05
Q_Y, Q_P = 1.2e-5, 500.0

#: Strokes for each metre of wear, as a fleet has them; changes of temperature in K, and the grease's factor for each.
STROKES_A_METRE, TEMPERATURES = 3e8, {"cold": (-30.0, 2.0), "warm": (30.0, 0.6)}

#: Factors of the other changes.
FACTORS: dict[str, dict[str, float]] = {
    "supply": {"P_S": 0.95}, "seals": {"F_C": 1.4, "F_p": 1.4},
    "valves": {"A_s": 0.93, "A_e": 0.93, "tau_s": 1.2, "tau_e": 1.2, "t_s": 1.2, "t_e": 1.2},
}  # fmt: skip

#: Places of the states: motion; mass and pressure of both chambers; liner; supply and its feed; pilots, lifts and
#: whether the poppets are to open; friction of seals and load, lagged speed; sensors.
Y, V, M_A, P_A, M_B, P_B, T_W, P_V, W_R, QS, QE, XS, XE, OS, OE, F_D, F_L, V_L, S_Y, S_P = range(20)


def own_type(number: int) -> Any:
    """Type `number` of this plant, new."""
    rng = np.random.default_rng([917, number])
    drawn = {name: float(rng.uniform(low, high)) for name, (low, high) in RANGES.items()}
    return Kind(**drawn, period=float(rng.choice(PERIODS)), P_N=drawn["P_S"], rest=0.0, relaxed=1.0)


def aged(kind: Any, wear: float) -> Any:
    """Age a type by the wear of its facing in m and the strokes that belong to it."""
    millions = wear * STROKES_A_METRE / 1e6
    return scaled(
        kind._replace(l_0=kind.l_0 - wear, rest=-kind.i_w * wear, relaxed=1.0 - kind.a_H * math.tanh(3.0 * millions)),
        F_C=1.0 + kind.a_F * millions, C_AB=1.0 + kind.a_C * millions, C_A0=1.0 + kind.a_C * millions,
    )  # fmt: skip


def scaled(kind: Any, **factors: float) -> Any:
    """Multiply some numbers of a type."""
    return kind._replace(**{name: factor * getattr(kind, name) for name, factor in factors.items()})


def changed(kind: Any, change: str) -> Any:
    """Apply a change of `clutchid.truck.CHANGES` in the terms of this plant."""
    if change in TEMPERATURES:
        step, factor = TEMPERATURES[change]
        other = kind._replace(T_0=kind.T_0 + step)
        return scaled(other, D_v=factor * viscosity(kind) / viscosity(other))
    return scaled(kind, **FACTORS[change])


def viscosity(kind: Any) -> float:
    """Viscosity of the grease relative to 20 degrees Celsius, after Arrhenius."""
    return math.exp(kind.B_v * (1.0 / (kind.T_0 + kind.dT) - 1.0 / 293.15))


def load_table(kind: Any) -> tuple[FloatArray, float]:
    """Load in N of clutch and return spring over the travel from the rest, every `PITCH`, and the touch point in m."""

    def shape(u: Any) -> Any:
        return u * ((kind.eta - u) * (kind.eta - 0.5 * u) + 1.0)

    hump = kind.relaxed * kind.P_h / shape(kind.eta - math.sqrt((kind.eta**2 - 2.0) / 3.0))
    clamped = hump * shape(kind.l_0 / kind.L)
    compression = kind.c_cu * (clamped / kind.F_cu) ** (1.0 / kind.n_cu)
    lift = np.linspace(0.0, 5e-3, 4001)
    cushion = kind.F_cu * (np.maximum(compression - lift, 0.0) / kind.c_cu) ** kind.n_cu
    force = (hump * shape((kind.l_0 + lift) / kind.L) - cushion) / kind.lever
    travel = kind.lever * lift + force / kind.K_f + kind.d_f * (1.0 - np.exp(-force / kind.F_f))
    grid = np.arange(0.0, 0.03, PITCH)
    spring = kind.relaxed * kind.F_r + kind.k_r * (kind.rest + grid)
    return np.interp(grid, travel, force) + spring, float(np.interp(compression, lift, travel))


@njit(cache=True, error_model="numpy")
def nozzle(area: float, p_h: float, p_l: float, T_h: float, c_d: float, c_r: float) -> float:
    """Mass flow in kg/s after Saint-Venant and Wantzel, linear near equal pressures, with a falling coefficient."""
    r = p_l / p_h
    if r >= 1.0:
        return 0.0
    within = min(max(r, 0.5283), 0.995)
    q = within ** (1.0 / 1.4)
    psi = math.sqrt(7.0 * (q * q - q * within))
    if r > 0.995:
        psi *= (1.0 - r) / 0.005
    return c_d * (1.0 - c_r * r) * area * p_h / math.sqrt(R * T_h) * psi


@njit(cache=True, error_model="numpy")
def poppet(x: FloatArray, place: int, signal: bool, tau: float, t_up: float, p: Any) -> None:
    """Move a pilot chamber and the main poppet behind it: it opens above one level, and closes below a lower one."""
    x[QS + place] += DT / tau * ((x[P_V] - p.P_0 if signal else 0.0) - x[QS + place])
    level = x[QS + place] / ((1.0 - p.g_q) * p.P_N + p.g_q * x[P_V] - p.P_0)
    if level > p.q_open:
        x[OS + place] = 1.0
    elif level < p.q_close:
        x[OS + place] = 0.0
    rate = 1.0 / t_up if x[OS + place] > 0.5 else -1.0 / (p.down * t_up)
    x[XS + place] = min(1.0, max(0.0, x[XS + place] + DT * rate))


@njit(cache=True, error_model="numpy")
def move_air(x: FloatArray, p: Any, p_set: float) -> None:
    """Move masses and pressures of both chambers, the liner and the supply by a step."""
    V_A, V_B = p.V_0A + p.A_A * x[Y], p.V_0B + p.A_B * (p.y_max - x[Y])
    T_A, T_B = x[P_A] * V_A / (x[M_A] * R), x[P_B] * V_B / (x[M_B] * R)
    full = math.tanh(p.k_x)
    w_s = nozzle(p.A_s * math.tanh(p.k_x * x[XS]) / full, x[P_V], x[P_A], p.T_0, p.c_d, p.c_r)
    w_e = nozzle(p.A_e * math.tanh(p.k_x * x[XE]) / full, x[P_A], p.P_0, T_A, p.c_d, p.c_r)
    w_in = nozzle(p.A_r, p.P_0, x[P_B], p.T_0, p.c_d, p.c_r)
    w_out = nozzle(p.A_r, x[P_B], p.P_0, T_B, p.c_d, p.c_r)
    slit = 1.185e-5 * 293.15 / x[T_W]
    w_AB = slit * p.C_AB * (x[P_A] ** 2 - x[P_B] ** 2)
    w_A0 = slit * p.C_A0 * (x[P_A] ** 2 - p.P_0**2)
    h = p.h_0 + p.h_v * math.sqrt(abs(x[V]))
    around = 2.0 * math.sqrt(math.pi / p.A_A)
    Q_A = h * (x[P_A] / 1e5) ** 0.7 * (2.0 * p.A_A + around * V_A) * (x[T_W] - T_A)
    Q_B = h * (x[P_B] / 1e5) ** 0.7 * (2.0 * p.A_B + around * V_B) * (x[T_W] - T_B)
    mixed = w_AB * (T_A if w_AB > 0.0 else T_B)
    H_A = w_s * p.T_0 - (w_e + w_A0) * T_A - mixed
    H_B = w_in * p.T_0 - w_out * T_B + mixed
    x[M_A] += DT * (w_s - w_e - w_AB - w_A0)
    x[M_B] += DT * (w_in - w_out + w_AB)
    x[P_A] += DT / V_A * (1.4 * (R * H_A - x[P_A] * p.A_A * x[V]) + 0.4 * Q_A)
    x[P_B] += DT / V_B * (1.4 * (R * H_B + x[P_B] * p.A_B * x[V]) + 0.4 * Q_B)
    x[T_W] += DT / p.C_w * (p.U_w * (p.T_0 + p.dT - x[T_W]) - Q_A - Q_B)
    stiffness = 1.2 * R * p.T_0 / p.V_S
    x[W_R] += DT / p.tau_R * (max(0.0, p_set - x[P_V]) / (stiffness * p.t_S) - x[W_R])
    x[P_V] += DT * stiffness * (x[W_R] - w_s)


@njit(cache=True, error_model="numpy")
def dahl(F: float, v: float, K: float, limit: float, exponent: float) -> float:
    """Force of a Dahl element after a step, with its limit at the present speed."""
    rest = 1.0 - (F / limit if v > 0.0 else -F / limit)
    return F + DT * K * v * math.copysign(abs(rest) ** exponent, rest)


@njit(cache=True, error_model="numpy")
def move_piston(x: FloatArray, p: Any, table: FloatArray, grease: float) -> None:
    """Move friction and piston by a step, the position with the new speed."""
    v, travel = x[V], x[Y] - p.rest
    at = min(max(travel / PITCH, 0.0), table.size - 1.001)
    load = table[int(at)] + (at % 1.0) * (table[int(at) + 1] - table[int(at)])
    x[V_L] += DT / p.tau_F * (abs(v) - x[V_L])
    sliding = p.F_C + p.F_p * math.sqrt(max(x[P_A] - p.P_0, 0.0) / 4e5)
    x[F_D] = dahl(x[F_D], v, p.K_z, sliding * (1.0 + (p.R_S - 1.0) * math.exp(-x[V_L] / p.v_S)), p.i_z)
    x[F_L] = dahl(x[F_L], v, p.K_h, p.F_h + p.mu_h * max(load, 0.0), 1.0)
    viscous = grease * v * ((abs(v) + 1e-3) / 0.1) ** (p.n_v - 1.0)
    force = p.A_A * (x[P_A] - p.P_0) - p.A_B * (x[P_B] - p.P_0) - load - x[F_D] - x[F_L] - viscous
    if travel < 0.0:  # rubber that stiffens, with losses
        force += max(0.0, -p.K_e * travel * (1.0 - travel / 1e-3) * (1.0 - 3.0 * v))
    elif x[Y] > p.y_max:
        deep = x[Y] - p.y_max
        force -= max(0.0, p.K_e * deep * (1.0 + deep / 1e-3) * (1.0 + 3.0 * v))
    x[V] += DT / p.M * force
    x[Y] += DT * x[V]


@njit(cache=True, error_model="numpy")
def asked(c: FloatArray, wanted: float, y: float, period: float, lead: float) -> float:
    """Wish of the controller, -1 to 1; `c` has filtered position and speed, whether it holds, and time to vent."""
    before = c[0]
    c[0] += (y - c[0]) / 3.0
    c[1] += ((c[0] - before) / SAMPLE - c[1]) / 6.0
    if wanted < 1e-4:
        c[2], c[3] = 0.0, 0.4 if c[0] > 0.5e-3 else max(c[3] - SAMPLE, 0.0)
        return -1.0 if c[3] > 0.0 else 0.0
    c[3] = 0.0
    error = wanted - c[0]
    ahead = error - lead * c[1]
    if (c[2] > 0.0 or (abs(ahead) < 0.15e-3 and abs(c[1]) < 0.02)) and abs(error) < 0.32e-3:
        c[2] = 1.0
        return 0.0
    c[2] = 0.0
    return math.copysign(min(1.0, (abs(ahead) / (3e-3 + 0.2 * period)) ** 0.9), ahead)


@njit(cache=True, error_model="numpy")
def duty_of(ask: float, dead: float) -> float:
    """Duty cycle for a wish of 0 to 1, above the pulse that opens nothing, in steps of the timer."""
    return math.floor(min(1.0, dead + (1.0 - dead) * ask) * TIMER + 0.5) / TIMER if ask > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def simulate(
    x: FloatArray, p: Any, table: FloatArray, grease: float, wanted: FloatArray, noise: FloatArray, zero: float,
    phase: float, out: FloatArray,
) -> None:  # fmt: skip
    """Drive a course; columns of `out`: position read, both duty cycles, pressure after its lag, supply."""
    c, every = np.zeros(4), int(p.period / SAMPLE + 0.5)
    dead = math.log(1.0 / (1.0 - p.q_open))
    dead_s, dead_e = p.tau_s * dead + 0.2 * p.t_s, p.tau_e * dead + 0.2 * p.t_e
    duty_s = duty_e = 0.0
    for k in range(wanted.size):
        reading = Q_Y * math.floor((x[S_Y] - zero + noise[k]) / Q_Y + 0.5)
        ask = asked(c, wanted[k], reading, p.period, 0.007 + 0.6 * p.period)
        if k % every == 0:
            duty_s, duty_e = duty_of(ask, dead_s), duty_of(-ask, dead_e)
        out[k] = reading, duty_s, duty_e, x[S_P], x[P_V]
        p_set = p.P_S + p.a_S * (4.0 * abs((phase + k * SAMPLE / p.T_S) % 1.0 - 0.5) - 1.0)
        for i in range(STEPS):
            share = ((k % every) + (i + 0.5) / STEPS) / every
            poppet(x, 0, share < duty_s, p.tau_s * p.period, p.t_s * p.period, p)
            poppet(x, 1, share < duty_e, p.tau_e * p.period, p.t_e * p.period, p)
            move_air(x, p, p_set)
            move_piston(x, p, table, grease)
            bowed = x[Y] + p.b_y * 4.0 * x[Y] / p.y_max * (1.0 - x[Y] / p.y_max)
            x[S_Y] += DT / p.tau_y * (bowed - x[S_Y])
            x[S_P] += DT / p.tau_p * (x[P_A] - x[S_P])


def course(touch: float, full: float, samples: int, rng: np.random.Generator) -> FloatArray:
    """Draw a set point in m at every sample: strokes, slip, queues, levels, sweeps and dips, with rests between."""
    parts = [np.zeros(round(rng.uniform(0.25, 0.4) / SAMPLE))]

    def go(level: float, seconds: float, stay: float, swing: float = 0.0, hertz: float = 0.0) -> None:
        start, n = parts[-1][-1], max(round(seconds / SAMPLE), 1)
        smooth = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, n + 1) / n)
        t = np.arange(round(stay / SAMPLE)) * SAMPLE
        parts.extend([start + (level - start) * smooth, level + swing * np.sin(2.0 * np.pi * hertz * t)])
        parts[-1] = np.append(parts[-1], level)

    u, others = rng.uniform, ("change", "change", "hill", "queue", "levels", "sweep", "dips", "stroke")
    while sum(part.size for part in parts) < samples:
        for name in ("change", *rng.permutation(others)):
            near, low, levels = touch + u(0.5e-3, 1.5e-3), max(touch - 3e-3, 1e-3), np.linspace(0.06, 0.94, 8)
            opened = (full - u(0.0, 2.5e-3), 0.0, u(0.4, 1.2))
            steps = {
                "change": [opened, (near + 1.2e-3, 0.12, 0.0), (low, u(0.25, 0.8), 0.0)],
                "hill": [opened, (near, u(0.3, 0.6), u(0.3, 0.8), 3e-4, 1.0),
                         (touch - u(0.5e-3, 1.5e-3), u(1.0, 2.2), 0.2), (low, 0.5, 0.0)],
                "queue": [opened, (near, u(0.3, 0.6), u(2.5, 4.5), u(0.7e-3, 1.6e-3), u(0.25, 0.9))],
                "levels": [(level * full + u(-4e-4, 4e-4), 0.02, 0.5) for level in rng.permutation(levels)],
                "sweep": [(full, u(2.0, 3.5), 0.3), (0.5e-3, u(2.0, 3.5), 0.0)],
                "dips": [step for level in u(0.25, 0.75, 3) for step in (
                    opened, (level * full, 0.0, 0.4), (max(level - 0.2, 0.03) * full, 1.0, 0.1))],
                "stroke": [opened],
            }  # fmt: skip
            for step in (*steps[name], (0.0, 0.0, u(0.6, 1.4))):
                go(*step)
    return np.concatenate(parts)[:samples]


@dataclass(frozen=True, eq=False)
class OwnTruth:
    """Load and set supply pressure [Pa] of a recording; the sensor's zero lies at the mechanical position `zero`."""

    kind: Any
    table: FloatArray
    zero: float

    @property
    def supply(self) -> float:
        """Set supply pressure in Pa."""
        return float(self.kind.P_S)

    def load(self, travel: FloatArray) -> FloatArray:
        """Load in N without friction and hysteresis over the travel in m from the vented rest."""
        grid = self.kind.rest + PITCH * np.arange(self.table.size)
        return np.interp(np.asarray(travel) + self.zero, grid, self.table)


@dataclass(frozen=True, eq=False)
class OwnDrive:
    """A recording of this plant and, apart from it, its truth."""

    log: Log
    truth: OwnTruth


def own_drive(
    number: int, seed: int, *, wear: float = 0.0, pressure: bool = True, change: str | Sequence[str] = (),
    temperature: float | None = None, name: str = "drive", seconds: float = 30.0,
) -> OwnDrive:  # fmt: skip
    """Record type `number` with ambient temperature and supply pressure; the arguments are those of `drive`."""
    kind = aged(own_type(number), wear)
    kind = kind if temperature is None else kind._replace(T_0=temperature)
    for one_change in (change,) if isinstance(change, str) else change:
        kind = changed(kind, one_change)
    n = round(seconds / SAMPLE)
    seeds = np.random.SeedSequence([917, number, seed]).spawn(3)
    of_course, of_noise, of_sensors = map(np.random.default_rng, seeds)
    table, touch = load_table(kind)
    wanted = course(touch, kind.y_max - kind.rest - 2e-3, n, of_course)
    hertz = np.interp(np.arange(n) / n, np.linspace(0.0, 1.0, 31), of_noise.uniform(30.0, 90.0, 31))
    noise = kind.s_y * of_noise.standard_normal(n) + kind.a_y * np.sin(2.0 * np.pi * np.cumsum(hertz) * SAMPLE)
    # at the vented rest the return spring presses the piston into its stop
    rest = kind.rest - table[0] / kind.K_e
    x = np.zeros(20)
    x[Y], x[S_Y], x[P_A], x[P_B], x[S_P] = rest, rest, kind.P_0, kind.P_0, kind.P_0
    x[M_A] = kind.P_0 * (kind.V_0A + kind.A_A * rest) / (R * (kind.T_0 + kind.dT))
    x[M_B] = kind.P_0 * (kind.V_0B + kind.A_B * (kind.y_max - rest)) / (R * (kind.T_0 + kind.dT))
    x[T_W], x[P_V], out = kind.T_0 + kind.dT, kind.P_S - of_sensors.uniform(0.0, 1e4), np.empty((n, 5))
    simulate(
        x, kind, table, kind.D_v * viscosity(kind), wanted, noise, rest - kind.e_y, of_sensors.uniform(0.0, 1.0), out
    )  # fmt: skip
    position, duty_supply, duty_exhaust, p_A, p_S = out.T.copy()
    read = kind.e_p + (1.0 + kind.g_p) * p_A + kind.s_p * of_sensors.standard_normal(n)
    air = kind.T_0 + of_sensors.uniform(-2.0, 2.0) + 0.05 * of_sensors.standard_normal(n)
    supply = p_S + of_sensors.uniform(-5e3, 5e3) + 1e3 * of_sensors.standard_normal(n)
    columns = {"position": position, "duty_supply": duty_supply, "duty_exhaust": duty_exhaust}
    columns |= {"pressure_a": Q_P * np.round(read / Q_P)} if pressure else {}
    columns |= {"temperature_ambient": np.round(air, 1), "pressure_supply": Q_P * np.round(supply / Q_P)}
    metadata = {"manoeuvre": "own", "seed": str(seed), "recorder": "controller"}
    log = Log(np.arange(n) / round(1 / SAMPLE), columns, name, metadata)
    return OwnDrive(log, OwnTruth(kind, table, rest - kind.e_y))

"""Friction of seals and grease, and hysteresis of the load: LuGre and Dahl bristles, or slipping elements and play."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clutchid.truck.parts.part import GUESS, LIFE_STROKES, Friction
from clutchid.truck.rows import choice, number

_SHARED = ("F_C", "D_v", "R_S", "v_S", "K_z", "a_F")


@dataclass(frozen=True, kw_only=True)
class BristleRows:
    """LuGre at the seals, exponential in temperature, and Dahl at the release bearing."""

    c_F: float = number(1.5e-4, "m²", "its increase with the pressure over the piston", 0, 1e-2)
    D_z: float = number(4000.0, "N·s/m", "damping of their deflection at rest", 0, 1e4)
    v_z: float = number(0.05, "m/s", "velocity at which this damping is halved", 1e-4, 1e3, "assumption")
    beta: float = number(0.0125, "1/K", "temperature coefficient of the grease viscosity", 0, 0.05)
    F_h: float = number(25.0, "N", "release bearing: friction without load", 1e-4, 500, "assumption")
    mu_h: float = number(0.035, "1", "release bearing: half hysteresis over load", 0, 0.2, "5 to 10 % of load")
    K_h: float = number(5e5, "N/m", "release bearing: stiffness before it slips", 1, 1e7, "assumption")


@dataclass(frozen=True, kw_only=True)
class SlipRows:
    """Maxwell slip or elasto-plastic bristles at the seals, Vogel's law, and play of bearing and fingers."""

    F_p: float = number(120.0, "N", "largest increase of seal friction by pressure", 0, 5e3, GUESS)
    p_F: float = number(3e5, "Pa", "pressure for half of that increase", 1e3, 1e7, GUESS)
    D_z: float = number(800.0, "N·s/m", "elasto-plastic seals: damping at rest", 0, 1e4, GUESS)
    x_b: float = number(0.6, "1", "elasto-plastic seals: elastic fraction of the steady deflection", 0.01, 0.99, GUESS)
    v_g: float = number(1.0, "m/s", "velocity at which shear halves the viscous friction", 0.01, 1e9, GUESS)
    T_V: float = number(120.0, "K", "grease: Vogel temperature", 0, 200, GUESS)
    B_V: float = number(300.0, "K", "grease: Vogel constant", 0, 5e3, "twice at -30 °C, half at 80 °C")
    F_b: float = number(15.0, "N", "play of the release bearing: friction without load", 1e-2, 500, GUESS)
    mu_b: float = number(0.02, "1", "play of the release bearing: half hysteresis over load", 0, 0.2)
    K_b: float = number(8e5, "N/m", "play of the release bearing: stiffness", 1, 1e7, GUESS)
    mu_f: float = number(0.015, "1", "play of the fingers: half hysteresis over load", 0, 0.2)
    K_f: float = number(2e5, "N/m", "play of the fingers: stiffness", 1, 1e7, GUESS)
    friction: str = choice("maxwell-slip", ("maxwell-slip", "elasto-plastic"))


BRISTLES = Friction(
    name="LuGre and Dahl", rows=BristleRows, shared=_SHARED,
    numbers=lambda t: {"F_C": t.F_C * (1 + t.a_F * (t.cycles / LIFE_STROKES))},
    factors={"seals": {"F_C": 1.4, "c_F": 1.4}}, true=lambda _, x: {"deflection": x["z"], "bearing": x["z_h"]},
    module="bristles", viscosity=lambda t: float(np.exp(-t.beta * (t.T_0 + t.dT_w))),
)  # fmt: skip
SLIP = Friction(
    name="slip and play", rows=SlipRows, shared=_SHARED,
    numbers=lambda t: {
        "F_C": t.F_C * (1 + t.a_F * math.sqrt(t.cycles / LIFE_STROKES)),
        "plastic": float(t.friction == "elasto-plastic"),
    },
    factors={"seals": {"F_C": 1.4, "F_p": 1.4}},
    true=lambda _, x: {"deflection": x["z_1"], "bearing": x["z_b"], "fingers": x["z_f"]}, module="slip",
    viscosity=lambda t: float(np.exp(t.B_V / (t.T_0 + t.dT_w - t.T_V))),
)  # fmt: skip

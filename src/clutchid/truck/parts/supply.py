"""Air supply: a reservoir that a compressor fills, switched by a governor; or a pressure regulator with droop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.truck.parts.gas import energy, mass, truth_of_energy
from clutchid.truck.parts.part import GUESS, Supply
from clutchid.truck.rows import number

#: Regulator: largest distance of the supply pressure from the set one at the start, as a share.
_START = 0.01


@dataclass(frozen=True, kw_only=True)
class ReservoirRows:
    """Governor, line and reservoir."""

    dP_G: float = number(0.2e5, "Pa", "half the range of the governor", 0, 2e5)
    r_up: float = number(0.1e5, "Pa/s", "pressure rise while the compressor runs", 1, 1e5, "assumption")
    r_down: float = number(0.03e5, "Pa/s", "pressure fall while it is off", 1, 1e5, "assumption")
    V_S: float = number(9e-3, "m³", "reservoir of the clutch circuit", 1e-4, 1e9, "assumption, sags 0.1 to 0.4 bar")
    G_S: float = number(2e-7, "kg/(Pa·s)", "line from governor to reservoir", 0, 1e-3, "assumption, for that sag")
    UA_S: float = number(5.0, "W/K", "heat transfer of the reservoir", 0, 1e9, "assumption")


@dataclass(frozen=True, kw_only=True)
class RegulatorRows:
    """Pressure regulator, and the volume behind it."""

    V_S: float = number(6e-3, "m³", "volume behind the pressure regulator", 1e-4, 1e9, GUESS)
    dp_T: float = number(2e5, "Pa", "pressure before the regulator above the set one", 0, 1e6, GUESS)
    A_R: float = number(20e-6, "m²", "area of the open regulator", 0, 1e-3, GUESS)
    dp_R: float = number(0.8e5, "Pa", "droop of the regulator when fully open", 1e3, 5e5, GUESS)
    tau_R: float = number(0.05, "s", "time constant of the regulator", 1e-3, 10, GUESS)


def _reservoir(t: Any, x: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    return truth_of_energy(t, "supply", x["m_S"], x["U_S"], t.V_S) | {"pressure_governor": x["p_G"]}


def _saw_tooth(t: Any, rng: np.random.Generator) -> tuple[float, bool]:
    """A random phase of the governor's saw-tooth."""
    p_G = t.P_S + t.dP_G * rng.uniform(-0.95, 0.95)
    return p_G, bool(rng.uniform() < t.r_down / (t.r_up + t.r_down))


RESERVOIR = Supply(
    name="governor and reservoir", rows=ReservoirRows, shared=("P_S",), factors={"supply": {"P_S": 0.95}},
    true=_reservoir, module="reservoir", rest=lambda t, p: (mass(t, p, t.V_S, t.T_0), energy(t, p, t.V_S), p),
    start=_saw_tooth,
)  # fmt: skip
REGULATOR = Supply(
    name="pressure regulator", rows=RegulatorRows, shared=("P_S",), numbers=lambda t: {"p_T": t.P_S + t.dp_T},
    factors={"supply": {"P_S": 0.95}}, true=lambda _, x: {"pressure_supply": x["p_S"], "regulator": x["x_R"]},
    module="regulator", rest=lambda _, p: (p, 0.0), start=lambda t, rng: (t.P_S * (1 - _START * rng.uniform()), False),
)  # fmt: skip

"""Air in the chambers: an energy balance with heat to the walls, or polytropic; and a tube to chamber A."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from clutchid.log import FloatArray
from clutchid.truck.parts.part import GUESS, Gas, Tube
from clutchid.truck.rows import number


@dataclass(frozen=True, kw_only=True)
class EnergyRows:
    """Heat transfer to the walls."""

    h_A: float = number(60.0, "W/(m²·K)", "heat transfer in chamber A at 1 bar and 293.15 K", 0, 1e7)
    h_B: float = number(30.0, "W/(m²·K)", "heat transfer in chamber B at 1 bar and 293.15 K", 0, 1e7)


@dataclass(frozen=True, kw_only=True)
class PolytropicRows:
    """Polytropic air that relaxes to the wall."""

    n_p: float = number(1.2, "1", "polytropic exponent of the air", 1, 1.4, "textbook")
    tau_w: float = number(1.5, "s", "relaxation of the air to the temperature of the wall", 0.01, 1e9, GUESS)


@dataclass(frozen=True, kw_only=True)
class TubeRows:
    """Dead volume at the valves, and the tube from there to chamber A."""

    V_D: float = number(4e-5, "m³", "dead volume between valves and tube", 2e-5, 1e-3, GUESS)
    C_t: float = number(1.8e-7, "kg/(Pa·s)", "conductance of the tube to chamber A", 1e-9, 4e-7, GUESS)
    dp_t: float = number(5e3, "Pa", "difference below which the tube's flow is laminar", 1e3, 1e5, "regularisation")


#: Names of the zones in a truth.
_ZONES = {"A": "a", "D": "dead", "B": "b"}


def volumes(t: Any, y: Any) -> dict[str, Any]:
    """Volumes of the zones in m³ at positions in m."""
    V = {"A": t.V_0A + t.A_A * y, "B": t.V_0B + t.A_B * (t.y_max - y)}
    return {"A": V["A"], "D": t.V_D + 0.0 * y, "B": V["B"]} if t.parts.tube.module else V


def mass(t: Any, p: float, V: float, T: float) -> Any:
    """Mass of air in kg."""
    return p * V / (t.R * T)


def energy(t: Any, p: float, V: float) -> Any:
    """Internal energy of air in J."""
    return p * V / (t.gamma - 1)


def truth_of_energy(t: Any, name: str, m: FloatArray, U: FloatArray, V: Any) -> dict[str, FloatArray]:
    """Pressure, temperature and mass of air in a volume from its mass and internal energy."""
    p, T = (t.gamma - 1) * U / V, (t.gamma - 1) * U / (t.R * m)
    return {f"pressure_{name}": p, f"temperature_{name}": T, f"mass_{name}": m}


def _truth_of_pressure(t: Any, name: str, m: FloatArray, p: FloatArray, V: Any) -> dict[str, FloatArray]:
    return {f"pressure_{name}": p, f"temperature_{name}": p * V / (t.R * m), f"mass_{name}": m}


def _true(of: Callable[..., dict[str, FloatArray]], second: str, t: Any, x: Mapping[str, FloatArray]) -> Any:
    """Columns of all zones, whose second state has this letter, by a function of one."""
    zones = volumes(t, x["y"]).items()
    columns = (of(t, _ZONES[zone], x[f"m_{zone}"], x[f"{second}_{zone}"], V) for zone, V in zones)
    return {name: values for zone_columns in columns for name, values in zone_columns.items()}


def _at_most_adiabatic(t: Any) -> Iterator[str]:
    if t.n_p > t.gamma:
        yield f"n_p = {t.n_p:g}: air is at most adiabatic, so n_p must not exceed gamma = {t.gamma:g}."


ENERGY = Gas(
    name="energy balance", rows=EnergyRows, true=partial(_true, truth_of_energy, "U"), module="energy",
    rest=lambda t, p, V, T: (mass(t, p, V, T), energy(t, p, V)),
)  # fmt: skip
POLYTROPIC = Gas(
    name="polytropic", rows=PolytropicRows, contradictions=_at_most_adiabatic, module="polytropic",
    true=partial(_true, _truth_of_pressure, "p"), rest=lambda t, p, V, T: (mass(t, p, V, T), p),
)  # fmt: skip
DIRECT = Tube(name="none", shared=("V_0A",), delay=0.0)
TUBE = Tube(name="tube and dead volume", module="tube", rows=TubeRows, shared=("V_0A",), delay=0.004)

"""Family A: its truck types, and the arrays of its compiled loop."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.truck import sensors
from clutchid.truck.ageing import worn_parameters
from clutchid.truck.compiled import Loop
from clutchid.truck.family import Family, changes_of
from clutchid.truck.law import SAMPLE, TICK
from clutchid.truck.load import load_curve
from clutchid.truck.load_table import LoadTable, rest_position
from clutchid.truck.parameters import PARAMETERS, SETTINGS, STATES, Truck

#: Sampling period in s of the bang-bang drive; its valves are as fast as for PWM at 100 Hz.
BANG_PERIOD, BANG_VALVES = 0.002, 0.01

#: Controller output at which the bang-bang drive opens a valve.
BANG = 0.3


LOOP = Loop(
    name="truck",
    plant="plant",
    laws=(("law", ("magnet", "lift_rate", "snapped", "governor", "quantised", "lagged", "request", "duty")),),
    constants=(),
    settings=SETTINGS,
    template="first.py.j2",
    files=("air.py", "friction.py", "plant.py", "templates/first.py.j2"),
)


def prepared(drawn: dict[str, Any]) -> dict[str, Any]:
    """Drawn numbers with the period that scales the times of the valves."""
    return {**drawn, "T_pwm": BANG_VALVES} if drawn["drive"] == "bang-bang" else drawn


def finished(drawn: dict[str, Any]) -> dict[str, Any]:
    """Drawn numbers with those of the controller."""
    return drawn | tuning(drawn["T_pwm"], drawn["drive"])


def tuning(T_pwm: float, drive: str) -> dict[str, float]:
    """Parameters of the controller for a period of the valves; a longer period needs a longer prediction time."""
    if drive == "bang-bang":
        return {"T_pwm": BANG_PERIOD, "L_p": 3e-3, "t_lead": 0.01, "e_in": 0.8e-3, "e_out": 1e-3}
    return {"T_pwm": T_pwm, "L_p": 3e-3 + 0.2 * T_pwm, "t_lead": 0.007 + 0.6 * T_pwm, "e_in": 0.15e-3, "e_out": 0.3e-3}


def at_rest(truck: Truck, curve: LoadTable, p_G: float | None = None) -> FloatArray:
    """States of a vented truck whose piston rests at the engaged end; `p_G` is the governor's pressure, default P_S."""
    t, y = truck, rest_position(truck, curve)
    supply = t.P_S if p_G is None else p_G
    V_A, V_B = t.V_0A + t.A_A * y, t.V_0B + t.A_B * (t.y_max - y)
    air = [value for V in (V_A, V_B) for value in _air(t, t.P_0, V, t.T_0 + t.dT_w)]
    return np.array([y, 0.0, *air, *_air(t, supply, t.V_S, t.T_0), 0.0, 0.0, 0.0, 0.0, supply])


def _air(t: Truck, p: float, V: float, T: float) -> tuple[float, float]:
    """Mass and internal energy of the air in a volume."""
    return p * V / (t.R * T), p * V / (t.gamma - 1)


def start(truck: Truck, curve: LoadTable, rng: np.random.Generator) -> tuple[FloatArray, bool]:
    """Initial states, at a random phase of the governor's saw-tooth, and whether the compressor runs."""
    p_G = truck.P_S + truck.dP_G * rng.uniform(-0.95, 0.95)
    return at_rest(truck, curve, p_G), bool(rng.uniform() < truck.r_down / (truck.r_up + truck.r_down))


def plant_parameters(truck: Truck) -> FloatArray:
    """Parameters of the truck at its age, in the order of the loop."""
    known = {name: getattr(truck, name) for name in PARAMETERS if hasattr(truck, name)}
    known |= worn_parameters(truck) | {"T_w": truck.T_0 + truck.dT_w}
    return np.array([known[name] for name in PARAMETERS])


def settings(truck: Truck, zero: float, working: bool) -> FloatArray:
    """Settings of the loop in their order: valves, governor, sensors and controller."""
    period = period_in_ticks(truck.T_pwm)
    known = {name: float(getattr(truck, name)) for name in SETTINGS if hasattr(truck, name)}
    bang_bang = truck.drive == "bang-bang"
    known |= {"period": period, "timer": 1.0 / period, "bang_bang": bang_bang, "working": working, "zero": zero}
    known |= {f"dead_{valve}": BANG if bang_bang else known[f"t_1{valve}"] / truck.T_pwm for valve in "se"}
    known |= {"quantum": truck.q_y, "band": truck.L_p, "lead": truck.t_lead}
    return np.array([known[name] for name in SETTINGS], dtype=np.float64)


def period_in_ticks(T_pwm: float) -> int:
    """Period of the valves in ticks.

    Raises
    ------
    ParameterError
        If the period is no multiple of the controller's sampling time.
    """
    period = round(T_pwm / TICK)
    if period % round(SAMPLE / TICK):
        raise ParameterError(f"T_pwm = {T_pwm:g} s: must be a multiple of the controller's {SAMPLE:g} s.")
    return period


def true_states(truck: Truck, x: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Pressures, temperatures and masses of air, deflections of seal and bearing, lifts of the valves, governor."""
    volume = {
        "a": truck.V_0A + truck.A_A * x["y"],
        "b": truck.V_0B + truck.A_B * (truck.y_max - x["y"]),
        "supply": np.full(x["y"].size, truck.V_S),
    }
    states = {"deflection": x["z"], "bearing": x["z_h"]}
    for chamber, letter in (("a", "A"), ("b", "B"), ("supply", "S")):
        mass, energy = x[f"m_{letter}"], x[f"U_{letter}"]
        states[f"pressure_{chamber}"] = (truck.gamma - 1) * energy / volume[chamber]
        states[f"temperature_{chamber}"] = (truck.gamma - 1) * energy / (truck.R * mass)
        states[f"mass_{chamber}"] = mass
    return states | {"lift_supply": x["x_s"], "lift_exhaust": x["x_e"], "pressure_governor": x["p_G"]}


def viscosity(truck: Truck) -> float:
    """Viscous friction at the temperature of the wall, relative to that at the reference temperature."""
    return float(np.exp(-truck.beta * (truck.T_0 + truck.dT_w)))


FIRST = Family(
    kind=Truck,
    ranges=Path(__file__).parent / "ranges.toml",
    prepared=prepared,
    finished=finished,
    load_curve=load_curve,
    states=STATES,
    loop=LOOP,
    at_rest=at_rest,
    plant_parameters=plant_parameters,
    settings=settings,
    start=start,
    position_noise=sensors.position_noise,
    measured_pressure=sensors.measured_pressure,
    true_states=true_states,
    changes=changes_of(
        viscosity,
        passing=("C_s", "C_e"),
        times=tuple(f"t_{part}{valve}" for valve in "se" for part in (1, 2, 3, 4)),
        friction=("F_C", "c_F"),
    ),
)

"""Family B: its truck types, the arrays of its compiled loop, its sensors and its truth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.truck.compiled import Loop
from clutchid.truck.family import Family, changes_of
from clutchid.truck.first import period_in_ticks
from clutchid.truck.law import SAMPLE
from clutchid.truck.load_table import LoadTable, rest_position
from clutchid.truck.second.clutch import load_curve, worn
from clutchid.truck.second.parameters import PARAMETERS, SETTINGS, STATES, TruckB


def coloured(n: int, tau: float, rng: np.random.Generator) -> FloatArray:
    """Noise of standard deviation 1 whose correlation decays within `tau` in s (first-order Gauss-Markov)."""
    from scipy.signal import lfilter

    kept = float(np.exp(-SAMPLE / tau))
    first = rng.standard_normal()
    noise: FloatArray = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(n), zi=[kept * first])[0]
    return noise


def position_noise(truck: TruckB, n: int, rng: np.random.Generator) -> FloatArray:
    """White and coloured noise of the position sensor in m."""
    noise: FloatArray = truck.s_y * rng.standard_normal(n) + truck.s_c_y * coloured(n, truck.tau_c, rng)
    return noise


def measured_pressure(truck: TruckB, pressure: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Measured pressure in Pa from the lagged one: gain (about ambient), offset, coloured noise and quantisation."""
    true = truck.P_0 + (1 + truck.e_gain) * (pressure - truck.P_0)
    noisy: FloatArray = true + truck.e_p + truck.s_p * coloured(pressure.size, truck.tau_c, rng)
    return truck.q_p * np.round(noisy / truck.q_p) if truck.q_p > 0 else noisy


#: Steps of the duty cycle that a proportional valve resolves.
STEPS = 1000
#: Largest distance of the supply pressure from the set one at the start, as a share.
START = 0.01


LOOP = Loop(
    name="truck_b",
    plant="second.plant",
    laws=(
        ("law", ("snapped", "quantised", "lagged", "request", "duty")),
        ("second.law", ("spool", "port", "solenoid", "poppet", "scaled")),
    ),
    constants=(("second.law", "PARTS"),),
    settings=SETTINGS,
    template="second.py.j2",
    files=(
        *(f"second/{name}.py" for name in ("gas", "friction", "plant", "law", "parameters")),
        "templates/second.py.j2",
    ),
)


def prepared(drawn: dict[str, Any]) -> dict[str, Any]:
    """Drawn numbers; the position sensor's curve bends either way."""
    bend = drawn["bend"]
    return {name: value for name, value in drawn.items() if name != "bend"} | {"e_lin": bend * drawn["e_lin"]}


def finished(drawn: dict[str, Any]) -> dict[str, Any]:
    """Drawn numbers with those of the controller: it predicts over the time that duty cycle and valve need."""
    T, spool = drawn["T_pwm"], drawn["valve"] == "spool"
    held = T if drawn["duty"] == "latched" or not spool else 1e-3
    late = (drawn["tau_x"] if drawn["spool"] == "first-order" else 1.6 * drawn["t_n"]) if spool else 1e-3
    tube = 0.004
    return drawn | {
        "L_p": 3e-3 + 0.2 * T,
        "t_lead": 0.004 + 0.6 * held + late + tube,
        "e_in": 0.15e-3,
        "e_out": 0.3e-3,
    }


def at_rest(truck: TruckB, curve: LoadTable, p_S: float | None = None) -> FloatArray:
    """States of a vented truck whose piston rests at the engaged end; `p_S` is the supply pressure, default P_S."""
    t, y = truck, rest_position(truck, curve)
    volumes = (t.V_0A + t.A_A * y, t.V_D, t.V_0B + t.A_B * (t.y_max - y))
    air = [value for V in volumes for value in (t.P_0 * V / (t.R * (t.T_0 + t.dT_w)), t.P_0)]
    return np.array([y, 0.0, *air, t.P_S if p_S is None else p_S, 0.0, *[0.0] * 8])


def start(truck: TruckB, curve: LoadTable, rng: np.random.Generator) -> tuple[FloatArray, bool]:
    """Initial states, the supply a little below its set pressure; there is no compressor."""
    return at_rest(truck, curve, truck.P_S * (1 - START * rng.uniform())), False


def plant_parameters(truck: TruckB) -> FloatArray:
    """Parameters of the truck at its age, in the order of the loop."""
    known = {name: getattr(truck, name) for name in PARAMETERS if hasattr(truck, name)}
    known |= worn(truck)
    known |= {"T_w": truck.T_0 + truck.dT_w, "p_T": truck.P_S + truck.dp_T}
    known["plastic"] = float(truck.friction == "elasto-plastic")
    return np.array([known[name] for name in PARAMETERS])


def settings(truck: TruckB, zero: float, working: bool) -> FloatArray:
    """Settings of the loop in their order: valves, sensors and controller; `working` has no meaning here."""
    del working
    period = period_in_ticks(truck.T_pwm)
    known = {name: getattr(truck, name) for name in SETTINGS if isinstance(getattr(truck, name, None), float)}
    spool = truck.valve == "spool"
    known |= {"period": period, "timer": 1 / STEPS if spool else 1 / period, "bang_bang": False, "spool": spool}
    known |= {"continuous": truck.duty == "continuous", "second_order": truck.spool == "second-order"}
    known |= {
        f"dead_{valve}": known[f"x_0{valve}"] if spool else known[f"tau_i{valve}"] / truck.T_pwm for valve in "se"
    }
    known |= {"zero": zero, "quantum": truck.q_y, "rest": zero + truck.e_y, "stroke": truck.y_max}
    known |= {"band": truck.L_p, "lead": truck.t_lead}
    return np.array([known[name] for name in SETTINGS], dtype=np.float64)


def true_states(truck: TruckB, x: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Pressures, temperatures and masses of air, deflections of seals and bearing, openings of the ports, regulator."""
    volume = {
        "a": truck.V_0A + truck.A_A * x["y"],
        "dead": np.full(x["y"].size, truck.V_D),
        "b": truck.V_0B + truck.A_B * (truck.y_max - x["y"]),
    }
    states = {"deflection": x["z_1"], "bearing": x["z_b"], "fingers": x["z_f"], "pressure_supply": x["p_S"]}
    for zone, letter in (("a", "A"), ("dead", "D"), ("b", "B")):
        states[f"pressure_{zone}"] = x[f"p_{letter}"]
        states[f"temperature_{zone}"] = x[f"p_{letter}"] * volume[zone] / (truck.R * x[f"m_{letter}"])
        states[f"mass_{zone}"] = x[f"m_{letter}"]
    return states | {"lift_supply": x["x_s"], "lift_exhaust": x["x_e"], "regulator": x["x_R"]}


def viscosity(truck: TruckB) -> float:
    """Viscous friction at the temperature of the wall, up to a constant factor."""
    return float(np.exp(truck.B_V / (truck.T_0 + truck.dT_w - truck.T_V)))


SECOND = Family(
    kind=TruckB,
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
    position_noise=position_noise,
    measured_pressure=measured_pressure,
    true_states=true_states,
    changes=changes_of(
        viscosity,
        passing=("A_s", "A_e"),
        times=("tau_x", "t_n", "tau_is", "tau_ie", "t_xs", "t_xe"),
        friction=("F_C", "F_p"),
    ),
)

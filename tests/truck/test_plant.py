"""The right-hand side of the plant, computed from its definitions one by one: which air flows where, at what heat."""

import math
from functools import cache
from typing import Any

import pytest

from clutchid.codegen.numba_source import terms_source
from clutchid.truck import Truck
from clutchid.truck.assembly import numbers
from clutchid.truck.equations.plant import plant

T = Truck()
STATES = Truck.parts.structure.states
SYSTEM = plant(Truck.parts.structure)
C_P = T.R * T.gamma / (T.gamma - 1)
#: No heat through walls, closed valves, and no way for the air but the one that a test opens.
SEALED = T.replace({"h_A": 0.0, "h_B": 0.0, "UA_S": 0.0, "G_S": 0.0, "C_r": 0.0, "C_AB": 0.0, "C_A0": 0.0})
STEADY = {"y": 8e-3, "v": 0.0, "z": 0.0, "z_h": 0.0, "x_s": 0.0, "x_e": 0.0, "p_G": T.P_S}
AIR = {"A": (4e5, 330.0), "B": (1.5e5, 260.0), "S": (8e5, 310.0)}


@cache
def equations() -> dict[str, Any]:
    """The plant as plain Python, term by term."""
    module: dict[str, Any] = {"math": math}
    exec(terms_source(SYSTEM), module)
    return module


def rates(truck: Truck, air: dict[str, tuple[float, float]], f_l: float = 0.0, **changes: float) -> dict[str, float]:
    """Rates of the states with chambers and reservoir at pressures in Pa and temperatures in K, under a load in N."""
    state = STEADY | changes
    volume = {
        "A": truck.V_0A + truck.A_A * state["y"],
        "B": truck.V_0B + truck.A_B * (truck.y_max - state["y"]),
        "S": truck.V_S,
    }
    for name, (p, kelvin) in air.items():
        state[f"m_{name}"] = p * volume[name] / (truck.R * kelvin)
        state[f"U_{name}"] = p * volume[name] / (truck.gamma - 1)
    constants = numbers(truck, 0.0, False)
    held = [0.0] * len(SYSTEM.inputs)
    parameters = [constants[name] for name in SYSTEM.parameter_names()]
    values = equations()["terms"]([state[name] for name in STATES], held, parameters, f_l)
    entries = dict(zip((row[0] for row in equations()["TERMS"]), values, strict=True))
    return {name: entries[f"d_{name}"] for name in STATES}


def pressures(**changed: float) -> dict[str, tuple[float, float]]:
    return {name: (changed.get(name, p), kelvin) for name, (p, kelvin) in AIR.items()}


@pytest.mark.parametrize(
    ("way", "air", "source", "chambers"),
    [
        ({"C_AB": 2e-11}, pressures(A=4e5, B=1.5e5), "A", {"A": -1, "B": 1}),
        ({"C_AB": 2e-11}, pressures(A=1.5e5, B=4e5), "B", {"A": 1, "B": -1}),
        ({"C_A0": 2e-11}, pressures(A=4e5), "A", {"A": -1}),
        ({"C_A0": 2e-11}, pressures(A=0.8e5), "outside", {"A": 1}),
        ({"C_r": 2e-8}, pressures(B=1.5e5), "B", {"B": -1}),
        ({"C_r": 2e-8}, pressures(B=0.8e5), "outside", {"B": 1}),
    ],
    ids=["seal forth", "seal back", "leak outwards", "leak inwards", "breather outwards", "breather inwards"],
)
def test_air_takes_the_temperature_along_from_where_it_comes(way, air, source, chambers):
    rates_of_change = rates(SEALED.replace(way), air)
    kelvin = T.T_0 if source == "outside" else air[source][1]
    for name in AIR:
        flow, power = rates_of_change[f"m_{name}"], rates_of_change[f"U_{name}"]
        # 1 kg/s carries c_p T; the piston stands and the walls take nothing
        assert power == pytest.approx(C_P * kelvin * flow, rel=1e-12)
        assert (flow > 0) - (flow < 0) == chambers.get(name, 0)
    if len(chambers) == 2:
        assert rates_of_change["m_A"] == -rates_of_change["m_B"]


@pytest.mark.parametrize(("valve", "source", "sink"), [("x_s", "S", "A"), ("x_e", "A", None)])
def test_an_open_valve_passes_air_with_the_heat_of_what_is_before_it_in_proportion_to_its_lift(valve, source, sink):
    half, full = (rates(SEALED, AIR, **{valve: lift}) for lift in (0.5, 1.0))
    flow = -full[f"m_{source}"]
    assert flow > 0
    assert -half[f"m_{source}"] == pytest.approx(flow / 2, rel=1e-12)
    assert -full[f"U_{source}"] == pytest.approx(C_P * AIR[source][1] * flow, rel=1e-12)
    if sink:
        assert (full[f"m_{sink}"], full[f"U_{sink}"]) == (flow, -full[f"U_{source}"])
    assert full["m_B"] == full["U_B"] == 0.0


def test_the_compressor_fills_the_reservoir_with_air_of_the_ambience():
    rates_of_change = rates(SEALED.replace({"G_S": 5e-7}), pressures(S=8e5), p_G=9e5)
    assert rates_of_change["m_S"] == pytest.approx(5e-7 * 1e5, rel=1e-12)
    assert rates_of_change["U_S"] == pytest.approx(C_P * T.T_0 * rates_of_change["m_S"], rel=1e-12)


def test_walls_give_each_chamber_heat_through_its_own_area_and_the_reservoir_by_its_own_number():
    warm = {name: (p, T.T_0) for name, (p, _) in AIR.items()}
    walls = SEALED.replace({"h_A": 50.0, "h_B": 30.0, "UA_S": 7.0, "dT_w": 40.0})
    rates_of_change = rates(walls, warm)
    area = {"A": 2 * T.A_A, "B": 2 * T.A_B}
    length = {"A": T.V_0A / T.A_A + 8e-3, "B": T.V_0B / T.A_B + T.y_max - 8e-3}
    for name, h in (("A", 50.0), ("B", 30.0)):
        A = area[name] / 2
        surface = area[name] + 2 * math.sqrt(math.pi * A) * length[name]
        expected = h * math.sqrt(warm[name][0] * T.T_0 / (1e5 * 293.15)) * surface * 40.0
        assert rates_of_change[f"U_{name}"] == pytest.approx(expected, rel=1e-12)
    assert rates_of_change["U_S"] == pytest.approx(0.0, abs=1e-9)
    assert rates(walls, AIR)["U_S"] == pytest.approx(7.0 * (T.T_0 - 310.0), rel=1e-12)


def test_a_moving_piston_works_on_the_air_of_both_chambers():
    rates_of_change = rates(SEALED, AIR, v=0.2)
    assert rates_of_change["y"] == 0.2
    assert rates_of_change["U_A"] == pytest.approx(-4e5 * T.A_A * 0.2, rel=1e-12)
    assert rates_of_change["U_B"] == pytest.approx(1.5e5 * T.A_B * 0.2, rel=1e-12)


@pytest.mark.parametrize("v", [0.03, -0.03])
def test_every_force_acts_on_the_piston_with_its_own_numbers(v):
    t = SEALED.replace({"dT_w": 30.0, "beta": 0.0125, "c_F": 2e-4, "R_S": 1.5, "v_S": 0.02, "v_z": 0.05, "mu_h": 0.04})
    z, z_h, f_l = 1.1e-4, -2e-5, 3000.0
    rates_of_change = rates(t, AIR, f_l, v=v, z=z, z_h=z_h)
    g = (t.F_C + t.c_F * (4e5 - 1.5e5)) * (1 + 0.5 / (1 + 1.5**2))
    z_dot = v - t.K_z * abs(v) / g * z
    viscous = t.D_v * math.exp(-0.0125 * (t.T_0 + 30.0 - 293.15))
    seal = t.K_z * z + t.D_z / (1 + 0.6**2) * z_dot + viscous * v
    pushed = t.A_A * (4e5 - t.P_0) - t.A_B * (1.5e5 - t.P_0)
    assert rates_of_change["v"] == pytest.approx((pushed - f_l - t.K_h * z_h - seal) / t.M, rel=1e-12)
    assert rates_of_change["z"] == pytest.approx(z_dot, rel=1e-12)
    assert rates_of_change["z_h"] == pytest.approx(v - t.K_h * abs(v) / (t.F_h + 0.04 * f_l) * z_h, rel=1e-12)


@pytest.mark.parametrize("v", [0.05, -0.05])
def test_the_stops_push_the_piston_back_from_the_far_end_and_from_the_rest_of_a_worn_clutch(v):
    worn = SEALED.replace({"wear": 2e-3, "i_w": 0.5})
    depth = 1e-4
    for end, into, sign in ((worn.y_max + depth, v, -1), (-1e-3 - depth, -v, 1)):
        # where the stop does not touch yet all else is the same: the pressures are given
        free = rates(worn, AIR, y=end + sign * 2 * depth, v=v)["v"]
        force = worn.K_stop * depth**1.5 * (1 + worn.chi * into)
        # two accelerations of some 100 m/s², rounded
        assert rates(worn, AIR, y=end, v=v)["v"] - free == pytest.approx(sign * force / worn.M, rel=1e-11)


def test_every_valve_and_orifice_has_its_own_flow_function():
    t = SEALED.replace({"b_s": 0.2, "m_s": 0.5, "b_e": 0.3, "m_e": 0.55, "b_r": 0.4, "m_r": 0.6, "C_r": 3e-8})
    air = {"A": (1.5e5, 330.0), "B": (1.3e5, 260.0), "S": (2e5, 310.0)}
    derivatives = rates(t, air, x_s=1.0), rates(t, air, x_e=1.0), rates(t, air)

    def flow(p_h: float, p_l: float, kelvin: float, C: float, b: float, m: float) -> float:
        return 1.185 * C * p_h * math.sqrt(293.15 / kelvin) * (1 - ((p_l / p_h - b) / (1 - b)) ** 2) ** m

    assert derivatives[0]["m_A"] == pytest.approx(flow(2e5, 1.5e5, 310.0, t.C_s, 0.2, 0.5), rel=1e-12)
    assert derivatives[1]["m_A"] == pytest.approx(-flow(1.5e5, t.P_0, 330.0, t.C_e, 0.3, 0.55), rel=1e-12)
    assert derivatives[2]["m_B"] == pytest.approx(-flow(1.3e5, t.P_0, 260.0, 3e-8, 0.4, 0.6), rel=1e-12)


def test_air_in_a_leak_takes_the_temperature_of_the_wall():
    t = SEALED.replace({"dT_w": 40.0, "C_AB": 2e-11})
    leak = 1.185 * 2e-11 / 1e5 * 293.15 / (t.T_0 + 40.0)
    assert rates(t, AIR)["m_B"] == pytest.approx(leak * (4e5**2 - 1.5e5**2), rel=1e-12)
    outwards = t.replace({"C_AB": 0.0, "C_A0": 2e-11})
    assert rates(outwards, AIR)["m_A"] == pytest.approx(-leak * (4e5**2 - t.P_0**2), rel=1e-12)

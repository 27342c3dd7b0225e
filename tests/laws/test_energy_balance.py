"""Laws of the energy balance: mass and energy are kept, sealed air is adiabatic, the reservoir only gives."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.chambers import (
    heat_flow,
    heated_pressure_rate,
    temperature_rate,
    wall_area,
)
from clutchid.model.supply import governor_rate, reservoir_rate
from clutchid.model.valves import leak_flow, thermal_factor
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.simulation.stiffness import stiffness

pytestmark = pytest.mark.slow

EPS = 2.3e-16
LOAD = Load((9e5, -0.3e5, 0.6e5))
GAMMA, R, T_0, P_0 = 1.4, 288.0, 293.0, 1.095e5
pressures = st.floats(5e4, 1.2e6)
temperatures = st.floats(180, 500)
volumes = st.floats(1e-5, 1e-3)
#: None, or from far less than a piston has: of less a rate loses its digits, as a double below 2e-308.
growths = st.floats(-4e-3, 4e-3).map(lambda growth: growth if abs(growth) > 1e-20 else 0.0)
flows = st.floats(-0.05, 0.05)


def air(p: float, T: float, V: float, V_dot: float, w: float, H: float, Q: float) -> tuple[float, float]:
    p_dot = float(heated_pressure_rate(p, V, V_dot, H, Q, GAMMA))
    return p_dot, float(temperature_rate(T, p, p_dot, V, V_dot, w, R))


@given(pressures, temperatures, volumes, growths, flows, st.floats(-3e4, 3e4), st.floats(-1e4, 1e4))
def test_energy_and_mass_of_a_chamber_change_by_what_crosses_its_border(p, T, V, V_dot, w, H, Q):
    p_dot, T_dot = air(p, T, V, V_dot, w, H, Q)
    # U = p V / (gamma - 1) takes enthalpy and heat and gives work; m = p V / (R T) takes the flow
    energy = (p_dot * V + p * V_dot) / (GAMMA - 1)
    size = abs(H) + abs(Q) + GAMMA / (GAMMA - 1) * abs(p * V_dot)
    assert abs(energy - (H + Q - p * V_dot)) <= 20 * EPS * size
    m = p * V / (R * T)
    shares = (p_dot / p, V_dot / V, -T_dot / T)
    large = m * (abs(p_dot / p) + abs(V_dot / V)) + abs(w)
    assert abs(m * sum(shares) - w) <= 40 * EPS * large


@given(temperatures, temperatures)
def test_cold_air_is_dense_so_more_of_it_flows(first, other):
    cold, warm = sorted((first, other))
    assert float(thermal_factor(T_0, cold)) >= float(thermal_factor(T_0, warm))
    assert float(thermal_factor(T_0, T_0)) == 1


@given(pressures, pressures, st.floats(1e-13, 1e-9))
def test_a_leak_runs_to_the_lower_pressure_faster_than_in_proportion_and_not_between_equals(p, q, C):
    low, high = sorted((p, q))
    flow = float(leak_flow(high, low, C, 1.185))
    assert flow >= 0
    assert float(leak_flow(low, high, C, 1.185)) == -flow
    assert float(leak_flow(p, p, C, 1.185)) == 0
    assert float(leak_flow(2 * high, low, C, 1.185)) >= 2 * flow
    assert float(leak_flow(high, low, 2 * C, 1.185)) == pytest.approx(2 * flow, rel=1e-14)


@given(st.floats(1e-3, 3e-2), volumes)
def test_the_wall_of_a_chamber_is_that_of_a_cylinder(A, V):
    d, length = np.sqrt(4 * A / np.pi), V / A
    assert float(wall_area(V, A)) == pytest.approx(2 * A + np.pi * d * length, rel=1e-12)


@given(pressures, temperatures, temperatures, st.floats(1e-3, 0.1), st.floats(1.0, 5e3), st.floats(1.1, 9.0))
def test_heat_transfer_goes_with_the_root_of_pressure_and_is_the_given_one_at_1_bar_and_20_degrees(p, T, T_w, S, h, n):
    Q = float(heat_flow(p, T, T_w, S, h))
    assert float(heat_flow(n * p, T, T_w, S, h)) == pytest.approx(np.sqrt(n) * Q, rel=1e-14)
    assert float(heat_flow(p, T, T_w, n * S, h)) == pytest.approx(n * Q, rel=1e-14)
    assert float(heat_flow(1e5, 293.15, T_w, S, h)) == pytest.approx(h * S * (T_w - 293.15), rel=1e-14)
    # of the same density in another state, p ~ T, the coefficient goes with T
    hot = float(heat_flow(n * p, n * T, n * T_w, S, h))
    assert hot == pytest.approx(n**2 * Q, rel=1e-12, abs=1e-12 * h * S * T * n**2)


@given(st.floats(5e5, 1.3e6), st.floats(5e5, 1.3e6), st.floats(0.1, 100.0))
def test_a_governor_comes_back_to_its_mean_from_either_side_and_stays_there(p_G, P_S, tau_G):
    rate = governor_rate(p_G, P_S, tau_G)
    assert rate * (P_S - p_G) >= 0
    assert governor_rate(P_S, P_S, tau_G) == 0
    # the tangent reaches the mean after tau_G
    assert p_G + tau_G * rate == pytest.approx(P_S, rel=4 * EPS)


@given(st.floats(4e5, 9e5), st.floats(0.05, 3.0), st.floats(1e-3, 0.1))
def test_a_reservoir_recovers_towards_the_governors_pressure_and_a_flow_only_lowers_it(p_S, tau_S, V_S):
    at_rest = reservoir_rate(p_S, 9e5, tau_S, 0.0, V_S, R, T_0)
    assert at_rest == (9e5 - p_S) / tau_S >= 0
    assert reservoir_rate(p_S, 9e5, tau_S, 0.02, V_S, R, T_0) < at_rest
    assert reservoir_rate(9e5, 9e5, tau_S, 0.0, V_S, R, T_0) == 0


def shut(seconds: float, step: float) -> Log:
    n = round(seconds / step)
    return Log(np.arange(n) * step, {"duty_supply": np.zeros(n), "duty_exhaust": np.zeros(n)})


def chambers(log: Log, p: Parameters) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Pressure, volume and temperature of A and B."""
    V_A = p.V_0A + p.A_A * log["position"]
    V_B = p.V_0B + p.A_B * (p.y_max - log["position"])
    return [(log["pressure_a"], V_A, log["temperature_a"]), (log["pressure_b"], V_B, log["temperature_b"])]


@pytest.mark.parametrize(("y", "p_A"), list(itertools.product((1e-3, 6e-3, 12e-3), (1.5e5, 4e5, 8.5e5))))
def test_sealed_and_insulated_air_follows_the_adiabat_while_the_piston_springs(y, p_A):
    step = 1e-3 / 64
    parameters = Parameters(C_r=0.0, h_A=0.0, h_B=0.0)
    actuator = Actuator(parameters, LOAD, "energy-balance")
    log = simulate(actuator, shut(0.06, step), starts=[(y, p_A)]).log
    assert np.ptp(log["position"]) > 5e-5
    # RK4 keeps p V^gamma but for its truncation, as tests/laws/test_air.py: (h lambda)^4
    tolerance = (step * stiffness(actuator)) ** 4
    for p, V, T in chambers(log, parameters):
        for constant in (p * V**GAMMA, T * V ** (GAMMA - 1), p * V / T):
            assert np.abs(constant / constant[0] - 1).max() < tolerance
        assert np.ptp(T) > 0.1


@settings(max_examples=30)
@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1), st.integers(2, 60)), min_size=1, max_size=6))
def test_bristle_bearing_temperatures_and_reservoir_stay_within_their_limits(pattern):
    fine = 8
    duties = np.repeat([[a, b] for a, b, _ in pattern], [fine * count for *_, count in pattern], axis=0)
    time = np.arange(duties.shape[0]) * 1e-3 / fine
    actuator = Actuator(load=LOAD, model="energy-balance-stribeck")
    p = actuator.parameters
    log = simulate(actuator, Log(time, {"duty_supply": duties[:, 0], "duty_exhaust": duties[:, 1]})).log
    allowance = 1 + (1e-3 / fine * stiffness(actuator)) ** 4  # of RK4, as for the isothermal bristle
    pressed = p.F_C + p.c_F * np.abs(log["pressure_a"] - log["pressure_b"]).max()
    assert np.abs(log["deflection"]).max() <= p.R_S * pressed / p.K_z * allowance
    held = p.F_h + p.mu_h * LOAD.force(np.linspace(0.0, log["position"].max(), 1000)).max()
    assert np.abs(log["deflection_bearing"]).max() <= held / p.K_h * allowance
    assert log["pressure_supply"].max() <= p.P_S * allowance
    # Filling heats to gamma T_0 at most, and squeezing chamber A by a retreating piston 25 mm of 37 mm long further.
    hottest = p.gamma * p.T_0 * ((p.V_0A + p.A_A * p.y_max) / p.V_0A) ** (p.gamma - 1)
    assert log["temperature_a"].max() <= hottest
    # Venting from the supply pressure to the ambient without heat: T_0 (P_0 / P_S)^((gamma - 1) / gamma) of the start.
    coldest = p.T_0 * (p.P_0 / p.P_S) ** ((p.gamma - 1) / p.gamma)
    assert log["temperature_a"].min() >= coldest

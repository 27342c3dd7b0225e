"""Equations against numbers typed from their definitions, and the parts of the plant that only show in a run."""

import math

import numpy as np
import pytest

from clutchid.truck import Truck, load_curve
from clutchid.truck.assembly import at_rest
from clutchid.truck.equations.bristles import bearing_force, coulomb_force, seal_force, stribeck_force, viscous_friction
from clutchid.truck.equations.flow import orifice_flow, valve_flow
from clutchid.truck.running import run_truck
from clutchid.truck.settings import Course

STATES = Truck.parts.structure.states


def test_choked_flow_goes_with_upstream_pressure_and_the_root_of_temperature():
    at_reference = float(valve_flow(8e5, 1e5, 293.15, 19e-9, 0.3, 0.55, 0.995))
    assert at_reference == pytest.approx(1.185 * 19e-9 * 8e5)
    assert float(valve_flow(8e5, 1e5, 350.0, 19e-9, 0.3, 0.55, 0.995)) == pytest.approx(
        at_reference * math.sqrt(293.15 / 350)
    )

    def one_way(p, q, T, sign):
        return sign * valve_flow(p, q, T, 19e-9, 0.3, 0.55, 0.995)

    half = float(valve_flow(8e5, 0.65 * 8e5, 293.15, 19e-9, 0.3, 0.55, 0.995))
    assert half == pytest.approx(at_reference * 0.75**0.55)
    assert float(orifice_flow(one_way, 2e5, 8e5, 300.0, 350.0)) == pytest.approx(
        -at_reference * math.sqrt(293.15 / 350)
    )


def test_friction_has_its_textbook_values():
    assert float(coulomb_force(5e5, 1e5, 150, 2e-4)) == pytest.approx(230)
    assert float(coulomb_force(1e5, 5e5, 150, 2e-4)) == pytest.approx(230)
    assert stribeck_force(0.01, 200, 1.4, 0.01) == pytest.approx(240)
    assert stribeck_force(-0.02, 200, 1.4, 0.01) == pytest.approx(216)
    assert seal_force(0.05, 1e-4, 0.01, 1e6, 4000, 0.05, 3000) == pytest.approx(100 + 2000 * 0.01 + 150)
    assert float(viscous_friction(4000, 0.0125, 253.15, 293.15)) == pytest.approx(4000 * math.exp(0.5))
    assert float(bearing_force(-500.0, 25, 0.04)) == 25
    assert float(bearing_force(2000.0, 25, 0.04)) == pytest.approx(105)


def rested(t: Truck, milliseconds: int, **start: float) -> np.ndarray:
    """States of a truck left alone, with some of its states changed at the start."""
    x0 = at_rest(t, load_curve(t))
    for name, value in start.items():
        x0[STATES.index(name)] = value
    nothing = np.zeros(milliseconds)
    return run_truck(t, Course(nothing, np.zeros((milliseconds, 2)), nothing), start=x0).outputs.states


def test_a_cooled_reservoir_takes_the_ambient_temperature_with_its_time_constant():
    t = Truck(G_S=0.0)
    mass = t.P_S * t.V_S / (t.R * t.T_0)
    U = 0.95 * t.P_S * t.V_S / (t.gamma - 1)
    states = rested(t, 4001, U_S=U)
    T_S = (t.gamma - 1) * states[:, 7] / (states[:, 6] * t.R)
    tau = mass * t.R / (t.gamma - 1) / t.UA_S
    assert T_S[-1] == pytest.approx(t.T_0 * (1 - 0.05 * math.exp(-4 / tau)), rel=1e-9)


def test_the_governor_fills_the_reservoir_through_its_line():
    t = Truck(UA_S=0.0, dP_G=0.0, r_up=1.0, r_down=1.0)
    low = 0.98 * t.P_S
    states = rested(t, 501, m_S=low * t.V_S / (t.R * t.T_0), U_S=low * t.V_S / (t.gamma - 1))
    p_S = (t.gamma - 1) * states[:, 7] / t.V_S
    # adiabatic filling with air of T_0: p' = gamma R T_0 G (p_G - p) / V
    rate = t.gamma * t.R * t.T_0 * t.G_S / t.V_S
    assert p_S[-1] == pytest.approx(t.P_S - 0.02 * t.P_S * math.exp(-rate * 0.5), rel=1e-4)


def test_the_governor_saws_between_its_two_pressures():
    t = Truck(r_up=0.5e5, r_down=0.3e5)
    p_G = rested(t, 5000)[:, STATES.index("p_G")]
    # one sample of the rise or fall may pass the bound
    assert p_G.max() == pytest.approx(t.P_S + t.dP_G, abs=1e-3 * t.r_up)
    assert p_G.min() == pytest.approx(t.P_S - t.dP_G, abs=1e-3 * t.r_up)
    slopes = np.unique(np.round(np.diff(p_G) / 1e-3))
    assert set(slopes) == {-t.r_down, t.r_up}

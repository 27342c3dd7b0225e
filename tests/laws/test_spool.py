"""Laws of a proportional valve: its spool follows the duty cycle with a lag; without one the valve is averaged."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.simulation.stiffness import stiffness

PROPORTIONAL = "energy-balance-stribeck-proportional"


def strokes() -> Log:
    t = np.arange(0, 0.5, 1e-3)
    supply = np.interp(t, [0.02, 0.03, 0.12, 0.14, 0.18, 0.19], [0.0, 0.15, 0.6, 1.0, 1.0, 0.0])
    exhaust = np.interp(t, [0.25, 0.26, 0.40, 0.42, 0.45, 0.46], [0.0, 0.15, 0.5, 1.0, 1.0, 0.0])
    return Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})


def test_a_spool_answers_a_step_of_its_duty_cycle_with_an_exponential():
    t = np.arange(0, 0.1, 1e-3)
    step = Log(t, {"duty_supply": np.where(t >= 0.02, 0.7, 0.0), "duty_exhaust": np.where(t < 0.05, 1.0, 0.2)})
    p = Parameters(tau_vs=8e-3, tau_ve=3e-3)
    simulated = simulate(Actuator(p, Load(), PROPORTIONAL), step).log
    since = np.maximum(t - 0.02, 0.0)
    # classical Runge-Kutta: a step of h / tau = 1 / 6 is wrong by (1 / 6)^5 / 120, 1e-6, of what is left
    np.testing.assert_allclose(simulated["spool_supply"], 0.7 * (1 - np.exp(-since / p.tau_vs)), rtol=0, atol=1e-5)
    at = int(np.searchsorted(t, 0.05))
    left = simulated["spool_exhaust"][at] - 0.2
    expected = 0.2 + left * np.exp(-(t[at:] - 0.05) / p.tau_ve)
    np.testing.assert_allclose(simulated["spool_exhaust"][at:], expected, rtol=0, atol=1e-5)


def test_the_faster_its_spools_the_nearer_is_a_proportional_valve_to_an_averaged_one():
    log = strokes()
    averaged = simulate(Actuator(Parameters(), Load(), "energy-balance-stribeck"), log).log["position"]
    apart = []
    for tau in (4e-3, 2e-3, 1e-3, 5e-4):
        position = simulate(Actuator(Parameters(tau_vs=tau, tau_ve=tau), Load(), PROPORTIONAL), log).log["position"]
        apart.append(np.abs(position - averaged).max())
    halved = np.array(apart[1:]) / apart[:-1]
    assert np.all(np.abs(halved - 0.5) < 0.1), "a lag delays the stroke by itself"


def test_the_integration_of_the_fastest_possible_spool_is_stable():
    fastest = Parameters.row("tau_vs").low
    actuator = Actuator(Parameters(tau_vs=fastest, tau_ve=fastest, C_r=1e-8), Load(), PROPORTIONAL)
    assert stiffness(actuator) >= 1 / fastest * (1 - 1e-9)
    log = simulate(actuator, strokes()).log
    assert log["spool_supply"].max() == pytest.approx(1.0, abs=1e-9)
    assert log["spool_supply"].min() >= -1e-9


@pytest.mark.parametrize("name", ["tau_vs", "tau_ve", "n_vs", "R_0ve"])
def test_sensitivities_through_a_spool_are_exact(name):
    actuator = Actuator(Parameters(tau_vs=3e-3, tau_ve=5e-3, n_vs=1.2, n_ve=0.9), Load(), PROPORTIONAL)
    log = strokes()
    exact = simulate(actuator, log, sensitivities=[name]).sensitivities[name][:, 0]
    assert np.abs(exact).max() > 0
    value, errors = actuator.value(name), []
    for step in (1e-4, 1e-5, 1e-6):
        h = step * abs(value)
        up, down = (simulate(actuator.replace({name: value + d}), log).log["position"] for d in (h, -h))
        errors.append(np.abs((up - down) / (2 * h) - exact).max())
    assert min(errors) <= 1e-5 * np.abs(exact).max() + 1e-13 * 10e-3 / (1e-6 * abs(value))


def test_a_carrier_has_no_influence_on_a_proportional_valve():
    plain, carried = (
        simulate(Actuator(Parameters(T_pwm=T_pwm), Load(), PROPORTIONAL), strokes()).log["position"]
        for T_pwm in (0.0, 0.01)
    )
    assert np.array_equal(plain, carried)

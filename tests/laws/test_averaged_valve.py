"""Laws of averaged valves: the opening as a power, Eq. (11) with exponent 1, and the lag of a proportional spool."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.opening import switched_opening
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.simulation.stiffness import stiffness

SHARE, EXPONENT = sp.symbols("a n", real=True)
LAW = switched_opening(SHARE, sp.Integer(0), sp.Integer(0), EXPONENT)
power = sp.lambdify((SHARE, EXPONENT), LAW, "math")
slopes = {name: sp.lambdify((SHARE, EXPONENT), LAW.diff(by), "math") for name, by in (("a", SHARE), ("n", EXPONENT))}
shares = st.floats(-1, 2)
PROPORTIONAL = "energy-balance-stribeck-proportional"
exponents = st.floats(Parameters.row("n_vs").low, Parameters.row("n_vs").high)


@given(shares, exponents)
def test_the_opening_lies_between_closed_and_fully_open_and_has_finite_slopes(a, n):
    # a power has no finite slope at 0, so it stays 1e-9 above it
    assert power(a, n) == pytest.approx(min(max(a, 0.0), 1.0) ** n, rel=1e-9, abs=1e-9**n if a < 1e-8 else 0.0)
    assert slopes["n"](a, n) == 0.0 or 0.0 < a < 1.0
    # the steepest: n a^(n - 1) at a = 1e-9
    assert 0.0 <= slopes["a"](a, n) <= max(n, n * 1e-9 ** (n - 1)) * (1 + 1e-9)
    # -a^n ln a is at most 1 / (e n)
    assert -1 / (np.e * n) * (1 + 1e-9) <= slopes["n"](a, n) <= 0.0


def strokes() -> Log:
    """Two strokes of a proportional valve: closed, just open, in the middle and fully open."""
    t = np.arange(0, 0.5, 1e-3)
    supply = np.interp(t, [0.02, 0.03, 0.12, 0.14, 0.18, 0.19], [0.0, 0.15, 0.6, 1.0, 1.0, 0.0])
    exhaust = np.interp(t, [0.25, 0.26, 0.40, 0.42, 0.45, 0.46], [0.0, 0.15, 0.5, 1.0, 1.0, 0.0])
    return Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})


def test_a_carrier_leaves_the_exponent_without_influence():
    switched = Parameters(T_pwm=0.01, s_vs=0.07, s_ve=0.07)
    first, other = (
        simulate(Actuator(switched.replace({"n_vs": n, "n_ve": n}), Load(), "energy-balance"), strokes()).log
        for n in (1.0, 2.0)
    )
    assert np.array_equal(first["position"], other["position"])


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


def test_a_carrier_has_no_influence_on_a_proportional_valve():
    plain, carried = (
        simulate(Actuator(Parameters(T_pwm=T_pwm), Load(), PROPORTIONAL), strokes()).log["position"]
        for T_pwm in (0.0, 0.01)
    )
    assert np.array_equal(plain, carried)

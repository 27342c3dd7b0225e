"""Laws of an averaged valve whose opening is a power: Eq. (11) with exponent 1, and finite at its ends."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.opening import opening, switched_opening
from clutchid.parameters import Parameters
from clutchid.simulation import simulate

EPS = 2.3e-16
SHARE, EXPONENT = sp.symbols("a n", real=True)
LAW = switched_opening(SHARE, sp.Integer(0), sp.Integer(0), EXPONENT)
power = sp.lambdify((SHARE, EXPONENT), LAW, "math")
slopes = {name: sp.lambdify((SHARE, EXPONENT), LAW.diff(by), "math") for name, by in (("a", SHARE), ("n", EXPONENT))}
shares = st.floats(-1, 2)
exponents = st.floats(Parameters.row("n_vs").low, Parameters.row("n_vs").high)


@given(st.floats(0, 1), st.floats(0, 0.3), st.floats(0.5, 1.5))
def test_with_an_exponent_of_one_the_valve_is_that_of_equation_11(u, R_0, R_1):
    # a power has no finite slope at 0, so it stays 1e-9 above it
    degree = float(opening(u, R_0, R_1))
    assert power((u - R_0) / (R_1 - R_0), 1.0) == pytest.approx(degree, abs=1e-9)


@given(shares, exponents)
def test_the_opening_lies_between_closed_and_fully_open_and_has_finite_slopes(a, n):
    assert 0.0 <= power(a, n) <= 1.0
    # the steepest: n a^(n - 1) at a = 1e-9
    assert 0.0 <= slopes["a"](a, n) <= max(n, n * 1e-9 ** (n - 1)) * (1 + 1e-9)
    # -a^n ln a is at most 1 / (e n)
    assert -1 / (np.e * n) * (1 + 1e-9) <= slopes["n"](a, n) <= 0.0


@pytest.mark.parametrize("a", [-0.5, 0.0, 1.0, 1.5])
def test_a_closed_and_a_fully_open_valve_do_not_depend_on_the_exponent(a):
    assert power(a, 0.2) == power(a, 1.0) == power(a, 5.0) == min(max(a, 0.0), 1.0)
    assert slopes["n"](a, 1.3) == 0.0


@given(st.floats(1e-6, 1), exponents)
def test_the_exponent_is_the_slope_over_logarithms(a, n):
    h = 0.01 * a
    measured = np.log(power(a, n) / power(a - h, n)) / np.log(a / (a - h))
    assert measured == pytest.approx(n, rel=1e-9)


def strokes() -> Log:
    """Two strokes of a proportional valve: closed, just open, in the middle and fully open."""
    t = np.arange(0, 0.5, 1e-3)
    supply = np.interp(t, [0.02, 0.03, 0.12, 0.14, 0.18, 0.19], [0.0, 0.15, 0.6, 1.0, 1.0, 0.0])
    exhaust = np.interp(t, [0.25, 0.26, 0.40, 0.42, 0.45, 0.46], [0.0, 0.15, 0.5, 1.0, 1.0, 0.0])
    return Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})


@pytest.mark.parametrize("exponent", [0.6, 1.0, 1.3, 2.5])
@pytest.mark.parametrize("name", ["n_vs", "n_ve", "R_0vs", "R_1ve", "C_vs"])
def test_sensitivities_through_averaged_valves_are_exact(name, exponent):
    actuator = Actuator(Parameters(n_vs=exponent, n_ve=exponent), Load(), "energy-balance-stribeck")
    log = strokes()
    exact = simulate(actuator, log, sensitivities=[name]).sensitivities[name][:, 0]
    assert np.isfinite(exact).all()
    assert np.abs(exact).max() > 0
    value, errors = actuator.value(name), []
    for step in (1e-4, 1e-5, 1e-6):
        h = step * abs(value)
        up, down = (simulate(actuator.replace({name: value + d}), log).log["position"] for d in (h, -h))
        errors.append(np.abs((up - down) / (2 * h) - exact).max())
    # curvature at the large, rounding of 500 steps of 10 mm over 1e-6 at the small step
    assert min(errors) <= 1e-5 * np.abs(exact).max() + 1e-13 * 10e-3 / (1e-6 * abs(value))


def test_a_carrier_leaves_the_exponent_without_influence():
    switched = Parameters(T_pwm=0.01, s_vs=0.07, s_ve=0.07)
    one, other = (
        simulate(Actuator(switched.replace({"n_vs": n, "n_ve": n}), Load(), "energy-balance"), strokes()).log
        for n in (1.0, 2.0)
    )
    assert np.array_equal(one["position"], other["position"])

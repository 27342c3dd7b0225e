"""Laws of the switched valves: over whole periods they pass what the averaged valve passes, and nothing more."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.compiled import kernels
from clutchid.model.valves import opening, switched_opening
from clutchid.parameters import Parameters
from clutchid.simulation import simulate

_letters = sp.symbols("a s c d", real=True)
mean_opening = sp.lambdify(_letters, switched_opening(*_letters), "math")
shares = st.floats(0, 1)
phases = st.floats(-1, 1)
EPS = 2.3e-16


@given(shares, phases, st.integers(1, 40))
def test_over_the_samples_of_a_period_a_switched_valve_is_open_for_its_share(a, s, n):
    parts = [mean_opening(a, s, k / n, 1 / n) for k in range(n)] if n > 1 else [mean_opening(a, s, 0.0, 1.0)]
    assert min(parts) >= 0
    # d divides lengths that are rounded to 1e-16
    assert max(parts) <= 1 + 8 * n * EPS
    assert abs(np.mean(parts) - a) <= 16 * n * EPS


@given(shares, phases, st.floats(0, 0.999), st.floats(1e-3, 0.999))
def test_the_mean_over_a_sample_is_the_share_of_fine_time_in_which_the_valve_is_open(a, s, c, d):
    assume(c + d <= 2 + s)  # the period after next, which only a phase near -1 lets into a sample, is not counted
    at = c + d * (np.arange(2000) + 0.5) / 2000
    open_ = (at - s) % 1.0 < a
    # four edges at most that may lie anywhere in a fine step
    assert abs(mean_opening(a, s, c, d) - open_.mean()) <= 4 / 2000


@given(shares, phases, st.floats(0, 0.999))
def test_without_a_carrier_the_valve_is_open_by_its_share(a, s, c):
    assert mean_opening(a, s, c, 0.0) == a


@given(st.lists(st.tuples(shares, st.floats(0, 0.999), st.floats(0, 0.999)), min_size=1, max_size=5), phases)
def test_for_arrays_of_samples_the_opening_is_the_same(rows, s):
    a, c, d = (np.array(column) for column in zip(*rows, strict=True))
    opened = kernels("energy-balance").switched_opening(a, c, d, s)
    # a length is a difference of numbers up to 3, which d divides; where d is nothing, so is the carrier
    for value, row, part in zip(opened, rows, d, strict=True):
        assert value == pytest.approx(mean_opening(row[0], s, *row[1:]), abs=12 * EPS / max(part, 1e-12))


def test_for_an_array_of_duty_cycles_the_opening_is_that_of_the_text():
    u = np.linspace(0.0, 1.0, 101)
    expected = [float(opening(duty, 0.07, 0.93)) for duty in u]
    assert kernels("isothermal").opening(u, 0.07, 0.93) == pytest.approx(expected, abs=4 * EPS)


def filling(actuator: Actuator) -> Log:
    t = np.arange(0, 0.4, 1e-3)
    supply, exhaust = np.where((t > 0.03) & (t < 0.13), 0.4, 0.0), np.where(t > 0.25, 0.3, 0.0)
    return simulate(actuator, Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})).log


def test_a_fast_carrier_moves_the_piston_as_the_averaged_valve_does():
    # The pressure ripples by half a period of flow: 10 ms of 7 bar in 100 ms are 0.35 bar, 2 ms a fifth of it; on a
    # piston whose load rises by 9e5 N/m that is 0.35e5 * 12.3e-3 / 9e5 = 0.5 mm for 10 ms and 0.1 mm for 2 ms.
    def moved(T_pwm: float) -> np.ndarray:
        parameters = Parameters(T_pwm=T_pwm)
        return filling(Actuator(parameters, Load(), "energy-balance"))["position"]

    averaged = moved(0.0)
    assert np.abs(moved(0.002) - averaged).max() < 0.2e-3
    assert 0.05e-3 < np.abs(moved(0.010) - averaged).max() < 1.0e-3
    assert np.array_equal(moved(0.0005), averaged)  # several periods in a sample


@pytest.mark.parametrize("name", ["s_vs", "s_ve", "R_0vs", "R_1ve", "C_vs"])
def test_sensitivities_through_switched_valves_are_exact(name):
    t = np.arange(0, 0.4, 1e-3)
    supply, exhaust = np.where((t > 0.03) & (t < 0.13), 0.4, 0.0), np.where(t > 0.25, 0.3, 0.0)
    log = Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})
    # a period that no number of samples fills, so that no edge lies on a sample
    parameters = Parameters(T_pwm=0.0093, s_pwm=0.137, s_vs=0.21, s_ve=-0.17)
    actuator = Actuator(parameters, Load(), "energy-balance-stribeck")
    exact = simulate(actuator, log, sensitivities=[name]).sensitivities[name][:, 0]
    assert np.abs(exact).max() > 0
    value, errors = actuator.value(name), []
    for step in (1e-4, 1e-5, 1e-6):
        h = step * abs(value)
        up, down = (simulate(actuator.replace({name: value + d}), log).log["position"] for d in (h, -h))
        errors.append(np.abs((up - down) / (2 * h) - exact).max())
    # curvature at the large, rounding of 400 steps of 10 mm over 1e-6 at the small step
    assert min(errors) <= 1e-5 * np.abs(exact).max() + 1e-13 * 10e-3 / (1e-6 * abs(value))

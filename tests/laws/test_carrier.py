"""Laws of the switched valves: over whole periods they pass what the averaged valve passes, and nothing more."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.compiled import kernels
from clutchid.model.opening import (
    bridged_share,
    continued_share,
    fall,
    opening,
    passed_pulses,
    pulse_share,
    switched_opening,
)
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_carrier")

pytestmark = pytest.mark.slow

_letters = sp.symbols("a b s e c d", real=True)
passed = sp.lambdify(_letters, passed_pulses(*_letters), "math")
shares = st.floats(0, 1)
phases = st.floats(-1, 1)
travels = st.one_of(st.just(0.0), st.floats(0, 1))
EPS = 2.3e-16


_limit = sp.symbols("a i d n", real=True)
limited = sp.lambdify(_limit, switched_opening(*_limit), "math")


def _as_function(law, letters):
    """A law as a function of numbers in which only the branch that holds is computed."""
    symbols = sp.symbols(letters, real=True)
    return sp.lambdify(symbols, law(*symbols), "math")


share_of = _as_function(pulse_share, "u R_0 R_1 a_0 e")
fallen_after = _as_function(fall, "u a_0 e")
bridged = _as_function(bridged_share, "a following h")
continued = _as_function(continued_share, "a u late h")


def mean_opening(a, b, s, e, c, d):
    return limited(a, passed(a, b, s, e, c, d), d, 1.0)


def lift(x, e):
    """Lift of an armature that begins to rise at -e / 2 and arrives at e / 2; 0 or 1."""
    return np.interp(x, [-e / 2, e / 2], [0.0, 1.0]) if e > 0 else np.where(x >= 0, 1.0, 0.0)


@given(shares, st.floats(0, 1), travels, st.integers(1, 40))
def test_over_the_samples_of_a_period_a_switched_valve_passes_its_share_whatever_its_travel(a, s, e, n):
    parts = [mean_opening(a, a, s, e, k / n, 1 / n) for k in range(n)] if n > 1 else [passed(a, a, s, e, 0.0, 1.0)]
    # d divides sums of sixteen lengths up to 3, rounded to 1e-16
    assert min(parts) >= -100 * n * EPS
    assert max(parts) <= 1 + 100 * n * EPS
    assert abs(np.mean(parts) - a) <= 100 * n * EPS


@given(shares, st.floats(0, 1.5), phases, travels, st.floats(0, 0.999), st.floats(1e-3, 0.999))
def test_what_a_sample_passes_is_the_mean_lift_over_fine_time_of_pulses_with_ramps(a, b, s, e, c, d):
    # the period after next, which only a phase near -1 lets into a sample, is not counted
    assume(c + d <= 2 + s - e / 2)
    at = c + d * (np.arange(2000) + 0.5) / 2000
    pulses = sum(lift(at - k - s, e) - lift(at - k - s - (a if k >= 0 else b), e) for k in range(-4, 3))
    # six edges at most that may lie anywhere in a fine step: a jump is missed by a half of it, a ramp's corner by less
    assert abs(passed(a, b, s, e, c, d) / d - pulses.mean()) <= 6 / 2000
    assert mean_opening(a, b, s, e, c, d) == min(1.0, passed(a, b, s, e, c, d) / d)


@given(shares, st.floats(0, 1.5), phases, st.floats(0, 0.999), st.floats(1e-3, 0.999))
def test_without_travel_a_sample_passes_the_length_of_its_common_part_with_the_pulses(a, b, s, c, d):
    starts = [(k + s, k + s + (a if k >= 0 else b)) for k in (-2, -1, 0, 1)]
    common = sum(max(0.0, min(c + d, high) - max(c, low)) for low, high in starts)
    assert passed(a, b, s, 0.0, c, d) == pytest.approx(common, abs=100 * EPS)


@given(st.floats(0, 1.5), phases, travels, st.floats(0, 0.999))
def test_without_a_carrier_the_valve_is_open_by_its_share(a, s, e, c):
    # below 1e-9 a power has no finite slope, so the opening stays there
    assert mean_opening(a, a, s, e, c, 0.0) == (min(max(a, 1e-9), 1.0) if a > 0 else 0.0)


rows_of_samples = st.lists(st.tuples(shares, shares, st.floats(0, 0.999), st.floats(0, 0.999)), min_size=1, max_size=5)


@given(rows_of_samples, phases, travels)
def test_for_arrays_of_samples_the_opening_is_the_same(rows, s, e):
    a, b, c, d = (np.array(column) for column in zip(*rows, strict=True))
    for value, row in zip(kernels("energy-balance").passed_pulses(a, b, c, d, s, e), rows, strict=True):
        # sixteen terms up to 3, with half a dozen roundings each
        assert value == pytest.approx(passed(row[0], row[1], s, e, row[2], row[3]), abs=100 * EPS)


@given(shares, st.floats(0, 0.3), st.floats(0.5, 1.5))
def test_without_decay_and_travel_the_pulses_follow_equation_11(u, R_0, R_1):
    # but for the end, where the averaged valve is wide open and the switched one outlasts its period
    share, degree = share_of(u, R_0, R_1, 0.0, 0.0), float(opening(u, R_0, R_1))
    assert min(share, 1.0) == pytest.approx(degree, abs=8 * EPS)


#: A magnet that needs 0.08 of a period before its armature moves and 0.12 before it moves back; it travels for 0.15.
RISE, DECAY, TRAVEL = 0.08, 0.12, 0.15
LAW = (RISE, RISE + 1.0 - DECAY, DECAY, TRAVEL)


def armature(duties, n=4000):
    """Open time of each period, in periods, of an armature that opens and closes with its delays, on a fine grid."""
    dt, on, off, lift, current, opened = 1.0 / n, 0.0, np.inf, 0.0, [], []
    for duty in (*duties, 0.0, 0.0):
        current += [k < round(duty * n) for k in range(n)]
    for flows in current:
        on, off = (on + dt, 0.0) if flows else (0.0, off + dt)
        rate = (on > RISE) * 1.0 - (off > DECAY) * 1.0
        lift = min(1.0, max(0.0, lift + rate * dt / TRAVEL))
        opened.append(lift)
    return np.array(opened).reshape(-1, n).mean(axis=1)


def modelled(duties, n=50):
    """The same by the laws of the switched valve."""
    h = [1.0, *(fallen_after(u, DECAY, TRAVEL) for u in duties), 1.0]
    alone = [0.0, *(share_of(u, *LAW) for u in duties), 0.0, 0.0]
    late, total = share_of(1.0, *LAW) - 1.0, []
    for k, u in enumerate((*duties, 0.0, 0.0), 1):
        fallen = h[k - 1] if k < len(h) else 1.0
        a = continued(alone[k] if k < len(alone) else 0.0, u, late, fallen)
        b = bridged(alone[k - 1], u, fallen)
        total.append(np.mean([mean_opening(a, b, RISE + TRAVEL / 2, TRAVEL, i / n, 1 / n) for i in range(n)]))
    return np.array(total)


@pytest.mark.parametrize(("duties", "off"), CASES["a_valve_passes_what_an_armature_with_delays_passes"])
def test_a_valve_passes_what_an_armature_with_delays_passes(duties, off):
    assert np.abs(np.cumsum(modelled(duties)) - np.cumsum(armature(duties))).max() <= off


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_a_pulse_before_never_closes_a_valve_earlier(u, u_1, a_0, e):
    h = fallen_after(u_1, a_0, e)
    assert 0 <= h <= 1
    law = (0.1, 0.9, a_0, e)
    assert bridged(share_of(u_1, *law), u, h) >= share_of(u_1, *law) - EPS
    alone = share_of(u, *law)
    assert continued(alone, u, 0.1, h) >= alone
    assert continued(alone, u, 0.1, 1.0) == alone


def test_for_an_array_of_duty_cycles_the_opening_is_that_of_the_text():
    u = np.linspace(0.0, 1.0, 101)
    expected = [float(opening(duty, 0.07, 0.93)) for duty in u]
    assert kernels("isothermal").opening(u, 0.07, 0.93) == pytest.approx(expected, abs=4 * EPS)


def pulsed() -> Log:
    t = np.arange(0, 0.4, 1e-3)
    supply, exhaust = np.where((t > 0.03) & (t < 0.13), 0.4, 0.0), np.where(t > 0.25, 0.3, 0.0)
    return Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})


def filling(actuator: Actuator) -> Log:
    return simulate(actuator, pulsed()).log


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


def test_a_travel_that_vanishes_leads_to_the_valve_that_opens_at_once():
    def moved(travel: float) -> np.ndarray:
        parameters = Parameters(T_pwm=0.0093, s_vs=0.21, s_ve=0.17, t_vs=travel, t_ve=travel)
        names = ("C_vs", "s_vs", "t_vs")
        simulation = simulate(Actuator(parameters, Load(), "energy-balance"), pulsed(), sensitivities=names)
        assert all(np.isfinite(simulation.sensitivities[name]).all() for name in names)
        return simulation.log["position"]

    at_once, short, long = moved(0.0), moved(1e-6), moved(0.1)
    # an edge is off by an eighth of 1e-6 of a period: 1e-9 s of at most 0.3 m/s; forty edges
    assert np.abs(short - at_once).max() < 40 * 1e-9 * 0.3
    assert np.abs(long - at_once).max() > 1e-6

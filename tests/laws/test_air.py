"""Laws of the air: it flows downhill, a closed chamber keeps its mass, what flows in is what is there."""

import itertools

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.opening import opening
from clutchid.model.valves import breathing_flow, iso_flow, iso_psi, leak_flow, orifice_flow, psi
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.simulation.stiffness import stiffness

P = Parameters()
shapes = st.one_of(st.sampled_from([-1.0, -0.7, 0.0, 0.1, 0.5, 1.0]), st.floats(-1, 1))
pressures = st.floats(5e4, 1.2e6)
#: None, and from far less than any leak: of less the flow loses its digits, as a double below 2e-308.
conductances = st.one_of(st.just(0.0), st.floats(1e-20, 1e-6))
ratios = st.floats(0, 1.5)
critical = st.floats(0.1, 0.9)

indices = st.floats(0.1, 3.0)
choking = st.one_of(st.just(0.0), st.floats(0, 0.9))

_b, _m = sp.symbols("b m", real=True)
_r, _B, _B_0, _r_lam, _p_h, _p_l, _C, _u, _R_0, _R_1 = sp.symbols("r B B_0 r_lam p_h p_l C u R_0 R_1", real=True)
flow_shape = sp.lambdify((_r, _B, _B_0, _r_lam), psi(_r, _B, _B_0, _r_lam), "math")
flow = sp.lambdify((_p_h, _p_l, _C, _B), orifice_flow(_p_h, _p_l, _C, _B, P.rho_0, P.B_0, P.r_lam), "math")
iso_shape = sp.lambdify((_r, _b, _m, _r_lam), iso_psi(_r, _b, _m, _r_lam), "math")
valve_flow = sp.lambdify((_p_h, _p_l, _C, _b, _m), iso_flow(_p_h, _p_l, _C, _b, _m, P.rho_0, P.r_lam), "math")
breath = sp.lambdify((_p_h, _p_l), breathing_flow(_p_h, _p_l, P.C_r, P.B_in, P.B_out, P.rho_0, P.B_0, P.r_lam), "math")
open_at = sp.lambdify((_u, _R_0, _R_1), opening(_u, _R_0, _R_1), "math")


@given(ratios, shapes, critical, st.floats(0.9, 0.99999))
def test_the_flow_function_is_that_of_the_page_up_to_a_straight_line_to_zero(r, B, B_0, r_lam):
    """It lies between 0 and 1, falls with the ratio, and has no jump: as what is typed here."""
    at = min(r, r_lam)
    half, ellipse = np.sqrt(1 - at**2), np.sqrt(1 - max(0.0, (at - B_0) / (1 - B_0)) ** 2)
    printed = half + B * (ellipse - half if B > 0 else half - (1 - at))
    line = 1.0 if r <= r_lam else max(0.0, (1 - r) / (1 - r_lam))
    # 1 - r^2 near r = 1 loses what 1 - r_lam = 1e-5 leaves of sixteen digits
    assert flow_shape(r, B, B_0, r_lam) == pytest.approx(printed * line, abs=1e-11)


@given(pressures, pressures, conductances, shapes)
def test_air_never_flows_uphill(p_h, p_l, C, B):
    w = flow(p_h, p_l, C, B)
    if p_l > p_h:
        assert w == 0
    elif p_l == p_h:
        # 1 - r is rounded to 1e-16 and stretched by psi(r_lam) / (1 - r_lam) < 100; either sign
        assert abs(w) <= 1e-14 * P.rho_0 * C * p_h
    else:
        assert w >= 0
    if C > 0 and p_l < 0.99 * p_h and B < 1:
        assert w > 0


@given(ratios, choking, indices, st.floats(0.91, 0.99999))
def test_the_iso_flow_function_is_1_where_choked_and_0_where_no_pressure_drops(r, b, m, r_lam):
    value = iso_shape(r, b, m, r_lam)
    assert 0 <= value <= 1
    if r <= b:
        assert value == 1
    if r >= 1:
        assert value == 0
    if b < r:  # the standard, typed again, and a straight line to zero: as it is there, it has no jump and never rises
        line = 1.0 if r <= r_lam else max(0.0, (1 - r) / (1 - r_lam))
        assert value == pytest.approx((1 - ((min(r, r_lam) - b) / (1 - b)) ** 2) ** m * line, rel=1e-13)


@given(st.floats(0, 1.2), critical, st.floats(0.91, 0.99999))
def test_the_papers_flow_function_of_shape_1_is_the_iso_one_of_index_one_half(r, b, r_lam):
    # 1 - x^2 near x = 1 loses what 1 - r_lam = 1e-5 leaves of sixteen digits; the paper adds and takes an ellipse
    assert iso_shape(r, b, 0.5, r_lam) == pytest.approx(flow_shape(r, 1.0, b, r_lam), abs=1e-11)


@given(pressures, pressures, conductances, choking, indices)
def test_through_an_iso_valve_air_never_flows_uphill_and_chokes_at_its_conductance(p_h, p_l, C, b, m):
    w = valve_flow(p_h, p_l, C, b, m)
    if p_l > p_h:
        assert w == 0
    elif p_l == p_h:
        # as above: 1 - r is rounded to 1e-16 and stretched by psi(r_lam) / (1 - r_lam) < 1000; either sign
        assert abs(w) <= 1e-12 * P.rho_0 * C * p_h
    else:
        assert w >= 0
    if p_l <= 0.999 * b * p_h:
        assert w == pytest.approx(P.rho_0 * C * p_h, rel=1e-15)
    if C > 0 and p_l < 0.99 * p_h:
        assert w > 0
    # twice the pressure on both sides is twice the flow
    assert valve_flow(2 * p_h, 2 * p_l, C, b, m) == 2 * w


@given(st.floats(5e4, 3e5), st.floats(5e4, 3e5))
def test_chamber_b_breathes_towards_the_ambient(p_B, P_0):
    w_r = breath(p_B, P_0)
    assert w_r * (P_0 - p_B) >= 0
    if abs(p_B - P_0) > 1e-6 * P_0:
        assert w_r != 0


@given(st.floats(0, 1), st.floats(0, 0.8), st.floats(0.01, 1.2))
def test_an_opening_saturates_at_closed_and_at_fully_open(u, R_0, width):
    degree = open_at(u, R_0, R_0 + width)
    assert 0 <= degree <= 1
    assert (degree == 0) == (u <= R_0)
    if u >= R_0 + width:
        assert degree == 1


def filled(log: Log, area: float, dead: float, sign: float, pressure: str) -> np.ndarray:
    return log[pressure] * (dead + sign * area * log["position"])


def shut(seconds: float, step: float) -> Log:
    n = round(seconds / step)
    return Log(np.arange(n) * step, {"duty_supply": np.zeros(n), "duty_exhaust": np.full(n, P.R_0ve)})


@pytest.mark.parametrize(
    ("y", "p_A", "C_r"), list(itertools.product((1e-3, 6e-3, 12e-3), (1.5e5, 4e5, 8.5e5), (0.0, 5e-8)))
)
def test_with_closed_valves_the_air_in_chamber_a_stays_while_the_piston_springs(y, p_A, C_r):
    step = 1e-3 / 64
    actuator = Actuator(Parameters(C_r=C_r), Load((9e5, -0.3e5, 0.6e5)))
    log = simulate(actuator, shut(0.06, step), starts=[(y, p_A)]).log
    assert np.ptp(log["position"]) > 5e-5
    # RK4 keeps p V but for its truncation: a motion with rates up to lambda is wrong by (h lambda)^5 / 120 a step for
    # the 1 / (h lambda) steps that it lasts; (h lambda)^4 = 2e-6 is safely above
    tolerance = (step * stiffness(actuator)) ** 4
    mass = filled(log, P.A_A, P.V_0A, 1.0, "pressure_a")
    assert np.abs(mass / mass[0] - 1).max() < tolerance
    mass = filled(log, P.A_B, P.V_0B + P.A_B * P.y_max, -1.0, "pressure_b")
    if C_r == 0:
        assert np.abs(mass / mass[0] - 1).max() < tolerance
    else:
        assert np.abs(mass / mass[0] - 1).max() > 10 * tolerance  # it breathes


def test_what_flows_in_and_out_is_what_the_chambers_hold():
    step = 1e-3 / 16
    n = round(0.4 / step)
    t = np.arange(n) * step
    supply, exhaust = np.where(t < 0.09, 0.8, 0.0), np.where(t > 0.15, 0.6, 0.0)
    actuator = Actuator(load=Load((9e5, -0.3e5, 0.6e5)))
    log = simulate(actuator, Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})).log
    # mass flows typed again: 1.185 kg/m3, Appendix A
    w_in = np.array([flow(9e5, p, 19e-9, 0.1) for p in log["pressure_a"]]) * np.clip((supply - 0.07) / 0.86, 0, 1)
    w_out = np.array([flow(p, 1.095e5, 21.4e-9, -0.7) for p in log["pressure_a"]])
    net = w_in - w_out * np.clip((exhaust - 0.07) / 0.86, 0, 1)
    w_b = np.array([breath(p, 1.095e5) for p in log["pressure_b"]])
    held_a = filled(log, 12.3e-3, 0.148e-3, 1.0, "pressure_a") / (288 * 293)
    held_b = filled(log, 11.848e-3, 1.2e-4 + 11.848e-3 * 25e-3, -1.0, "pressure_b") / (288 * 293)
    edges = (round(0.09 / step), round(0.15 / step) + 1)
    for mass, rate in ((held_a, net), (held_b, w_b)):
        for a, b in itertools.pairwise((0, *edges, n)):
            flown = np.trapezoid(rate[a:b], dx=step)
            # trapezium rule on rates with time constants down to 1 / lambda = 0.4 ms: (h lambda)^2 / 12 of the flow;
            # and the rounding of the masses
            allowed = (step * stiffness(actuator)) ** 2 / 12 * np.trapezoid(np.abs(rate[a:b]), dx=step)
            assert abs(mass[b - 1] - mass[a] - flown) <= allowed + 1e-13 * mass[a]


def test_a_laminar_leak_grows_with_the_difference_of_the_squares_of_its_pressures():
    """So that C is its conductance at 1 bar of difference from 0 to 1 bar, and none flows at equal pressures."""
    assert leak_flow(1e5, 0.0, 2e-12, 1.185) == pytest.approx(1.185 * 2e-12 * 1e5)
    assert leak_flow(3e5, 1e5, 2e-12, 1.185) == pytest.approx(1.185 * 2e-12 * 8e5)
    assert leak_flow(1e5, 1e5, 2e-12, 1.185) == 0.0

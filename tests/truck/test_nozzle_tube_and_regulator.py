"""Air of family B: polytropes, nozzles, the tube and the regulator, against hand calculations and limits."""

import math

import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from clutchid.truck.equations import nozzle as nozzles
from clutchid.truck.equations import polytropic as gas
from clutchid.truck.equations.regulator import regulator_rate
from clutchid.truck.equations.tube import tube_flow

R, GAMMA, R_LAM = 287.05, 1.4, 0.995
_p, _q, _T, _A, _C = sp.symbols("p q T A C", positive=True)
nozzle = sp.lambdify((_p, _q, _T, _A), nozzles.nozzle_flow(_p, _q, _T, _A, R, GAMMA, R_LAM), "math")
psi = sp.lambdify(_p, nozzles.nozzle_function(_p, GAMMA, R_LAM), "math")
tube = sp.lambdify((_p, _q, _C), tube_flow(_p, _q, _C, 5e3), "math")
regulator = sp.lambdify((_p, _q), regulator_rate(_p, _q, 9e5, 1e5, 0.05), "math")
pressure, kelvin, volume = st.floats(5e4, 1.5e6), st.floats(200, 450), st.floats(1e-5, 1e-3)
exponent = st.floats(1.0, 1.4)


@given(pressure, volume, st.floats(-1e-2, 1e-2), exponent)
def test_a_closed_zone_keeps_p_times_v_to_the_exponent(p, V, V_dot, n):
    rate = gas.pressure_rate(p, V, V_dot, 0.0, n, 1e-3, R, 300.0, math.inf)
    assert rate / p + n * V_dot / V == pytest.approx(0, abs=1e-12 * abs(n * V_dot / V) + 1e-300)


@given(pressure, volume, st.floats(1e-4, 1e-2), st.floats(1e-4, 0.05), exponent)
def test_a_zone_that_empties_keeps_pressure_over_mass_to_the_exponent(p, V, m, w, n):
    T = gas.temperature(p, V, m, R)
    rate = gas.pressure_rate(p, V, 0.0, -w * T, n, m, R, 300.0, math.inf)
    assert rate / p == pytest.approx(-n * w / m, rel=1e-12)


@given(pressure, volume, st.floats(-1e-2, 1e-2), st.floats(0, 0.05), kelvin)
def test_with_the_adiabatic_exponent_the_energy_of_a_zone_follows_the_first_law(p, V, V_dot, w, T):
    rate = gas.pressure_rate(p, V, V_dot, w * T, GAMMA, 1e-3, R, 300.0, math.inf)
    stored = (rate * V + p * V_dot) / (GAMMA - 1)
    crossing = R * GAMMA / (GAMMA - 1) * T * w - p * V_dot
    assert stored == pytest.approx(crossing, rel=1e-9, abs=1e-9 * p * (abs(V_dot) + 1e-9))


@given(volume, st.floats(1e-4, 1e-2), st.floats(-1e-2, 1e-2), st.floats(-0.05, 0.05), kelvin)
def test_with_the_exponent_1_air_of_the_walls_stays_as_warm_as_they_are(V, m, V_dot, w, T_w):
    p = m * R * T_w / V
    rate = gas.pressure_rate(p, V, V_dot, w * T_w, 1.0, m, R, T_w, 0.7)
    assert rate == pytest.approx(p * (w / m - V_dot / V), rel=1e-9, abs=1e-6 * p)


def test_air_takes_the_temperature_of_the_wall_with_its_time_constant():
    m, V, T, T_w = 1e-3, 2e-4, 350.0, 300.0
    rate = gas.pressure_rate(m * R * T / V, V, 0.0, 0.0, 1.2, m, R, T_w, 2.0)
    assert rate * V / (m * R) == pytest.approx((T_w - T) / 2.0)


@given(pressure, pressure, kelvin, st.floats(0, 1e-4))
def test_air_never_flows_uphill(p, q, T, A):
    assert nozzle(p, q, T, A) >= 0
    if q >= p:
        assert nozzle(p, q, T, A) == 0
    assert tube(p, q, 2e-7) * (p - q) >= 0
    assert tube(p, q, 2e-7) == -tube(q, p, 2e-7)


def test_a_choked_nozzle_passes_what_the_textbook_says():
    # 0.0404 p A / sqrt(T) for air, times the discharge coefficient
    assert nozzle(8e5, 1e5, 293.15, 1e-5) == pytest.approx(
        nozzles.discharge(0.125) * 0.0404 * 8e5 * 1e-5 / math.sqrt(293.15), rel=1e-3
    )
    assert psi(0.528) == pytest.approx(1, abs=1e-6)


def test_the_nozzle_has_no_step_at_its_seams():
    for seam in ((2 / 2.4) ** 3.5, R_LAM, 1.0):
        # the slope is at most that of the laminar line, psi(r_lam) / (1 - r_lam) = 30
        assert abs(psi(seam + 1e-9) - psi(seam - 1e-9)) < 1e-7


@given(st.floats(0, 1), st.floats(0, 1))
def test_less_back_pressure_never_means_less_flow_but_for_the_measured_coefficient(a, b):
    low, high = sorted((a, b))
    assert psi(low) >= psi(high) - 1e-12
    assert 0.59 < nozzles.discharge(low) < 0.9


def test_the_tube_is_turbulent_but_for_small_differences():
    assert tube(5.4e5, 5e5, 1e-7) == pytest.approx(1e-7 * math.sqrt(5.4e5 * 4e4), rel=0.07)
    assert tube(5e5 + 10, 5e5, 1e-7) == pytest.approx(2 * tube(5e5 + 5, 5e5, 1e-7), rel=1e-2)


def test_the_regulator_opens_in_proportion_to_its_droop_and_closes_at_the_set_pressure():
    assert [regulator(0.0, p) for p in (9.1e5, 9e5, 8.5e5, 8e5, 5e5)] == pytest.approx([0, 0, 10, 20, 20])
    assert regulator(0.5, 8.5e5) == 0
    assert regulator(1.0, 9.1e5) == pytest.approx(-20)

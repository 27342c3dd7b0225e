"""Laws of the forces: friction takes energy, its bristle stays bounded, an end stop only pushes."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.model.friction import bearing_force, coulomb_force, deflection_rate, friction_force, stribeck_force
from clutchid.model.motion import acceleration, stop_force
from clutchid.parameters import Parameters

P = Parameters()
REACH = P.F_C / P.K_z
velocities = st.floats(-1, 1)


def pushed(d: float, d_dot: float) -> float:
    return float(stop_force(d, d_dot, P.K_stop, P.D_stop, P.d_stop))


@given(velocities)
def test_a_bristle_at_its_limit_is_never_bent_further(v):
    # exactly 0 when it slides on; the difference of two equal numbers of size v is off by their rounding
    assert float(deflection_rate(v, REACH, P.K_z, P.F_C)) <= 4 * 2.3e-16 * abs(v)
    assert float(deflection_rate(v, -REACH, P.K_z, P.F_C)) >= -4 * 2.3e-16 * abs(v)


@given(velocities, st.floats(1, 5), st.floats(1e-3, 0.1), st.floats(-9e5, 9e5), st.floats(0, 1e-3))
def test_steady_friction_falls_from_static_friction_and_grows_with_pressure_on_either_side(v, R_S, v_S, dp, c_F):
    pressed = float(coulomb_force(1e6 + dp, 1e6, P.F_C, c_F))
    assert pressed == pytest.approx(P.F_C + c_F * abs(dp), rel=1e-9)
    steady = float(stribeck_force(v, pressed, R_S, v_S))
    assert steady == pytest.approx(pressed * (1 + (R_S - 1) * math.exp(-((v / v_S) ** 2))), rel=1e-14)


@given(velocities, st.floats(-1, 1), st.floats(0, 8e5), st.sampled_from([1.0, P.R_S]))
def test_friction_never_gives_more_power_than_the_bristle_stores_with_and_without_static_friction(v, part, dp, R_S):
    pressed = float(coulomb_force(dp, 0.0, P.F_C, P.c_F))
    steady = float(stribeck_force(v, pressed, R_S, P.v_S))
    z = part * R_S * pressed / P.K_z  # as far as static friction can bend it
    z_dot = float(deflection_rate(v, z, P.K_z, steady))
    power = float(friction_force(v, z, z_dot, P.D_v, P.K_z, P.D_zdot)) * v
    stored = P.K_z * z * z_dot
    # D_zdot takes R_S - 1 = 0.3 of its share back at most, D_v gives as much as all of it
    assert power - stored >= -1e-15 * (abs(power) + abs(stored))


@given(st.floats(-1e4, 1e4), st.floats(0.1, 200), st.floats(0, 0.3))
def test_a_bearing_slips_at_a_share_of_the_load_and_without_load_at_its_own_friction(f_l, F_h, mu_h):
    assert float(bearing_force(f_l, F_h, mu_h)) == pytest.approx(F_h + mu_h * max(0.0, f_l), rel=1e-14)


@given(velocities, st.floats(-1, 1), st.floats(-1e3, 1e4))
def test_a_bearing_never_gives_more_power_than_its_deflection_stores(v, part, f_l):
    held = float(bearing_force(f_l, P.F_h, P.mu_h))
    z_h = part * held / P.K_h
    z_h_dot = float(deflection_rate(v, z_h, P.K_h, held))
    power, stored = P.K_h * z_h * v, P.K_h * z_h * z_h_dot
    # what is left is heat: K_h z_h^2 K_h / g |v|
    assert power - stored >= -1e-15 * (abs(power) + abs(stored))
    assert power - stored <= held * abs(v) * (1 + 1e-14)


@given(st.floats(-1e-3, 1e-3), st.floats(-2, 2))
def test_an_end_stop_is_a_parabola_up_to_a_depth_and_a_line_beyond_and_never_pulls(d, d_dot):
    spring = P.K_stop * (d**2 / (2 * P.d_stop) if d < P.d_stop else d - P.d_stop / 2)
    force = spring + P.D_stop * min(1.0, d / P.d_stop) * d_dot
    assert pushed(d, d_dot) == pytest.approx(max(0.0, force) if d > 0 else 0.0, rel=1e-12, abs=1e-9)


@given(st.floats(1e4, 2e5), st.floats(1e-3, 2e-2), st.floats(1e-4, 1.1e-2), st.floats(1, 50))
def test_a_vented_actuator_is_in_balance_whatever_its_areas(P_0, A_A, difference, M):
    A_B = max(1e-5, A_A - difference)
    # 0 but for the rounding of three products of the size of A_A P_0
    assert abs(acceleration(P_0, P_0, 0.0, 0.0, 0.0, A_A, A_B, P_0, M)) <= 8 * 2.3e-16 * A_A * P_0 / M

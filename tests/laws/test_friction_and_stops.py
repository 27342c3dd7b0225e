"""Laws of the forces: friction takes energy, its bristle stays bounded, an end stop only pushes."""

from hypothesis import given
from hypothesis import strategies as st

from clutchid.model.friction import bearing_force, coulomb_force, deflection_rate, friction_force, stribeck_force
from clutchid.model.motion import acceleration, stop_force
from clutchid.parameters import Parameters

P = Parameters()
REACH = P.F_C / P.K_z
velocities = st.floats(-1, 1)
depths = st.floats(-1e-3, 1e-3)


def pushed(d: float, d_dot: float) -> float:
    return float(stop_force(d, d_dot, P.K_stop, P.D_stop, P.d_stop))


@given(velocities)
def test_a_bristle_at_its_limit_is_never_bent_further(v):
    # exactly 0 when it slides on; the difference of two equal numbers of size v is off by their rounding
    assert float(deflection_rate(v, REACH, P.K_z, P.F_C)) <= 4 * 2.3e-16 * abs(v)
    assert float(deflection_rate(v, -REACH, P.K_z, P.F_C)) >= -4 * 2.3e-16 * abs(v)


@given(velocities, st.floats(-1, 1))
def test_friction_never_gives_more_power_than_the_bristle_stores(v, part):
    z = part * REACH
    z_dot = float(deflection_rate(v, z, P.K_z, P.F_C))
    power = float(friction_force(v, z, z_dot, P.D_v, P.K_z, P.D_zdot)) * v
    stored = P.K_z * z * z_dot
    assert power - stored >= -1e-15 * (abs(power) + abs(stored))


@given(velocities, velocities, st.floats(1, 5), st.floats(1e-3, 0.1))
def test_steady_friction_falls_from_static_to_coulomb_friction_and_knows_no_direction(first, other, R_S, v_S):
    slow, fast = sorted((abs(first), abs(other)))
    at = [float(stribeck_force(v, P.F_C, R_S, v_S)) for v in (slow, fast, -fast)]
    rounded = 1 + 8 * 2.3e-16
    assert P.F_C / rounded <= at[1] <= at[0] * rounded <= P.F_C * R_S * rounded**2
    assert at[1] == at[2]
    assert float(stribeck_force(0.0, P.F_C, R_S, v_S)) == P.F_C * (1 + (R_S - 1))
    assert float(stribeck_force(first, P.F_C, 1.0, v_S)) == P.F_C


@given(st.floats(1e5, 1e6), st.floats(1e5, 1e6), st.floats(0, 1e-3))
def test_pressure_on_either_side_presses_the_seals_alike(p_A, p_B, c_F):
    pressed = float(coulomb_force(p_A, p_B, P.F_C, c_F))
    assert pressed == float(coulomb_force(p_B, p_A, P.F_C, c_F)) >= P.F_C
    assert float(coulomb_force(p_A, p_A, P.F_C, c_F)) == float(coulomb_force(p_A, p_B, P.F_C, 0.0)) == P.F_C


@given(velocities, st.floats(-1, 1), st.floats(0, 8e5))
def test_stribeck_friction_never_gives_more_power_than_the_bristle_stores(v, part, dp):
    pressed = float(coulomb_force(dp, 0.0, P.F_C, P.c_F))
    steady = float(stribeck_force(v, pressed, P.R_S, P.v_S))
    z = part * P.R_S * pressed / P.K_z  # as far as static friction can bend it
    z_dot = float(deflection_rate(v, z, P.K_z, steady))
    power = float(friction_force(v, z, z_dot, P.D_v, P.K_z, P.D_zdot)) * v
    stored = P.K_z * z * z_dot
    # D_zdot takes R_S - 1 = 0.3 of its share back at most, D_v gives as much as all of it
    assert power - stored >= -1e-15 * (abs(power) + abs(stored))


@given(st.floats(-1e4, 1e4), st.floats(0.1, 200), st.floats(0, 0.3))
def test_a_bearing_slips_at_a_share_of_the_load_and_without_load_at_its_own_friction(f_l, F_h, mu_h):
    force = float(bearing_force(f_l, F_h, mu_h))
    assert force >= F_h
    assert force == float(bearing_force(f_l, F_h, 0.0)) + mu_h * max(0.0, f_l)
    if f_l <= 0:
        assert force == F_h


@given(velocities, st.floats(-1, 1), st.floats(-1e3, 1e4))
def test_a_bearing_never_gives_more_power_than_its_deflection_stores(v, part, f_l):
    held = float(bearing_force(f_l, P.F_h, P.mu_h))
    z_h = part * held / P.K_h
    z_h_dot = float(deflection_rate(v, z_h, P.K_h, held))
    power, stored = P.K_h * z_h * v, P.K_h * z_h * z_h_dot
    # what is left is heat: K_h z_h^2 K_h / g |v|
    assert power - stored >= -1e-15 * (abs(power) + abs(stored))
    assert power - stored <= held * abs(v) * (1 + 1e-14)


@given(depths, st.floats(-2, 2))
def test_an_end_stop_never_pulls_and_a_free_piston_feels_nothing(d, d_dot):
    force = pushed(d, d_dot)
    assert force >= 0
    if d <= 0:
        assert force == 0


@given(st.floats(0, 1e-3), st.floats(0, 1e-3), st.floats(0, 0.3))
def test_an_end_stop_pushes_harder_the_deeper_and_the_faster_it_is_hit(first, other, d_dot):
    shallow, deep = sorted((first, other))
    assert pushed(shallow, d_dot) <= pushed(deep, d_dot) * (1 + 1e-15)
    assert pushed(deep, -d_dot) <= pushed(deep, d_dot)


@given(st.floats(-0.3, 0.3))
def test_an_end_stop_takes_hold_without_a_step(d_dot):
    # at first touch: of order d, so a nanometre is worth D / d_stop |v| d = 0.03 N at most
    tiny = 1e-9
    assert pushed(tiny, d_dot) <= tiny * P.D_stop / P.d_stop * abs(d_dot) + P.K_stop * tiny**2 / P.d_stop
    # where the parabola goes over into the line: the slope is K_stop + D_stop / d_stop |v| on either side
    below, above = pushed(P.d_stop - tiny, d_dot), pushed(P.d_stop + tiny, d_dot)
    assert abs(above - below) <= 2 * tiny * (P.K_stop + P.D_stop / P.d_stop * abs(d_dot)) * (1 + 1e-6)


@given(st.floats(1e4, 2e5), st.floats(1e-3, 2e-2), st.floats(1e-4, 1.1e-2), st.floats(1, 50))
def test_a_vented_actuator_is_in_balance_whatever_its_areas(P_0, A_A, difference, M):
    A_B = max(1e-5, A_A - difference)
    # 0 but for the rounding of three products of the size of A_A P_0
    assert abs(acceleration(P_0, P_0, 0.0, 0.0, 0.0, A_A, A_B, P_0, M)) <= 8 * 2.3e-16 * A_A * P_0 / M

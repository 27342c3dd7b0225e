"""Pressure from the load: Eqs. (25), (26) and the full balance, against motions whose forces are known by hand."""

import numpy as np
import pytest

from clutchid.estimation.result import Recording, errors_over
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.study.pressure import measured_motion, pressures, static_estimate

pytestmark = pytest.mark.slow

ACTUATOR = Actuator(load=Load((9e5, -0.3e5, 0.6e5)))
P = ACTUATOR.parameters
T = np.arange(0, 0.5, 1e-3)


def moving(position, velocity, deflection, pressure=None):
    """A recording whose measured and simulated motion are the same, with chamber B vented."""
    vented = np.full(T.size, P.P_0)
    states = {"position": position, "velocity": velocity, "deflection": deflection, "pressure_b": vented}
    simulated = Log(T, {**states, "pressure_a": vented})
    measured = Log(T, {"position": position} | ({} if pressure is None else {"pressure_a": pressure}))
    return Recording(measured, simulated, errors_over([(measured, simulated)]), ())


def test_at_rest_without_deflection_both_pressures_are_the_load_over_the_area():
    still = np.full(T.size, 6e-3)
    samples = pressures(ACTUATOR, moving(still, 0 * T, 0 * T))
    expected = P.P_0 + ACTUATOR.load.force(still) / P.A_A
    for name in ("static_simulated", "static_measured", "balanced_measured"):
        np.testing.assert_allclose(getattr(samples, name), expected, rtol=1e-12)


@pytest.mark.parametrize("v", [0.02, -0.02])
def test_in_steady_sliding_the_balance_adds_coulomb_and_viscous_friction(v):
    y = 12e-3 + v * (T - 0.25)
    samples = pressures(ACTUATOR, moving(y, np.full(T.size, v), np.full(T.size, np.sign(v) * P.F_C / P.K_z)))
    friction = (np.sign(v) * P.F_C + P.D_v * v) / P.A_A
    # Along the measured motion the seal starts undeflected and follows with rate K_z |v| / F_C = 100 1/s; away from
    # the ends, where smoothing sees a corner, the difference is the same once exp(-100 t) has died out.
    inner = slice(300, 460)
    np.testing.assert_allclose((samples.balanced_measured - samples.static_measured)[inner], friction, rtol=1e-9)


def test_acceleration_enters_with_the_mass():
    actuator, v = ACTUATOR.replace(M=100), 0.02 + 0.1 * T
    samples = pressures(actuator, moving(5e-3 + 0.02 * T + 0.05 * T**2, v, 0 * T))
    inner = slice(300, 460)  # as above; a held velocity rises by 1e-4 m/s a sample, D_zdot makes 0.5 N of 10 N of it
    expected = (100 * 0.1 + P.F_C + P.D_v * v) / P.A_A
    difference = samples.balanced_measured - samples.static_measured - expected
    assert np.abs(difference[inner]).max() * P.A_A < 0.6


def test_errors_are_rms_against_the_measured_pressure_and_missing_samples_are_left_out():
    still = np.full(T.size, 6e-3)
    true = P.P_0 + ACTUATOR.load.force(still) / P.A_A
    pressure = true + 1e4
    pressure[::3] = np.nan
    assert pressures(ACTUATOR, moving(still, 0 * T, 0 * T, pressure)).rms("static_simulated") == pytest.approx(1e4)
    assert pressures(ACTUATOR, moving(still, 0 * T, 0 * T)).rms("static_simulated") is None


@pytest.mark.parametrize("speed", [0.1, -0.1])
def test_the_static_estimate_takes_only_slow_samples_with_a_pressure_in_either_direction(speed):
    y = np.where(T < 0.25, 5e-3, 5e-3 + speed * (T - 0.25))
    pressure = np.full(T.size, 4e5)
    pressure[:50] = np.nan
    position, force = static_estimate(Log(T, {"position": y, "pressure_a": pressure}), ACTUATOR, 0.01)
    assert position.size == pytest.approx(200, abs=31)  # half the smoothing window
    np.testing.assert_allclose(force, P.A_A * (4e5 - P.P_0), rtol=1e-12)
    assert static_estimate(Log(T, {"position": y}), ACTUATOR, 0.01)[0].size == 0


def test_a_parabola_has_its_velocity_and_its_acceleration():
    y, v, a = measured_motion(Log(T, {"position": 4e-3 + 0.3 * T - 0.5 * 0.7 * T**2}))
    inner = slice(40, -40)
    np.testing.assert_allclose(y[inner], (4e-3 + 0.3 * T - 0.5 * 0.7 * T**2)[inner], atol=1e-12)
    np.testing.assert_allclose(v[inner], (0.3 - 0.7 * T)[inner], atol=1e-9)
    np.testing.assert_allclose(a[inner], -0.7, atol=1e-6)


def test_motion_is_derived_across_missing_samples_and_uneven_time():
    t = T + 2e-4 * np.sin(50 * T)
    y = 3e-3 + 0.04 * t
    y[100:110] = np.nan
    position, velocity, acceleration = measured_motion(Log(t, {"position": y}))
    inner = slice(40, -40)
    np.testing.assert_allclose(position[inner], 3e-3 + 0.04 * t[inner], atol=1e-9)
    np.testing.assert_allclose(velocity[inner], 0.04, atol=1e-9)
    np.testing.assert_allclose(acceleration[inner], 0.0, atol=1e-6)


def test_friction_and_acceleration_bring_the_pressure_nearer_to_the_measured_one(study):
    table = study.tables["pressure_errors"]
    for which in ("first", "second"):
        for motion in ("simulated", "measured"):
            static, balanced = (table.column(f"{which}_{kind}_{motion}") for kind in ("static", "balanced"))
            assert all(b < s for s, b in zip(static, balanced, strict=True))

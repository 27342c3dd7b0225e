"""The lag of a sensor, to first order: against its differential equation, and its derivative against differences."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from clutchid.log import Log
from clutchid.parameters import Parameters
from clutchid.simulation.comparison import SHORTEST_LAG
from clutchid.simulation.sensors import lag_coefficients, lagged, sensor_output, without_sensors
from fixtures.sensors import lag_derivative

STEP = 1e-3
TIME = STEP * np.arange(300)

#: A position in m: a ramp that ends, as a stroke does, and a sine of 15 Hz.
MOTIONS = {
    "ramp": lambda t: 0.25 * np.clip(np.asarray(t) - 0.05, 0.0, 0.06),
    "sine": lambda t: 5e-3 * np.sin(2 * np.pi * 15.0 * np.asarray(t)),
}


def solved(samples, tau, start):
    """The lag of what goes straight from sample to sample, by a solver that goes from sample to sample."""
    shown = [start]
    for before, now in pairwise(samples):
        slope = (now - before) / STEP
        answer = solve_ivp(
            lambda t, y, x=before, s=slope: (x + s * t - y) / tau, (0.0, STEP), [shown[-1]], rtol=1e-11, atol=1e-15
        )
        shown.append(float(answer.y[0, -1]))
    return np.array(shown)


@pytest.mark.parametrize("tau", [0.3e-3, 1.5e-3, 8e-3])
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_lag_is_the_solution_of_its_differential_equation(motion, tau):
    samples = MOTIONS[motion](TIME[:150])
    start = samples[0] - tau * (samples[1] - samples[0]) / STEP
    assert lagged(samples, tau, STEP) == pytest.approx(solved(samples, tau, start), abs=1e-11)


@given(st.floats(0.0, 20e-3), st.floats(-1.0, 1.0))
def test_a_ramp_is_shown_exactly_one_lag_late(tau, velocity):
    shown = lagged(velocity * TIME, tau, STEP)
    assert shown == pytest.approx(velocity * (TIME - tau), abs=1e-13)


@given(st.floats(0.0, 0.99))
def test_a_lag_of_a_small_part_of_a_sample_is_a_shift_to_first_order(part):
    x, tau = MOTIONS["sine"](TIME), part * SHORTEST_LAG * STEP
    assert lagged(x, tau, STEP) == pytest.approx(x - tau * np.gradient(x, STEP), rel=0, abs=1e-16)


def test_columns_are_shown_each_on_its_own():
    both = np.column_stack([motion(TIME) for motion in MOTIONS.values()])
    shown = lagged(both, 1.5e-3, STEP)
    for column, motion in enumerate(MOTIONS.values()):
        assert shown[:, column] == pytest.approx(lagged(motion(TIME), 1.5e-3, STEP), rel=0, abs=1e-16)


def test_where_a_short_lag_becomes_a_shift_the_record_hardly_jumps():
    x, least = MOTIONS["sine"](TIME), SHORTEST_LAG * STEP
    below, above = (lagged(x, tau, STEP) for tau in (0.999 * least, 1.001 * least))
    # 10 µs of lag: half a sample times the curvature, which is at most 5 mm (2 pi 15 Hz)**2
    assert np.abs(above - below).max() < least * STEP * 5e-3 * (2 * np.pi * 15.0) ** 2


def test_of_a_single_sample_the_lag_is_not_known():
    sample = np.array([3e-3])
    assert np.array_equal(lagged(sample, 2e-3, STEP), sample)
    assert np.array_equal(lag_derivative(sample, sample, 2e-3, STEP), [0.0])


@pytest.mark.parametrize("motion", MOTIONS)
@given(tau=st.floats(0.05e-3, 20e-3) | st.floats(0.0, 0.5 * SHORTEST_LAG * STEP))
def test_the_slope_of_a_lag_is_that_of_differences(motion, tau):
    x, h = MOTIONS[motion](TIME), 1e-5 * max(abs(tau), 0.1e-3)
    central = (lagged(x, tau + h, STEP) - lagged(x, tau - h, STEP)) / (2 * h)
    slope = lag_derivative(x, lagged(x, tau, STEP), tau, STEP)
    assert slope == pytest.approx(central, abs=1e-6 * np.abs(central).max())


def test_what_is_not_known_stays_so_and_each_stretch_is_lagged_on_its_own():
    values = MOTIONS["sine"](TIME)
    values[:5] = values[100:120] = values[200] = values[202] = values[-3:] = np.nan
    record = sensor_output(values, TIME, 2e-3, 1e-4)
    assert np.array_equal(np.isnan(record), np.isnan(values))
    for part in (slice(5, 100), slice(120, 200), slice(203, 297)):
        assert record[part] == pytest.approx(lagged(values[part], 2e-3, STEP) + 1e-4, abs=1e-15)
    assert record[201] == values[201] + 1e-4, "of a sample alone the lag is not known"


def test_nothing_lasts_across_a_hole_in_time():
    time = np.r_[TIME[:100], TIME[:100] + 5.0]
    values = np.repeat([15e-3, 1e-3], 100) + 1e-3 * np.r_[TIME[:100], TIME[:100]]
    record = sensor_output(values, time, 8e-3, 1e-4)
    for part in (slice(0, 100), slice(100, 200)):
        assert record[part] == pytest.approx(sensor_output(values[part], time[part], 8e-3, 1e-4), abs=1e-12)
    earlier = without_sensors(Log(time, {"position": record}), Parameters(tau_y=8e-3, e_y=1e-4))
    assert np.abs(earlier["position"] - values).max() < 2e-5


def test_without_its_sensor_a_ramp_is_shown_as_it_was():
    """What a sensor of lag tau shows now was so tau ago: a log without sensors is earlier by it, not later."""
    p, ramp = Parameters(tau_y=8e-3, e_y=1e-4), 1e-3 + 0.2 * TIME[:200]
    shown = 1e-4 + 1e-3 + 0.2 * (TIME[:200] - 8e-3)
    log = without_sensors(Log(TIME[:200], {"position": shown}), p)
    assert log["position"][:-20] == pytest.approx(ramp[:-20], abs=1e-12)


def test_without_values_there_is_no_output():
    assert np.isnan(sensor_output(np.full(20, np.nan), TIME[:20], 2e-3, 1e-4)).all()


@given(st.floats(0.02e-3, 20e-3), st.floats(0.1e-3, 20e-3))
def test_the_recursion_of_a_lag_is_the_exponential_of_its_differential_equation(tau, dt):
    coefficients = lag_coefficients(tau, np.array([dt]))[0, :3]
    # output, input and its slope: d/dt (output, x, slope) = ((x - output)/tau, slope, 0)
    moved = expm(np.array([[-dt / tau, dt / tau, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))[0]
    assert coefficients == pytest.approx([moved[0], moved[1] - moved[2], moved[2]], abs=1e-12)


@pytest.mark.parametrize("q", [0.004, 0.3, 1.0, 7.0])
def test_the_slopes_of_the_recursion_of_a_lag_are_those_of_differences(q):
    dt, h = np.array([2e-3]), 1e-6
    up, down = (lag_coefficients((q + step) * dt[0], dt)[0, :3] for step in (h, -h))
    # a third derivative of at most 1 and rounding over the step, both relative to a lag in samples
    assert lag_coefficients(q * dt[0], dt)[0, 3:] * dt[0] == pytest.approx((up - down) / (2 * h), abs=1e-8)


def test_where_a_short_lag_becomes_a_shift_the_recursion_hardly_jumps():
    dt = np.array([1e-3])
    below, above = (lag_coefficients(part * SHORTEST_LAG * 1e-3, dt)[0, :3] for part in (0.999, 1.001))
    # the coefficients change by the lag in samples, and a decay of exp(-100) is nothing
    assert below == pytest.approx(above, abs=1.01 * 0.002 * SHORTEST_LAG)

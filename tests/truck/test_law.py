"""Magnets, ramps, governor, sensor and controller, as plain functions and inside the compiled loop."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.truck import law
from clutchid.truck.settings import SAMPLE, TICK

#: The functions as Python's own: a compiled one for the numbers of each test would take longer than they do.
duty, governor, lag_output, lift_rate, magnet, quantised, request, snapped = (
    getattr(law, name).py_func
    for name in ("duty", "governor", "lag_output", "lift_rate", "magnet", "quantised", "request", "snapped")
)

CONTROLLER = (5e-3, 0.012, 0.12e-3, 0.25e-3)


def lifts(on_ticks: int, times: tuple[float, float, float, float], ticks: int = 200) -> np.ndarray:
    """Lift of a valve at every tick after a pulse of `on_ticks`."""
    flux, lift, out = 0.0, 0.0, []
    for tick in range(ticks):
        out.append(lift)
        rate = lift_rate(flux, tick < on_ticks, lift, times[1], times[3], TICK)
        flux = magnet(flux, tick < on_ticks, times[0], times[2], TICK)
        lift = snapped(lift + rate * TICK)
    return np.array(out)


def test_a_valve_opens_after_its_dead_time_along_its_ramp_and_closes_the_same_way():
    lift = lifts(60, (2e-3, 1e-3, 3e-3, 2e-3))
    assert np.all(lift[:21] == 0)
    assert lift[25] == pytest.approx(0.5)
    assert np.all(lift[30:91] == 1)
    assert lift[100] == pytest.approx(0.5)
    assert np.all(lift[110:] == 0)


def test_a_pulse_shorter_than_the_dead_time_does_not_open_the_valve():
    assert np.all(lifts(19, (2e-3, 1e-3, 3e-3, 2e-3)) == 0)
    assert lifts(25, (2e-3, 1e-3, 3e-3, 2e-3)).max() == pytest.approx(0.5)


@given(st.integers(1, 150), *[st.integers(0, 40).map(lambda n: n * TICK)] * 4)
def test_a_lift_stays_between_closed_and_open_and_ends_closed(on, pull, opening, drop, closing):
    lift = lifts(on, (pull, max(opening, TICK), drop, max(closing, TICK)), 400)
    assert np.all((lift >= 0) & (lift <= 1))
    assert lift[-1] == 0


@given(st.floats(-1e-3, 30e-3), st.floats(1e-6, 1e-4))
def test_a_quantised_position_is_a_multiple_within_half_a_quantum(value, quantum):
    read = quantised(value, quantum)
    assert abs(read - value) <= quantum / 2 * (1 + 1e-9)
    assert math.isclose(read / quantum, round(read / quantum), abs_tol=1e-9 * (1 + abs(read / quantum)))


def test_the_lag_follows_a_ramp_exactly():
    tau, slope, out = 1.5e-3, 0.2, 0.0
    for k in range(100):
        out = lag_output(out, slope * k * TICK, slope * (k + 1) * TICK, tau, TICK)
    t = 100 * TICK
    assert out == pytest.approx(slope * (t - tau * (1 - math.exp(-t / tau))), rel=1e-12)


def test_the_governor_works_between_its_two_pressures_with_memory():
    P_S, d = 9e5, 0.2e5
    assert governor(False, P_S - d, P_S, d)
    assert governor(True, P_S, P_S, d)
    assert not governor(False, P_S, P_S, d)
    assert not governor(True, P_S + d, P_S, d)


def test_the_controller_holds_in_its_dead_band_and_moves_outside_with_the_right_sign():
    assert request(10e-3, 10.05e-3, 0.0, False, 0.0, *CONTROLLER) == (0.0, True, 0.0)
    assert request(10e-3, 10.2e-3, 0.0, True, 0.0, *CONTROLLER) == (0.0, True, 0.0)
    assert request(10e-3, 10.2e-3, 0.0, False, 0.0, *CONTROLLER)[0] < 0
    assert request(10e-3, 8e-3, 0.0, False, 0.0, *CONTROLLER)[0] == pytest.approx(0.4)
    assert request(10e-3, 2e-3, 0.0, False, 0.0, *CONTROLLER)[0] == 1.0


def test_the_controller_brakes_before_it_arrives():
    assert request(10e-3, 9e-3, 0.2, False, 0.0, *CONTROLLER)[0] < 0


def test_an_engaged_clutch_is_vented_and_then_left_alone():
    ask, holding, venting = request(0.0, 5e-3, 0.0, True, 0.0, *CONTROLLER)
    assert (ask, holding) == (-1.0, False)
    asked = []
    for _ in range(1000):
        ask, holding, venting = request(0.0, 0.1e-3, 0.0, False, venting, *CONTROLLER)
        asked.append(ask)
    assert asked.count(-1.0) == pytest.approx(0.4 / SAMPLE, abs=2)
    assert asked[-1] == 0.0


@given(st.floats(0, 1), st.floats(0, 0.5), st.sampled_from([50, 100, 200]))
def test_a_duty_cycle_is_a_whole_number_of_ticks_past_the_dead_zone(ask, dead, ticks):
    value = duty(ask, dead, False, 1 / ticks)
    assert 0 <= value <= 1
    assert value * ticks == pytest.approx(round(value * ticks), abs=1e-9)
    if ask == 0:
        assert value == 0
    elif ask == 1:
        assert value == pytest.approx(1)
    else:
        assert value >= dead - 0.5 / ticks - 1e-12


def test_bang_bang_drive_knows_only_open_and_shut():
    assert {duty(ask, 0.3, True, 0.05) for ask in (0.0, 0.1, 0.3, 0.7, 1.0)} == {0.0, 1.0}

"""Spools, solenoids, ports and the scale of the position sensor, as plain functions and inside the compiled loop."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.truck import TruckB, law, respond
from clutchid.truck.parts.sensor import coloured, coloured_noise, gained_pressure
from clutchid.truck.settings import SAMPLE, TICK, TICKS

poppet, port, sensor_position, solenoid, spool = (
    getattr(law, name).py_func for name in ("poppet", "port", "sensor_position", "solenoid", "spool")
)


def moved(u: float, ticks: int, **kind: float) -> np.ndarray:
    """Position of a spool after every tick of a step to `u`."""
    given_ = {"second_order": True, "tau": 2e-3, "omega": 500.0, "zeta": 0.7} | kind
    x, v, out = 0.0, 0.0, []
    for _ in range(ticks):
        x, v = spool(x, u, v, tick=TICK, **given_)
        out.append(x)
    return np.array(out)


def test_a_spool_of_second_order_answers_a_step_as_the_textbook_says():
    t, omega, zeta = np.arange(1, 151) * TICK, 500.0, 0.7
    damped = omega * math.sqrt(1 - zeta**2)
    lost = np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    # semi-implicit Euler with steps of 25 us: its error is of the order omega h = 1.25 %
    assert moved(0.6, 150) == pytest.approx(0.6 * (1 - lost), abs=0.6 * 0.0125)


def test_a_spool_of_first_order_answers_a_step_exactly():
    t = np.arange(1, 101) * TICK
    assert moved(-0.4, 100, second_order=False) == pytest.approx(-0.4 * (1 - np.exp(-t / 2e-3)), rel=1e-9)


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=20), st.floats(0.1, 1.2), st.floats(100, 1000))
def test_a_spool_stays_within_its_travel(commands, zeta, omega):
    x, v = 0.0, 0.0
    for u in commands:
        for _ in range(20):
            x, v = spool(x, u, v, True, 1.0, omega, zeta, TICK)
            assert -1 <= x <= 1


def test_a_port_is_closed_within_its_overlap_and_open_at_the_end():
    assert [port(x, 0.1, 1.2) for x in (-1.0, 0.0, 0.1, 1.0)] == [0, 0, 0, 1]
    assert port(0.55, 0.1, 1.0) == pytest.approx(0.5)
    assert port(0.55, 0.1, 2.0) == pytest.approx(0.25)
    assert [poppet(x) for x in (0.0, 1.0)] == [0, 1]


def test_an_armature_leaves_its_seat_when_the_magnet_beats_the_spring_and_returns():
    tau, travel, spring = 1e-3, 1e-3, 0.36
    current = lift = speed = 0.0
    lifts = []
    for tick in range(200):
        current, lift, speed = solenoid(current, lift, speed, tick < 80, tau, travel, spring, TICK)
        lifts.append(lift)
    lifts = np.array(lifts)
    # the current reaches 0.6, whose square beats the spring, after -tau ln 0.4 = 0.92 ms
    assert np.all(lifts[:9] == 0)
    assert np.all((lifts >= 0) & (lifts <= 1))
    # afterwards at most twice the least time, with the growing force of the magnet
    assert lifts[10 + 25] == 1.0
    assert np.all(lifts[40:80] == 1)
    # it holds until the square of the current has fallen to 1.5 times the spring, -tau ln sqrt(0.54) = 0.31 ms
    assert np.all(lifts[80:83] == 1)
    assert np.all(lifts[120:] == 0)


@pytest.mark.parametrize("kind", ["first-order", "second-order"])
def test_the_compiled_spool_moves_as_the_plain_one_does(kind):
    truck = TruckB(spool=kind, duty="continuous", x_0s=0.05, n_x=1.3)
    duty = np.repeat([0.0, 0.7, 0.2, 1.0, 0.0], 7)
    lift = respond(truck, duty, np.zeros(35)).truth.states["lift_supply"]
    x = v = 0.0
    for k in range(35):
        assert lift[k] == pytest.approx(port(x, 0.05, 1.3), abs=1e-12)
        for _ in range(TICKS):
            x, v = spool(x, duty[k], v, kind == "second-order", truck.tau_x, 1 / truck.t_n, truck.zeta_x, TICK)


def test_each_compiled_solenoid_moves_as_the_plain_one_with_its_own_numbers_does():
    truck = TruckB(valve="solenoids", tau_is=0.5e-3, t_xs=0.8e-3, tau_ie=1.1e-3, t_xe=1.6e-3, f_x=0.3, T_pwm=0.01)
    share, nothing = np.full(30, 0.6), np.zeros(30)
    numbers = {"lift_supply": (0.5e-3, 0.8e-3), "lift_exhaust": (1.1e-3, 1.6e-3)}
    for name, duties in (("lift_supply", (share, nothing)), ("lift_exhaust", (nothing, share))):
        states = respond(truck, *duties).truth.states
        current = lift = speed = 0.0
        for k in range(30):
            assert states[name][k] == pytest.approx(poppet(lift), abs=1e-9)
            for tick in range(TICKS):
                on = (k % 10) * TICKS + tick < 60
                current, lift, speed = solenoid(current, lift, speed, on, *numbers[name], 0.3, TICK)
        assert not states[({*numbers} - {name}).pop()].any()


@pytest.mark.parametrize("valve", ["spool", "solenoids"])
def test_a_latched_duty_waits_for_the_period_and_a_continuous_one_does_not(valve):
    duty, nothing = np.zeros(60), np.zeros(60)
    duty[13:] = 1.0
    for how, opens in (("latched", 20), ("continuous", 13)):
        lift = respond(TruckB(valve=valve, duty=how), duty, nothing).truth.states["lift_supply"]
        first = int(np.argmax(lift > 0))
        assert opens < first <= opens + 4
        log = respond(TruckB(valve=valve, duty=how), duty, nothing).log
        assert int(np.argmax(log["duty_supply"] > 0)) == opens


def test_the_gain_of_the_position_sensor_varies_by_its_share_and_is_right_at_the_rest_and_the_far_end():
    y = np.linspace(-1e-4, 25e-3, 501)
    shown = np.array([sensor_position(position, -1e-4, 25.1e-3, 0.008) for position in y])
    gain = np.gradient(shown, y)
    assert gain.max() == pytest.approx(1.008, abs=1e-4)
    assert gain.min() == pytest.approx(0.992, abs=1e-4)
    assert [shown[0], shown[-1]] == pytest.approx([y[0], y[-1]])


def test_the_sensor_shows_the_scaled_position_and_the_truth_does_not():
    truck = TruckB(e_lin=0.01, tau_y=0.0, e_y=2e-5)
    duty = np.zeros(400)
    duty[10:250] = 1.0
    response = respond(truck, duty, np.zeros(400))
    true = response.truth.states["position"]
    assert np.ptp(true) > 0.02
    wave = 0.01 * truck.y_max / (2 * math.pi) * np.sin(2 * math.pi * (true - truck.e_y) / truck.y_max)
    # the zero of the sensor lies at the rest, but for the error of its estimate, of which the gain takes its share
    assert response.log["position"] - true == pytest.approx(wave, abs=1e-9)


def test_noise_has_its_size_and_its_colour():
    rng = np.random.default_rng(0)
    noise = coloured(200_000, 5e-3, rng)
    assert noise.std() == pytest.approx(1, rel=0.03)
    lags = [float(np.mean(noise[k:] * noise[: noise.size - k])) for k in (1, 5)]
    assert lags == pytest.approx([math.exp(-0.2), math.exp(-1.0)], abs=0.03)
    position = coloured_noise(TruckB(s_y=1e-5, s_c_y=2e-5), 100_000, rng)
    assert position.std() == pytest.approx(math.hypot(1e-5, 2e-5), rel=0.05)
    assert SAMPLE == 1e-3


def test_the_pressure_sensor_has_an_error_of_its_gain_about_ambient():
    truck = TruckB(e_gain=0.01, e_p=500.0, s_p=0.0, q_p=0.0, P_0=1e5)
    read = gained_pressure(truck, np.array([1e5, 6e5]), np.random.default_rng(0))
    assert read == pytest.approx([1e5 + 500, 6e5 + 5500])

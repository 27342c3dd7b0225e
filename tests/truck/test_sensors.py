"""Sensors: offset, noise and quantum of the pressure, messages on the bus, drop-outs."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.truck import Truck
from clutchid.truck.parts.sensor import offset_pressure, vibrating_noise
from clutchid.truck.recorder import bus_log, with_dropouts

N = 20_000


def test_the_pressure_is_measured_with_its_offset_its_noise_and_its_quantum():
    rng = np.random.default_rng(0)
    truck = Truck(e_p=3e3, s_p=800.0, q_p=500.0)
    error = offset_pressure(truck, np.full(N, 4e5), rng) - 4e5
    assert np.array_equal(error, 500.0 * np.round(error / 500.0))
    # mean and standard deviation of 20,000 samples: 4 standard errors of 1 / sqrt(n) and 1 / sqrt(2 n) of the noise
    noise = np.hypot(800.0, 500.0 / np.sqrt(12))
    assert error.mean() == pytest.approx(3e3, abs=4 * noise / np.sqrt(N))
    assert error.std() == pytest.approx(noise, rel=4 / np.sqrt(2 * N))


def test_without_a_quantum_the_pressure_is_any_number():
    read = offset_pressure(Truck(e_p=0.0, s_p=0.0, q_p=0.0), np.array([123456.789]), np.random.default_rng(0))
    assert read.tolist() == [123456.789]


def test_the_position_has_white_noise_and_the_vibration_of_the_engine():
    quiet = vibrating_noise(Truck(s_y=0.0, a_vib=5e-5), N, np.random.default_rng(1))
    noisy = vibrating_noise(Truck(s_y=4e-5, a_vib=0.0), N, np.random.default_rng(1))
    # sine and half order of 0.3 times it; over 20 s of a wandering speed some hundred periods: 5 %
    assert quiet.std() == pytest.approx(5e-5 * np.sqrt((1 + 0.3**2) / 2), rel=0.05)
    assert np.abs(quiet).max() <= 1.3 * 5e-5
    assert noisy.std() == pytest.approx(4e-5, rel=4 / np.sqrt(2 * N))


@pytest.fixture
def log() -> Log:
    time = np.arange(5000) / 1000
    columns = {"position": np.arange(5000.0), "duty_supply": np.arange(5000) / 5000}
    return Log(time, {**columns, "duty_exhaust": np.zeros(5000), "pressure_a": -np.arange(5000.0)}, "run")


def test_a_message_on_the_bus_has_the_last_values_of_the_controller_and_not_the_next(log):
    bus = bus_log(Truck(e_clock=0.0, j_clock=0.0), log, np.random.default_rng(2))
    assert np.diff(bus.time) == pytest.approx(0.01, abs=2e-9)
    sent = np.floor(bus.time * 1000 + 1e-6)
    for name, sign in (("position", 1), ("pressure_a", -1), ("duty_supply", 1 / 5000)):
        assert bus[name] == pytest.approx(sign * sent)


def test_a_clock_on_the_bus_runs_fast_and_stamps_late_by_its_jitter_at_most(log):
    true = bus_log(Truck(e_clock=0.0, j_clock=0.0), log, np.random.default_rng(2)).time
    heard = bus_log(Truck(e_clock=1e-3, j_clock=2e-3), log, np.random.default_rng(2)).time
    late = heard - true * (1 + 1e-3)
    assert late.min() > -1e-6
    assert 1e-3 < late.max() < 2e-3 + 1e-6
    assert np.all(np.diff(heard) > 0)


def test_a_drop_out_takes_the_measurements_of_5_to_60_ms_and_no_inputs(log):
    lengths = []
    for seed in range(40):
        holed = with_dropouts(log, 1, np.random.default_rng(seed))
        gone = np.flatnonzero(np.isnan(holed["position"]))
        assert np.array_equal(np.diff(gone), np.ones(gone.size - 1))
        assert np.array_equal(np.isnan(holed["pressure_a"]), np.isnan(holed["position"]))
        assert np.array_equal(holed["duty_supply"], log["duty_supply"])
        lengths += [gone.size] if gone[-1] < len(log) - 1 else []
    # both samples at the ends of a stretch of a whole number of milliseconds
    assert 5 <= min(lengths) < 12
    assert 50 < max(lengths) <= 62

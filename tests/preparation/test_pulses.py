"""Recordings that are slower than the pulses of the valves: the pulses are put together where that can be."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimate.calibrate import fit_with_priors
from clutchid.estimate.request import FitRequest
from clutchid.estimate.shooting.fit import SHOOTING
from clutchid.estimate.verification import on_samples
from clutchid.log import Log
from clutchid.preparation.carrier import centred
from clutchid.preparation.pulses import STAMP_STD, find_phase, pulsed, resampled
from clutchid.uncertainty.calibration import Calibration

#: The carrier of the drives in these tests: a new duty cycle every 10 ms.
PERIOD = 0.01


def every(log, n, first=0):
    """Each n-th sample of a recording, as a slow recorder keeps it."""
    return replace(log, time=log.time[first::n], columns={name: v[first::n] for name, v in log.columns.items()})


@pytest.fixture(scope="module")
def switched(plant):
    """The plant with valves that a carrier switches, whose periods start with those of the drive."""
    return plant.replace({"T_pwm": PERIOD, "s_pwm": 0.0, "s_vs": 0.07, "s_ve": 0.07})


@pytest.fixture(scope="module")
def bus(switched, recorded_by):
    """6 s of the plant with a load that is 8 % higher, at 100 Hz, position only."""
    load = switched.load
    worn = switched.replace({name: 1.08 * value for name, value in zip(load.names, load.theta, strict=True)})
    return every(recorded_by(worn, seconds=6.0, name="bus", driven=1), 10, first=4).without("pressure_a")


def slow(duty, step=0.01):
    time = 0.003 + step * np.arange(len(duty))
    return Log(
        time, {"duty_supply": np.array(duty), "duty_exhaust": np.zeros(time.size), "position": 1e-3 * time}, "slow"
    )


def test_samples_stay_and_duty_cycles_change_where_periods_start():
    log = slow([0.0, 0.5, 0.8, 0.8])
    fine = resampled(log, PERIOD, 0.2)
    at = np.searchsorted(fine.time, log.time)
    assert np.array_equal(fine.time[at], log.time)
    assert np.array_equal(fine["position"][at], log["position"])
    assert np.isnan(np.delete(fine["position"], at)).all()
    assert np.allclose(np.diff(fine.time), 2.5e-4)
    changed = fine.time[1:][np.diff(fine["duty_supply"]) != 0.0]
    assert changed == pytest.approx([0.012, 0.022], abs=2.5e-4), "two tenths of a period after each tenth millisecond"
    assert fine["duty_supply"][-1] == 0.8


def test_duty_cycles_change_later_for_a_position_that_is_late():
    log = slow([0.0, 0.5, 0.8, 0.8])
    fine = resampled(log, PERIOD, 0.2, delay=2e-3)
    changed = fine.time[1:][np.diff(fine["duty_supply"]) != 0.0]
    assert changed == pytest.approx([0.014, 0.024], abs=2.5e-4)


def test_a_period_without_a_sample_keeps_the_duty_cycle_before():
    log = slow([0.0, 0.5, 0.7, 0.9], step=0.0105)
    fine = resampled(log, 0.01, 0.0)
    numbers = np.floor(fine.time / 0.01)
    assert [fine["duty_supply"][numbers == n][-1] for n in range(4)] == [0.0, 0.5, 0.7, 0.9]


def test_into_a_hole_in_time_no_samples_are_put():
    log = slow([0.0] * 20)
    gone = replace(log, time=np.where(np.arange(20) < 10, log.time, log.time + 0.5))
    fine = resampled(gone, PERIOD, 0.0)
    assert len(fine) == 18 * 40 + 2
    assert np.diff(fine.time).max() == pytest.approx(0.51)


def test_a_recorder_of_1_khz_needs_nothing(switched, drive_log):
    found = pulsed(drive_log, switched, True)
    assert found.log is drive_log
    assert found.warning is None


def test_the_phase_of_a_slow_recording_is_found(switched, bus):
    assert abs(centred(find_phase(bus, switched))) < 0.1
    found = pulsed(bus, switched, False)
    assert len(found.log) == 40 * (len(bus) - 1) + 1
    assert found.phase_std == pytest.approx(STAMP_STD / PERIOD)


def test_a_load_is_read_from_100_hz(switched, bus):
    known = Calibration((), np.zeros((0, 0)))
    fit = fit_with_priors(SHOOTING, [bus], switched, FitRequest(("position",), ("load",), calibration=known))
    y = np.linspace(0.5e-3, 20e-3, 40)
    true = 1.08 * switched.load.force(y)
    assert np.sqrt(np.mean((fit.actuator.load.force(y) - true) ** 2)) < 0.01 * true.max()
    assert "s_pwm@bus" in fit.parameters
    one = fit.recordings["bus"]
    assert one.measured is bus
    assert np.array_equal(one.simulated.time, bus.time)
    assert np.sqrt(np.mean((one.simulated["position"] - bus["position"]) ** 2)) < 1e-3


def test_a_recording_too_slow_for_the_pulses_is_a_warning(switched, bus):
    known = Calibration((), np.zeros((0, 0)))
    fit = fit_with_priors(SHOOTING, [every(bus, 2)], switched, FitRequest(("position",), ("load",), calibration=known))
    assert fit.warnings[0] == (
        "bus: a sample every 20 ms does not resolve the pulses of valves with a carrier period of 10 ms; they are "
        "averaged, which can cause large errors of the load. Record at 1 kHz."
    )
    assert fit.status == "warning"
    assert not any("s_pwm" in name for name in fit.parameters)


def test_a_simulation_on_a_finer_raster_is_given_at_the_samples(adapted, worn_log):
    one = adapted.recordings["worn"]
    assert on_samples(one, worn_log) is one
    coarse = on_samples(one, every(worn_log, 7))
    assert np.array_equal(coarse.simulated["pressure_a"], one.simulated["pressure_a"][::7])
    assert len(coarse.measured) == len(coarse.simulated)

"""Verification of a fit by shooting: simulated with the recording's own phase, compared as its sensors see it."""

import numpy as np
import pytest

import clutchid
from clutchid.estimation.verification import verification
from clutchid.parameters import Parameters
from clutchid.simulation.sensors import with_sensors, without_sensors
from fixtures.changed_logs import thinned

BOTH = ("position", "pressure_a")

#: Noise of the recordings: m and Pa.
POSITION_NOISE, PRESSURE_NOISE = 3e-5, 2e3


@pytest.fixture(scope="module")
def actuator(plant):
    """A plant with switched valves and with sensors that are slow and off, as a calibration leaves it."""
    sensors = {"tau_y": 2e-3, "tau_p": 2e-3, "e_y": 2e-4, "e_p": 3e3}
    return plant.replace({"T_pwm": 0.01, "s_pwm": 0.3, "s_vs": 0.07, "s_ve": 0.07, **sensors})


@pytest.fixture(scope="module")
def other(actuator, recorded_by):
    """A recording of it that began at another phase of the carrier."""
    return recorded_by(actuator.replace({"s_pwm": -0.2}), seconds=4.0, seed=7, name="other")


def test_a_recording_of_the_true_actuator_has_errors_of_its_noise_only(actuator, other):
    verified, warnings = verification(actuator, [other], None, BOTH, True)
    errors = verified["other"].errors
    assert warnings == []
    # the phase is found to 0.02 of a period, which moves the piston by less than the noise
    assert errors.position_rms == pytest.approx(POSITION_NOISE, rel=0.35)
    assert errors.pressure_a_rms == pytest.approx(PRESSURE_NOISE, rel=0.25)


def test_without_sensors_and_phase_the_errors_would_be_theirs(actuator, other):
    errors = verification(actuator, [other], None, BOTH)[0]["other"].errors
    assert errors.position_rms > 1.5e-4  # 0.2 mm of offset
    assert errors.pressure_a_rms > 3e3


def test_a_bus_log_is_verified_with_the_pulses_between_its_samples(actuator, recorded_by):
    fast = recorded_by(actuator.replace({"s_pwm": 0.0}), seconds=6.0, seed=7, name="bus", driven=1)
    slow = thinned(fast, 10, first=4)
    verified, warnings = verification(actuator, [slow], None, BOTH, True)
    assert warnings == []
    recording = verified["bus"]
    assert recording.measured is slow
    assert np.array_equal(recording.simulated.time, slow.time)
    # averaged valves would miss by 0.2 mm
    assert recording.errors.position_rms < 1e-4


def test_a_verified_recording_keeps_what_was_measured_and_the_models_own_motion(actuator, other):
    recording = verification(actuator, [other], None, BOTH, True)[0]["other"]
    assert recording.measured is other
    assert np.array_equal(recording.simulated.time, other.time)
    # the simulated piston is where it is, not where the sensor says, which is 0.2 mm higher
    assert np.median(other["position"] - recording.simulated["position"]) == pytest.approx(2e-4, abs=2e-5)


def test_a_recording_without_pressure_is_verified_by_its_position(actuator, other):
    errors = verification(actuator, [other.without("pressure_a")], None, BOTH, True)[0]["other"].errors
    assert errors.position_rms == pytest.approx(POSITION_NOISE, rel=0.25)
    assert errors.pressure_a_rms is None


@pytest.mark.slow
def test_a_fit_by_shooting_is_verified_so(calibrated, worn, worn_log, recorded_by):
    unused = recorded_by(worn, seconds=5.0, seed=9, name="unused").without("pressure_a")
    result = clutchid.fit(
        worn_log, calibrated.actuator, request=clutchid.FitRequest(calibration=calibrated.calibration), verify=[unused]
    )
    assert result.method == "shooting"
    through, blind = (
        verification(result.actuator, [unused], None, through_sensors=s)[0]["unused"] for s in (True, False)
    )
    assert result.verification["unused"].errors == through.errors
    assert through.errors.position_rms < blind.errors.position_rms


def test_what_the_sensors_did_is_undone(actuator, recorded_by):
    log = recorded_by(actuator, seconds=3.0, seed=None)
    true = recorded_by(actuator.replace(dict.fromkeys(("tau_y", "tau_p", "e_y", "e_p"), 0.0)), 3.0, None)
    back = without_sensors(log, actuator.parameters)
    # a lag to first order leaves a tau**2: 2 ms at 50 m/s² are 0.2 mm, but only where a stroke begins or ends
    assert np.sqrt(np.mean((back["position"] - true["position"]) ** 2)) < 2e-5
    assert np.sqrt(np.mean((back["pressure_a"] - true["pressure_a"]) ** 2)) < 2e3
    assert np.array_equal(without_sensors(log, Parameters())["position"], log["position"])


def test_a_single_sample_is_sensed_without_a_lag(plant, drive_log):
    sample = clutchid.simulate(plant, drive_log.slice(0, 10)).log.slice(0, 1)
    recorded = with_sensors(sample, Parameters(tau_p=2e-3, e_p=5e3))
    assert recorded["pressure_a"] - sample["pressure_a"] == pytest.approx([5e3])


def test_a_result_that_predicts_another_recording_no_better_than_its_start_is_no_improvement(own_log):
    first, second = own_log.slice(0, 3000), own_log.slice(3000, 6000)
    better = clutchid.fit(first, verify=[second])
    (gain,) = better.gains.values()
    assert gain > 0.5
    assert not any(reason.startswith("no improvement") for reason in better.verdict.reasons)
    again = clutchid.fit(first, better.actuator, verify=[second])
    (gain,) = again.gains.values()
    assert abs(gain) < 0.01
    (reason,) = [reason for reason in again.verdict.reasons if reason.startswith("no improvement")]
    assert "keep those, or fit recordings like it" in reason
    assert again.verdict.trust != "good"


@pytest.fixture(scope="module")
def own_log():
    """The paper's model with a load 10 % above the start values, and white noise."""
    log = clutchid.bundled_recording().slice(0, 6000)
    truth = clutchid.Actuator(load=clutchid.Load((9.5e5, -4e4, 0.0)))
    noise = 2e-5 * np.random.default_rng(4).standard_normal(len(log))
    return log.with_columns(position=clutchid.simulate(truth, log).log["position"] + noise)

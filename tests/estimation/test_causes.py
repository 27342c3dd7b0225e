"""Faults of the inputs of a recording, named by an observer, and the tests of a reading that need no search."""

import numpy as np
import pytest

import clutchid
from clutchid.estimation.assess.pressure import pressure_test
from clutchid.estimation.assess.reasons import named_cause
from clutchid.estimation.causes import compared_causes
from clutchid.inference.uncertainty.conditions import RecordedConditions, supply_difference
from clutchid.log import INPUTS, Log
from clutchid.strokes.travel import Travel, travel_change, travel_of


def without(log, *names):
    return log.without(*(name for name in names if name in log))


@pytest.fixture(scope="module")
def recording(calibrated, recorded_by, worn):
    """A recording of the worn clutch from position alone, by another drive."""
    return without(recorded_by(worn, seconds=4.0, seed=5, name="other", driven=1), "pressure_a")


def shifted(log, samples):
    return log.with_columns(position=np.append(np.full(samples, log["position"][0]), log["position"][:-samples]))


def filtered(log, tau):
    shown, decay = log["position"].copy(), np.exp(-1e-3 / tau)
    for i in range(1, shown.size):
        shown[i] = decay * shown[i - 1] + (1.0 - decay) * shown[i]
    return log.with_columns(position=shown)


FAULTS = {
    "shift": (lambda log: shifted(log, 30), 0.03, 2e-3),
    "filter": (lambda log: filtered(log, 0.02), 0.02, 3e-3),
    "gain of the duty cycles": (lambda log: log.with_columns(**{n: 0.7 * log[n] for n in INPUTS}), 0.7, 0.05),
    "duty_exhaust inverted": (lambda log: log.with_columns(duty_exhaust=1.0 - log["duty_exhaust"]), 0.0, 0.0),
    "swapped": (lambda log: log.with_columns(duty_supply=log["duty_exhaust"], duty_exhaust=log["duty_supply"]), 0, 0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_the_inputs_is_named_with_its_size(recording, calibrated, name):
    spoil, size, tolerance = FAULTS[name]
    causes = compared_causes(spoil(recording), calibrated.actuator, calibrated.calibration)
    assert (causes[0].name, named_cause(causes)) == (name, causes[0])
    assert causes[0].size == pytest.approx(size, abs=tolerance)


@pytest.mark.slow
def test_a_sound_recording_has_no_cause(recording, calibrated):
    assert named_cause(compared_causes(recording, calibrated.actuator, calibrated.calibration)) is None


@pytest.mark.parametrize(("bar", "named"), [(7.64, True), (9.66, True), (8.2, False), (8.65, False), (6.5, False)])
def test_a_supply_that_differs_by_an_atmosphere_is_named(bar, named):
    time, closed = np.arange(100) / 1e3, np.zeros(100)
    log = Log(time, {"pressure_supply": np.full(100, bar * 1e5), **dict.fromkeys(INPUTS, closed)})
    difference = supply_difference(log, clutchid.Actuator(), RecordedConditions(supply=8.65e5))
    assert (difference is not None) == named


def test_a_pressure_that_is_off_by_more_than_sensor_and_band_contradicts():
    measured = np.full(1000, 4e5)
    within, beyond = (pressure_test(measured, measured + by, np.full(1000, 5e3), 1e-3) for by in (4e3, 15e3))
    assert not within.deviates
    assert beyond.deviates
    assert beyond.contradicts
    of_wide_band = pressure_test(measured, measured + 15e3, np.full(1000, 2e4), 1e-3)
    assert of_wide_band.deviates
    assert not of_wide_band.contradicts


@pytest.mark.parametrize(("gain", "suspect"), [(0.9, True), (0.95, True), (1.0, False), (1.05, True), (1.1, True)])
def test_the_far_stop_checks_the_gain_of_a_position(gain, suspect):
    time = np.arange(0.0, 1.0, 1e-3)
    pressed = Log(time, {"position": np.minimum(0.1 * time, 0.025), "duty_supply": np.ones(1000),
                         "duty_exhaust": np.zeros(1000)})  # fmt: skip
    now = travel_of(pressed.with_columns(position=gain * pressed["position"]))
    change = travel_change(travel_of(pressed), now)
    assert (change.checked, change.suspect) == (True, suspect)
    assert change.ratio == pytest.approx(gain)


@pytest.mark.parametrize(("gain", "suspect"), [(0.9, False), (1.0, False), (1.05, False), (1.1, True)])
def test_more_travel_than_ever_is_suspect_and_less_is_not(gain, suspect):
    change = travel_change(Travel(0.0234), Travel(gain * 0.0234))
    assert (change.checked, change.suspect) == (False, suspect)
    assert suspect or "cannot be checked here" in change.sentence


def test_a_rest_that_fell_by_wear_moves_no_far_stop():
    assert not travel_change(Travel(0.0234, 0.025), Travel(0.0242, 0.0258), subtracted=-8e-4).suspect

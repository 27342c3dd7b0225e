"""Recordings with samples that are no values, at the doors of fits, checks and simulations."""

import numpy as np
import pytest

from clutchid import fit
from clutchid.errors import DataError
from clutchid.preparation.inspection import inspect
from clutchid.preparation.prepare import with_usable_samples
from clutchid.simulation import simulate

SENTENCE = "position: 2 samples beyond the stops, the first at 0.700 s (65.53 mm), treated as missing."


@pytest.fixture(scope="module")
def spiked(drive_log):
    log = drive_log.slice(0, 1500)
    return log.with_columns(position=np.where(np.isin(np.arange(1500), (700, 900)), 65.535e-3, log["position"]))


@pytest.fixture(scope="module")
def zeroed_anew(drive_log):
    return drive_log.with_columns(position=drive_log["position"] + 1e-3 * (np.arange(len(drive_log)) >= 3000))


def test_what_is_no_value_is_missing_once_and_good_recordings_are_as_they_were(plant, drive_log, spiked):
    (good, bad) = with_usable_samples([drive_log, spiked], plant)
    assert good is drive_log
    assert np.flatnonzero(np.isnan(bad["position"])).tolist() == [700, 900]
    assert bad.warnings == (f"log: {SENTENCE}",)
    (again,) = with_usable_samples([bad], plant)
    assert again is bad


def test_the_check_of_a_recording_and_a_simulation_say_it_with_the_same_words(plant, spiked):
    (check,) = [check for check in inspect(spiked, plant).checks if check.name == "values of position"]
    assert (check.grade, check.value, check.sentence) == ("suspect", "2 missing from 0.700 s", SENTENCE)
    assert not any(check.grade == "bad" for check in inspect(spiked, plant).checks)
    assert f"log: {SENTENCE}" in simulate(plant, spiked).warnings


@pytest.mark.slow
def test_a_fit_says_it_and_its_errors_are_those_without_the_samples(plant, spiked):
    missing = spiked.with_columns(position=np.where(spiked["position"] > 0.06, np.nan, spiked["position"]))
    result, expected = (fit(log, plant, free=plant.load.names[:1]) for log in (spiked, missing))
    assert f"log: {SENTENCE}" in result.warnings
    assert result.errors == expected.errors
    assert result.actuator == expected.actuator


def test_a_position_with_two_zeros_is_refused_with_what_to_do(plant, drive_log, zeroed_anew):
    words = "jumps at 3.000 s and stays there, .* cut the recording there, and estimate its parts one by one"
    with pytest.raises(DataError, match=words):
        with_usable_samples([drive_log, zeroed_anew], plant)
    with pytest.raises(DataError, match=words):
        fit(zeroed_anew, plant)
    (check,) = [check for check in inspect(zeroed_anew, plant).checks if check.name == "values of position"]
    assert check.value == "a jump from 3.000 s"

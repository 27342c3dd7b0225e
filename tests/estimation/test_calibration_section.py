"""Section of a calibration in a parameter file: what is written is read, and what is wrong is one sentence."""

from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.estimation.parameter_file import (
    ParameterFile,
    calibration_section,
    read_parameters,
    write_parameters,
)
from clutchid.inference.uncertainty.calibration import Calibration, Origin, PositionOnlyErrors
from clutchid.inference.uncertainty.conditions import NOT_RECORDED, RecordedConditions
from clutchid.model import Actuator
from fixtures.cases import case_tables
from fixtures.sentences import one_sentence

CASES = case_tables(__file__, "test_calibration_section")

#: A calibration of one parameter and of the load, and its section in a file.
KEPT = Calibration(
    ("C_vs",),
    np.array([[1e-20]]),
    position_only=PositionOnlyErrors(
        ((), ("supply pressure",), ("supply pressure", "valves")),
        ("theta_1", "C_vs", "R_0vs"),
        np.array([[120.0, -0.01, 2e-3], [80.0, 0.02, 1e-3], [60.0, 0.03, -1e-3]]),
        np.array([-41.5, -39.25, -40.0]),
        1.75,
    ),
    theta=(9e5, -3e4, 6e4),
    theta_covariance=np.diag([1e8, 1e6, np.inf]),
)
SECTION = "[fit.calibration]\nnames = ['C_vs']\ncovariance = [[1e-20]]\n"


def calibration_of(path, calibration, baseline=None, **about):
    """What is read of a calibration that was written to a file."""
    write_parameters(
        ParameterFile(Actuator(), {}, {"calibration": calibration_section(calibration, baseline), **about}), path
    )
    return read_parameters(path).calibration


def test_a_calibration_is_read_with_its_load_and_its_file(tmp_path):
    path = tmp_path / "CAL.toml"
    stored = calibration_of(path, KEPT, created="2026-11-22T10:00:00+00:00", trust="good", method="prediction-error")
    assert (stored.names, stored.theta, stored.method) == (KEPT.names, KEPT.theta, "prediction-error")
    np.testing.assert_array_equal(stored.covariance, KEPT.covariance)
    np.testing.assert_array_equal(stored.theta_covariance, KEPT.theta_covariance)
    assert stored.converged
    digest = sha256(path.read_bytes()).hexdigest()
    assert stored.origin == Origin("CAL.toml", "2026-11-22T10:00:00+00:00", digest, "good")


def test_the_errors_of_position_alone_are_read_as_they_were(tmp_path):
    errors, expected = calibration_of(tmp_path / "CAL.toml", KEPT).position_only, KEPT.position_only
    assert (errors.hypotheses, errors.names, errors.dispersion) == (
        expected.hypotheses,
        expected.names,
        expected.dispersion,
    )
    np.testing.assert_array_equal(errors.shifts, expected.shifts)
    np.testing.assert_array_equal(errors.log_evidence, expected.log_evidence)
    without = replace(KEPT, position_only=None)
    assert calibration_of(tmp_path / "CAL.toml", without).position_only is None


def test_a_calibration_that_saw_no_settled_rest_keeps_that_and_an_older_file_saw_one(tmp_path):
    assert calibration_of(tmp_path / "CAL.toml", replace(KEPT, vented=False)).vented is False
    assert "vented" not in SECTION
    (tmp_path / "OLDER.toml").write_text(SECTION)
    assert read_parameters(tmp_path / "OLDER.toml").calibration.vented is True


def changed_errors(without="", **entries):
    """Section of the errors of position alone with some entries changed, and without one."""
    section = calibration_section(KEPT)
    section["position_only"] = {k: v for k, v in {**section["position_only"], **entries}.items() if k != without}
    return section


@pytest.mark.parametrize("entries", CASES["errors"], ids=str)
def test_errors_of_position_alone_that_are_wrong_are_one_sentence(entries, tmp_path):
    path = tmp_path / "CAL.toml"
    write_parameters(ParameterFile(Actuator(), {}, {"calibration": changed_errors(**entries)}), path)
    message = one_sentence(ParameterError, lambda: read_parameters(path).calibration)
    assert message.startswith("CAL.toml: [fit.calibration.position_only]: hypotheses (the first empty)")
    assert message.endswith("save the calibration again.")


@pytest.mark.parametrize(("text", "words"), CASES["sections"])
def test_a_calibration_that_is_wrong_is_one_sentence(text, words, tmp_path):
    path = tmp_path / "CAL.toml"
    path.write_text(f"{text}\n")
    message = one_sentence(ParameterError, lambda: read_parameters(path).calibration)
    assert message.startswith("CAL.toml: ")
    assert words in message


def test_a_search_that_had_not_converged_stays_so_in_the_file(tmp_path):
    assert not calibration_of(tmp_path / "CAL.toml", replace(KEPT, converged=False)).converged


def test_a_reading_keeps_the_file_of_its_calibration_and_not_its_own(tmp_path):
    calibrated = calibration_of(tmp_path / "CAL.toml", KEPT, trust="good")
    read = calibration_of(tmp_path / "worn.toml", calibrated, calibrated, trust="none")
    assert read.origin == calibrated.origin
    assert read.theta == KEPT.theta


def test_a_reading_from_a_calibration_in_memory_is_not_its_file(tmp_path):
    read = calibration_of(tmp_path / "worn.toml", KEPT, KEPT, trust="none", created="2026-11-22")
    assert read.origin == Origin()
    # a calibration that started from another one is in its own file
    again = calibration_of(tmp_path / "CAL.toml", KEPT, replace(KEPT), trust="good")
    assert (again.origin.name, again.origin.trust) == ("CAL.toml", "good")


def test_a_calibration_of_an_older_file_has_no_load_and_had_converged(tmp_path):
    path = tmp_path / "old.toml"
    path.write_text(SECTION)
    calibration = read_parameters(path).calibration
    assert calibration.theta == ()
    assert calibration.theta_covariance.shape == (0, 0)
    assert calibration.converged
    assert (calibration.origin.name, calibration.origin.created, calibration.origin.trust) == ("old.toml", "", "")


def test_what_is_no_text_in_the_origin_of_a_calibration_is_left_out(tmp_path):
    path = tmp_path / "CAL.toml"
    about, origin = "[fit]\ntrust = 5\ncreated = 2026-11-22\n", "[fit.calibration.origin]\nname = 7\ntrust = 'good'\n"
    path.write_text(about + SECTION + origin)
    origin = read_parameters(path).calibration.origin
    assert (origin.name, origin.created, origin.trust) == ("CAL.toml", "", "good")


def test_the_conditions_of_a_calibration_are_read_as_they_were(tmp_path):
    for conditions in (RecordedConditions(281.5, 9.4e5, 9.2e5), RecordedConditions(temperature=281.5), NOT_RECORDED):
        calibration = replace(KEPT, conditions=conditions)
        assert calibration_of(tmp_path / "CAL.toml", calibration).conditions == conditions
    assert "conditions" not in calibration_section(KEPT), "as in an earlier version"


@pytest.mark.parametrize("spread", [(-1.0, 1.0, 1.0), (1e300, 1.0, 1.0)])
def test_a_covariance_of_the_load_that_is_none_is_one_sentence(tmp_path, spread):
    calibration = replace(KEPT, theta_covariance=np.diag(spread))
    with pytest.raises(ParameterError, match="theta_covariance: the variance of theta_1 is"):
        calibration_of(tmp_path / "CAL.toml", calibration)


def test_a_parameter_that_the_data_do_not_determine_has_an_infinite_variance(tmp_path):
    calibration = replace(KEPT, names=("C_vs", "F_C"), covariance=np.diag([np.inf, 4.0]))
    np.testing.assert_array_equal(calibration_of(tmp_path / "CAL.toml", calibration).covariance, calibration.covariance)

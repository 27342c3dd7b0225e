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
from fixtures.sentences import one_sentence

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


def changed_errors(**entries):
    """Section of the errors of position alone with some entries changed; None leaves one out."""
    section = calibration_section(KEPT)
    section["position_only"] = {k: v for k, v in {**section["position_only"], **entries}.items() if v is not None}
    return section


@pytest.mark.parametrize(
    "entries",
    [
        {"shifts": None},
        {"hypotheses": None},
        {"dispersion": None},
        {"hypotheses": []},
        {"hypotheses": [], "shifts": [], "log_evidence": []},
        {"hypotheses": 5},
        {"hypotheses": [["valves"], [], ["supply pressure"]]},
        {"hypotheses": [[], [], ["valves"]]},
        {"names": ["theta_1", "theta_1", "C_vs"]},
        {"names": ["theta_1"]},
        {"shifts": [[1.0, 2.0, 3.0]]},
        {"shifts": [[1.0, 2.0, float("nan")]] * 3},
        {"shifts": [["x", 2.0, 3.0]] * 3},
        {"log_evidence": [0.0]},
        {"log_evidence": [0.0, float("inf"), 1.0]},
        {"dispersion": 0.0},
        {"dispersion": float("inf")},
        {"dispersion": "wide"},
    ],
    ids=str,
)
def test_errors_of_position_alone_that_are_wrong_are_one_sentence(entries, tmp_path):
    path = tmp_path / "CAL.toml"
    write_parameters(ParameterFile(Actuator(), {}, {"calibration": changed_errors(**entries)}), path)
    message = one_sentence(ParameterError, lambda: read_parameters(path).calibration)
    assert message.startswith("CAL.toml: [fit.calibration.position_only]: hypotheses (the first empty)")
    assert message.endswith("save the calibration again.")


EYE = np.eye(3).tolist()
BOTH = "[fit.calibration]\nnames = ['C_vs', 'F_C']\ncovariance = "
CONDITIONS = f"{SECTION}[fit.calibration.conditions]\n"
WANTED = "temperature in K, supply and supply_estimated in Pa, above 0"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            f"{SECTION}positions_only = 5",
            "no entry of [fit.calibration] 'positions_only'; did you mean 'position_only'",
        ),
        (f"{SECTION}position_only = 5", "[fit.calibration.position_only]: hypotheses"),
        (f"{SECTION}theta = [1.0, 2.0]\ntheta_covariance = [[1.0, 0.0], [0.0, 1.0]]", "2 numbers for 3 load weights"),
        (f"{SECTION}theta = [1.0, 2.0, 3.0]", "theta: finite load weights"),
        (f"{SECTION}theta_covariance = [[1.0]]", "square theta_covariance"),
        (f"{SECTION}theta = [1.0, 2.0, 3.0]\ntheta_covariance = [[1.0, 0.0], [0.0, 1.0]]", "square theta_covariance"),
        (f"{SECTION}theta = [1.0, nan, 3.0]\ntheta_covariance = {EYE}", "finite load weights"),
        (f"{SECTION}theta = [1.0, 'x', 3.0]\ntheta_covariance = {EYE}", "finite load weights"),
        (f"{SECTION}theta = [1{400 * '0'}, 2, 3]\ntheta_covariance = {EYE}", "finite load weights"),
        (f"{SECTION}theta = 5", "finite load weights"),
        (f"{SECTION}missed = -1.0", "missed = -1.0: a number of N, 0 or above, is needed; save the calibration again"),
        (f"{SECTION}missed = nan", "a number of N, 0 or above, is needed"),
        (f"{SECTION}missed = 'much'", "a number of N, 0 or above, is needed"),
        (f"{CONDITIONS}temperature = 'warm'", WANTED),
        (f"{CONDITIONS}supply = -1.0", WANTED),
        (f"{CONDITIONS}humidity = 0.5", WANTED),
        (f"{CONDITIONS}temperature = true", WANTED),
        (f"{BOTH}[[nan, 0], [0, 1]]", "not finite"),
        (f"{BOTH}[[1e-20, inf], [inf, 1]]", "not finite"),
        (f"{BOTH}[[-1e-20, 0], [0, 1]]", "covariance: the variance of C_vs is -1e-20, from 0 to 1e-10"),
        (f"{BOTH}[[1e300, 0], [0, 1]]", "the variance of C_vs is 1e+300"),
        (f"{BOTH}[[1e-20, 0], [0, 1e300]]", "the variance of F_C is 1e+300"),
        (f"{BOTH}[[1e-20, 1e-11], [0, 1]]", "is not symmetric"),
        (f"{BOTH}[[1e-20, 2e-10], [2e-10, 1]]", "correlations beyond -1 to 1"),
        (f"[parameters]\nC_vs = 0.0\n{SECTION}", "[parameters] C_vs = 0 m³/(Pa·s): a calibrated valve passes air"),
        (f"[parameters]\nC_ve = 0.0\n{SECTION}", "[parameters] C_ve = 0 m³/(Pa·s): a calibrated valve passes air"),
    ],
)
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

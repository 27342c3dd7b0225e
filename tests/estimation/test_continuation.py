"""A search that has not converged goes on from its saved file, with its original priors; readings say what it was."""

import tomllib
from dataclasses import astuple, replace

import numpy as np
import pytest

import clutchid
from clutchid.errors import ParameterError
from clutchid.estimation.parameter_file import search_in, search_section
from clutchid.estimation.request import Continuation, FitRequest, SearchState, ended
from clutchid.inference.smoother import search
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.verbs import saving
from clutchid.verbs.fitting import fitted as fit_reading
from clutchid.verbs.reading import Reading
from clutchid.verbs.start import start_of

MEASURE, FREE = ("position", "pressure_a"), ("load", "P_S", "C_vs", "F_C")
STATE = SearchState("limit", 7, ("load", "P_S"), {"P_S": Prior(9e5, 4e4), "s_pwm@a": Prior(0.1, 0.03)})


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Five seconds of an actuator of the model with sensor noise, as a file."""
    path = tmp_path_factory.mktemp("continued") / "cal.csv"
    duty = clutchid.bundled_recording().slice(0, 5000)
    actuator = clutchid.Actuator().replace(theta_1=8.5e5, theta_2=-2e4, theta_3=1e5, P_S=8.8e5, C_vs=2.1e-8, F_C=170.0)
    simulated = clutchid.simulate(actuator, duty.without("position").without("pressure_a")).log
    noise = np.random.default_rng(1).standard_normal((2, len(duty)))
    measured = {
        "position": simulated["position"] + 1e-5 * noise[0],
        "pressure_a": simulated["pressure_a"] + 500.0 * noise[1],
    }
    clutchid.write(duty.with_columns(**measured), path)
    return path


def fitted(recording, start=None, free=FREE, measure=MEASURE):
    """The outcome of a calibration, or of what starts from the file `start`."""
    actuator, request = start_of(start, FitRequest(measure, free, method="shooting"))
    return fit_reading(Reading((recording,), ambient=101300.0, force=True), actuator, request)


@pytest.fixture(scope="module")
def whole(recording):
    return fitted(recording)


@pytest.fixture(scope="module")
def stopped(recording, tmp_path_factory):
    """A calibration whose budget was used up, and its file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "MAX_STEPS", 0)
        outcome = fitted(recording)
    path = tmp_path_factory.mktemp("saved") / "CAL.toml"
    saving.save_fit(outcome, path)
    return outcome, path


def test_the_end_of_a_search_has_one_wording_in_python_files_and_messages(stopped):
    fit, path = stopped
    words = f"stopped after {fit.evaluations} evaluations, not converged: the allowed number of evaluations is used up"
    assert (fit.converged, fit.search.status, fit.message) == (False, "limit", words)
    assert f"the search {words}." in fit.warnings
    assert tomllib.loads(path.read_text())["fit"]["search"]["status"] == "limit"
    assert ended("limit", fit.evaluations) == fit.message


def test_a_continued_search_has_the_original_priors_and_ends_where_a_single_one_does(recording, stopped, whole):
    fit, path = stopped
    continued = fitted(recording, path)
    assert continued.converged
    assert continued.baseline is None, "no new calibration on top of the old one"
    assert continued.evaluations < fit.evaluations
    assert continued.search.priors.keys() == whole.search.priors.keys()
    for name, prior in whole.search.priors.items():
        assert astuple(continued.search.priors[name]) == pytest.approx(astuple(prior), rel=1e-9)
    assert continued.scales == pytest.approx(whole.scales, rel=1e-9)
    for name, estimate in whole.parameters.items():
        assert abs(continued.parameters[name].value - estimate.value) < 0.2 * estimate.std
        assert continued.parameters[name].std == pytest.approx(estimate.std, rel=0.05)


def test_a_converged_search_that_is_continued_stays_where_it_was(recording, whole, tmp_path):
    saving.save_fit(whole, tmp_path / "CAL.toml")
    again = fitted(recording, tmp_path / "CAL.toml")
    assert again.converged
    for name, estimate in whole.parameters.items():
        assert abs(again.parameters[name].value - estimate.value) < 0.1 * estimate.std
        assert again.parameters[name].std == pytest.approx(estimate.std, rel=0.02)


def test_other_free_parameters_or_another_recording_start_a_new_search_from_the_calibration(recording, stopped):
    _, path = stopped
    other = fitted(recording, path, free=("load", "P_S", "C_vs"))
    assert other.baseline is not None
    assert other.baseline.origin.name == "CAL.toml"
    altered = recording.with_name("other.csv")
    altered.write_text(recording.read_text() + "\n")
    assert fitted(altered, path).baseline is not None


def test_a_reading_from_a_calibration_that_had_not_converged_says_so(recording, stopped):
    _, path = stopped
    read = fitted(recording, path, free=("load",), measure=("position",))
    assert read.baseline.converged is False
    assert read.verdict.trust != "good"
    assert any("CAL.toml had not converged" in reason for reason in read.verdict.reasons)


def test_a_search_in_a_file_is_read_as_it_was():
    assert search_in(search_section(STATE)) == STATE


@pytest.mark.parametrize(
    "wrong",
    [{"status": "done"}, {"priors": {"P_S": [9e5]}}, {"priors": {"P_S": [9e5, 0.0]}}, {"priors": {"P_S": ["x", 1]}},
     {"priors": 3}, {"evaluations": "many"}, {"free": 4}],
)  # fmt: skip
def test_a_search_that_cannot_be_understood_is_one_sentence(wrong):
    with pytest.raises(ParameterError, match=r"^\[fit\.search\]: status .* are needed; save the fit again"):
        search_in({**search_section(STATE), **wrong})
    with pytest.raises(ParameterError, match=r"^\[fit\.search\]"):
        search_in("converged")


def test_a_search_is_continued_only_for_the_same_files_columns_and_parameters():
    earlier = Continuation(STATE, {}, {"position": 1e-5}, {"a": "12"})
    assert earlier.applies(("P_S", "load"), ("position",), {"a": "12"})
    assert not earlier.applies(("P_S",), ("position",), {"a": "12"})
    assert not earlier.applies(("P_S", "load"), ("position", "pressure_a"), {"a": "12"})
    assert not earlier.applies(("P_S", "load"), ("position",), {"a": "13"})
    assert not earlier.applies(("P_S", "load"), ("position",), {"a": "12", "b": "12"})
    unknown = replace(earlier, data={"a": "unknown"})
    assert not unknown.applies(("P_S", "load"), ("position",), {"a": "unknown"})


@pytest.mark.slow
def test_a_prediction_error_search_is_continued_too(recording, tmp_path):
    actuator, request = start_of(None, FitRequest(MEASURE, ("load", "P_S"), method="prediction-error"))
    reading = Reading((recording,), ambient=101300.0, force=True)
    first = fit_reading(reading, actuator, request)
    saving.save_fit(first, tmp_path / "CAL.toml")
    actuator, request = start_of(tmp_path / "CAL.toml", request)
    again = fit_reading(reading, actuator, request)
    assert again.converged
    assert again.baseline is None
    for name, estimate in first.parameters.items():
        assert abs(again.parameters[name].value - estimate.value) < 0.5 * estimate.std
    assert np.isfinite(again.covariance).all()

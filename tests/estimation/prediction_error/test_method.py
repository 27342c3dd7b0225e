"""Prediction error as a method of `fit`: asked for, chosen by a calibration, verified, refused."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid import fit, parameter_file, read_parameters, write_parameters
from clutchid.errors import ParameterError, SolveError
from clutchid.estimation import prediction_error as module
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.prediction_error import PREDICTION_ERROR
from clutchid.estimation.request import FitRequest
from clutchid.estimation.verification import verification
from clutchid.inference.filter import filtering
from clutchid.model import Actuator
from clutchid.numerics.failure import Failure
from clutchid.simulation import Partition
from clutchid.simulation.noise import Noise

pytestmark = pytest.mark.slow

BOTH = ("position", "pressure_a")
METHOD = "prediction-error"


@pytest.fixture(scope="module")
def recording(plant, recorded_by):
    return recorded_by(plant, 2.0)


@pytest.fixture(scope="module")
def calibrated(plant, recording):
    return fit(recording, plant, measure=BOTH, free=("load", "C_vs"), method=METHOD)


def test_a_fit_that_asks_for_it_is_by_prediction_error(plant, recording):
    result = fit(recording, plant, measure=BOTH, free=("C_vs", "P_S"), method=METHOD)
    same = fit_with(PREDICTION_ERROR, [recording], plant, FitRequest(BOTH, ("C_vs", "P_S")))
    assert result.method == METHOD
    assert result.follows
    assert result.converged
    assert result.parameters == same.parameters


def test_what_a_calibration_left_is_gone_on_with_by_its_method(calibrated, recording, tmp_path):
    write_parameters(parameter_file(calibrated), tmp_path / "cal.toml")
    content = read_parameters(tmp_path / "cal.toml")
    assert content.calibration.method == calibrated.calibration.method == METHOD
    worn = replace(recording.without("pressure_a"), name="worn")
    adapted = fit(worn, content.actuator, request=FitRequest(calibration=content.calibration))
    assert adapted.method == METHOD
    shot = fit(
        worn,
        content.actuator,
        request=FitRequest(calibration=content.calibration),
        free=("theta_5",),
        method="shooting",
    )
    assert shot.method == "shooting"


def test_a_recording_is_verified_as_its_sensors_would_see_it(plant, recorded_by, recording):
    other = recorded_by(plant, 2.0, seed=8, name="other")
    result = fit(recording, plant, free=("C_vs",), verify=[other], method=METHOD)
    mapped = verification(result.actuator, [other], None, through_sensors=True)[0]["other"]
    assert result.verification["other"].errors == mapped.errors
    assert mapped.errors.position_rms == pytest.approx(Noise().measured["position"], rel=0.2)


def test_a_partition_is_refused(plant, recording):
    with pytest.raises(ParameterError, match="corrected at every sample"):
        fit(recording, plant, request=FitRequest(partition=Partition(every=100)), method=METHOD)


def test_a_misspelt_method_names_the_nearest(plant, recording):
    with pytest.raises(ParameterError, match="did you mean 'prediction-error'"):
        fit(recording, plant, method="prediction_error")


def test_a_start_that_cannot_be_filtered_raises_or_is_returned(plant, recording, monkeypatch):
    monkeypatch.setattr(module, "predict_errors", lambda *_: Failure("y is not finite at 0.1 s."))
    with pytest.raises(SolveError, match=r"0\.1 s"):
        fit(recording, plant, free=("C_vs",), method=METHOD)
    result = fit(recording, plant, free=("C_vs",), method=METHOD, on_failure="return")
    assert (result.status, result.converged) == ("failed", False)


def test_the_papers_model_is_filtered_too(plant, recording):
    paper = Actuator(plant.parameters)
    result = fit(recording.without("pressure_a"), paper, free=("theta_1", "theta_2"), method=METHOD)
    assert result.status != "failed"
    assert np.isfinite(result.covariance).all()


def test_a_segment_that_was_planned_for_another_model_is_refused(plant, recording, problem_of):
    problem = problem_of(recording, plant, ("C_vs",))
    foreign = replace(plant, model="isothermal")
    with pytest.raises(ParameterError, match="plan the recording"):
        filtering.filtered(
            problem.tracks[0], replace(problem, actuator=foreign).parameter_map(np.zeros(1), "log"), BOTH, Noise()
        )

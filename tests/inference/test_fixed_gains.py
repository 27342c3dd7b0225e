"""Prediction errors with fixed gains: those of the filter that the gains are of."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.inference.filter.filtering import filtered
from clutchid.inference.fixed_gains import prediction_errors
from fixtures.filter_recordings import duties, plant, problem_of, recorded_by  # noqa: F401

pytestmark = pytest.mark.slow

NAMES = ("theta_4", "D_v", "tau_y")


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):  # noqa: F811
    """A second of position, of which some samples are missing."""
    log = recorded_by(plant, 1.0)
    position = log["position"].copy()
    position[300:320], position[400] = np.nan, np.inf
    return problem_of(log.with_columns(position=position), plant, NAMES, ("position",))


@pytest.fixture(scope="module")
def gains(problem):
    """Gains of a pass at the means of the priors."""
    return pass_at(problem, np.zeros(len(NAMES))).gains


def pass_at(problem, x, fixed_gains=None):
    mapped = problem.parameter_map(x, "log")
    return filtered(problem.tracks[0], mapped, problem.measure, problem.noise, fixed_gains)


def test_they_are_those_of_the_filter_at_other_parameters_too(problem, gains):
    x = np.array([0.5, -0.4, 0.3])
    errors = prediction_errors(problem.tracks[0], problem.actuator_of(x, "log"), gains[:, 0])
    of_filter = pass_at(problem, x, gains.copy()).errors[:, 0]
    assert errors == pytest.approx(of_filter[:, 0] / np.sqrt(of_filter[:, 1]), rel=1e-6, abs=1e-6, nan_ok=True)
    assert np.flatnonzero(np.isnan(errors)).tolist() == [*range(300, 320), 400]


def test_a_simulation_that_diverges_has_none(problem, gains):
    track = problem.tracks[0]
    broken = replace(track, segment=replace(track.segment, position_start=np.nan))
    assert prediction_errors(broken, problem.actuator_of(np.zeros(len(NAMES)), "log"), gains[:, 0]) is None

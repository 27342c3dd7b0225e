"""How far a reading departs from its calibration."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.departure import departure, misfit
from clutchid.estimation.hypotheses import Explanation
from clutchid.estimation.method import SearchResult
from clutchid.inference.problem import Problem, with_hypothesis
from clutchid.inference.uncertainty.calibration import Calibration, PositionOnlyErrors
from clutchid.inference.uncertainty.change_prior import change_covariance, change_priors
from clutchid.inference.uncertainty.coordinates import coordinates
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.parameters import GROUPS
from clutchid.simulation.noise import Noise

PLANT = Actuator(model="energy-balance-stribeck")
NAMES = ("P_S", "T_0", "D_v", "C_A0")


@pytest.fixture(scope="module")
def problem():
    priors = {f"{name}@w": prior for name, prior in change_priors(PLANT).items() if name in NAMES}
    free = ("theta_1", *priors)
    return Problem(
        actuator=PLANT,
        coordinates=coordinates(PLANT, free, {}, priors),
        stems=("w",),
        measure=("position",),
        noise=Noise(states={}),
        curvature=3e8,
        changing=tuple(priors),
    )


def moving(seconds):
    """A second at rest, then a stroke at 20 mm/s."""
    t = np.arange(0.0, 1.0 + seconds, 1e-3)
    return Log(t, {"position": 0.02 * np.maximum(t - 1.0, 0.0)}, "w")


def calibration(usual):
    errors = PositionOnlyErrors(((),), ("theta_1",), np.zeros((1, 1)), np.zeros(1), 1.0, usual)
    return Calibration((), np.zeros((0, 0)), position_only=errors)


def explanation(problem, information=0.0):
    """An explanation at 0, with as much information of the data about each parameter as the prior has at most."""
    x = np.zeros(len(problem.coordinates))
    data = np.column_stack([np.sqrt(information) * np.eye(x.size), x])
    return Explanation(SearchResult(problem, Failure("")), Solution(x, None, "converged", 1), data, 1.0)


def departed(problem, x, cost=1.0, logs=None, usual=None, information=0.0):
    calibrations = usual or calibration(1.0)
    return departure(explanation(problem, information), np.array(x), cost, logs or [moving(1.0)], calibrations)


def test_the_distance_is_that_of_mahalanobis_under_the_prior_of_all_changes(problem):
    x = np.array([5.0, 0.3, -1.0, 0.5, 9.0])
    measures = departed(problem, x)
    own = problem.coordinates[1:4]
    sizes = np.array([c.slope(0.0) for c in own])
    covariance = change_covariance(PLANT, [c.base for c in own], tuple(GROUPS)) / np.outer(sizes, sizes)
    assert measures.distance == pytest.approx(x[1:4] @ np.linalg.solve(covariance, x[1:4]))


def test_neither_a_load_that_has_changed_nor_a_leak_is_a_departure(problem):
    assert departed(problem, [9.0, 0.0, 0.0, 0.0, 9.0]).distance == 0.0


@pytest.mark.parametrize(("information", "expected"), [(0.0, 0.0), (1e12, 3.0)])
def test_as_many_parameters_are_expected_to_have_moved_as_the_data_determine(problem, information, expected):
    assert departed(problem, np.zeros(5), information=information).expected == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_the_expected_distance_is_that_of_trucks_drawn_from_the_prior(problem):
    rng = np.random.default_rng(1)
    root = with_hypothesis(problem, tuple(GROUPS)).prior_root
    truth = np.linalg.solve(root, rng.standard_normal((5, 400)))
    gain = np.linalg.inv(np.eye(5) + root.T @ root)  # of data with a standard deviation of 1 in each coordinate
    read = gain @ (truth + rng.standard_normal((5, 400)))
    distances = [departed(problem, x, information=1.0).distance for x in read.T]
    assert np.mean(distances) == pytest.approx(departed(problem, read[:, 0], information=1.0).expected, rel=0.1)


def test_a_departure_names_what_has_moved_farthest(problem):
    first, *_ = departed(problem, [9.0, 0.1, -0.9, 0.0, 9.0]).moved
    assert (first.name, first.before) == ("D_v", PLANT.value("D_v"))
    assert first.after < 0.7 * first.before


def test_the_misfit_is_the_cost_of_a_second_in_motion_over_that_of_the_calibration(problem):
    log = moving(2.0)
    assert misfit(100.0, [log]) == pytest.approx(50.0, rel=0.05)
    assert misfit(100.0, [log, log]) == pytest.approx(25.0, rel=0.05)
    measures = departed(problem, np.zeros(5), 100.0, [log], calibration(25.0))
    assert measures.misfit == pytest.approx(2.0, rel=0.05)


def test_without_motion_or_a_calibration_that_has_it_the_misfit_is_unknown(problem):
    still = Log(np.arange(0.0, 1.0, 1e-3), {"position": np.zeros(1000)}, "w")
    assert np.isnan(misfit(1.0, [still]))
    older = replace(calibration(1.0), position_only=None)
    assert np.isnan(departed(problem, np.zeros(5), usual=older).misfit)

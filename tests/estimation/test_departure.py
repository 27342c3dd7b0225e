"""How far a reading departs from its calibration."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.departure import departure, misfit
from clutchid.inference.problem import Problem
from clutchid.inference.uncertainty.calibration import Calibration, PositionOnlyErrors
from clutchid.inference.uncertainty.change_prior import change_covariance, change_priors
from clutchid.inference.uncertainty.coordinates import coordinates
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.parameters import GROUPS
from clutchid.simulation.noise import Noise

PLANT = Actuator(model="energy-balance-stribeck")
NAMES = ("P_S", "T_0", "D_v")


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


def test_the_distance_is_that_of_mahalanobis_under_the_prior_of_all_changes(problem):
    x = np.array([5.0, 0.3, -1.0, 0.5])
    found = departure(problem, x, 1.0, [moving(1.0)], calibration(1.0))
    own = problem.coordinates[1:]
    sizes = np.array([c.slope(0.0) for c in own])
    covariance = change_covariance(PLANT, [c.base for c in own], tuple(GROUPS)) / np.outer(sizes, sizes)
    assert found.distance == pytest.approx(x[1:] @ np.linalg.solve(covariance, x[1:]))
    assert found.parameters == 3


def test_a_load_that_has_changed_is_no_departure(problem):
    assert departure(problem, np.array([9.0, 0.0, 0.0, 0.0]), 1.0, [moving(1.0)], calibration(1.0)).distance == 0.0


def test_the_misfit_is_the_cost_of_a_second_in_motion_over_that_of_the_calibration(problem):
    log = moving(2.0)
    assert misfit(100.0, [log]) == pytest.approx(50.0, rel=0.05)
    assert misfit(100.0, [log, log]) == pytest.approx(25.0, rel=0.05)
    found = departure(problem, np.zeros(4), 100.0, [log], calibration(25.0))
    assert found.misfit == pytest.approx(2.0, rel=0.05)


def test_without_motion_or_a_calibration_that_has_it_the_misfit_is_unknown(problem):
    still = Log(np.arange(0.0, 1.0, 1e-3), {"position": np.zeros(1000)}, "w")
    assert np.isnan(misfit(1.0, [still]))
    older = replace(calibration(1.0), position_only=None)
    assert np.isnan(departure(problem, np.zeros(4), 1.0, [moving(1.0)], older).misfit)

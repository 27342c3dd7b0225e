"""The least-squares problem of a fit by prediction error."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation import prediction as module
from clutchid.estimation.prediction import Prediction, predict_errors
from clutchid.numerics.failure import Failure

NAMES = ("theta_4", "theta_9", "C_vs", "F_C")
ZERO = np.zeros(len(NAMES))


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    return problem_of(recorded_by(plant, 1.2), plant, NAMES, ("position",))


@pytest.fixture(scope="module")
def here(problem):
    return predict_errors(problem, ZERO)


def test_the_cost_is_that_of_the_prior_and_of_every_error(problem, here):
    x = np.array([0.5, 0.0, 0.0, -0.2])
    there = predict_errors(problem, x)
    assert there.cost == pytest.approx(np.sum(there.prior[:, -1] ** 2) + sum(s.cost for s in there.segments))
    assert there.cost > here.cost, "the recording was made at 0"


def test_the_linearisation_foresees_the_cost_nearby_with_fixed_gains(problem, here):
    L, step = here.linearisation(), np.array([1e-3, -1e-3, 2e-3, 5e-3])
    rest = L.cost - 0.5 * L.q @ L.q
    wanted = rest + 0.5 * np.sum((L.q + L.R @ step) ** 2)
    cost = predict_errors(problem, step, here).cost / 2
    # what a step changes is foreseen to its square: the step is 0.5 % of a prior's width
    assert cost - L.cost == pytest.approx(wanted - L.cost, rel=0.02)


def test_samples_and_prior_rows_are_counted(problem, here):
    assert here.linearisation().count == 1200 + here.prior.shape[0]


def test_a_recording_without_a_measurement_leaves_the_prior(plant, recorded_by, problem_of):
    log = recorded_by(plant, 0.3)
    empty = problem_of(log.with_columns(position=np.full(300, np.nan)), plant, ("C_vs", "F_C"), ("position",))
    L = predict_errors(empty, np.array([1.0, -2.0])).linearisation()
    assert np.abs(L.R) == pytest.approx(np.eye(2))
    assert L.cost == pytest.approx(2.5)


def test_numbers_that_contradict_each_other_are_a_failure(plant, recorded_by, problem_of):
    # a valve that opens fully before it opens at all
    problem = problem_of(recorded_by(plant, 0.3), plant, ("R_0vs",), ("position",))
    prediction = predict_errors(problem, np.array([1e3]))
    assert isinstance(prediction, Failure)


def test_a_segment_that_fails_fails_the_whole(problem, monkeypatch):
    monkeypatch.setattr(module, "filtered", lambda *_, **__: Failure("y is not finite at 0.1 s."))
    assert predict_errors(problem, ZERO) == Failure("y is not finite at 0.1 s.")


def test_a_cost_that_is_not_finite_is_a_failure(problem, monkeypatch, here):
    broken = replace(here.segments[0], cost=np.inf)
    monkeypatch.setattr(module, "filtered", lambda *_, **__: broken)
    assert predict_errors(problem, ZERO) == Failure("the cost is not finite")


def test_fixed_gains_are_those_of_the_other_pass(problem, here):
    there = predict_errors(problem, np.array([0.3, 0.0, 0.0, 0.0]), here)
    assert isinstance(there, Prediction)
    assert there.segments[0].gains is here.segments[0].gains
    assert np.array_equal(there.segments[0].errors[:, :, 1], here.segments[0].errors[:, :, 1], equal_nan=True)

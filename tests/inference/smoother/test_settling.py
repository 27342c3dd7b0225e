"""Minimisation over the states at fixed parameters, with a damping for each window."""

import numpy as np
import pytest

from clutchid.inference.smoother import trial
from clutchid.inference.smoother.problem import condense, linearise
from clutchid.inference.smoother.trial import (
    REJECTED_DAMPING,
    evaluate_step,
    initial_damping,
    minimise_states,
    shifted_states,
    stepped_states,
    with_theta_fixed,
)
from clutchid.numerics.failure import Failure

NAMES = ("theta_5", "theta_9", "C_vs", "F_C")


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    return problem_of([recorded_by(plant, seconds=4.0)], plant, NAMES, ("position",))


@pytest.fixture(scope="module")
def current(problem, starts_of):
    """The problem of the states alone, far from where they would be."""
    x = np.array([0.05, -0.05, 0.3, 0.2])
    return with_theta_fixed(problem, linearise(problem, x, starts_of(problem)))


@pytest.fixture(scope="module")
def minimised(problem, current):
    damping, calls = initial_damping(problem), []
    return minimise_states(problem, current, damping, lambda: calls.append(1)), damping, calls


def test_minimised_states_cost_less_and_as_computed(problem, current, minimised, cost_at):
    minimised, _, calls = minimised
    assert np.array_equal(minimised.x, current.x), "the parameters are fixed"
    assert minimised.cost < 0.9 * current.cost
    assert minimised.cost == pytest.approx(cost_at(problem, minimised.x, minimised.X), abs=trial.CONVERGED_GAIN)
    assert len(calls) >= 3


def test_minimised_states_have_no_further_gain(problem, current, minimised):
    minimised = minimised[0]
    again = minimise_states(problem, minimised, initial_damping(problem), lambda: None)
    assert 0.0 <= minimised.cost - again.cost < 0.01 * (current.cost - minimised.cost)


def test_only_a_window_whose_prediction_fails_is_damped(problem, current, monkeypatch):
    wrong = 12

    def misleading(t, point, x, X, last=None):
        answer = evaluate_step(t, point, x, X, last)
        moved = np.abs(X[0][wrong] - current.X[0][wrong]).max() > 0.0
        answer.excess[0][wrong] += 1e6 * moved
        object.__setattr__(answer, "cost", answer.cost + 1e6 * moved)
        return answer

    monkeypatch.setattr(trial, "evaluate_step", misleading)
    damping = initial_damping(problem)
    minimised = minimise_states(problem, current, damping, lambda: None)
    assert damping[0][wrong] >= REJECTED_DAMPING * 10 ** (trial.MAX_TRIALS - 2)
    others = np.delete(damping[0], [wrong - 1, wrong, wrong + 1])
    assert np.median(others) <= trial.INITIAL_DAMPING
    assert minimised.cost <= current.cost


def test_where_every_step_fails_the_states_stay(problem, current, monkeypatch):
    monkeypatch.setattr(trial, "evaluate_step", lambda *_: Failure("no such state."))
    damping = initial_damping(problem)
    minimised = minimise_states(problem, current, damping, lambda: None)
    assert minimised is current
    assert damping[0].min() > trial.INITIAL_DAMPING, "the next time a shorter step is tried"


def test_damping_of_one_window_shortens_its_step_most(problem, current):
    tight = initial_damping(problem)
    tight[0][7] = 1e6
    plain, damped = (
        stepped_states(problem, current.X, condense(problem, current, by)[1], np.zeros(0))
        for by in (initial_damping(problem), tight)
    )
    went, goes = (np.abs(X[0] - current.X[0]) for X in (plain, damped))
    assert np.all(goes[7] < 0.05 * np.maximum(went[7], 1e-12) + 1e-9)
    assert np.median(np.abs(goes[30:] - went[30:])) < 0.05 * np.median(went[30:])


def test_shifted_states_are_linear_in_the_step(problem, starts_of):
    point = linearise(problem, np.zeros(4), starts_of(problem))
    chains = condense(problem, point)[1]
    step = np.array([0.1, 0.0, -0.2, 0.0])
    once, twice = (shifted_states(problem, point.X, chains, factor * step)[0] - point.X[0] for factor in (1.0, 2.0))
    assert np.abs(once).max() > 0.0
    assert twice == pytest.approx(2.0 * once, rel=1e-6, abs=1e-9 * np.abs(once).max())
    stay = shifted_states(problem, point.X, chains, np.zeros(4))[0]
    assert np.array_equal(stay, point.X[0])

"""States settle at held parameters, each window held as firmly as it needs."""

import numpy as np
import pytest

from clutchid.numerics.failure import Failure
from clutchid.smoother import settling
from clutchid.smoother.problem import condense, linearise
from clutchid.smoother.settling import FIRM, followed, loose, settle, stepped
from clutchid.smoother.trial import attempt, with_theta_fixed

NAMES = ("theta_5", "theta_9", "C_vs", "F_C")


@pytest.fixture(scope="module")
def task(plant, recorded_by, task_of):
    return task_of([recorded_by(plant, seconds=4.0)], plant, NAMES, ("position",))


@pytest.fixture(scope="module")
def here(task, starts_of):
    """The problem of the states alone, far from where they would be."""
    x = np.array([0.05, -0.05, 0.3, 0.2])
    return with_theta_fixed(task, linearise(task, x, starts_of(task)))


@pytest.fixture(scope="module")
def settled(task, here):
    damping, calls = loose(task), []
    return settle(task, here, damping, lambda: calls.append(1)), damping, calls


def test_settled_states_cost_less_and_exactly_what_is_said(task, here, settled, cost_at):
    there, _, calls = settled
    assert np.array_equal(there.x, here.x), "the parameters are held"
    assert there.cost < 0.9 * here.cost
    assert there.cost == pytest.approx(cost_at(task, there.x, there.X), abs=settling.CALM)
    assert len(calls) >= 3


def test_what_has_settled_has_nothing_left_to_gain(task, here, settled):
    there = settled[0]
    again = settle(task, there, loose(task), lambda: None)
    assert 0.0 <= there.cost - again.cost < 0.01 * (here.cost - there.cost)


def test_one_window_that_goes_wrong_is_held_and_the_others_are_not(task, here, monkeypatch):
    wrong = 12

    def misleading(t, point, x, X, last=None):
        answer = attempt(t, point, x, X, last)
        moved = np.abs(X[0][wrong] - here.X[0][wrong]).max() > 0.0
        answer.excess[0][wrong] += 1e6 * moved
        object.__setattr__(answer, "cost", answer.cost + 1e6 * moved)
        return answer

    monkeypatch.setattr(settling, "attempt", misleading)
    damping = loose(task)
    there = settle(task, here, damping, lambda: None)
    assert damping[0][wrong] >= FIRM * 10 ** (settling.TRIALS - 2)
    others = np.delete(damping[0], [wrong - 1, wrong, wrong + 1])
    assert np.median(others) <= settling.LOOSE
    assert there.cost <= here.cost


def test_where_every_step_fails_the_states_stay(task, here, monkeypatch):
    monkeypatch.setattr(settling, "attempt", lambda *_: Failure("no such state."))
    damping = loose(task)
    there = settle(task, here, damping, lambda: None)
    assert there is here
    assert damping[0].min() > settling.LOOSE, "the next time a shorter step is tried"


def test_damping_of_one_window_shortens_its_step_most(task, here):
    tight = loose(task)
    tight[0][7] = 1e6
    plain, held = (stepped(task, here.X, condense(task, here, by)[1], np.zeros(0)) for by in (loose(task), tight))
    went, goes = (np.abs(X[0] - here.X[0]) for X in (plain, held))
    assert np.all(goes[7] < 0.05 * np.maximum(went[7], 1e-12) + 1e-9)
    assert np.median(np.abs(goes[30:] - went[30:])) < 0.05 * np.median(went[30:])


def test_states_that_follow_a_step_move_with_it_linearly(task, starts_of):
    point = linearise(task, np.zeros(4), starts_of(task))
    chains = condense(task, point)[1]
    step = np.array([0.1, 0.0, -0.2, 0.0])
    once, twice = (followed(task, point.X, chains, factor * step)[0] - point.X[0] for factor in (1.0, 2.0))
    assert np.abs(once).max() > 0.0
    assert twice == pytest.approx(2.0 * once, rel=1e-6, abs=1e-9 * np.abs(once).max())
    stay = followed(task, point.X, chains, np.zeros(4))[0]
    assert np.array_equal(stay, point.X[0])

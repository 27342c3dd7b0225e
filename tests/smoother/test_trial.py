"""A small step from a linearised problem: what is simulated, what is linearised again, and that neither is missed."""

import numpy as np
import pytest

from clutchid.numerics.failure import Failure
from clutchid.simulation.windows import units
from clutchid.smoother import trial as module
from clutchid.smoother.problem import condense, linearise
from clutchid.smoother.settling import stepped
from clutchid.smoother.trial import DRIFT, NEAR_COST, accept, attempt, with_theta_fixed, with_theta_free

NAMES = ("theta_5", "theta_9", "C_vs", "F_C", "tau_y")


@pytest.fixture(scope="module")
def task(plant, recorded_by, task_of):
    return task_of([recorded_by(plant, seconds=4.0)], plant, NAMES, ("position", "pressure_a"))


@pytest.fixture(scope="module")
def here(task, starts_of):
    return linearise(task, np.zeros(len(NAMES)), starts_of(task))


@pytest.fixture
def counted(monkeypatch):
    """How many windows are simulated, and how many linearised."""
    counts = {"simulated": 0, "linearised": 0}
    cost, told = module.window_cost, module.linearise_windows

    def simulated(*arguments, **options):
        counts["simulated"] += 1
        return cost(*arguments, **options)

    def linearised(*arguments):
        counts["linearised"] += len(arguments[-1])
        return told(*arguments)

    monkeypatch.setattr(module, "window_cost", simulated)
    monkeypatch.setattr(module, "linearise_windows", linearised)
    return counts


def nudged(task, here, window, size=1e-3):
    """Starts with one of them moved by `size` of a natural size, in all states."""
    X = [one.copy() for one in here.X]
    X[0][window] += size * units(task.actuator)
    return X


def test_a_step_that_moves_nothing_is_not_simulated_and_keeps_every_derivative(task, here, counted):
    trial = attempt(task, here, here.x, here.X)
    assert trial.cost == pytest.approx(here.cost, rel=1e-12)
    there = accept(task, trial)
    assert counted == {"simulated": 0, "linearised": 0}
    assert np.array_equal(there.chains[0].windows.linearised.own, here.chains[0].windows.linearised.own)


def test_only_the_window_that_moves_is_simulated(task, here, counted, cost_at):
    X = nudged(task, here, 9, 0.1)
    trial = attempt(task, here, here.x, X)
    assert counted["simulated"] == 1
    assert trial.simulated[0].drift[9] == 0.0
    # the window itself is simulated, and with it the links before and after
    assert trial.cost == pytest.approx(cost_at(task, here.x, X), rel=1e-9)


def test_a_window_that_did_otherwise_is_linearised_again_and_no_other(task, here, counted):
    X = nudged(task, here, 9, 0.5)
    trial = attempt(task, here, here.x, X)
    assert abs(trial.excess[0][9]) > NEAR_COST, "the step must be far from linear, or nothing is tested"
    there = accept(task, trial)
    assert counted["linearised"] == 1
    fresh, old, new = (one.chains[0].windows.linearised for one in (linearise(task, here.x, X), here, there))
    assert new.own[9] == pytest.approx(fresh.own[9], rel=1e-9)
    assert np.array_equal(np.delete(new.own, 9, axis=0), np.delete(old.own, 9, axis=0))


def test_small_steps_one_after_another_add_up_until_the_window_is_simulated(task, here, counted, cost_at):
    at, simulated = here, []
    for number in range(1, 40):
        X = nudged(task, here, 9, 2e-5 * number)
        trial = attempt(task, at, here.x, X)
        simulated.append(counted["simulated"])
        assert np.all(trial.simulated[0].drift <= DRIFT)
        assert trial.cost == pytest.approx(cost_at(task, here.x, X), abs=0.2)
        at = accept(task, trial)
    assert simulated[0] == 0
    assert 1 <= simulated[-1] < 20


def test_what_the_linear_problem_says_of_a_step_is_what_happens_to_first_order(task, here, cost_at):
    rng = np.random.default_rng(1)
    unit = units(task.actuator)
    move, by = rng.standard_normal(here.X[0].shape), rng.standard_normal(len(NAMES))
    costs = []
    for h in (1e-5, -1e-5):
        told = here.chains[0].windows.linearised.moved(h * move, h * by)
        costs.append(float(np.sum(told.cost)))
    windows = [
        sum(
            module.window_cost(
                track, window, start + h * m * unit, task.parameter_map(h * by, "log"), task.measure, task.noise
            )[1]
            for track in task.tracks
            for window, start, m in zip(track.windows, here.X[0], move, strict=True)
        )
        for h in (1e-5, -1e-5)
    ]
    assert costs[0] - costs[1] == pytest.approx(windows[0] - windows[1], rel=2e-3)


def test_a_step_of_the_parameters_is_simulated_everywhere_it_matters(task, here, cost_at):
    x = here.x + np.array([0.02, -0.01, 0.05, 0.05, 0.1])
    trial = attempt(task, here, x, here.X)
    assert trial.cost == pytest.approx(cost_at(task, x, here.X), abs=DRIFT * len(task.tracks[0].windows))
    there = accept(task, trial)
    fresh = linearise(task, x, here.X)
    factors = [condense(task, one)[0] for one in (there, fresh)]
    theta = [np.linalg.lstsq(factor[:-1, :-1], -factor[:-1, -1], rcond=None)[0] for factor in factors]
    # the step that follows from kept derivatives is that of new ones, to a fraction of what the problem is uncertain by
    factor = factors[1][:-1, :-1]
    assert np.linalg.norm(factor @ (theta[0] - theta[1])) < 0.3 * np.linalg.norm(factor @ theta[1])


def test_the_last_trial_is_where_the_next_one_begins(task, here, counted):
    X = nudged(task, here, 9, 0.5)
    last = attempt(task, here, here.x, X)
    again = attempt(task, here, here.x, X, last)
    assert counted["simulated"] == 1
    assert again.cost == pytest.approx(last.cost, rel=1e-12)


def test_held_and_free_again_the_problem_is_the_same(task, here):
    held = with_theta_fixed(task, here)
    n = units(task.actuator).size
    assert held.chains[0].first.shape == (n, n + 1)
    assert held.cost == here.cost
    chains = condense(task, held)[1]
    X = stepped(task, held.X, chains, np.zeros(0))
    there = accept(task, attempt(task, held, here.x, X), free=False)
    assert isinstance(there.cost, float)
    freed = with_theta_free(task, here, there)
    assert freed.cost == pytest.approx(there.cost, rel=1e-12)
    assert all(np.array_equal(one, other) for one, other in zip(freed.X, there.X, strict=True))
    fresh = linearise(task, freed.x, freed.X)
    R, wanted = (condense(task, one)[0][:-1, :-1] for one in (freed, fresh))
    assert np.linalg.norm(R.T @ R - wanted.T @ wanted) < 0.05 * np.linalg.norm(wanted.T @ wanted)


def test_a_step_that_cannot_be_simulated_is_a_failure(task, here):
    X = nudged(task, here, 4)
    X[0][4, 2] = np.nan
    answer = attempt(task, here, here.x, X)
    assert isinstance(answer, Failure)
    assert answer.message

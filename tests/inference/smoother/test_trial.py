"""A trial step from a linearised problem: which windows are simulated, and which are linearised again."""

import numpy as np
import pytest

from clutchid.inference.smoother import trial as module
from clutchid.inference.smoother.problem import condense, linearise
from clutchid.inference.smoother.rows import Sensors
from clutchid.inference.smoother.trial import (
    COST_TOLERANCE,
    RESIMULATION_DISTANCE,
    accept,
    evaluate_step,
    stepped_states,
    with_theta_fixed,
    with_theta_free,
)
from clutchid.numerics.failure import Failure
from clutchid.simulation.windows import units

NAMES = ("theta_5", "theta_9", "C_vs", "F_C", "tau_y")


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    return problem_of([recorded_by(plant, seconds=4.0)], plant, NAMES, ("position", "pressure_a"))


@pytest.fixture(scope="module")
def current(problem, starts_of):
    return linearise(problem, np.zeros(len(NAMES)), starts_of(problem))


@pytest.fixture
def counted(monkeypatch):
    """How many windows are simulated, and how many linearised."""
    counts = {"simulated": 0, "linearised": 0}
    cost, linearise_windows = module.window_cost, module.linearise_windows

    def simulated(*arguments, **options):
        counts["simulated"] += 1
        return cost(*arguments, **options)

    def linearised(*arguments):
        counts["linearised"] += len(arguments[-1])
        return linearise_windows(*arguments)

    monkeypatch.setattr(module, "window_cost", simulated)
    monkeypatch.setattr(module, "linearise_windows", linearised)
    return counts


def nudged(problem, current, window, size=1e-3):
    """Starts with one of them moved by `size` of a natural size, in all states."""
    X = [states.copy() for states in current.X]
    X[0][window] += size * units(problem.actuator)
    return X


def test_a_step_that_moves_nothing_is_not_simulated_and_keeps_every_derivative(problem, current, counted):
    trial = evaluate_step(problem, current, current.x, current.X)
    assert trial.cost == pytest.approx(current.cost, rel=1e-12)
    candidate = accept(problem, trial)
    assert counted == {"simulated": 0, "linearised": 0}
    assert np.array_equal(
        candidate.chains[0].windows.linearised.jacobian, current.chains[0].windows.linearised.jacobian
    )


def test_only_the_window_that_moves_is_simulated(problem, current, counted, cost_at):
    X = nudged(problem, current, 9, 0.1)
    trial = evaluate_step(problem, current, current.x, X)
    assert counted["simulated"] == 1
    assert trial.simulated[0].distance[9] == 0.0
    # the window itself is simulated, and with it the links before and after
    assert trial.cost == pytest.approx(cost_at(problem, current.x, X), rel=1e-9)


def test_a_window_that_did_otherwise_is_linearised_again_and_no_other(problem, current, counted):
    X = nudged(problem, current, 9, 0.5)
    trial = evaluate_step(problem, current, current.x, X)
    assert abs(trial.excess[0][9]) > COST_TOLERANCE, "the step must be far from linear, or nothing is tested"
    candidate = accept(problem, trial)
    assert counted["linearised"] == 1
    fresh, old, new = (
        linear.chains[0].windows.linearised for linear in (linearise(problem, current.x, X), current, candidate)
    )
    assert new.jacobian[9] == pytest.approx(fresh.jacobian[9], rel=1e-9)
    assert np.array_equal(np.delete(new.jacobian, 9, axis=0), np.delete(old.jacobian, 9, axis=0))


def test_small_steps_one_after_another_add_up_until_the_window_is_simulated(problem, current, counted, cost_at):
    at, simulated = current, []
    for number in range(1, 40):
        X = nudged(problem, current, 9, 2e-5 * number)
        trial = evaluate_step(problem, at, current.x, X)
        simulated.append(counted["simulated"])
        assert np.all(trial.simulated[0].distance <= RESIMULATION_DISTANCE)
        assert trial.cost == pytest.approx(cost_at(problem, current.x, X), abs=0.2)
        at = accept(problem, trial)
    assert simulated[0] == 0
    assert 1 <= simulated[-1] < 20


def test_what_the_linear_problem_says_of_a_step_is_what_happens_to_first_order(problem, current, cost_at):
    rng = np.random.default_rng(1)
    unit = units(problem.actuator)
    move, by = rng.standard_normal(current.X[0].shape), rng.standard_normal(len(NAMES))
    (track,) = problem.tracks
    predicted, happened = [], []
    for h in (1e-5, -1e-5):
        predicted.append(np.sum(current.chains[0].windows.linearised.extrapolated(h * move, h * by).cost))
        mapped, starts = problem.parameter_map(h * by, "log"), current.X[0] + h * move * unit
        sensors = Sensors.of(track, mapped, problem.measure, problem.noise)
        costs = [
            module.window_cost(track, window, start, mapped, sensors)[1]
            for window, start in zip(track.windows, starts, strict=True)
        ]
        happened.append(np.sum(costs))
    assert np.diff(predicted) == pytest.approx(np.diff(happened), rel=2e-3)


def test_a_step_of_the_parameters_is_simulated_everywhere_it_matters(problem, current, cost_at):
    x = current.x + np.array([0.02, -0.01, 0.05, 0.05, 0.1])
    trial = evaluate_step(problem, current, x, current.X)
    assert trial.cost == pytest.approx(
        cost_at(problem, x, current.X), abs=RESIMULATION_DISTANCE * len(problem.tracks[0].windows)
    )
    candidate = accept(problem, trial)
    fresh = linearise(problem, x, current.X)
    factors = [condense(problem, linear)[0] for linear in (candidate, fresh)]
    theta = [np.linalg.lstsq(factor[:-1, :-1], -factor[:-1, -1], rcond=None)[0] for factor in factors]
    # the step that follows from kept derivatives is that of new ones, to a fraction of what the problem is uncertain by
    factor = factors[1][:-1, :-1]
    assert np.linalg.norm(factor @ (theta[0] - theta[1])) < 0.3 * np.linalg.norm(factor @ theta[1])


def test_the_last_trial_is_where_the_next_one_begins(problem, current, counted):
    X = nudged(problem, current, 9, 0.5)
    last = evaluate_step(problem, current, current.x, X)
    again = evaluate_step(problem, current, current.x, X, last)
    assert counted["simulated"] == 1
    assert again.cost == pytest.approx(last.cost, rel=1e-12)


def test_fixed_and_freed_again_the_problem_is_the_same(problem, current):
    fixed = with_theta_fixed(problem, current)
    n = units(problem.actuator).size
    assert fixed.chains[0].first.shape == (n, n + 1)
    assert fixed.cost == current.cost
    chains = condense(problem, fixed)[1]
    X = stepped_states(problem, fixed.X, chains, np.zeros(0))
    candidate = accept(problem, evaluate_step(problem, fixed, current.x, X), free=False)
    assert isinstance(candidate.cost, float)
    freed = with_theta_free(problem, current, candidate)
    assert freed.cost == pytest.approx(candidate.cost, rel=1e-12)
    assert all(np.array_equal(states, final) for states, final in zip(freed.X, candidate.X, strict=True))
    fresh = linearise(problem, freed.x, freed.X)
    R, expected = (condense(problem, states)[0][:-1, :-1] for states in (freed, fresh))
    assert np.linalg.norm(R.T @ R - expected.T @ expected) < 0.05 * np.linalg.norm(expected.T @ expected)


def test_a_step_that_cannot_be_simulated_is_a_failure(problem, current):
    X = nudged(problem, current, 4)
    X[0][4, 2] = np.nan
    answer = evaluate_step(problem, current, current.x, X)
    assert isinstance(answer, Failure)
    assert answer.message

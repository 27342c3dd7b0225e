"""The linearised problem: cost, gradient, numbers of one recording, bounds, and what cannot be simulated."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.inference.problem import Problem, prior_rows
from clutchid.inference.smoother.problem import condense, linearise
from clutchid.inference.smoother.rows import recover
from clutchid.inference.uncertainty.coordinates import PRIOR_LIMIT, Prior, coordinates
from clutchid.model import Actuator, Load
from clutchid.model.variants import VARIANTS
from clutchid.numerics.failure import Failure
from clutchid.preparation.prepare import prepare
from clutchid.simulation.noise import Noise
from clutchid.simulation.windows import tracks, units
from fixtures.dense import window_rows

NAMES = ("theta_5", "theta_9", "theta_14", "C_vs", "P_S", "F_C", "T_w", "P_0", "tau_y", "tau_p", "e_y")
#: Number of states.
N = len(VARIANTS["energy-balance-stribeck"])


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    return problem_of([recorded_by(plant, seconds=3.0)], plant, NAMES)


@pytest.fixture(scope="module")
def point(problem, starts_of):
    """A point away from every optimum, so that all terms of the cost are at work."""
    rng = np.random.default_rng(2)
    return 0.3 * rng.standard_normal(len(NAMES)), starts_of(problem)


def inflated(problem, factor, **noise):
    return replace(problem, noise=replace(problem.noise, **noise).inflated(factor))


@pytest.mark.parametrize("inflation", [1.0, 30.0])
def test_the_cost_of_the_linearised_problem_is_the_cost_without_derivatives(problem, point, cost_at, inflation):
    soft = inflated(problem, inflation)
    assert linearise(soft, *point).cost == pytest.approx(cost_at(soft, *point), rel=1e-9)


def own_gradient(linear, size, n):
    """Derivative of the cost with respect to theta with fixed states, from the rows before any state is eliminated."""
    total = 2 * linear.prior[:, :-1].T @ linear.prior[:, -1]
    for chain in linear.chains:
        blocks = [
            (chain.first, n),
            *((rows, n) for rows in window_rows(chain)),
            *((link, 2 * n) for link in chain.links),
        ]
        total = total + sum(2 * rows[:, skip:-1].T @ rows[:, -1] for rows, skip in blocks)
    assert total.shape == (size,)
    return total


@pytest.mark.parametrize("outlier", [1e9, 4.0])
def test_the_gradient_to_theta_at_fixed_states_is_that_of_differences(problem, point, cost_at, outlier):
    x, X = point
    soft = inflated(problem, 8.0, outlier=outlier)
    gradient = own_gradient(linearise(soft, x, X), x.size, N)
    h = 1e-5
    for i, name in enumerate(NAMES):
        e = h * np.eye(x.size)[i]
        central = (cost_at(soft, x + e, X) - cost_at(soft, x - e, X)) / (2 * h)
        # hundreds of kinks of the model lie in a recording; each moves by the step only
        assert gradient[i] == pytest.approx(central, rel=2e-3, abs=1e-5 * np.abs(gradient).max()), name


def test_the_gradient_to_the_states_is_that_of_differences(problem, point, cost_at):
    x, X = point
    soft = inflated(problem, 8.0)
    linear, unit, h = linearise(soft, x, X), units(problem.actuator), 1e-6
    chain, number = linear.chains[0], 12
    own, before, after = window_rows(chain)[number], chain.links[number - 1], chain.links[number]
    gradient = 2 * (own[:, :N].T @ own[:, -1] + before[:, N : 2 * N].T @ before[:, -1] + after[:, :N].T @ after[:, -1])
    for state in range(N):
        costs = []
        for sign in (1, -1):
            moved = X[0].copy()
            moved[number, state] += sign * h * unit[state]
            costs.append(cost_at(soft, x, [moved]))
        central = (costs[0] - costs[1]) / (2 * h)
        assert gradient[state] == pytest.approx(central, rel=2e-3, abs=1e-5 * np.abs(gradient).max())


def test_the_condensed_gradient_is_that_of_the_cost_with_states_that_follow(problem, point):
    x, X = point
    linear = linearise(inflated(problem, 8.0), x, X)
    factor, chains = condense(problem, linear)
    R, q = factor[:-1, :-1], factor[:-1, -1]
    # with the states moved to where they are best, a step in theta changes the linearised cost by 2 q^T R d + |R d|^2
    d = 1e-3 * np.random.default_rng(3).standard_normal(x.size)
    change = 2 * q @ R @ d + np.sum((R @ d) ** 2)

    def linearised(step, states):
        rows = [linear.prior @ np.append(step, 1.0)]
        for chain, moved in zip(linear.chains, states, strict=True):
            rows.append(chain.first @ np.concatenate([moved[0], step, [1.0]]))
            rows += [own @ np.concatenate([u, step, [1.0]]) for own, u in zip(window_rows(chain), moved, strict=True)]
            pairs = zip(chain.links, moved[:-1], moved[1:], strict=True)
            rows += [link @ np.concatenate([u, v, step, [1.0]]) for link, u, v in pairs]
        return float(np.sum(np.concatenate(rows) ** 2))

    at = [[recover(chain, step[:, None])[:, :, 0] for chain in chains] for step in (np.zeros(x.size), d)]
    assert linearised(d, at[1]) - linearised(np.zeros(x.size), at[0]) == pytest.approx(change, rel=1e-6)
    assert linearised(d, at[1]) < linearised(d, at[0]), "states that follow cost less than states that stay"


@pytest.fixture(scope="module")
def pair(plant, recorded_by):
    """Two recordings of one plant, the second on a supply pressure of 8.2 bar."""
    low = plant.replace({"P_S": 8.2e5})
    return [recorded_by(plant, 3.0, name="one"), recorded_by(low, 3.0, name="two")]


def test_a_number_of_one_recording_stands_in_for_the_shared_one(pair, plant, problem_of):
    problem = problem_of(pair, plant, ("theta_5", "P_S", "P_S@two", "C_vs"))
    assert problem.places("one") == [0, 1, 3]
    assert problem.places("two") == [0, 2, 3]
    x = np.array([0.0, 0.0, problem.coordinates[2].of(8.2e5), 0.1])
    first, second = (problem.actuator_of(x, stem).parameters for stem in ("one", "two"))
    assert pytest.approx((9e5, 8.2e5)) == (first.P_S, second.P_S)
    assert first.C_vs == second.C_vs == pytest.approx(19e-9 * np.exp(0.015))


def test_each_recording_says_something_about_its_own_numbers_only(pair, plant, problem_of, starts_of):
    problem = problem_of(pair, plant, ("P_S@one", "P_S@two"))
    linear = linearise(problem, np.zeros(2), starts_of(problem))
    for number, chain in enumerate(linear.chains):
        influence = [np.abs(rows[:, N:-1]).max(axis=0) for rows in window_rows(chain)]
        influence += [np.abs(link[:, 2 * N : -1]).max(axis=0) for link in chain.links]
        largest = np.max(influence, axis=0)
        assert largest[number] > 0.0
        assert largest[1 - number] == 0.0


def test_bounds_of_x_lead_to_the_bounds_in_si(plant, recorded_by, problem_of):
    log = recorded_by(plant, 0.5)
    limits = {"P_S": (8e5, 9.5e5), "e_y": (-1e-5, 3e-5), "theta_4": (0.0, np.inf)}
    problem = problem_of([log], plant, ("P_S", "e_y", "theta_4", "C_vs"), bounds=limits)
    low, high = problem.bounds()
    assert [c.si(v) for c, v in zip(problem.coordinates[:3], low[:3], strict=True)] == pytest.approx([8e5, -1e-5, 0.0])
    assert [c.si(v) for c, v in zip(problem.coordinates[:2], high[:2], strict=True)] == pytest.approx([9.5e5, 3e-5])
    assert np.all(low < high)
    assert (low[3], high[2], high[3]) == (-PRIOR_LIMIT, PRIOR_LIMIT, PRIOR_LIMIT), (
        "no number goes far from what is known of it"
    )


def test_prior_rows_hold_every_number_and_the_shape_of_a_free_load(problem, plant):
    x = np.linspace(-1, 1, len(NAMES))
    rows = prior_rows(problem, x)
    assert np.array_equal(rows[: x.size], np.column_stack([np.eye(x.size), x]))
    assert rows.shape[0] == x.size + len(plant.load.knots)
    h = 1e-3
    for i in range(x.size):
        e = h * np.eye(x.size)[i]
        central = (prior_rows(problem, x + e)[:, -1] - prior_rows(problem, x - e)[:, -1]) / (2 * h)
        assert rows[:, i] == pytest.approx(central, abs=1e-6)
    straight = prior_rows(replace(problem, coordinates=problem.coordinates[3:]), x[3:])
    assert straight.shape == (x.size - 3, x.size - 2), "a load that is not free needs no shape"


def test_what_is_remembered_of_a_point_is_that_of_its_values(problem):
    x = np.linspace(-1, 1, len(NAMES))
    mapped, rows = problem.parameter_maps(x), prior_rows(problem, x)
    assert problem.parameter_maps(x.copy()) is mapped
    assert prior_rows(problem, x.copy()) is rows
    before = mapped["log"].actuator
    x += 0.1
    assert problem.parameter_maps(x)["log"].actuator == problem.actuator_of(x, "log") != before
    assert np.array_equal(prior_rows(problem, x)[: x.size, -1], x)
    with pytest.raises(ValueError, match="read-only"):
        rows[0, 0] = 2.0


def test_the_papers_splines_have_no_smoothness_to_pay(drive_log, problem_of):
    actuator = Actuator(load=Load((9e5, 0.0, 0.0)))
    problem = replace(problem_of([drive_log], actuator, ("theta_1", "theta_2")), reference=actuator.load.theta)
    assert prior_rows(problem, np.zeros(2)).shape == (2, 3)


def test_numbers_that_contradict_each_other_are_a_failure(drive_log, plant):
    names = ("R_0vs", "R_1vs")
    plans = [prepare(drive_log.slice(0, 500), plant, ("position",))]
    priors = {"R_0vs": Prior(0.07, 0.5)}
    problem = Problem(
        plant, coordinates(plant, names, {}, priors), ("log",), ("position",), Noise(), tracks=tracks(plans)
    )
    x, X = np.array([1.8, 0.0]), [np.zeros((len(problem.tracks[0].windows), N))]
    answer = linearise(problem, x, X)
    assert isinstance(answer, Failure)
    assert "R_0vs" in answer.message


def test_states_that_cannot_be_simulated_are_a_failure(problem, point):
    x, X = point
    bad = [X[0].copy()]
    bad[0][4, 2] = np.nan
    answer = linearise(problem, x, bad)
    assert isinstance(answer, Failure)
    assert answer.message

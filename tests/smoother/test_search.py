"""The search finds a load from position alone, keeps its bounds, and survives trial points that fail."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from clutchid.numerics.failure import Failure
from clutchid.smoother import projection, trial
from clutchid.smoother import search as module
from clutchid.smoother.problem import condense, linearise
from clutchid.smoother.search import FROM_AFAR, FROM_NEAR, ShootingSolution, search
from clutchid.smoother.settling import followed
from clutchid.smoother.trial import attempt


@pytest.fixture(scope="module")
def task(plant, worn_log, task_of):
    """The worn plant's recording, seen with everything but its load known: the load is 8 % off."""
    return task_of([worn_log], plant, plant.load.names, ("position",))


@pytest.fixture(scope="module")
def start(task, starts_of):
    return np.zeros(len(task.coordinates)), starts_of(task)


@pytest.fixture(scope="module")
def found(task, start):
    return search(task, *start, FROM_NEAR)


def forces(task, x, y):
    return task.actuator_of(x, "worn").load.force(y)


def deviations(task, found, y):
    """Standard deviation of the load at positions y as the curvature of the cost says."""
    factor, _ = condense(task, linearise(task, found.x, found.X))
    root = np.linalg.inv(factor[:-1, :-1]) * task.slopes(found.x)[:, None]
    return np.linalg.norm(task.actuator.load.phi(y) @ root, axis=1)


def test_a_load_8_percent_off_is_found_from_position_alone_within_what_noise_allows(task, found, worn):
    assert found.status == "converged"
    y = np.linspace(0.5e-3, 20e-3, 40)
    miss = forces(task, found.x, y) - worn.load.force(y)
    before = task.actuator.load.force(y) - worn.load.force(y)
    # the covariance counts a position noise of 50 µm and a model's own error that these recordings do not have, so
    # three of its deviations hold everywhere
    assert np.all(np.abs(miss) < 3 * deviations(task, found, y))
    assert np.sqrt(np.mean(miss**2)) < 0.05 * np.sqrt(np.mean(before**2))


def test_the_end_is_a_minimum_to_every_side(task, found, cost_at):
    cost = cost_at(task, found.x, found.X)
    # windows that have hardly moved since they were simulated are not simulated again
    assert cost == pytest.approx(found.at.cost, abs=projection.SETTLED)
    here = linearise(task, found.x, found.X)
    factor, chains = condense(task, here)
    # what a whole undamped step could still gain is near what the search takes for nothing
    assert np.sum(factor[:-1, -1] ** 2) < 2 * projection.SETTLED
    for place in (3, 8, 13):
        for sign in (-1, 1):
            # far enough that the cost of a parabola would rise by 9
            step = sign * 3.0 / np.linalg.norm(factor[:-1, place]) * np.eye(found.x.size)[place]
            assert cost_at(task, found.x + step, followed(task, found.X, chains, step)) > cost


def test_from_afar_and_from_near_the_search_ends_in_the_same_load(task, start, found):
    afar = search(task, *start, FROM_AFAR)
    y = np.linspace(0.5e-3, 20e-3, 40)
    # both end where a step gains less than `SETTLED`, of the 1 that a deviation costs
    assert np.all(np.abs(forces(task, afar.x, y) - forces(task, found.x, y)) < 0.7 * deviations(task, found, y))
    assert afar.at.cost == pytest.approx(found.at.cost, rel=1e-3)


def test_a_trial_point_that_fails_neither_ends_nor_poisons_the_search(task, start, found, monkeypatch):
    calls = {"attempt": 0, "told": 0}
    linearise_windows = trial.linearise_windows

    def failing_attempt(*arguments):
        calls["attempt"] += 1
        return Failure("no such state.") if calls["attempt"] % 5 == 1 else attempt(*arguments)

    def failing_told(*arguments):
        calls["told"] += 1
        return Failure("no such state.") if calls["told"] % 7 == 3 else linearise_windows(*arguments)

    monkeypatch.setattr(projection, "attempt", failing_attempt)
    monkeypatch.setattr("clutchid.smoother.settling.attempt", failing_attempt)
    monkeypatch.setattr(trial, "linearise_windows", failing_told)
    answer = search(task, *start, (1.0,))
    assert isinstance(answer, ShootingSolution)
    assert min(calls.values()) >= 4, "several of the trial points have failed"
    assert np.isfinite(answer.x).all()
    # where a step has failed a shorter one is taken
    assert answer.at.cost == pytest.approx(found.at.cost, rel=2e-3)
    y = np.linspace(0.5e-3, 20e-3, 40)
    assert np.all(np.abs(forces(task, answer.x, y) - forces(task, found.x, y)) < 0.7 * deviations(task, found, y))


def test_a_search_whose_every_trial_fails_stays_where_it_was(task, start, monkeypatch):
    for name in ("projection", "settling"):
        monkeypatch.setattr(f"clutchid.smoother.{name}.attempt", lambda *_: Failure("no such state."))
    answer = search(task, *start, (1.0,))
    assert answer.status == "stalled"
    assert np.array_equal(answer.x, start[0])
    assert all(np.array_equal(one, other) for one, other in zip(answer.X, start[1], strict=True))


@pytest.mark.parametrize(("hoped", "status", "begun"), [(375.0, "stalled", 2), (1.0, "converged", 1)])
def test_a_step_too_short_to_gain_is_the_end_only_where_little_is_hoped_for(
    task, start, monkeypatch, hoped, status, begun
):
    begins, begin = [], projection._Way.begin

    def counted(way, *at):
        begins.append(at)
        return begin(way, *at)

    def shortened(_way, here, _longest):
        return replace(here, cost=here.cost - 0.04), hoped, 1e-4

    monkeypatch.setattr(projection._Way, "begin", counted)
    monkeypatch.setattr(projection._Way, "step", shortened)
    assert search(task, *start, (1.0,)).status == status
    assert len(begins) == begun


def test_a_start_that_cannot_be_simulated_is_a_failure_with_its_sentence(task, start):
    broken = [X.copy() for X in start[1]]
    broken[0][5, 1] = np.nan
    answer = search(task, start[0], broken, FROM_NEAR)
    assert isinstance(answer, Failure)
    assert answer.message.endswith(".")


@pytest.fixture(scope="module")
def mass_task(plant, worn_log, task_of):
    """Only the mass of the piston, 10 kg, and the supply valve are free."""
    return task_of([worn_log], plant, ("M", "C_vs"), ("position",))


def test_a_start_for_which_the_steps_were_not_made_is_a_failure_that_names_the_number(mass_task, starts_of):
    # 1 g of piston: its fastest motion is ten thousand times too fast for the steps of 10 kg
    start = np.array([np.log(1e-4) / 0.15, 0.0])
    assert mass_task.si(start)[0] == pytest.approx(1e-3)
    answer = search(mass_task, start, starts_of(mass_task), (8.0, 1.0))
    assert isinstance(answer, Failure)
    assert answer.message.startswith("worn: ")
    assert "M = 0.001 kg" in answer.message


@pytest.mark.parametrize("share", [0.1, 3.0])
def test_a_poor_start_that_can_be_simulated_is_left_for_the_same_end(mass_task, starts_of, share):
    near, far = (
        search(mass_task, np.array([np.log(of) / 0.15, 0.0]), starts_of(mass_task), (8.0, 1.0)) for of in (1.0, share)
    )
    assert near.status == far.status == "converged"
    assert far.at.cost == pytest.approx(near.at.cost, abs=projection.SETTLED)
    # each ends where a step would gain less than `SETTLED`, the square of its length in standard deviations
    factor, _ = condense(mass_task, linearise(mass_task, near.x, near.X))
    assert np.linalg.norm(factor[:-1, :-1] @ (far.x - near.x)) < 2 * np.sqrt(projection.SETTLED)


def test_bounds_are_kept_exactly_and_met_where_the_truth_lies_beyond(plant, worn_log, worn, task_of, starts_of):
    name, most = "theta_9", 1.02 * plant.value("theta_9")
    assert worn.value(name) > most
    task = task_of([worn_log], plant, plant.load.names, ("position",), bounds={name: (0.0, most)})
    answer = search(task, np.zeros(22), starts_of(task), FROM_NEAR)
    place = task.names.index(name)
    assert task.si(answer.x)[place] == most
    assert answer.x[place] == task.bounds()[1][place]


def test_no_trial_point_leaves_the_bounds(plant, worn_log, task_of, starts_of, monkeypatch):
    limits = {"theta_9": (3600.0, 3950.0), "C_vs": (18.9e-9, 19.5e-9), "tau_y": (0.5e-3, 2e-3)}
    task = task_of([worn_log], plant, (*plant.load.names, "C_vs", "tau_y"), ("position",), bounds=limits)
    low, high = task.bounds()
    tried = []

    def watched(t, here, x, X, last=None):
        tried.append(x)
        return attempt(t, here, x, X, last)

    for name in ("search", "projection", "settling"):
        monkeypatch.setattr(f"clutchid.smoother.{name}.attempt", watched)
    search(task, np.zeros(24), starts_of(task), FROM_NEAR)
    assert len({tuple(x) for x in tried}) >= 4
    assert all(np.all((low <= x) & (x <= high)) for x in tried)


def test_every_step_lowers_the_cost_of_its_stage(task, start, monkeypatch):
    accepted = []
    step, reached = module._step, projection._Way._reached

    def watched(t, here, *rest):
        there = step(t, here, *rest)
        accepted.append((t.noise.measured["position"], here.cost, there))
        return there

    def settled(way, here, *rest):
        there = reached(way, here, *rest)
        accepted.append((way.task.noise.measured["position"], here.cost, there))
        return there

    monkeypatch.setattr(module, "_step", watched)
    monkeypatch.setattr(projection._Way, "_reached", settled)
    search(task, *start, FROM_NEAR)
    taken = [(scale, cost, there.cost) for scale, cost, there in accepted if not isinstance(there, Failure)]
    assert len(taken) >= 4
    assert all(after < before for _, before, after in taken)
    assert [scale for scale, *_ in taken] == sorted((scale for scale, *_ in taken), reverse=True)
    for (one, _, reached_cost), (other, begun, _) in pairwise(taken):
        # the next step begins where the last has ended; one window or another is simulated in between
        assert one != other or begun == pytest.approx(reached_cost, abs=projection.SETTLED)


def test_progress_is_told_with_a_growing_number_and_the_name_of_the_stage(task, start):
    told = []
    answer = search(task, *start, FROM_NEAR, lambda stage, count: told.append((stage, count)))
    assert list(dict.fromkeys(stage for stage, _ in told)) == ["coarse", "fine"]
    counts = [count for _, count in told]
    assert counts == sorted(counts)
    assert answer.evaluations >= counts[-1]


def test_without_a_stage_there_is_nothing_to_find(task, start):
    assert isinstance(search(task, *start, ()), Failure)


def test_missing_samples_change_the_load_by_less_than_the_noise_allows(
    plant, worn_log, task_of, starts_of, found, task
):
    position = worn_log["position"].copy()
    position[1000:1060] = np.nan
    position[::7] = np.nan
    holed = task_of([worn_log.with_columns(position=position)], plant, plant.load.names, ("position",))
    answer = search(holed, np.zeros(22), starts_of(holed), FROM_NEAR)
    y = np.linspace(0.5e-3, 20e-3, 40)
    assert answer.status == "converged"
    assert forces(task, answer.x, y) == pytest.approx(forces(task, found.x, y), abs=0.01 * 5000)


def test_pressure_that_is_not_asked_for_is_not_used(plant, worn, recorded_by, task_of, starts_of, found):
    log = recorded_by(worn, seconds=6.0, seed=5, name="worn", driven=1)
    wrong = log.with_columns(pressure_a=log["pressure_a"] + 5e4)
    blind = task_of([wrong], plant, plant.load.names, ("position",))
    answer = search(blind, np.zeros(22), starts_of(blind), FROM_NEAR)
    assert np.array_equal(answer.x, found.x)

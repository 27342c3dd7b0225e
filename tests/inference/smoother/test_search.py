"""The search finds a load from position alone, keeps its bounds, and survives trial points that fail."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from clutchid.inference.smoother import search as module
from clutchid.inference.smoother import trial
from clutchid.inference.smoother.problem import condense, linearise
from clutchid.inference.smoother.search import FINE_STAGE, STAGES_FROM_CALIBRATION, STAGES_FROM_PRIOR, Effort, search
from clutchid.inference.smoother.trial import evaluate_step, shifted_states
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution

Y = np.linspace(0.5e-3, 20e-3, 40)


@pytest.fixture(scope="module")
def problem(plant, worn_log, problem_of):
    """The worn plant's recording, with everything but its load known: the load is 8 % off."""
    return problem_of([worn_log], plant, plant.load.names, ("position",))


@pytest.fixture(scope="module")
def start(problem, starts_of):
    return np.zeros(len(problem.coordinates)), starts_of(problem)


@pytest.fixture(scope="module")
def solution(problem, start):
    return search(problem, *start, STAGES_FROM_CALIBRATION)


def forces(problem, x):
    return problem.actuator_of(x, "worn").load.force(Y)


def deviations(problem, solution):
    """Standard deviation of the load at positions Y as the curvature of the cost says."""
    factor, _ = condense(problem, linearise(problem, solution.x, solution.at.X))
    root = np.linalg.inv(factor[:-1, :-1]) * problem.slopes(solution.x)[:, None]
    return np.linalg.norm(problem.actuator.load.phi(Y) @ root, axis=1)


def test_a_load_8_percent_off_is_found_from_position_alone_within_what_noise_allows(problem, solution, worn):
    assert solution.status == "converged"
    miss = forces(problem, solution.x) - worn.load.force(Y)
    before = problem.actuator.load.force(Y) - worn.load.force(Y)
    # the covariance counts a position noise of 50 µm and a model's own error that these recordings do not have, so
    # three of its deviations hold everywhere
    assert np.all(np.abs(miss) < 3 * deviations(problem, solution))
    assert np.sqrt(np.mean(miss**2)) < 0.05 * np.sqrt(np.mean(before**2))


@pytest.mark.parametrize("most", [1, 2, 5, 9, 14])
def test_a_search_takes_no_evaluation_more_than_its_limit_and_says_that_it_has_not_converged(problem, start, most):
    reported = []
    limited = search(problem, *start, FINE_STAGE, reported.append, effort=Effort(most, whole=most))
    assert limited.status == "limit"
    assert limited.evaluations <= most
    assert [step.evaluations for step in reported] == list(range(1, limited.evaluations))
    assert {step.most for step in reported} <= {most}


def test_the_end_is_a_minimum_to_every_side(problem, solution, cost_at):
    cost = cost_at(problem, solution.x, solution.at.X)
    # windows that have hardly moved since they were simulated are not simulated again
    assert cost == pytest.approx(solution.at.cost, abs=module.CONVERGED_GAIN)
    current = linearise(problem, solution.x, solution.at.X)
    factor, chains = condense(problem, current)
    # what a whole undamped step could still gain is near what the search takes for nothing
    assert np.sum(factor[:-1, -1] ** 2) < 2 * module.CONVERGED_GAIN
    for place in (3, 8, 13):
        for sign in (-1, 1):
            # far enough that the cost of a parabola would rise by 9
            step = sign * 3.0 / np.linalg.norm(factor[:-1, place]) * np.eye(solution.x.size)[place]
            assert cost_at(problem, solution.x + step, shifted_states(problem, solution.at.X, chains, step)) > cost


def test_from_afar_and_from_near_the_search_ends_in_the_same_load(problem, start, solution):
    from_prior = search(problem, *start, STAGES_FROM_PRIOR)
    # both end where a step gains less than `CONVERGED_GAIN`, of the 1 that a deviation costs
    assert np.all(
        np.abs(forces(problem, from_prior.x) - forces(problem, solution.x)) < 0.7 * deviations(problem, solution)
    )
    assert from_prior.at.cost == pytest.approx(solution.at.cost, rel=1e-3)


def test_a_trial_point_that_fails_neither_ends_nor_poisons_the_search(problem, start, solution, monkeypatch):
    calls = {"evaluate_step": 0, "linearise_windows": 0}
    linearise_windows = trial.linearise_windows

    def failing_attempt(*arguments):
        calls["evaluate_step"] += 1
        return Failure("no such state.") if calls["evaluate_step"] % 5 == 1 else evaluate_step(*arguments)

    def failing_linearisation(*arguments):
        calls["linearise_windows"] += 1
        return Failure("no such state.") if calls["linearise_windows"] % 7 == 3 else linearise_windows(*arguments)

    monkeypatch.setattr(module, "evaluate_step", failing_attempt)
    monkeypatch.setattr("clutchid.inference.smoother.trial.evaluate_step", failing_attempt)
    monkeypatch.setattr(trial, "linearise_windows", failing_linearisation)
    answer = search(problem, *start, (1.0,))
    assert isinstance(answer, Solution)
    assert min(calls.values()) >= 4, "several of the trial points have failed"
    assert np.isfinite(answer.x).all()
    # where a step has failed a shorter one is taken
    assert answer.at.cost == pytest.approx(solution.at.cost, rel=2e-3)
    assert np.all(np.abs(forces(problem, answer.x) - forces(problem, solution.x)) < 0.7 * deviations(problem, solution))


def test_a_search_whose_every_trial_fails_stays_where_it_was(problem, start, monkeypatch):
    for name in ("search", "trial"):
        monkeypatch.setattr(f"clutchid.inference.smoother.{name}.evaluate_step", lambda *_: Failure("no such state."))
    answer = search(problem, *start, (1.0,))
    assert answer.status == "stalled"
    assert np.array_equal(answer.x, start[0])
    assert all(np.array_equal(state, expected) for state, expected in zip(answer.at.X, start[1], strict=True))


@pytest.fixture
def started(monkeypatch):
    """Where the problem has been linearised anew for a projection."""
    calls, original = [], module.VariableProjection.start

    def counted(projected, *at):
        calls.append(at)
        return original(projected, *at)

    monkeypatch.setattr(module.VariableProjection, "start", counted)
    return calls


@pytest.mark.parametrize(("predicted", "status", "starts"), [(375.0, "stalled", 2), (1.0, "converged", 1)])
def test_a_step_too_short_to_gain_is_the_end_only_where_little_gain_is_predicted(
    problem, start, started, monkeypatch, predicted, status, starts
):
    def shortened(_projection, current, _radius):
        return replace(current, cost=current.cost - 0.04), predicted, 1e-4

    monkeypatch.setattr(module.VariableProjection, "step", shortened)
    assert search(problem, *start, (1.0,)).status == status
    assert len(started) == starts


def test_a_step_that_gains_little_of_what_it_predicted_has_the_problem_linearised_anew(
    problem, start, started, monkeypatch
):
    shares = iter([0.5, 0.1, 0.1, 0.1, 0.5])

    def gaining(_projection, current, radius):
        share = next(shares, 0.0)
        return replace(current, cost=current.cost * (1.0 - 1e-3 * share)), 1e-3 * current.cost if share else 0.0, radius

    monkeypatch.setattr(module.VariableProjection, "step", gaining)
    assert search(problem, *start, (1.0,)).status == "converged"
    # the first, then after the second and the fourth step: the third is the first after a new linearisation
    assert len(started) == 3


@pytest.mark.parametrize(("part", "steps"), [(0.9, 3), (1.1, 6)])
def test_two_steps_far_below_predictions_that_do_not_matter_end_a_search(problem, start, monkeypatch, part, steps):
    predicted, gains = part * module.INSIGNIFICANT * start[0].size, iter([0.5, 0.2, 0.2, 0.2, 0.2])
    taken = []

    def gaining(_projection, current, radius):
        share = next(gains, 0.0)
        taken.append(share)
        return replace(current, cost=current.cost - share * predicted), predicted if share else 0.0, radius

    monkeypatch.setattr(module.VariableProjection, "step", gaining)
    assert search(problem, *start, (1.0,)).status == "converged"
    assert len(taken) == steps


def test_a_search_goes_on_from_a_point_nearby_without_linearising_all_windows_anew(problem, solution, started):
    x = solution.x + 0.05
    near = search(problem, x, solution.at, (1.0,))
    assert not started
    from_starts = search(problem, x, solution.at.X, (1.0,))
    assert near.at.cost == pytest.approx(from_starts.at.cost, abs=2 * module.CONVERGED_GAIN)


def test_a_start_that_cannot_be_simulated_is_a_failure_with_its_sentence(problem, start):
    broken = [X.copy() for X in start[1]]
    broken[0][5, 1] = np.nan
    answer = search(problem, start[0], broken, STAGES_FROM_CALIBRATION)
    assert isinstance(answer, Failure)
    assert answer.message.endswith(".")


@pytest.fixture(scope="module")
def mass_problem(plant, worn_log, problem_of):
    """Only the mass of the piston, 10 kg, and the supply valve are free."""
    return problem_of([worn_log], plant, ("M", "C_vs"), ("position",))


def test_a_start_for_which_the_steps_were_not_made_is_a_failure_that_names_the_number(mass_problem, starts_of):
    # 1 g of piston: its fastest motion is ten thousand times too fast for the steps of 10 kg
    start = np.array([np.log(1e-4) / 0.15, 0.0])
    assert mass_problem.si(start)[0] == pytest.approx(1e-3)
    answer = search(mass_problem, start, starts_of(mass_problem), (8.0, 1.0))
    assert isinstance(answer, Failure)
    assert answer.message.startswith("worn: ")
    assert "M = 0.001 kg" in answer.message


@pytest.mark.parametrize("share", [0.1, 3.0])
def test_a_poor_start_that_can_be_simulated_is_left_for_the_same_end(mass_problem, starts_of, share):
    near, far = (
        search(mass_problem, np.array([np.log(of) / 0.15, 0.0]), starts_of(mass_problem), (8.0, 1.0))
        for of in (1.0, share)
    )
    assert near.status == far.status == "converged"
    assert far.at.cost == pytest.approx(near.at.cost, abs=module.CONVERGED_GAIN)
    # each ends where a step would gain less than `CONVERGED_GAIN`, the square of its length in standard deviations
    factor, _ = condense(mass_problem, linearise(mass_problem, near.x, near.at.X))
    assert np.linalg.norm(factor[:-1, :-1] @ (far.x - near.x)) < 2 * np.sqrt(module.CONVERGED_GAIN)


def test_bounds_are_kept_exactly_and_met_where_the_truth_lies_beyond(plant, worn_log, worn, problem_of, starts_of):
    name, most = "theta_9", 1.02 * plant.value("theta_9")
    assert worn.value(name) > most
    problem = problem_of([worn_log], plant, plant.load.names, ("position",), bounds={name: (0.0, most)})
    answer = search(problem, np.zeros(22), starts_of(problem), STAGES_FROM_CALIBRATION)
    place = problem.names.index(name)
    assert problem.si(answer.x)[place] == most
    assert answer.x[place] == problem.bounds()[1][place]


def test_no_trial_point_leaves_the_bounds(plant, worn_log, problem_of, starts_of, monkeypatch):
    limits = {"theta_9": (3600.0, 3950.0), "C_vs": (18.9e-9, 19.5e-9), "tau_y": (0.5e-3, 2e-3)}
    problem = problem_of([worn_log], plant, (*plant.load.names, "C_vs", "tau_y"), ("position",), bounds=limits)
    low, high = problem.bounds()
    tried = []

    def watched(t, current, x, X, last=None):
        tried.append(x)
        return evaluate_step(t, current, x, X, last)

    for name in ("search", "trial"):
        monkeypatch.setattr(f"clutchid.inference.smoother.{name}.evaluate_step", watched)
    search(problem, np.zeros(24), starts_of(problem), STAGES_FROM_CALIBRATION)
    assert len({tuple(x) for x in tried}) >= 4
    assert all(np.all((low <= x) & (x <= high)) for x in tried)


def test_every_step_lowers_the_cost_of_its_stage(problem, start, monkeypatch):
    accepted = []
    step, reached = module.coarse_step, module.VariableProjection.evaluated

    def watched(t, current, *rest):
        candidate = step(t, current, *rest)
        accepted.append((t.noise.measured["position"], current.cost, candidate))
        return candidate

    def settled(projected, current, *rest):
        candidate = reached(projected, current, *rest)
        accepted.append((projected.problem.noise.measured["position"], current.cost, candidate))
        return candidate

    monkeypatch.setattr(module, "coarse_step", watched)
    monkeypatch.setattr(module.VariableProjection, "evaluated", settled)
    search(problem, *start, STAGES_FROM_CALIBRATION)
    taken = [(scale, cost, candidate.cost) for scale, cost, candidate in accepted if not isinstance(candidate, Failure)]
    assert len(taken) >= 4
    assert all(after < before for _, before, after in taken)
    assert [scale for scale, *_ in taken] == sorted((scale for scale, *_ in taken), reverse=True)
    for (stage, _, reached_cost), (next_stage, starts, _) in pairwise(taken):
        # the next step begins where the last has ended; one window or another is simulated in between
        assert stage != next_stage or starts == pytest.approx(reached_cost, abs=module.CONVERGED_GAIN)


def test_progress_is_reported_with_a_growing_number_and_the_name_of_the_stage(problem, start):
    reported = []
    answer = search(problem, *start, STAGES_FROM_CALIBRATION, reported.append)
    assert list(dict.fromkeys(step.stage for step in reported)) == ["coarse search", "fine search"]
    counts = [step.evaluations for step in reported]
    assert counts == sorted(counts)
    assert answer.evaluations >= counts[-1]


def test_without_a_stage_there_is_nothing_to_find(problem, start):
    assert isinstance(search(problem, *start, ()), Failure)


def test_pressure_that_is_not_asked_for_is_not_used(plant, worn, recorded_by, problem_of, starts_of, solution):
    log = recorded_by(worn, seconds=6.0, seed=5, name="worn", driven=1)
    wrong = log.with_columns(pressure_a=log["pressure_a"] + 5e4)
    blind = problem_of([wrong], plant, plant.load.names, ("position",))
    answer = search(blind, np.zeros(22), starts_of(blind), STAGES_FROM_CALIBRATION)
    assert np.array_equal(answer.x, solution.x)


@pytest.fixture(scope="module")
def valve_problem(plant, drive_log, problem_of):
    """Both valves' ends and the friction are free in two recordings, the second of which drives the valves less far."""
    weaker = drive_log.with_columns(duty_supply=0.9 * drive_log["duty_supply"])
    names = ("F_C", "R_1vs@weaker", "R_1ve", "R_1vs@log")
    return problem_of([drive_log, replace(weaker, name="weaker")], plant, names)


def test_the_cost_has_a_kink_where_a_valve_opens_fully_at_the_highest_duty_cycle_of_its_recordings(valve_problem):
    log, weaker = (track.measured for track in valve_problem.tracks)
    expected = [weaker["duty_supply"], log["duty_exhaust"], log["duty_supply"]]
    kinks = valve_problem.kinks
    assert np.isnan(kinks[0])
    values = [c.si(kink) for c, kink in zip(valve_problem.coordinates[1:], kinks[1:].tolist(), strict=True)]
    assert values == pytest.approx([duties.max() for duties in expected])


def stepped(problem, x, towards, held):
    """Where a Gauss-Newton step from x ends that would end at `towards` were it not for bounds and kinks."""
    factor = np.column_stack([np.eye(x.size), x - towards])
    return x + module.bounded_step(module.within_kinks(problem, x, held), factor, x, radius=10.0)


@pytest.mark.parametrize(
    ("start", "towards", "end"),
    [
        pytest.param("at", 0.5, "above", id="a start at the kink has not come from above"),
        pytest.param(0.4, -0.5, "below", id="from above it ends at the kink, where the derivatives are those below"),
        pytest.param(-0.4, 0.5, "above", id="from below it ends above the kink"),
        pytest.param("below", 0.5, "below", id="what has come from above stays where both sides lead to the kink"),
        pytest.param("below", -0.5, -0.5, id="what has come from above goes on downwards"),
        pytest.param("above", 0.5, 0.5, id="what has come from below goes on upwards"),
        pytest.param("above", -0.5, "below", id="what has come from below and is led back ends at the kink"),
        pytest.param(0.4, 0.5, 0.5, id="above a kink nothing stops a step upwards"),
        pytest.param(-0.4, -0.5, -0.5, id="below a kink nothing stops a step downwards"),
    ],
)
def test_a_step_of_one_parameter_ends_at_a_kink_and_the_others_take_the_whole_step(valve_problem, start, towards, end):
    kinks = valve_problem.kinks
    places = {"at": kinks[2], "below": kinks[2] - module._AT_KINK, "above": kinks[2] + module._BEYOND_KINK}
    at = {name: places[value] if isinstance(value, str) else kinks[2] + value for name, value in
          (("start", start), ("towards", towards), ("end", end))}  # fmt: skip
    x, goal = np.array([0.1, -2.0, at["start"], -0.1]), np.array([1.1, -2.7, at["towards"], -0.7])
    held = np.array([False, False, start == "below", False])
    assert stepped(valve_problem, x, goal, held) == pytest.approx([1.1, -2.7, at["end"], -0.7], abs=1e-9)


def test_a_step_across_a_kink_has_the_problem_linearised_on_its_other_side(
    valve_problem, starts_of, started, monkeypatch
):
    kink, moves = valve_problem.kinks[2], iter([-0.2, 0.01, 0.01, -0.02])

    def moving(_projection, current, radius):
        move = next(moves, None)
        if move is None:
            return current, 0.0, radius
        return (
            replace(current, x=current.x + np.array([0.0, 0.0, move, 0.0]), cost=0.9 * current.cost),
            current.cost / 9,
            radius,
        )

    monkeypatch.setattr(module.VariableProjection, "step", moving)
    x = np.array([0.0, valve_problem.kinks[1] - 1.0, kink + 0.19, valve_problem.kinks[3] - 1.0])
    assert search(valve_problem, x, starts_of(valve_problem), (1.0,)).status == "converged"
    # the first, and one for each of the three steps that lead across
    assert [at[0][2] > kink for at in started] == [True, False, True, False]


def test_a_parameter_stays_at_a_kink_only_after_it_has_come_there_from_above(valve_problem):
    projection = module.VariableProjection.of(valve_problem, lambda: None)
    kink, there = valve_problem.kinks[2], np.array([0.0, -2.0, 0.0, -1.0])
    places = {"above": kink + 0.2, "just below": kink - 1e-6, "below": kink - 0.2, "beyond": kink + 0.03}
    at = {name: there + np.array([0.0, 0.0, value, 0.0]) for name, value in places.items()}
    steps = [
        ("above", "just below", True, True),
        ("just below", "just below", False, True),
        ("just below", "below", False, False),
        ("below", "beyond", True, False),
        ("beyond", "above", False, False),
    ]
    for before, after, crossed, held in steps:
        assert projection.crossed(at[before], at[after]) == crossed
        assert projection.held.tolist() == [False, False, held, False]


def test_a_bound_at_a_kink_does_not_keep_a_parameter_there(plant, drive_log, problem_of, starts_of):
    highest = float(drive_log["duty_supply"].max())
    problem = problem_of(
        [drive_log], plant, ("R_1vs", "C_vs"), bounds={"R_1vs": (highest, 1.5)}, priors={"R_1vs": Prior(1.1, 0.1)}
    )
    x = problem.bounds()[0]
    limits = module.within_kinks(problem, x, np.zeros(2, dtype=bool))
    assert limits[0][0] == pytest.approx(problem.kinks[0])
    assert limits[1][0] > problem.kinks[0] + 0.01

"""The bootstrap over excursions says what a dense sandwich says, and how excursions are cut."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.bootstrap import FEWEST_EXCURSIONS, bootstrap, excursions, gauss_newton_steps, scatter_ratio
from clutchid.inference.smoother.problem import condense, linearise
from clutchid.inference.smoother.search import CONVERGED_GAIN, STAGES_FROM_CALIBRATION, search
from clutchid.log import Log
from clutchid.numerics.least_squares import Solution
from clutchid.simulation.noise import Noise
from fixtures.dense import dense_blocks, window_rows

STATES = 10


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    """The load free, position only, with white noise exactly as large as the problem takes it for."""
    problem = problem_of([recorded_by(plant, seed=4)], plant, plant.load.names, ("position",))
    return replace(problem, noise=Noise(measured={"position": 3e-5}))


@pytest.fixture(scope="module")
def solution(problem, starts_of):
    return search(problem, np.zeros(22), starts_of(problem), STAGES_FROM_CALIBRATION)


@pytest.fixture(scope="module")
def root(problem, solution):
    """Square root of the covariance were all residuals independent."""
    return np.linalg.inv(condense(problem, solution.at)[0][:-1, :-1])


@pytest.fixture(scope="module")
def small(problem, solution):
    """Twelve windows from a rest on, four strokes of them, so that a dense matrix holds them."""
    track = replace(problem.tracks[0], windows=problem.tracks[0].windows[16:28])
    few = replace(problem, tracks=(track,))
    return few, linearise(few, solution.x, (solution.at.X[0][16:28],)), (np.repeat([0, 1, 2, 3], [5, 1, 2, 4]),)


def resting(problem_of, plant, excursions, low=0.0, missing=(), name="log"):
    """A problem on a recording of half a second at `low`, half a second at 15 mm, and so on, resting at its end."""
    time = np.arange(0.0, excursions + 0.5, 1e-3)
    position = np.where(time % 1.0 < 0.5, low, 15e-3)
    for start, stop in missing:
        position[round(1000 * start) : round(1000 * stop)] = np.nan
    duty = np.zeros(time.size)
    log = Log(time, {"duty_supply": duty, "duty_exhaust": duty, "position": position}, name)
    return problem_of([log], plant, ("F_C",), ("position",))


def dense_moves(linear, numbers):
    """The pull of each stroke and of what is known before, each moved by the dense inverse; pulls; information."""
    chain, k, strokes = linear.chains[0], linear.prior.shape[1] - 1, numbers[0] + 1
    blocks = list(dense_blocks(chain.first, window_rows(chain), chain.links, STATES))
    n = STATES * len(strokes)
    blocks.append(np.hstack([np.zeros((len(linear.prior), n)), linear.prior]))
    contributions, H = np.zeros((n + k, 1 + strokes.max())), np.zeros((n + k, n + k))
    for rows, kind in zip(blocks, [0, *strokes, *strokes[:-1], 0], strict=True):
        H += rows[:, :-1].T @ rows[:, :-1]
        contributions[:, kind] += rows[:, :-1].T @ rows[:, -1]
    return -np.linalg.solve(H, contributions)[n:], np.linalg.inv(H)[n:, n:]


def test_the_step_of_each_stroke_is_that_of_the_dense_problem(small):
    _, linear, numbers = small
    parameters, moves = gauss_newton_steps(linear, numbers)
    wanted, covariance = dense_moves(linear, numbers)
    # in deviations of each number; the dense normal equations square a condition of some 1e5
    scale = np.sqrt(np.diag(covariance))[:, None]
    assert np.column_stack([parameters, moves]) / scale == pytest.approx(wanted / scale, abs=1e-5)
    assert np.abs(moves / scale).max() > 0.1


def test_the_draws_scatter_as_the_sandwich_of_the_dense_problem(small, solution, monkeypatch):
    problem, linear, numbers = small
    monkeypatch.setattr("clutchid.estimation.bootstrap.excursions", lambda _: numbers)
    x = bootstrap(problem, Solution(solution.x, linear, "converged", 1), draws=20000)
    moves = dense_moves(linear, numbers)[0][:, 1:]
    # numbers of draws that add up to the number of strokes: less the part in which all strokes agree
    apart = moves - moves.mean(axis=1, keepdims=True)
    scatter, wanted = np.std(x, axis=0), np.linalg.norm(apart, axis=1)
    linearised = wanted > 1e-6 * wanted.max()
    # 20000 draws know a deviation to 0.5 %
    assert linearised.sum() > 10
    assert scatter[linearised] == pytest.approx(wanted[linearised], rel=0.03)


def test_the_steps_of_all_strokes_add_up_to_the_step_of_the_whole_problem(problem, solution):
    parameters, moves = gauss_newton_steps(solution.at, excursions(problem))
    factor, _ = condense(problem, solution.at)
    assert parameters + moves.sum(axis=1) == pytest.approx(
        -np.linalg.solve(factor[:-1, :-1], factor[:-1, -1]), abs=1e-8
    )


def test_draws_are_the_same_on_every_run_with_the_same_seed(problem, solution):
    first = bootstrap(problem, solution, draws=20, seed=1)
    assert first.shape == (20, 22)
    assert np.array_equal(first, bootstrap(problem, solution, draws=20, seed=1))
    assert not np.array_equal(first, bootstrap(problem, solution, draws=20, seed=2))


def test_many_draws_are_spread_around_what_was_found(problem, solution, root):
    x = bootstrap(problem, solution, draws=2000)
    # the mean of 2000 draws is known to a 45th of their deviation; the search may have stopped short of the minimum
    stopped = np.sqrt(CONVERGED_GAIN) * np.linalg.norm(root, axis=1)
    assert np.all(np.abs(x.mean(axis=0) - solution.x) < 4 * np.std(x, axis=0) / np.sqrt(2000) + stopped)


def test_the_load_of_a_recording_with_white_noise_scatters_about_as_without_colour(problem, solution, root):
    # on eight recordings of other noise the load scattered with 0.81 of these deviations: the links count an error of
    # the model that is not there; 8 pieces know that to a quarter, and this is twice as much to either side
    assert [part.max() + 1 for part in excursions(problem)] == [8]
    assert 0.37 < scatter_ratio(problem, bootstrap(problem, solution), root) < 1.25


def test_the_ratio_is_how_much_wider_the_load_scatters(problem, solution, root):
    x = solution.x + np.random.default_rng(0).standard_normal((200, 22)) @ root.T
    # 200 draws know a deviation to 5 %
    assert scatter_ratio(problem, x, root) == pytest.approx(1.0, abs=0.15)
    assert scatter_ratio(problem, x, 0.5 * root) == pytest.approx(2.0 * scatter_ratio(problem, x, root), rel=1e-9)


def test_without_a_free_load_there_is_no_ratio(problem_of, plant):
    problem = resting(problem_of, plant, 9)
    assert np.isnan(scatter_ratio(problem, np.zeros((3, 1)), np.eye(1)))


@pytest.mark.parametrize("missing", [(), [(1.6, 1.9)], [(0.0, 0.3), (2.02, 2.37), (3.4, 3.55), (5.5, 5.9)]])
def test_every_excursion_from_rest_counts_also_where_position_is_missing(problem_of, plant, missing):
    problem = resting(problem_of, plant, 10, missing=missing)
    (numbers,) = excursions(problem)
    starts = [window.start for window in problem.tracks[0].windows]
    # rest and excursion take a second; the rest at the end has no excursion and belongs to the last one
    wanted = np.minimum(np.array(starts) // 1000, 9)
    assert np.mean(numbers == wanted) > 0.97
    assert np.array_equal(np.unique(numbers), np.arange(10))


def test_a_recording_without_rest_is_cut_into_pieces_of_a_second(problem_of, plant):
    (numbers,) = excursions(resting(problem_of, plant, 12, low=8e-3))
    assert np.array_equal(np.unique(numbers), np.arange(12))
    assert np.ptp(np.bincount(numbers)) <= 1, "125 windows of 0.1 s"
    assert np.all(np.diff(numbers) >= 0)


def test_a_recording_of_few_excursions_is_cut_into_pieces(problem_of, plant):
    few, enough = (
        excursions(resting(problem_of, plant, count))[0] for count in (FEWEST_EXCURSIONS - 1, FEWEST_EXCURSIONS)
    )
    assert np.ptp(np.bincount(few)) <= 1
    assert enough.max() + 1 == FEWEST_EXCURSIONS
    # the last one has the rest at the end
    assert np.bincount(enough)[-1] == 15


def test_a_recording_without_position_is_cut_into_pieces_and_has_no_ratio(problem_of, plant):
    problem = resting(problem_of, plant, 9)
    track = problem.tracks[0]
    blind = track.measured.with_columns(position=np.full(len(track.measured), np.nan))
    problem = replace(problem, tracks=(replace(track, measured=blind),))
    assert np.ptp(np.bincount(excursions(problem)[0])) <= 1
    free = replace(problem, coordinates=problem_of([], plant, plant.load.names).coordinates)
    assert np.isnan(scatter_ratio(free, np.zeros((3, 22)), np.eye(22)))


def test_excursions_of_several_recordings_are_numbered_without_gaps(problem_of, plant):
    parts = [resting(problem_of, plant, count).tracks[0] for count in (10, 3)]
    problem = resting(problem_of, plant, 10)
    problem = replace(problem, tracks=(parts[0], replace(parts[1], log=1)), stems=("a", "b"))
    numbers = excursions(problem)
    assert [len(part) for part in numbers] == [len(part.windows) for part in parts]
    assert np.array_equal(np.unique(np.concatenate(numbers)), np.arange(13)), "10 excursions and 3.499 s in 3 pieces"
    assert numbers[1].min() == 10


def test_one_stroke_alone_does_not_say_how_it_scatters(small, solution, problem):
    few, linear, _ = small
    second = replace(few.tracks[0], segment=replace(problem.tracks[0].segment, dt=problem.tracks[0].segment.dt[:1200]))
    x = bootstrap(replace(few, tracks=(second,)), Solution(solution.x, linear, "converged", 1), draws=3)
    assert np.isnan(x).all()
    assert np.isnan(scatter_ratio(few, x, np.eye(22)))

"""Covariance of the free numbers: noise, drift of what is taken as known, and the calibration's own uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimate.shooting import uncertainty as module
from clutchid.estimate.shooting.uncertainty import CORRELATED_SAMPLES, parameter_uncertainty, pressure_deviations
from clutchid.numerics.failure import Failure
from clutchid.smoother.problem import linearise
from clutchid.smoother.projection import CONVERGED_GAIN, ShootingSolution
from clutchid.smoother.search import STAGES_FROM_CALIBRATION, search
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.drift import DEVIATION_FACTOR, DRIFT_SHARES, DRIFT_WIDTHS, consider_parameters, drift

NAMES = ("C_vs", "P_S", "F_C")


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    """The load free on a recording with both columns, all else taken as known."""
    return problem_of([recorded_by(plant, seconds=4.0, driven=1)], plant, plant.load.names, ("position",))


@pytest.fixture(scope="module")
def solution(problem, starts_of):
    return search(problem, np.zeros(22), starts_of(problem), STAGES_FROM_CALIBRATION)


def calibration(scale=1.0, correlation=0.0):
    std = scale * np.array([2e-10, 5e3, 20.0])
    matrix = np.outer(std, std) * (np.eye(3) + correlation * (np.ones((3, 3)) - np.eye(3)))
    return Calibration(NAMES, matrix)


def test_drift_is_a_share_of_the_value_or_a_number_of_its_own(plant):
    assert drift(plant, "P_S") == pytest.approx(DRIFT_SHARES["P_S"] * 9e5)
    assert drift(plant, "R_0ve") == DRIFT_WIDTHS["R_0ve"]
    assert drift(plant, "R") == 0.0


def test_what_is_free_is_not_considered(problem, problem_of, plant, drive_log):
    names = {c.base for c in consider_parameters(problem.actuator, problem.coordinates, None)[0]}
    assert names == {*DRIFT_SHARES, *DRIFT_WIDTHS}
    freer = problem_of([drive_log.slice(0, 500)], plant, ("P_S", "C_vs@log"))
    assert {c.base for c in consider_parameters(freer.actuator, freer.coordinates, None)[0]} == names - {"P_S", "C_vs"}


def test_considered_numbers_have_the_covariance_of_drift_and_calibration(problem, plant):
    numbers, root = consider_parameters(problem.actuator, problem.coordinates, calibration(correlation=0.8))
    width = np.array([c.width for c in numbers])
    matrix = root @ root.T * np.outer(width, width)
    at = [[c.base for c in numbers].index(name) for name in NAMES]
    wanted = calibration(correlation=0.8).covariance + np.diag([drift(plant, name) ** 2 for name in NAMES])
    # widths from 1e-10 to 1e4: each entry against its own two deviations
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    assert matrix[np.ix_(at, at)] / scale == pytest.approx(wanted / scale, abs=1e-9)
    assert [numbers[i].mean for i in at] == [plant.value(name) for name in NAMES]


def test_a_calibrated_number_that_does_not_drift_is_considered_too(problem):
    numbers, _ = consider_parameters(problem.actuator, problem.coordinates, Calibration(("C_r",), np.array([[1e-18]])))
    assert [c.width for c in numbers if c.base == "C_r"] == pytest.approx([1e-9])
    certain, _ = consider_parameters(problem.actuator, problem.coordinates, Calibration(("C_r",), np.array([[0.0]])))
    assert "C_r" not in {c.base for c in certain}, "what is exactly known moves nothing"


def dense_rows(uncertain, x, X, share):
    """All rows of a problem of one track; those of samples and links times `share`."""
    wide, n, k, m, s = uncertain.problem, X[0].size, x.size, uncertain.consider_root.shape[0], X[0].shape[1]
    linear = linearise(wide, np.concatenate([x, np.zeros(m)]), X)
    chain, smooth = linear.chains[0], linear.prior[k + m :, :-1]
    rows = [np.eye(k, n + k + m, n), np.column_stack([np.zeros((smooth.shape[0], n)), smooth])]
    linearised = chain.windows.linearised
    own = np.concatenate([linearised.jacobian, linearised.r[:, :, None]], axis=2)
    placed = [(chain.first, 0, s), *((share * rows, i, s) for i, rows in enumerate(own))]
    placed += [(share * link, i, 2 * s) for i, link in enumerate(chain.links)]
    for block, at, width in placed:
        full = np.zeros((block.shape[0], n + k + m))
        full[:, s * at : s * at + width] = block[:, :width]
        full[:, n:] = block[:, width:-1]
        rows.append(full)
    return np.split(np.vstack(rows), [n + k], axis=1)


def dense_covariance(uncertain, x, X):
    """Covariance of all states and free numbers: neighbours count as one, the search took them one by one."""
    weak, weak_moved = dense_rows(uncertain, x, X, 1 / np.sqrt(CORRELATED_SAMPLES))
    A, B = dense_rows(uncertain, x, X, 1.0)
    n, k = X[0].size, x.size
    inverse = np.linalg.pinv(weak)
    gain = -np.linalg.pinv(A) @ B @ uncertain.consider_root
    # the states follow the shifted numbers as the weak rows say
    S = weak[:, :n]
    follow = -np.linalg.pinv(S) @ np.column_stack([weak[:, n:] @ gain[n:] + weak_moved @ uncertain.consider_root])
    gain[:n] = follow
    assert k == gain.shape[0] - n
    return DEVIATION_FACTOR**2 * (inverse @ inverse.T + gain @ gain.T)


@pytest.fixture(scope="module")
def small(problem, solution):
    """Twelve windows of the problem, so that a dense matrix holds them, with an unsure calibration."""
    track = replace(problem.tracks[0], windows=problem.tracks[0].windows[6:18])
    X = (solution.X[0][6:18],)
    return parameter_uncertainty(
        replace(problem, tracks=(track,)),
        ShootingSolution(solution.x, X, solution.at, "converged", 1),
        calibration(10.0),
    ), X


def test_the_covariance_is_that_of_the_dense_problem(small, solution):
    uncertain, X = small
    wanted = dense_covariance(uncertain, solution.x, X)[X[0].size :, X[0].size :]
    scale = np.sqrt(np.diag(wanted))
    assert uncertain.matrix / np.outer(scale, scale) == pytest.approx(wanted / np.outer(scale, scale), abs=1e-6)


def test_the_band_of_the_pressure_is_that_of_the_dense_problem(small, solution, monkeypatch):
    uncertain, X = small
    monkeypatch.setattr(module, "DRAWS", 20000)
    wanted = 1e5 * np.sqrt(np.diag(dense_covariance(uncertain, solution.x, X))[2 : X[0].size : X[0].shape[1]])
    # 20000 draws know a deviation to 0.5 %
    assert pressure_deviations(uncertain)[0] == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("name", ["F_C", "V_0A", "C_ve"])
def test_the_estimate_moves_with_a_considered_number_as_the_covariance_says(problem, solution, plant, starts_of, name):
    uncertain = parameter_uncertainty(problem, solution, None)
    numbers, _ = consider_parameters(problem.actuator, problem.coordinates, None)
    place = [c.base for c in numbers].index(name)
    # no calibration: the root is the identity, so a column is the shift for one deviation
    shift = uncertain.consider_shift @ uncertain.consider_root.T[:, place]
    off = replace(problem, actuator=plant.replace({name: plant.value(name) + drift(plant, name)}))
    again = search(off, solution.x, solution.X, (1.0,))
    y = np.linspace(1e-3, 20e-3, 30)
    phi = plant.load.phi(y) * problem.slopes(solution.x)
    predicted, happened = phi @ shift, phi @ (again.x - solution.x)
    assert np.abs(happened).max() > 5.0, "a drift moves the load by newtons"
    # both searches stop where a step would gain less than CONVERGED_GAIN, which is the square of its length in
    # deviations
    tolerance = (
        np.sqrt(CONVERGED_GAIN)
        * np.sqrt(
            np.einsum("ni,ij,nj->n", phi, uncertain.noise_root @ uncertain.noise_root.T / CORRELATED_SAMPLES, phi)
        ).max()
    )
    assert happened == pytest.approx(predicted, abs=tolerance + 0.1 * np.abs(predicted).max())


def test_intervals_grow_with_the_covariance_of_the_calibration(problem, solution):
    none, some, much = (
        parameter_uncertainty(problem, solution, c).matrix for c in (None, calibration(), calibration(3.0))
    )
    assert np.all(np.diag(some) > np.diag(none))
    # what three times the deviations add is nine times what they add once
    added = some - none
    assert (much - none) == pytest.approx(9 * added, abs=1e-6 * np.abs(added).max())


def test_what_the_noise_leaves_does_not_depend_on_the_calibration(problem, solution):
    none, some = parameter_uncertainty(problem, solution, None), parameter_uncertainty(problem, solution, calibration())
    assert none.noise_root @ none.noise_root.T == pytest.approx(some.noise_root @ some.noise_root.T, rel=1e-6)


def test_the_band_of_the_pressure_is_finite_and_grows_with_the_calibration(problem, solution):
    narrow, wide = (pressure_deviations(parameter_uncertainty(problem, solution, c)) for c in (None, calibration(3.0)))
    assert [band.shape for band in narrow] == [(len(track.windows),) for track in problem.tracks]
    assert np.all(np.isfinite(narrow[0]))
    assert np.all(narrow[0] > 0.0)
    # 48 draws know a deviation to 10 %
    assert np.median(wide[0] / narrow[0]) > 1.1
    assert np.median(narrow[0]) < 5e4, "the position determines the pressure to half a bar"


def test_the_band_of_the_pressure_is_the_same_on_every_run(problem, solution):
    uncertain = parameter_uncertainty(problem, solution, None)
    assert np.array_equal(pressure_deviations(uncertain)[0], pressure_deviations(uncertain)[0])


def test_a_measured_pressure_makes_its_band_narrow(plant, drive_log, problem_of, starts_of, problem, solution):
    both = problem_of([drive_log.slice(0, 4000)], plant, plant.load.names)
    with_pressure = search(both, np.zeros(22), starts_of(both), STAGES_FROM_CALIBRATION)
    known, unknown = (
        pressure_deviations(parameter_uncertainty(both, with_pressure, None))[0],
        pressure_deviations(parameter_uncertainty(problem, solution, None))[0],
    )
    assert np.median(known) < 0.5 * np.median(unknown)
    assert np.median(known) < 3e3


def test_states_that_cannot_be_simulated_are_a_failure(problem, solution):
    X = (np.full_like(solution.X[0], np.nan),)
    assert isinstance(
        parameter_uncertainty(problem, ShootingSolution(solution.x, X, solution.at, "converged", 1), None), Failure
    )


def test_correlations_of_a_calibration_move_the_estimate_as_they_move_that_of_the_dense_problem(
    problem, solution, plant
):
    # three times as uncertain as they drift, and all together too high or too low
    names = (*DRIFT_SHARES, *DRIFT_WIDTHS)
    width = np.array([drift(plant, name) for name in names])
    covariance = np.outer(3 * width, 3 * width) * (0.1 * np.eye(width.size) + 0.9)
    known = Calibration(names, covariance)
    track = replace(problem.tracks[0], windows=problem.tracks[0].windows[6:18])
    X, k = (solution.X[0][6:18],), solution.x.size
    shot = ShootingSolution(solution.x, X, solution.at, "converged", 1)
    uncertain = parameter_uncertainty(replace(problem, tracks=(track,)), shot, known)
    # the covariance of what is considered is written down, not multiplied from the root that is under test
    numbers = uncertain.problem.coordinates[k:]
    assert [c.base for c in numbers] == list(names)
    widths = np.array([c.width for c in numbers])
    A, B = dense_rows(uncertain, solution.x, X, 1.0)
    gain = (-np.linalg.pinv(A) @ B)[-k:]
    expected = DEVIATION_FACTOR**2 * gain @ ((covariance + np.diag(width**2)) / np.outer(widths, widths)) @ gain.T
    scale = np.sqrt(np.diag(expected))
    added = uncertain.matrix - DEVIATION_FACTOR**2 * uncertain.noise_root @ uncertain.noise_root.T
    assert added / np.outer(scale, scale) == pytest.approx(expected / np.outer(scale, scale), abs=1e-6)

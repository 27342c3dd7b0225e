"""Covariance of the free numbers: noise, drift of what is taken as known, and the calibration's own uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation import posterior as module
from clutchid.estimation.posterior import parameter_uncertainty, pressure_deviations
from clutchid.inference.smoother.problem import linearise
from clutchid.inference.smoother.residuals import dispersion
from clutchid.inference.smoother.search import CONVERGED_GAIN, STAGES_FROM_CALIBRATION, search
from clutchid.inference.uncertainty.calibration import Calibration, consider_parameters
from clutchid.inference.uncertainty.change_prior import drift
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.parameters import Parameters, in_order
from fixtures.dense import dense_blocks, window_rows

NAMES = ("C_vs", "P_S", "F_C")

#: Parameters that drift in the model of these tests.
DRIFTING = in_order(Parameters.rows(), lambda row: row.drift)


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


def test_what_is_free_is_not_considered(problem, problem_of, plant, drive_log):
    names = {c.base for c in consider_parameters(problem.actuator, problem.coordinates, None)[0]}
    assert names == set(DRIFTING)
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
    numbers, _ = consider_parameters(
        problem.actuator, problem.coordinates, Calibration(("D_zdot",), np.array([[1e-18]]))
    )
    assert [c.width for c in numbers if c.base == "D_zdot"] == pytest.approx([1e-9])
    certain, _ = consider_parameters(problem.actuator, problem.coordinates, Calibration(("D_zdot",), np.array([[0.0]])))
    assert "D_zdot" not in {c.base for c in certain}, "what is exactly known moves nothing"


def dense_rows(uncertain, x, X):
    """Rows of the prior, and those of the data, of a problem of one track: states, theta, considered."""
    wide, n, k, m, s = uncertain.problem, X[0].size, x.size, uncertain.consider_root.shape[0], X[0].shape[1]
    linear = linearise(wide, np.concatenate([x, np.zeros(m)]), X)
    chain, smooth = linear.chains[0], linear.prior[k:, :-1]
    prior = [np.eye(k, n + k + m, n), np.column_stack([np.zeros((smooth.shape[0], n)), smooth])]
    data = np.vstack(list(dense_blocks(chain.first, window_rows(chain), chain.links, s)))
    return np.vstack(prior), data[:, :-1]


def dense_gain(uncertain, x, X):
    """What a unit of each considered parameter moves states and theta by."""
    rows = np.vstack(dense_rows(uncertain, x, X))
    columns = X[0].size + x.size
    return -np.linalg.pinv(rows[:, :columns]) @ rows[:, columns:]


def dense_covariance(uncertain, x, X, scatter):
    """Covariance of all states and free parameters: theta with the scatter of the data, states as their rows say."""
    n, k, root = X[0].size, x.size, uncertain.consider_root
    prior, data = dense_rows(uncertain, x, X)
    states, theta, considered = data[:, :n], data[:, n : n + k], data[:, n + k :]
    inverse = np.linalg.pinv(states)
    of_theta, smooth = theta - states @ (inverse @ theta), prior[:, n : n + k]
    moved = dense_gain(uncertain, x, X)[n:] @ root
    covariance = np.linalg.inv(of_theta.T @ of_theta / scatter + smooth.T @ smooth)
    # the states follow theta and what is considered
    follow, along = -inverse @ theta, -inverse @ (theta @ moved + considered @ root)
    return np.block(
        [
            [inverse @ inverse.T + follow @ covariance @ follow.T + along @ along.T, np.zeros((n, k))],
            [np.zeros((k, n)), covariance + moved @ moved.T],
        ]
    )


@pytest.fixture(scope="module")
def small(problem, solution):
    """Twelve windows, which a dense matrix holds, with an unsure calibration; their states and the dispersion."""
    few = replace(problem, tracks=(replace(problem.tracks[0], windows=problem.tracks[0].windows[6:18]),))
    X = (solution.at.X[0][6:18],)
    shot = Solution(solution.x, linearise(few, solution.x, X), "converged", 1)
    return parameter_uncertainty(few, shot, calibration(10.0)), shot.at.X, dispersion(few, shot.at)


def test_the_covariance_is_that_of_the_dense_problem(small, solution):
    uncertain, X, scatter = small
    wanted = dense_covariance(uncertain, solution.x, X, scatter)[X[0].size :, X[0].size :]
    scale = np.sqrt(np.diag(wanted))
    assert uncertain.matrix / np.outer(scale, scale) == pytest.approx(wanted / np.outer(scale, scale), abs=1e-6)


@pytest.mark.slow
def test_the_band_of_the_pressure_is_that_of_the_dense_problem(small, solution, monkeypatch):
    uncertain, X, scatter = small
    monkeypatch.setattr(module, "DRAWS", 20000)
    wanted = 1e5 * np.sqrt(np.diag(dense_covariance(uncertain, solution.x, X, scatter))[2 : X[0].size : X[0].shape[1]])
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
    again = search(off, solution.x, solution.at.X, (1.0,))
    y = np.linspace(1e-3, 20e-3, 30)
    phi = plant.load.phi(y) * problem.slopes(solution.x)
    predicted, happened = phi @ shift, phi @ (again.x - solution.x)
    assert np.abs(happened).max() > 5.0, "a drift moves the load by newtons"
    # both searches stop where a step would gain less than CONVERGED_GAIN, which is the square of its length in
    # deviations
    searched = uncertain.noise_root @ uncertain.noise_root.T / dispersion(problem, solution.at)
    tolerance = np.sqrt(CONVERGED_GAIN) * np.sqrt(np.einsum("ni,ij,nj->n", phi, searched, phi)).max()
    assert happened == pytest.approx(predicted, abs=tolerance + 0.1 * np.abs(predicted).max())


def test_the_band_of_the_pressure_is_the_same_on_every_run(problem, solution):
    uncertain = parameter_uncertainty(problem, solution, None)
    assert np.array_equal(pressure_deviations(uncertain)[0], pressure_deviations(uncertain)[0])


def test_a_measured_pressure_makes_its_band_narrow(plant, drive_log, problem_of, starts_of, problem, solution):
    both = problem_of([drive_log.slice(0, 4000)], plant, plant.load.names)
    with_pressure = search(both, np.zeros(22), starts_of(both), STAGES_FROM_CALIBRATION)
    measured, unmeasured = (
        pressure_deviations(parameter_uncertainty(both, with_pressure, None))[0],
        pressure_deviations(parameter_uncertainty(problem, solution, None))[0],
    )
    assert np.median(measured) < 0.5 * np.median(unmeasured)
    assert np.median(measured) < 3e3


def test_states_that_cannot_be_simulated_are_a_failure(problem, solution):
    X = (np.full_like(solution.at.X[0], np.nan),)
    assert isinstance(
        parameter_uncertainty(problem, Solution(solution.x, replace(solution.at, X=X), "converged", 1), None), Failure
    )

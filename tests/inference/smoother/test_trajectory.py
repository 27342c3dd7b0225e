"""States along a recording, what the sensors would record of them, and the noise scales that follow."""

import numpy as np
import pytest

from clutchid.inference.smoother.problem import linearise
from clutchid.inference.smoother.residuals import noise_scales, sensor_outputs, trajectory
from clutchid.log.states import STATES
from clutchid.numerics.least_squares import Solution
from clutchid.simulation import simulate
from clutchid.simulation.sensors import lagged
from fixtures.changed_logs import spoiled


@pytest.fixture(scope="module")
def exact(plant, recorded_by, problem_of):
    """A recording without noise, and the window starts of the simulation that made it."""
    log = recorded_by(plant, seconds=3.0, seed=None)
    problem = problem_of([log], plant, ("tau_y", "tau_p", "e_y", "e_p"))
    simulated = simulate(plant, log).log
    columns = [STATES[name].column for name in plant.states]
    states = np.column_stack([simulated[name] for name in columns])
    X = tuple(states[[window.start for window in track.windows]] for track in problem.tracks)
    x = np.zeros(4)
    return log, problem, Solution(x, linearise(problem, x, X), "converged", 1), states


def test_from_the_true_starts_the_trajectory_is_the_simulation(exact):
    _, problem, solution, states = exact
    # the plans differ in their number of integration steps, so in the error of a fourth-order method
    scale = np.abs(states).max(axis=0)
    assert trajectory(problem, solution, 0) / scale == pytest.approx(states / scale, abs=1e-4)


def test_the_sensors_record_along_the_trajectory_what_the_log_holds(exact):
    log, problem, solution, _ = exact
    outputs = sensor_outputs(problem, solution, 0, trajectory(problem, solution, 0))
    assert outputs["position"] == pytest.approx(log["position"], abs=3e-6)
    # the pressure has edges where a valve opens
    assert np.median(np.abs(outputs["pressure_a"] - log["pressure_a"])) < 30.0


def test_the_record_along_given_states_has_the_lags_and_offsets_of_its_sensors(exact):
    _, problem, solution, states = exact
    x = np.array([c.of(v) for c, v in zip(problem.coordinates, (3e-3, 2.5e-3, 4e-5, 700.0), strict=True)])
    moved = sensor_outputs(problem, Solution(x, solution.at, "converged", 1), 0, states)
    plain = sensor_outputs(problem, solution, 0, states)
    position = lagged(states[:, 0], 3e-3, 1e-3) - lagged(states[:, 0], 1e-3, 1e-3) + 4e-5
    pressure = lagged(states[:, 2], 2.5e-3, 1e-3) - lagged(states[:, 2], 1.5e-3, 1e-3) + 700.0
    assert moved["position"] - plain["position"] == pytest.approx(position, abs=1e-12)
    assert moved["pressure_a"] - plain["pressure_a"] == pytest.approx(pressure, abs=1e-6)


@pytest.mark.parametrize("noise", [1e-4, 2e-4])
def test_noise_scales_are_the_standard_deviation_of_the_residuals(exact, problem_of, plant, noise):
    log, _, solution, _ = exact
    rng = np.random.default_rng(4)
    position = log["position"] + noise * rng.standard_normal(len(log))
    position[:20] = np.nan
    position[100] += 1.0
    pressure = log["pressure_a"] + 8e3 * rng.standard_normal(len(log))
    problem = problem_of(
        [log.with_columns(position=position, pressure_a=pressure)], plant, ("tau_y", "tau_p", "e_y", "e_p")
    )
    scales = noise_scales(problem, solution)
    # the median of 3000 absolute values is known to 2.5 %: three of that
    assert scales["position"] == pytest.approx(noise, rel=0.075)
    assert scales["pressure_a"] == pytest.approx(8e3, rel=0.075)


def test_noise_scales_stay_between_the_usual_one_and_ten_times_it(exact, problem_of, plant):
    log, problem, solution, _ = exact
    usual = problem.noise.measured
    assert noise_scales(problem, solution) == pytest.approx(dict(usual)), (
        "a perfect sensor does not make a perfect model"
    )
    wild = log.with_columns(position=log["position"] + 1.0, pressure_a=log["pressure_a"] + 1e6)
    far = problem_of([wild], plant, ("tau_y", "tau_p", "e_y", "e_p"))
    assert noise_scales(far, solution) == pytest.approx({name: 10 * value for name, value in usual.items()})


def test_between_segments_there_are_no_states(exact, plant, problem_of, starts_of):
    log = exact[0]
    problem = problem_of([spoiled(log, "duty_supply", slice(1500, 1510))], plant, ("e_y",))
    X = tuple(starts_of(problem))
    solution = Solution(np.zeros(1), linearise(problem, np.zeros(1), X), "converged", 1)
    states = trajectory(problem, solution, 0)
    assert np.isnan(states[1500:1510]).all()
    assert np.isfinite(states[:1500]).all()
    assert np.isfinite(states[1510:]).all()

"""The joint filter on recordings that the model itself made."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.inference.filter.joint_filter import (
    Diverged,
    JointSettings,
    covariance,
    follow,
    init,
    inputs,
    joint_filter,
)
from clutchid.inference.filter.setup import LAG, FilterState
from clutchid.numerics.failure import Failure
from clutchid.simulation.noise import Noise

NAMES = ("F_C", "V_0A", "tau_y")
SECONDS = 3.0


@pytest.fixture(scope="module")
def worn(plant):
    """The actuator of the recording: the load is a tenth larger than what the filter starts from."""
    return plant.replace({name: 1.1 * plant.value(name) for name in plant.load.names})


@pytest.fixture(scope="module")
def problem(plant, worn, recorded_by, problem_of):
    return problem_of(recorded_by(worn, SECONDS), plant, (*plant.load.names, *NAMES), ("position",))


def made(problem, settings=None):
    """Filter, first state, and inputs."""
    k, track = len(problem.coordinates), problem.tracks[0]
    joint = joint_filter(
        problem.actuator, problem.coordinates, problem.bounds(), ("position",), Noise(), settings or JointSettings()
    )
    return joint, init(joint, track.segment, np.zeros(k), np.eye(k)), inputs(joint, track)


def whole(problem, settings=None):
    joint, state, samples = made(problem, settings)
    return joint, state, samples, follow(joint, state, samples, (0, len(problem.tracks[0].segment)))


def same(result, expected):
    return all(np.array_equal(a, b) for a, b in zip(result, expected, strict=True))


def test_where_only_frequent_parameters_are_free_their_own_step_gives_what_that_for_all_does(problem, problem_of):
    joint, state, samples, output = whole(problem)
    assert joint.few
    by_all = follow(replace(joint, few=False), state, samples, (0, len(problem.tracks[0].segment)))
    # both compute the same, but for the order of sums: roundings of some 100 operations at 3000 samples of 2 steps
    assert output.state.theta == pytest.approx(by_all.state.theta, abs=100 * 6000 * 2.0**-52)
    assert output.states == pytest.approx(by_all.states, rel=100 * 6000 * 2.0**-52, abs=1e-9)


def test_a_parameter_that_is_seldom_free_has_the_step_for_all(plant, worn, recorded_by, problem_of):
    assert not made(problem_of(recorded_by(worn, 0.5), plant, ("F_C", "A_A"), ("position",)))[0].few


def test_a_segment_that_cannot_be_followed_is_a_failure_with_its_sample(problem):
    joint, state, samples, _ = whole(problem)
    length = samples.intervals.length.copy()
    length[500] = np.nan
    broken = samples._replace(intervals=samples.intervals._replace(length=length))
    output = follow(joint, state, broken, (0, 1000))
    assert (type(output), output.sample) == (Diverged, 501)
    assert "sample 501" in output.message
    assert not isinstance(follow(joint, state, broken, (0, 501)), Failure)


def test_the_window_of_load_weights_lies_where_the_piston_will_be(problem):
    joint, state, samples, output = whole(problem)
    moving = replace(joint.moving, window=joint.moving.weight_bases.size)
    sensors = joint.sensors + (joint.sensors[:, [LAG]] >= 0) * (np.arange(4) == LAG) * (
        moving.window - joint.moving.window
    )
    all_weights = replace(joint, moving=moving, sensors=sensors)
    responses, size = moving.responses, state.x.size
    start = state._replace(moved=np.eye(size, responses + size, responses), at_moved=np.zeros((size, responses + size)))
    wide = follow(all_weights, start, samples, (0, len(problem.tracks[0].segment)))
    assert output.state.theta == pytest.approx(wide.state.theta, abs=1e-8)
    assert np.abs(output.state.theta).max() > 0.1
    before = covariance(joint, output.state)
    scale = np.sqrt(np.diag(before))
    assert covariance(all_weights, wide.state) / np.outer(scale, scale) == pytest.approx(
        before / np.outer(scale, scale), abs=1e-7
    )


def test_a_pass_leaves_the_state_that_it_started_from_as_it_was(problem):
    joint, state, samples = made(problem)
    before = FilterState(*(array.copy() for array in state))
    follow(joint, state, samples, (0, 200))
    assert same(before, state)


def test_missing_measurements_leave_everything_finite(problem):
    track = problem.tracks[0]
    torn = track.measured["position"].copy()
    torn[400:1400] = np.nan
    torn[2000] = np.inf
    holes = replace(track, measured=track.measured.with_columns(position=torn))
    joint, state, _ = made(problem)
    output = follow(joint, state, inputs(joint, holes), (0, len(track.segment)))
    assert all(np.isfinite(array).all() for array in output.state._replace(at_values=np.zeros(1)))
    assert np.isnan(output.errors[400:1400]).all()


def test_the_covariance_stays_positive_and_the_parameters_gain_information(problem):
    joint, state, _, output = whole(problem, JointSettings(every=1))
    k = len(problem.coordinates)
    before, after = (covariance(joint, s) for s in (state, output.state))
    scale = np.sqrt(np.diag(after))
    eigenvalues = np.linalg.eigvalsh(after / np.outer(scale, scale))
    assert eigenvalues.min() > -1e-12
    assert (np.diag(after)[-k:] < 1.001 * np.diag(before)[-k:]).all()
    assert np.linalg.slogdet(after[-k:, -k:])[1] < np.linalg.slogdet(before[-k:, -k:])[1] - 10.0


def test_parameters_do_not_adapt_while_the_piston_is_slow(problem):
    _, state, _, output = whole(problem, JointSettings(least_speed=10.0))
    assert np.array_equal(output.state.theta, state.theta)
    assert np.array_equal(output.state.T, state.T)


def test_innovations_of_the_models_own_data_are_white_and_have_the_variance_that_is_predicted(
    plant, recorded_by, problem_of
):
    problem = problem_of(recorded_by(plant, 6.0), plant, (*plant.load.names, *NAMES), ("position",))
    exact = Noise(states=dict.fromkeys(plant.states, 0.0), flow=0.0)
    k, track = len(problem.coordinates), problem.tracks[0]
    joint = joint_filter(
        plant, problem.coordinates, problem.bounds(), ("position",), exact, JointSettings(every=1, least_speed=0.0)
    )
    output = follow(
        joint, init(joint, track.segment, np.zeros(k), 0.1 * np.eye(k)), inputs(joint, track), (0, len(track.segment))
    )
    innovations, variances = output.errors[:, 0].T
    z = innovations / np.sqrt(variances)
    n = z.size
    # chi-squared with n degrees of freedom less those of the prior, and a correlation of 0: four standard deviations
    assert -k - 4.0 * np.sqrt(2.0 * n) < z @ z - n < 4.0 * np.sqrt(2.0 * n)
    assert abs(z[1:] @ z[:-1] / n) < 4.0 / np.sqrt(n)

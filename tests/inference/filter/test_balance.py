"""Least squares on the balance of forces, on recordings that the model itself made."""

import numpy as np
import pytest

from clutchid import Actuator, Load, Parameters
from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.joint_filter import JointSettings, follow, init, inputs, joint_filter
from clutchid.inference.filter.references import FORCE, balance_numbers, smoothing
from clutchid.inference.filter.setup import scratch
from clutchid.simulation.noise import Noise

SECONDS = 3.0


def grown(actuator):
    """The load is a tenth larger."""
    return actuator.replace({name: 1.1 * actuator.value(name) for name in actuator.load.names})


@pytest.fixture(scope="module")
def linear_problem(recorded_by, problem_of):
    """Of the isothermal model, whose friction does not depend on the load: the balance is linear in the weights."""
    actuator = Actuator(Parameters(), Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5))), "isothermal")
    return problem_of(recorded_by(grown(actuator), SECONDS), actuator, actuator.load.names, ("position",))


def of(problem):
    """The filter of a problem."""
    numbers = balance_numbers(problem.actuator, problem.coordinates, np.eye(len(problem.coordinates)), 1e-3)
    return joint_filter(
        problem.actuator, problem.coordinates, problem.bounds(), ("position",), Noise(), JointSettings(),
        reference=numbers,
    )  # fmt: skip


def followed(joint, problem, theta, T):
    """The pass over the whole recording from theta and T."""
    track = problem.tracks[0]
    state = init(joint, track.segment, np.array(theta), np.array(T))
    return follow(joint, state, inputs(joint, track), (0, len(track.segment)))


@pytest.fixture(scope="module")
def batch(linear_problem):
    """Balance of each window in N at the prior's mean, its derivatives, a root of the prior, and least squares."""
    joint, k = of(linear_problem), len(linear_problem.coordinates)

    def residuals(theta):
        errors = followed(joint, linear_problem, theta, np.zeros((k, k))).errors[:, 0, 0]
        return errors[np.isfinite(errors)]

    at_prior = residuals(np.zeros(k))
    H = np.column_stack([at_prior - residuals(unit) for unit in np.eye(k)])
    T = np.tril(np.random.default_rng(2).uniform(-0.1, 0.1, (k, k))) + np.eye(k)
    rows, rest = np.vstack([H / FORCE, np.linalg.inv(T)]), np.append(at_prior / FORCE, np.zeros(k))
    return at_prior, H, T, np.linalg.lstsq(rows, rest, rcond=None)[0]


def test_recursive_least_squares_are_batch_least_squares_with_the_prior(batch, linear_problem):
    at_prior, H, T, expected = batch
    joint, k = of(linear_problem), len(linear_problem.coordinates)
    correct = kernels_in("clutchid.inference.filter.balance").correct_balance
    state = init(joint, linear_problem.tracks[0].segment, np.zeros(k), T)
    room = scratch(state.x.size, 0, T, len(linear_problem.actuator.states), 1)
    for e, h in zip(at_prior, H, strict=True):
        equation = float(e - h @ state.theta), FORCE, 1e9
        correct(state, equation, h, joint.free, np.ones(k), room)
    assert state.theta == pytest.approx(expected, abs=1e-9)
    covariance = np.linalg.inv(H.T @ H / FORCE**2 + np.linalg.inv(T @ T.T))
    assert pytest.approx(covariance, abs=1e-9) == state.T @ state.T.T


def test_the_load_of_a_whole_recording_is_that_of_batch_least_squares(batch, linear_problem):
    """But for the curvature of the basis within an interval: it is evaluated in the middle (rule of the mid-point)."""
    _, _, T, expected = batch
    output = followed(of(linear_problem), linear_problem, np.zeros_like(expected), T)
    interval = np.abs(np.diff(linear_problem.tracks[0].measured["position"])).max()
    knots = np.diff(linear_problem.actuator.load.knots).min()
    assert output.state.theta == pytest.approx(expected, abs=(interval / knots) ** 2 / 24 * np.abs(expected).max())


@pytest.mark.parametrize("at", [-10.0, -2.5, 0.0, 1.0])
def test_smoothing_keeps_a_parabola(at):
    t = np.arange(-20.0, 1.0)
    position, velocity = smoothing(21, at) @ (3.0 - 0.2 * t + 0.05 * t**2)
    assert position == pytest.approx(3.0 - 0.2 * at + 0.05 * at**2, abs=1e-9)
    assert velocity == pytest.approx(-0.2 + 0.1 * at, abs=1e-9)

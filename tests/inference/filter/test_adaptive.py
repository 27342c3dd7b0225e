"""The adaptive observer on recordings that the model itself made."""

import numpy as np
import pytest

from clutchid import Actuator, Load, Log, Parameters, simulate
from clutchid.inference.filter.joint_filter import JointSettings, follow, init, inputs, joint_filter
from clutchid.inference.filter.references import adaptive_numbers
from clutchid.simulation.noise import Noise

#: Speed in m/s above which sliding friction dissipates more than the seals give back.
SLIDING = 0.02


@pytest.fixture(scope="module")
def isothermal():
    return Actuator(Parameters(), Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5))), "isothermal")


@pytest.fixture(scope="module")
def truth(isothermal):
    """The actuator of the recording: the load is a tenth larger than what the observer starts from."""
    return isothermal.replace({name: 1.1 * isothermal.value(name) for name in isothermal.load.names})


@pytest.fixture(scope="module")
def simulated(truth, duties):
    return simulate(truth, duties).log


@pytest.fixture(scope="module")
def problem(isothermal, simulated, duties, problem_of):
    log = Log(duties.time, {name: duties[name] for name in ("duty_supply", "duty_exhaust")})
    log = log.with_columns(position=simulated["position"])
    return problem_of(log, isothermal, isothermal.load.names, ("position",))


def made(problem, **gains):
    """Filter, first state and inputs."""
    k, segment = len(problem.coordinates), problem.tracks[0].segment
    numbers = adaptive_numbers(problem.actuator, problem.coordinates, np.eye(k), 1e-3)._replace(**gains)
    joint = joint_filter(
        problem.actuator, problem.coordinates, problem.bounds(), ("position",), Noise(), JointSettings(every=1),
        reference=numbers,
    )  # fmt: skip
    return joint, init(joint, segment, np.zeros(k), np.eye(k)), inputs(joint, problem.tracks[0])


@pytest.fixture(scope="module")
def followed(problem, simulated):
    """States of the model and theta, by sample."""
    joint, state, samples = made(problem)
    states, theta = [], []
    for i in range(len(simulated)):
        output = follow(joint, state, samples, (i, i + 1))
        state = output.state
        states.append(output.states[0])
        theta.append(state.theta)
    return joint, np.array(states), np.array(theta)


def lyapunov(joint, states, theta, truth, simulated):
    """M v^2 / 2 + q_A^2 / (2 gamma_q) + theta' inv(T T') theta / (2 gamma), see docs/derivations_online.md."""
    p, at = truth.parameters, truth.states.index
    air, adaptation = joint.reference.air, joint.reference.adaptation
    v = states[:, at("v")] - simulated["velocity"]
    q = (states[:, at("p_A")] - simulated["pressure_a"]) * (p.V_0A + p.A_A * simulated["position"])
    off = theta - [c.of(truth.value(c.base)) for c in joint.coordinates]
    return 0.5 * p.M * v**2 + 0.5 * q**2 / air + 0.5 * np.sum(off**2, axis=1) / adaptation


def test_the_lyapunov_function_falls_in_every_sample_in_which_the_piston_slides(followed, truth, simulated):
    change = np.diff(lyapunov(*followed, truth, simulated))
    sliding = np.abs(simulated["velocity"][1:]) > SLIDING
    assert np.count_nonzero(sliding) > 500
    assert change[sliding].max() < 0.0


def test_at_rest_it_rises_by_no_more_than_the_springs_of_the_seals_can_store(followed, truth, simulated):
    function, p = lyapunov(*followed, truth, simulated), truth.parameters
    change = np.diff(function)
    stops = np.count_nonzero(np.diff((np.abs(simulated["velocity"]) > SLIDING).astype(int)) == -1)
    assert change[change > 0.0].sum() < stops * 0.5 * p.K_z * (2 * p.F_C / p.K_z) ** 2
    assert function[-1] < 0.5 * function[0]


def test_a_correction_of_the_position_keeps_the_air_of_the_chamber(problem):
    joint, state, samples = made(problem, velocity=0.0, air=0.0, adaptation=0.0)
    p, at = problem.actuator.parameters, problem.actuator.states.index

    def air(row):
        return row[at("p_A")] * (p.V_0A + p.A_A * row[at("y")])

    as_measured = follow(joint, state, samples, (0, 1)).states[0]
    moved = follow(joint, state, samples._replace(values=samples.values + 2e-3), (0, 1)).states[0]
    assert moved[at("y")] - as_measured[at("y")] == pytest.approx(2e-3, abs=1e-12)
    assert air(moved) == pytest.approx(air(as_measured), rel=1e-12)


def noisy(samples, seed=4):
    """The measurements with the noise of the sensor."""
    noise = Noise().of_samples("position", 1e-3) * np.random.default_rng(seed).standard_normal(samples.values.shape)
    return samples._replace(values=samples.values + noise)


def test_noise_does_not_shift_the_load_or_the_air(problem, truth, simulated):
    """A correction by V_A or phi at a measured position, or one at rest, would go with the noise of the next one."""
    joint, state, samples = made(problem)
    span = 0, len(simulated)
    quiet = follow(joint, state, samples, span)
    y = np.linspace(2e-3, 9e-3, 20)
    change = np.abs(truth.load.force(y) - problem.actuator.load.force(y)).max()
    at = truth.states.index("p_A")
    loads, pressures = [], []
    for seed in range(6):
        output = follow(joint, state, noisy(samples, seed), span)
        loads.append(joint.actuator(output.state.theta).load.force(y) - joint.actuator(quiet.state.theta).load.force(y))
        pressures.append(np.mean(output.states[:, at] - quiet.states[:, at]))
    assert np.abs(np.mean(loads, axis=0)).max() < 0.15 * change
    assert abs(np.mean(pressures)) < 2e3


def test_an_outlier_moves_no_weight_and_no_more_than_one_at_the_bound(problem):
    joint, state, samples = made(problem)
    before = follow(joint, state, samples, (0, 330)).state
    spike, bound = samples.values.copy(), samples.values.copy()
    predicted = samples.values[330, 0] - follow(joint, before, samples, (330, 331)).errors[0, 0, 0]
    spike[330] = predicted + 5e-3
    bound[330] = predicted + Noise().outlier * Noise().of_samples("position", 1e-3)
    far, near = (follow(joint, before, samples._replace(values=values), (330, 331)).state for values in (spike, bound))
    assert far.x == pytest.approx(near.x, rel=1e-9)
    assert np.array_equal(far.theta, before.theta)

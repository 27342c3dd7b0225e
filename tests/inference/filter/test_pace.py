"""Integration steps of the filter by position and speed."""

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.joint_filter import JointSettings, follow, init, inputs, joint_filter
from clutchid.simulation.noise import Noise
from clutchid.simulation.stiffness import AS_PLANNED, STABLE_STEP, pace, stiffness


@pytest.fixture(scope="module")
def steps_at():
    return kernels_in("clutchid.inference.filter.joint_parameters").steps_at


def test_at_top_speed_there_are_as_many_steps_as_the_stiffness_of_the_whole_range_needs(steps_at, plant):
    paces = pace(plant, 1.0)
    most = max(steps_at(paces, y, 1.0, 1e-3, 1) for y in (0.0, 0.5 * plant.parameters.y_max, plant.parameters.y_max))
    assert most == np.ceil(1e-3 * stiffness(plant) / STABLE_STEP)


def test_a_slow_piston_needs_fewer_steps_and_a_faster_or_longer_interval_never_fewer(steps_at, plant):
    paces = pace(plant, 1.0)
    for y in (-1e-3, 1e-3, 8e-3, 19e-3, 30e-3):
        by_speed = [steps_at(paces, y, v, 1e-3, 1) for v in (0.0, 0.03, -0.07, 0.15, 0.25, -0.9)]
        assert by_speed == sorted(by_speed)
        assert steps_at(paces, y, 0.0, 1e-2, 1) >= by_speed[0]
    assert steps_at(paces, 8e-3, 0.0, 1e-3, 1) < steps_at(paces, 8e-3, 1.0, 1e-3, 1)


def test_without_a_pace_the_steps_are_as_planned(steps_at):
    assert steps_at(AS_PLANNED, 8e-3, 0.3, 1e-3, 7) == 7


def test_a_filter_with_fewer_steps_at_low_speed_finds_the_same_load(plant, recorded_by, problem_of):
    worn = plant.replace({name: 1.1 * plant.value(name) for name in plant.load.names})
    problem = problem_of(recorded_by(worn, 3.0), plant, (*plant.load.names, "F_C"), ("position",))
    k, track, loads = len(problem.coordinates), problem.tracks[0], []
    for paces in (AS_PLANNED, pace(plant, 1.05)):
        joint = joint_filter(
            problem.actuator, problem.coordinates, problem.bounds(), ("position",), Noise(), JointSettings(), pace=paces
        )
        state = init(joint, track.segment, np.zeros(k), np.eye(k))
        output = follow(joint, state, inputs(joint, track), (0, len(track.segment)))
        loads.append(joint.actuator(output.state.theta).load.force(np.linspace(2e-3, 9e-3, 20)))
    change = np.abs(loads[0] - plant.load.force(np.linspace(2e-3, 9e-3, 20))).max()
    assert np.abs(loads[1] - loads[0]).max() < 0.02 * change

"""An observer that begins within a stroke, as after a reset or a hole, and at the far end stop."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_equal

from clutchid.inference.filter.joint_filter import init
from clutchid.observer import observe, observe_recording, start
from clutchid.observer.state import Tail, segment_of
from clutchid.simulation.plan import OUTSIDE
from clutchid.strokes.stroke import BEGINS, ENDS


@pytest.fixture(scope="module")
def stroke(log):
    """The first sample at which the piston returns, and that at which the stroke ends."""
    position = log["position"]
    away = int(np.argmax(position > BEGINS))
    ends = away + int(np.argmax(position[away:] < ENDS))
    return int(np.argmax(position[:ends])), ends


def test_a_stroke_whose_beginning_was_not_followed_teaches_nothing_and_the_next_one_does(joint, log, stroke):
    returns, ends = stroke
    state, samples = observe(joint, start(joint), log.slice(returns, ends))
    assert state.partial
    assert_equal((state.theta, state.T), (start(joint).theta, start(joint).T))
    assert np.isfinite(samples.innovations[:, 0]).sum() > 5, "and the states are corrected"
    np.testing.assert_array_equal(samples.partial, np.isfinite(samples.states[:, 0]))
    run = observe_recording(joint, log.slice(returns, len(log)))
    assert run.health["not_learning"] == pytest.approx(1e-3 * (ends - returns + 1)), "and that is flagged"
    state, _ = observe(joint, state, log.slice(ends, len(log)))
    assert state.strokes > 1
    assert not state.partial
    assert np.abs(state.theta).max() > 0.1


def test_after_a_hole_within_a_stroke_what_was_learnt_stays_and_nothing_is_added(joint, log, stroke):
    returns, ends = stroke
    before, _ = observe(joint, start(joint), log.slice(0, returns))
    assert before.theta.any()
    late = replace(log.slice(returns, ends), time=log.time[returns:ends] + 0.1)
    after, _ = observe(joint, before, late)
    assert_equal((after.theta, after.T), (before.theta, before.T))


def test_the_pressure_at_the_start_is_as_uncertain_as_the_friction_at_an_unknown_speed_makes_it(joint, plant):
    tail = Tail(np.zeros(1), np.zeros((1, 2)), np.array([9e-3]), *np.zeros((2, 1)))
    actuator, state = joint.joint.mapped.actuator, start(joint)
    S = init(joint.joint, segment_of(tail, actuator), state.theta, state.T).S[:, state.theta.size :]
    v, p_A = (actuator.states.index(name) for name in ("v", "p_A"))
    covariance = S @ S.T
    assert covariance[p_A, v] / covariance[v, v] == pytest.approx(plant.value("D_v") / plant.value("A_A"))
    vented = init(joint.joint, segment_of(tail._replace(position=np.zeros(1)), actuator), state.theta, state.T).S
    assert (vented @ vented.T)[p_A, v] == 0.0


def test_from_anywhere_in_a_stroke_the_position_stays_near_the_measured_one(joint, log):
    """Nearer than the piston moves in 19 ms, when the first correction acts that knows of its speed; none diverges."""
    position, at = log["position"], joint.actuator.states.index("y")
    firsts = [first for first in range(0, len(log) - 150, 10) if position[first] > BEGINS]
    moves = max(np.ptp(position[k : k + 19]) for k in range(len(log) - 19))
    for first in firsts:
        _, samples = observe(joint, start(joint), log.slice(first, first + 150))
        assert np.abs(samples.states[:, at] - position[first : first + 150]).max() < moves, first


def test_at_the_far_stop_the_pressure_is_anywhere_between_that_of_the_load_and_the_supply(joint):
    actuator = joint.joint.mapped.actuator
    p, at = actuator.parameters, actuator.states.index("p_A")

    def begun(y):
        tail = Tail(np.zeros(1), np.zeros((1, 2)), np.array([y]), *np.zeros((2, 1)))
        state = start(joint)
        return init(joint.joint, segment_of(tail, actuator), state.theta, state.T)

    by_load, at_stop = begun(p.y_max - 2 * OUTSIDE), begun(p.y_max)
    load = p.P_0 + float(actuator.load.force(np.array([p.y_max]))[0]) / p.A_A
    assert by_load.x[at] == pytest.approx(load, rel=1e-2)
    assert at_stop.x[at] == pytest.approx((load + p.P_S) / 2)
    k = at_stop.theta.size
    assert at_stop.S[at, k + at] == pytest.approx((p.P_S - load) / np.sqrt(12.0))
    assert at_stop.S[at, :k].sum() == pytest.approx(by_load.S[at, :k].sum() / 2), "as far as it is that of the load"

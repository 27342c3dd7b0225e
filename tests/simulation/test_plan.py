"""What `plan` makes of a recording: the clock of switched valves, stretches between holes, vented starts."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.simulation import Partition
from clutchid.simulation.inputs import carrier_clock
from clutchid.simulation.plan import OUTSIDE, REST_WINDOW, SHORTEST_STRETCH, Segment, outside_stroke, plan
from fixtures.cases import case_tables
from fixtures.changed_logs import spoiled

CASES = case_tables(__file__, "test_plan")

N = 1000
#: Stiffness in 1/s, here of no interest.
RATE = 2000.0
#: Columns of the inputs of an actuator with switched valves.
PHASE, PART, SUPPLY_BEFORE, EXHAUST_BEFORE = 2, 3, 4, 5


def switched(time: np.ndarray, T_pwm: float) -> Segment:
    """The plan of an actuator with switched valves, whose duty cycles are another number at every sample."""
    supply = np.arange(time.size) / time.size
    log = Log(time, {"duty_supply": supply, "duty_exhaust": 1.0 - supply})
    actuator = Actuator(model="energy-balance").replace({"T_pwm": T_pwm})
    (segment,) = plan(log, actuator, RATE).segments
    return segment


def shut(n: int, **columns: np.ndarray) -> Log:
    """Closed valves at 1 kHz."""
    return Log(np.arange(n) * 1e-3, {"duty_supply": np.zeros(n), "duty_exhaust": np.zeros(n), **columns}, "shut")


@pytest.mark.parametrize("time", [np.arange(N) * 1e-3, np.arange(N) / 1000, 3600.0 + np.arange(N) * 1e-3])
@pytest.mark.parametrize("n", [1, 2, 5, 10, 20])
def test_in_a_period_of_n_samples_the_period_before_is_n_samples_before_whatever_the_rounding(time, n):
    inputs = switched(time, n * 1e-3).inputs
    first = np.maximum(np.arange(N) - n, 0)
    assert np.array_equal(inputs[:, SUPPLY_BEFORE], inputs[first, 0])
    assert np.array_equal(inputs[:, EXHAUST_BEFORE], inputs[first, 1])


def test_where_a_period_is_no_whole_number_of_samples_the_duty_cycle_before_is_the_one_that_was_held_then():
    inputs = switched(np.arange(N) * 1e-3, 2.5e-3).inputs
    assert np.array_equal(inputs[3:, SUPPLY_BEFORE], inputs[:-3, 0])


def test_phase_and_part_of_a_period_follow_the_clock_of_the_recording():
    time = 0.25e-3 + np.cumsum(np.tile([1e-3, 2e-3], N // 2))
    inputs = switched(time, 8e-3).inputs
    # three roundings of numbers below 1.5 s / 8 ms = 190 periods
    np.testing.assert_allclose(inputs[:, PHASE], (time % 8e-3) / 8e-3, atol=3 * 190 * 2.3e-16)
    # the last sample lasts as long as the one before
    steps = np.append(np.diff(time), time[-1] - time[-2])
    np.testing.assert_allclose(inputs[:, PART], steps / 8e-3, atol=3 * 190 * 2.3e-16)


def test_samples_of_a_period_and_longer_see_no_carrier():
    # 1 / 128 s is exact in binary, and so is a part of 1
    assert not switched(np.arange(N) / 128, 1 / 128).inputs[:, PART].any()
    assert not switched(np.arange(N) * 16e-3, 8e-3).inputs[:, PART].any()
    assert not switched(np.arange(N) * 1e-3, 0.0).inputs[:, [PHASE, PART]].any()


@pytest.mark.parametrize(("samples", "counts"), [(SHORTEST_STRETCH - 1, False), (SHORTEST_STRETCH, True)])
def test_a_stretch_between_holes_counts_from_ten_samples_on(truth, samples, counts):
    log = spoiled(shut(100, position=np.zeros(100)), "duty_supply", [50, 51 + samples])
    starts = [segment.start for segment in plan(log, truth, RATE).segments]
    assert starts == ([0, 51, 52 + samples] if counts else [0, 52 + samples])


def test_of_a_short_recording_without_holes_every_sample_counts(truth):
    (segment,) = plan(shut(3), truth, RATE).segments
    assert len(segment) == 3


@pytest.mark.parametrize(
    ("low", "high", "warned", "alien"),
    CASES["positions"],
)
def test_a_position_a_little_outside_the_stroke_is_said_and_one_far_outside_is_another_unit(low, high, warned, alien):
    log = shut(400, position=1e-3 * np.repeat([low, high], 200))
    sentences, strange = outside_stroke(log, 25e-3)
    assert (len(sentences), strange) == (warned, alien)
    assert plan(log, Actuator(), RATE).warnings == tuple(sentences)


def test_starts_and_resets_stay_in_the_stroke_where_the_measured_position_does_not(truth):
    position = np.repeat([-1e-3, 26e-3], 100)
    (segment,) = plan(shut(200, position=position), truth, RATE, Partition(every=10)).segments
    y_max = truth.parameters.y_max
    assert segment.position_start == -OUTSIDE
    assert [segment.measured[at, 0] for at in (10, 110)] == [-OUTSIDE, y_max + OUTSIDE]


def test_only_the_start_of_a_recording_can_be_vented(truth):
    log = spoiled(shut(200, position=np.zeros(200)), "duty_supply", 100)
    segments = plan(log, truth, RATE).segments
    assert [segment.vented for segment in segments] == [True, False]


def test_a_vented_recording_starts_at_the_middle_of_its_rest_until_the_supply_opens_or_half_a_second(truth):
    rest = 1e-4 + 5e-5 * np.sin(np.arange(2000.0))
    moved = np.where(np.arange(2000) < 300, rest, 0.02)
    dead, opened = truth.parameters.R_0vs, np.arange(2000) >= 300
    # a duty cycle within the dead zone leaves the valve closed
    log = shut(2000, position=moved).with_columns(duty_supply=np.where(opened, 0.5, 0.9 * dead))
    assert plan(log, truth, RATE).segments[0].position_start == np.median(rest[:300])
    still = plan(shut(2000, position=rest), truth, RATE).segments[0]
    assert still.position_start == np.median(rest[: round(REST_WINDOW / 1e-3)])


def test_no_segment_is_reset_at_its_own_start(truth):
    log = spoiled(shut(400, position=np.zeros(400)), "duty_supply", slice(150, 200))
    first, second = plan(log, truth, RATE, Partition(every=100)).segments
    assert np.flatnonzero(first.jump).tolist() == [100]
    assert (second.start, np.flatnonzero(second.jump).tolist()) == (200, [100])


@pytest.mark.parametrize("period", [0.005, 0.01, 0.0125, 0.02])
def test_a_pulse_is_the_same_in_whichever_period_of_a_recording_it_lies(period):
    actuator = Actuator(model="energy-balance").replace({"T_pwm": period, "s_pwm": 0.2, "s_vs": 0.1})
    first = np.arange(0.0, 0.4, 1e-3)
    for later in (7, 1003):
        phases = [carrier_clock(time, actuator.parameters)[0] for time in (first, first + later * period)]
        # without a lost sample the phases differ by rounding, never by a whole period
        assert np.abs(phases[1] - phases[0]).max() < 1e-6


def test_an_interval_with_the_start_of_a_period_has_its_pulses():
    actuator = Actuator(model="energy-balance").replace({"T_pwm": 0.01, "s_pwm": 0.03})
    # periods start 0.3 ms after each tenth sample, which still has the duty cycle of the period before
    log = shut(40).with_columns(duty_supply=np.repeat([0.1, 0.2, 0.3, 0.4], 10)[(np.arange(40) - 1).clip(0)])
    edges = {"duty_supply": (3e-4 + 0.01 * np.arange(4), np.array([0.1, 0.2, 0.3, 0.4]))}
    inputs = plan(replace(log, edges=edges), actuator, RATE).segments[0].inputs
    supply, phase, before = inputs[:, 0], inputs[:, 2], inputs[:, 4]
    assert phase[9:12] == pytest.approx([0.9, 0.0, 0.1]), "below 0.03 what is left of the period before"
    assert supply[9:12] == pytest.approx([0.1, 0.2, 0.2])
    assert before[10:12] == pytest.approx([0.1, 0.1])
    prompt = actuator.replace({"s_pwm": 0.0})
    assert plan(replace(log, edges=edges), prompt, RATE).segments[0].inputs[10, 0] == pytest.approx(0.1), (
        "a period that starts with a sample"
    )

"""What `plan` makes of a recording: the clock of switched valves, stretches between holes, vented starts."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.simulation.plan import Segment, plan

N = 1000
#: Columns of the inputs of an actuator with switched valves.
PHASE, PART, SUPPLY_BEFORE, EXHAUST_BEFORE = 2, 3, 4, 5


def switched(time: np.ndarray, T_pwm: float) -> Segment:
    """The plan of an actuator with switched valves, whose duty cycles are another number at every sample."""
    supply = np.arange(time.size) / time.size
    log = Log(time, {"duty_supply": supply, "duty_exhaust": 1.0 - supply})
    actuator = Actuator(model="energy-balance").replace({"T_pwm": T_pwm})
    (segment,) = plan(log, actuator, 2000.0).segments
    return segment


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

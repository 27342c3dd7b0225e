"""Where a check turns from good to look and bad: each grade on either side of its limit."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator

P = Actuator().parameters


def pushes(up: int, late: bool = False) -> Log:
    """Ten supply pulses of 20 ms, of which so many move the piston up by 1 mm and the others down, and back slowly.

    With `late` it moves within 15 ms after the valve has closed.
    """
    n = 10_000
    time, supply, position = np.arange(n) / 1000, np.zeros(n), np.zeros(n)
    for k in range(10):
        begin = 1000 * k + 200
        supply[begin : begin + 20] = 1.0
        first, last = (begin + 20, begin + 35) if late else (begin, begin + 20)
        course = np.interp(np.arange(n), [first, last, begin + 300, begin + 600], [0.0, 1.0, 1.0, 0.0])
        position += (1e-3 if k < up else -1e-3) * course
    position += 5e-3 + 1e-6 * np.random.default_rng(0).standard_normal(n)
    return Log(time, {"position": position, "duty_supply": supply, "duty_exhaust": np.zeros(n)})


@pytest.mark.parametrize(
    ("up", "grade"), [(10, "good"), (8, "good"), (7, "suspect"), (3, "suspect"), (2, "bad"), (0, "bad")]
)
def test_a_sign_is_right_or_wrong_where_three_quarters_of_the_motion_say_so(check_of, up, grade):
    assert check_of(pushes(up), "sign of position").grade == grade


def test_motion_goes_on_for_a_while_after_a_valve_has_closed(check_of):
    assert check_of(pushes(10, late=True), "sign of position").grade == "good"


@pytest.mark.parametrize(("share", "grade"), [(1.9, "good"), (2.1, "bad")])
def test_no_pressure_exceeds_twice_the_supply(check_of, share, grade):
    rise = np.linspace(P.P_0, share * P.P_S, 2000)
    # one in a hundred samples may lie beyond
    level = np.concatenate([rise, np.full(500, share * P.P_S)])
    seen = check_of(Log(np.arange(2500) / 1000, {"pressure_a": level}), "unit of pressure_a")
    assert seen.grade == grade


@pytest.mark.parametrize(("share", "grade"), [(0.09, "good"), (0.11, "suspect")])
@pytest.mark.parametrize(("name", "friction"), [("position", P.F_C / P.K_z), ("pressure_a", P.F_C / P.A_A)])
def test_steps_without_noise_matter_from_a_tenth_of_the_friction_on(check_of, name, friction, share, grade):
    step, low = share * friction, {"position": 0.0, "pressure_a": P.P_0}[name]
    slow = low + step * np.round(np.linspace(0.0, 100.0, 20_000))
    assert check_of(Log(np.arange(20_000) / 1000, {name: slow}), f"quantisation of {name}").grade == grade


def test_a_piston_that_stands_near_its_rest_under_an_open_exhaust_is_not_stuck(check_of):
    time = np.arange(0, 12, 1e-3)
    phase = time % 2
    y = np.interp(phase, (0.0, 0.2, 0.3, 0.6), (0.0, 0.024, 0.024, 0.0))
    y -= 1e-3 * (time < 2) * np.interp(phase, (0.0, 0.2, 0.3, 0.6), (1.0, 0.0, 0.0, 1.0))  # a millimetre further once
    # after the way back the exhaust closes, and opens again for a second while the piston stands
    supply, exhaust = 1.0 * (phase < 0.2), 1.0 * ((phase > 0.3) & (phase < 0.6) | (phase > 0.8))
    # of even noise no second spans more than 2 sqrt(3) standard deviations, so a piston at rest looks still
    y += np.random.default_rng(0).uniform(-3e-5, 3e-5, time.size)
    log = Log(time, {"position": y, "duty_supply": supply, "duty_exhaust": exhaust})
    assert check_of(log, "stuck position").grade == "good"

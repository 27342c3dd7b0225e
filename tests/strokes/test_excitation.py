"""What a recording excites, and what is told to be missing in it."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.estimation.assess.missing_excitation import missing_excitation
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.parameters import Parameters
from clutchid.strokes.excitation import SLOW_WINDOW, excitation, joint_excitation, vented_rests
from clutchid.strokes.sampled import velocity

#: 1 s rest, up in 0.1 s to 22 mm, 1 s there, to 10 mm in 0.5 s, 1 s there, back in 0.4 s, 1 s rest.
CORNERS = ((0.0, 1.0, 1.1, 2.1, 2.6, 3.6, 4.0, 5.0), (0.0, 0.0, 0.022, 0.022, 0.010, 0.010, 0.0, 0.0))


def course(noise: float = 0.0, step: float = 1e-3, **columns: np.ndarray) -> Log:
    t = np.arange(0.0, 5.0, step)
    y = np.interp(t, *CORNERS) + noise * np.random.default_rng(0).standard_normal(t.size)
    return Log(t, {"position": y, **columns})


@pytest.mark.parametrize("noise", [0.0, 5e-5])
def test_reach_and_rests_are_those_of_the_course(noise):
    log = course(noise)
    assert excitation(log).reach == pytest.approx(0.022, abs=1e-6 + 5 * noise)
    lengths = [log.time[b - 1] - log.time[a] for a, b in vented_rests(log, Parameters())]
    assert lengths == pytest.approx([1.0, 1.0], abs=2 * SLOW_WINDOW)


@pytest.mark.parametrize("noise", [0.0, 5e-5])
def test_a_pass_counts_once_whatever_the_noise_at_the_edges(noise):
    visits = {visit.low: visit for visit in excitation(course(noise)).regions}
    assert [(v.opening, v.closing) for v in visits.values()] == [(1, 1)] * 7


def test_a_region_entered_and_left_on_the_same_side_is_not_passed():
    t = np.arange(0.0, 3.0, 1e-3)
    log = Log(t, {"position": np.interp(t, [0.0, 1.0, 2.0, 3.0], [0.0, 0.010, 0.006, 0.010])})
    visits = {visit.low: (visit.opening, visit.closing) for visit in excitation(log).regions}
    assert visits[5e-3] == (1, 0)
    assert visits[8e-3] == (0, 0)


def test_missing_positions_are_no_motion_and_a_hole_in_time_ends_a_rest():
    whole = course()
    gone = whole["position"].copy()
    gone[500:520] = gone[1500:1520] = np.nan
    assert excitation(whole.with_columns(position=gone)).vented_rests == 2
    later = Log(whole.time + 100.0 * (whole.time > 4.5), whole.columns)
    assert excitation(later).vented_rests == 3


def test_a_rest_is_vented_only_with_the_supply_shut_and_without_pressure():
    n = 5000
    assert excitation(course(duty_supply=np.full(n, 0.3))).vented_rests == 0
    assert excitation(course(duty_supply=np.full(n, 0.05))).vented_rests == 2
    assert excitation(course(pressure_a=np.full(n, 1.5e5))).vented_rests == 0
    assert excitation(course(pressure_a=np.where(np.arange(n) < 2500, 1.1e5, 1.5e5))).vented_rests == 1


def test_velocity_is_the_slope_whatever_is_missing():
    t = np.arange(0.0, 1.0, 1e-3)
    position = 0.003 + 0.02 * t
    position[100:130] = np.nan
    np.testing.assert_allclose(velocity(t, position, SLOW_WINDOW), 0.02, rtol=1e-6)
    assert np.isnan(velocity(t, np.full(1000, np.nan), SLOW_WINDOW)).all()


def test_a_vibration_is_a_rest_and_the_slowest_ramp_of_the_protocol_is_not():
    t = np.arange(0.0, 4.0, 1e-3)
    shaking = Log(t, {"position": 1e-4 * np.sin(2 * np.pi * 25 * t)})
    ((first, last),) = vented_rests(shaking, Parameters())
    assert (first, last) == pytest.approx((0, t.size), abs=50)
    assert vented_rests(Log(t, {"position": 2.5e-3 * (t - 2.0)}), Parameters()) == []


def test_several_recordings_count_together():
    excited = excitation(course())
    short = excitation(course().slice(0, 1020))
    both = joint_excitation([excited, short])
    assert (both.recordings, both.vented_rests) == (2, 3)
    assert both.reach == excited.reach
    assert both.regions[0].opening == 2
    with pytest.raises(DataError, match="at least one"):
        joint_excitation([])


def test_a_recording_without_positions_is_refused():
    with pytest.raises(DataError, match="no finite sample"):
        excitation(course().with_columns(position=np.full(5000, np.nan)))


def test_a_recording_with_everything_misses_nothing(truth, driven):
    assert missing_excitation(excitation(driven(reach=0.022), truth.parameters), truth) == []


def test_a_short_reach_is_reported_in_sentences_that_agree_in_number(truth, driven):
    excited = excitation(driven(reach=0.0086))
    reach = f"{excited.reach * 1e3:.1f} mm of 25.0 mm"
    words = f"this log reaches {reach} and contains no information about the load beyond: reach 20.0 mm or more."
    assert missing_excitation(excited, truth)[0] == words
    two = missing_excitation(joint_excitation([excited, excited]), truth)[0]
    assert two.startswith("these 2 logs reach ")
    assert " and contain no information about the load beyond" in two


def test_one_direction_only_and_a_missing_rest_are_reported():
    t = np.arange(0.0, 1.0, 1e-3)
    sentences = missing_excitation(
        excitation(Log(t, {"position": np.interp(t, [0.0, 1.0], [0.004, 0.022])})), Actuator()
    )
    assert len(sentences) == 6
    assert sentences[0] == (
        "this log passes 5 to 8 mm 1 time, only while opening: friction and load cannot be separated there; pass it "
        "while closing, too."
    )
    assert sentences[-1].startswith(
        "this log has no vented rest (lowest position 4.0 mm), so the pressure is unknown without"
    )


def test_the_ambient_pressure_is_that_of_the_actuator():
    assert excitation(course(pressure_a=np.full(5000, 1e5)), Parameters(P_0=0.8e5)).vented_rests == 0
    assert excitation(course(pressure_a=np.full(5000, 1e5))).vented_rests == 2

"""How recordings are cut into windows, and where they start."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.parameters import Parameters
from clutchid.preparation.prepare import prepare
from clutchid.simulation.windows import initial_states, tracks


def rest(n, step, hole=None):
    time = np.arange(n) * step
    if hole:
        time[hole:] += 20 * step
    zero = np.zeros(n)
    return Log(time, {"position": zero, "duty_supply": zero, "duty_exhaust": zero})


def windows_of(log):
    return tracks([prepare(log, Actuator(Parameters()), ("position",))])


@given(st.integers(2, 1500), st.sampled_from([1e-3, 1e-2]))
def test_windows_share_their_border_samples_and_cover_the_segment(n, step):
    (track,) = windows_of(rest(n, step))
    usual = round(0.1 / step)
    assert track.windows[0].start == 0
    assert track.windows[-1].stop == n
    for earlier, following in zip(track.windows[:-1], track.windows[1:], strict=True):
        assert earlier.stop - 1 == following.start
    for window in track.windows:
        assert window.dt.size == len(window) - 1 == window.inputs.shape[0] - 1 == window.substeps.size
        assert not window.jump.any()
    assert all(len(window) - 1 == usual for window in track.windows[:-1])
    last = len(track.windows[-1]) - 1
    assert last < 1.5 * usual
    assert last >= usual // 2 or len(track.windows) == 1, "no window is too short to tell its start"


def test_a_hole_ends_a_track_and_no_window_crosses_it():
    before, after = windows_of(rest(730, 1e-3, hole=333))
    assert (before.windows[0].start, before.windows[-1].stop) == (0, 333)
    assert (after.windows[0].start, after.windows[-1].stop) == (333, 730)
    assert all(window.dt.max() < 2e-3 for track in (before, after) for window in track.windows)


def test_a_track_knows_how_far_apart_its_measured_positions_are():
    log = rest(301, 1e-3)
    position = np.where(np.arange(301) % 10 == 0, log["position"], np.nan)
    plans = [prepare(recording, Actuator(), ("position",)) for recording in (log, log.with_columns(position=position))]
    assert [track.spacing for track in tracks(plans)] == pytest.approx([1e-3, 0.01])


def test_windows_know_the_recording_that_they_belong_to():
    plans = [prepare(rest(n, 1e-3), Actuator(), ("position",)) for n in (300, 450)]
    assert [(track.log, len(track.measured)) for track in tracks(plans)] == [(0, 300), (1, 450)]


def test_the_first_guess_takes_position_velocity_and_pressure_from_what_was_measured(plant, recorded_by, problem_of):
    log = recorded_by(plant, seconds=3.0, seed=None)
    problem = problem_of([log], plant.replace({"C_vs": 25e-9}), ("C_vs",))
    track = problem.tracks[0]
    at = np.array([window.start for window in track.windows])
    guess = initial_states(track, plant.replace({"C_vs": 25e-9}), True)
    velocity = np.gradient(log["position"], 1e-3)
    # medians and slopes over 16 ms, in which the piston moves by up to 3 mm and its velocity by as much as it has
    still = np.array([np.ptp(log["position"][max(0, i - 8) : i + 9]) < 2e-4 for i in at])
    assert still.sum() > 5
    assert guess[still, 0] == pytest.approx(log["position"][at][still], abs=1e-4)
    assert guess[still, 2] == pytest.approx(log["pressure_a"][at][still], abs=1e4)
    assert np.corrcoef(guess[:, 1], velocity[at])[0, 1] > 0.95
    blind = initial_states(track, plant.replace({"C_vs": 25e-9}), False)
    assert np.abs(blind[:, 2] - guess[:, 2]).max() > 1e4, "without pressure its guess is the simulated one"

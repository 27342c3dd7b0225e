"""How recordings are cut into windows, where they start, and the robust cost of their residuals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.inference.smoother.rows import downweight_outliers, first_rows
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.preparation.prepare import prepare
from clutchid.simulation.noise import Noise
from clutchid.simulation.windows import initial_states, tracks

BOTH = ("position", "pressure_a")


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
    for one, other in zip(track.windows[:-1], track.windows[1:], strict=True):
        assert one.stop - 1 == other.start
    for window in track.windows:
        assert window.dt.size == len(window) - 1 == window.inputs.shape[0] - 1 == window.substeps.size
        assert not window.jump.any()
    assert all(len(window) - 1 == usual for window in track.windows[:-1])
    last = len(track.windows[-1]) - 1
    assert last < 1.5 * usual
    assert last >= usual // 2 or len(track.windows) == 1, "no window is too short to tell its start"


def test_a_hole_ends_a_track_and_no_window_crosses_it():
    one, other = windows_of(rest(730, 1e-3, hole=333))
    assert (one.windows[0].start, one.windows[-1].stop) == (0, 333)
    assert (other.windows[0].start, other.windows[-1].stop) == (333, 730)
    assert all(window.dt.max() < 2e-3 for track in (one, other) for window in track.windows)


def test_a_track_knows_how_far_apart_its_measured_positions_are():
    log = rest(301, 1e-3)
    position = np.where(np.arange(301) % 10 == 0, log["position"], np.nan)
    plans = [prepare(one, Actuator(), ("position",)) for one in (log, log.with_columns(position=position))]
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


@pytest.mark.parametrize("name", ["P_0", "T_w", "P_S", "theta_11", "C_vs"])
def test_the_first_rows_move_with_what_the_start_depends_on(plant, drive_log, problem_of, name):
    names = ("P_0", "T_w", "P_S", "theta_11", "C_vs")
    # from the middle of a stroke, without pressure: the start rests against the load, Eq. (26)
    middle = int(np.argmax(drive_log["position"] > 8e-3))
    for log in (drive_log, drive_log.slice(middle, middle + 500)):
        problem = problem_of([log], plant, names, ("position",))
        track, x, h = problem.tracks[0], np.zeros(5), 1e-4
        start = np.array([1e-4, 0.0, 1.2e5, 1.1e5, 1e-5, 295.0, 290.0, 8.9e5, 9.1e5, 2e-5])
        e = h * np.eye(5)[names.index(name)]
        rows, cost = first_rows(track, start, problem.parameter_map(x, "log"), False, Noise())
        up, down = (
            first_rows(track, start, problem.parameter_map(x + s * e, "log"), False, Noise())[0] for s in (1, -1)
        )
        difference = (up[:, -1] - down[:, -1]) / (2 * h)
        assert rows[:, start.size + names.index(name)] == pytest.approx(
            difference, abs=1e-5 * max(1.0, np.abs(difference).max())
        )
        assert cost == pytest.approx(np.sum(rows[:, -1] ** 2))
    assert (np.abs(difference).max() > 0) == (name != "C_vs")


def test_a_measured_start_is_known_as_well_as_its_sensor(plant, drive_log, problem_of):
    middle = int(np.argmax(drive_log["position"] > 8e-3))
    log = drive_log.slice(middle, middle + 500)
    start, noise = np.zeros(len(VARIANTS[plant.model])), Noise()
    start[2] = 3e5
    slopes = []
    for measure in (BOTH, ("position",)):
        problem = problem_of([log], plant, ("C_vs",), measure)
        rows, _ = first_rows(
            problem.tracks[0], start, problem.parameter_map(np.zeros(1), "log"), "pressure_a" in measure, noise
        )
        slopes.append(rows[2, 2])
    assert slopes == pytest.approx([1e5 / 3e3, 1e5 / 1e5]), "3 kPa by the sensor, 1 bar without it"


@given(st.floats(0, 100), st.floats(0.5, 10), st.booleans())
def test_the_robust_cost_is_hubers_loss_and_scaled_rows_have_its_gradient(size, outlier, negative):
    r = -size if negative else size
    rows = np.array([[3.0, r]])
    cost = downweight_outliers(rows, outlier)
    huber = r**2 if size <= outlier else 2 * outlier * size - outlier**2
    slope = 2 * r if size <= outlier else 2 * outlier * np.sign(r)
    assert cost == pytest.approx(huber, rel=1e-12)
    assert 2 * rows[0, 0] * rows[0, 1] == pytest.approx(3.0 * slope, rel=1e-12)

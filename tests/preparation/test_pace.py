"""As many integration steps as a window needs: fewer where it is not stiff, never more than planned, and as exact."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.inference.smoother.rows import link_sigma
from clutchid.preparation.prepare import MAX_STEP, SPEED_MARGIN, with_steps
from clutchid.simulation.noise import Noise
from clutchid.simulation.run import KernelArrays, run
from clutchid.simulation.stiffness import STABLE_STEP, local_stiffness, stiffness
from fixtures.changed_logs import spoiled


@pytest.fixture(scope="module")
def stiff(plant):
    """An actuator whose chamber B is small and open: at the far stop it is four times as stiff as at rest."""
    return plant.replace({"V_0B": 6e-5, "C_r": 4e-7})


@pytest.fixture(scope="module")
def track(stiff, recorded_by, problem_of):
    return problem_of([recorded_by(stiff, seconds=6.0)], stiff, ("F_C",), ("position",)).tracks[0]


@pytest.fixture(scope="module")
def fewer(track, stiff):
    return with_steps(track, stiff, 1.05)


@pytest.fixture(scope="module")
def sparse(track):
    """The track as a recorder at 100 Hz has it, on a time grid of 1 ms: nine of ten positions are missing."""
    position = np.full(len(track.measured), np.nan)
    position[::10] = track.measured["position"][::10]
    return replace(track, measured=track.measured.with_columns(position=position), spacing=0.01)


def test_windows_take_fewer_steps_than_planned_and_never_more(track, fewer):
    planned, taken = (np.array([window.substeps[0] for window in prepared.windows]) for prepared in (track, fewer))
    assert np.all(taken <= planned)
    assert taken.mean() < 0.7 * planned.mean()
    assert np.all(track.segment.dt[0] / taken <= MAX_STEP * (1 + 1e-9))
    assert len(set(taken.tolist())) > 1, "not every window is equally stiff"


@pytest.mark.parametrize("of", ["fewer", "sparse"])
def test_the_steps_of_a_window_are_stable_where_its_piston_is(request, track, stiff, of):
    taken = request.getfixturevalue(of)
    for window in (taken if of == "fewer" else with_steps(taken, stiff, 1.05)).windows:
        position = track.measured["position"][window.start : window.stop]
        speed = np.abs(np.diff(position[::8])).max() / 8e-3
        rate = local_stiffness(stiff, float(speed), (float(position.min()), float(position.max())))
        assert window.dt.max() / window.substeps.min() <= STABLE_STEP / rate


def test_the_ends_of_windows_are_those_of_the_planned_steps(track, fewer, stiff):
    numbers, states = KernelArrays.of(stiff), run(track.segment, KernelArrays.of(stiff), _rest(stiff))[0]
    sigma = link_sigma(track, stiff, Noise())
    for many, few, width in zip(track.windows, fewer.windows, sigma, strict=True):
        start = states[many.start - track.segment.start]
        ends = [run(window, numbers, start)[0][-1] for window in (many, few)]
        assert np.abs((ends[0] - ends[1]) / width).max() < 0.05, "a twentieth of what the model misjudges"


def _rest(actuator):
    p = actuator.parameters
    return np.array([0.0, 0.0, p.P_0, p.P_0, 0.0, p.T_w, p.T_w, p.P_S, p.P_S, 0.0])


def test_a_window_without_position_keeps_its_steps(track, stiff):
    holed = with_steps(replace(track, measured=spoiled(track.measured, "position", slice(2500, 2510))), stiff, 1.05)
    number = next(i for i, window in enumerate(track.windows) if window.start <= 2505 < window.stop)
    assert np.array_equal(holed.windows[number].substeps, track.windows[number].substeps)


def test_windows_of_a_slow_recording_take_the_steps_of_the_same_at_1_khz(track, fewer, sparse, stiff):
    planned, at_1_khz, slow = (
        sum(int(window.substeps.sum()) for window in prepared.windows)
        for prepared in (track, fewer, with_steps(sparse, stiff, 1.05))
    )
    assert slow == pytest.approx(at_1_khz, rel=0.1)
    assert slow < 0.75 * planned


def test_a_window_of_a_slow_recording_that_lacks_samples_keeps_its_steps(track, sparse, stiff):
    holed = with_steps(replace(sparse, measured=spoiled(sparse.measured, "position", 2500)), stiff, 1.05)
    number = next(i for i, window in enumerate(track.windows) if window.start <= 2495 < window.stop)
    assert np.array_equal(holed.windows[number].substeps, track.windows[number].substeps)


def test_a_piston_faster_than_any_class_keeps_its_steps(track, stiff):
    time = track.measured.time
    fast = track.measured.with_columns(position=0.5e-2 + 0.4 * (time % 0.02))
    assert SPEED_MARGIN < 0.4
    unchanged = with_steps(replace(track, measured=fast), stiff, 1.05)
    assert all(
        np.array_equal(window.substeps, other.substeps)
        for window, other in zip(unchanged.windows, track.windows, strict=True)
    )


def test_a_larger_margin_asks_for_more_steps(track, stiff, fewer):
    more = with_steps(track, stiff, 2.0)
    counts = [sum(int(window.substeps.sum()) for window in prepared.windows) for prepared in (fewer, more, track)]
    assert counts[0] < counts[1] <= counts[2]


def test_local_stiffness_grows_with_speed_and_reach_up_to_the_whole(stiff):
    slow, fast = (local_stiffness(stiff, speed, (0.0, 5e-3)) for speed in (0.05, 0.3))
    assert slow <= fast <= local_stiffness(stiff, 0.3, (-np.inf, np.inf)) == stiffness(stiff)
    assert local_stiffness(stiff, 0.05, (0.0, 1e-3)) < 0.6 * stiffness(stiff)

"""One definition of a stroke: the count, the observer, its drift and the exported C have the same on any movement."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from clutchid.exports.c99 import CStyle
from clutchid.exports.parity import BAND, RESULT_COLUMNS, samples_of
from clutchid.inference.filter.joint_filter import drifted
from clutchid.log import Log
from clutchid.observer import curve, observer, start
from clutchid.observer.by_stroke import curve_positions
from clutchid.observer.configuration import DRIFT
from clutchid.observer.flags import ZERO_UNKNOWN
from clutchid.observer.following import observe_strokes
from clutchid.strokes.rule import VALUE
from clutchid.strokes.stroke import BEGINS, ENDS, SHORTEST
from fixtures.export_c import replay, write_sources
from fixtures.strokes import stroke_ends

pytestmark = pytest.mark.slow

#: Positions in m on both sides of the limits of a stroke, and samples at 1 kHz on both sides of its shortest time.
LEVELS = (np.nan, 0.0, ENDS - 1e-4, ENDS + 1e-4, BEGINS - 1e-4, BEGINS + 1e-4, 8e-3)
LENGTHS = (1, 5, *(round(1e-3 * SHORTEST) + by for by in (-1, 0, 1)), 60)

#: Movement in m between two samples.
RAMP = 2e-4


@pytest.fixture(scope="module")
def learning(plant):
    """An observer that learns from nothing but the number of strokes: its parameters drift, and do not adapt."""
    made = observer(plant, "joint")
    return replace(made, joint=replace(made.joint, settings=replace(made.joint.settings, least_speed=1e9)))


@pytest.fixture(scope="module")
def in_c(learning, tmp_path_factory):
    """Strokes by sample, and load with its band at the end, of the exported C: in_c(log)."""
    style, at = CStyle(real="double"), curve_positions(learning)
    program = replay(style, write_sources(learning, style, tmp_path_factory.mktemp("c") / "src"), at, 0)

    def run(log):
        samples = np.frombuffer(
            subprocess.run([program], input=samples_of(log).tobytes(), capture_output=True, check=True).stdout
        )
        n = len(log) * len(RESULT_COLUMNS)
        strokes = samples[:n].reshape(-1, len(RESULT_COLUMNS))[:, RESULT_COLUMNS.index("strokes")]
        return strokes, samples[n : n + BAND * at.size].reshape(-1, BAND)[:, :3]

    return run


def recorded(position):
    """A recording of a position with closed valves, at 1 kHz."""
    time, closed = 1e-3 * np.arange(position.size), np.zeros(position.size)
    return Log(time, {"position": position, "duty_supply": closed, "duty_exhaust": closed})


def moved(parts):
    """Levels for some samples each, with ramps between them that a piston may move: a step is no value."""
    position = []
    for level, length in parts:
        if position and np.isfinite(position[-1]) and np.isfinite(level):
            position += np.linspace(position[-1], level, round(abs(level - position[-1]) / RAMP) + 2)[1:-1].tolist()
        position += [level] * length
    return np.array(position)


@pytest.mark.filterwarnings("ignore::hypothesis.errors.HypothesisWarning")  # the observer has a long repr
@settings(max_examples=25)
@example([(BEGINS + 1e-4, 1), (np.nan, 5)])  # 60 ms of values before a step, which is believed after 130 ms
@given(st.lists(st.tuples(st.sampled_from(LEVELS), st.sampled_from(LENGTHS)), max_size=30))
def test_count_observer_drift_and_c_have_the_same_strokes(learning, in_c, movement):
    parts = [(0.0, 50), *movement, (8e-3, 60), (0.0, 50)]
    log = recorded(moved(parts))
    after, samples, at_ends = observe_strokes(learning, start(learning), log)
    position = np.where((samples.verdicts == VALUE) & ~samples.flagged(ZERO_UNKNOWN), log["position"], np.nan)
    ends = stroke_ends(log.time, position)
    assert after.strokes == len(ends)
    assert [end.latest for end in at_ends] == log.time[ends].tolist()
    covariance = start(learning).T @ start(learning).T.T
    T = drifted(learning.joint, after.T, after.wear)
    np.testing.assert_allclose(T @ T.T, (1.0 + DRIFT * len(ends)) * covariance, rtol=1e-9, atol=1e-12)
    strokes, load = in_c(log)
    assert np.flatnonzero(np.diff(strokes)).tolist() == [end - 1 for end in ends]
    expected = curve(learning, after, curve_positions(learning))
    np.testing.assert_allclose(load, np.stack([expected.force, expected.low, expected.high], axis=1), rtol=1e-9)


@pytest.fixture(scope="module")
def unseen(plant, recorded_by):
    """A stroke of which the position is missing from before it begins: a movement that does not count as a stroke."""
    log = recorded_by(plant, driven=1)
    begins = int(np.argmax(log["position"] > BEGINS)) - 20
    seen = log.with_columns(position=np.where(np.arange(len(log)) < begins, log["position"], np.nan))
    return seen.slice(0, stroke_ends(log.time, log["position"])[0] + 200)


def test_a_movement_that_is_no_stroke_does_not_drift_what_is_known(learning, plant, unseen):
    after, samples, at_ends = observe_strokes(learning, start(learning), unseen)
    moved = samples.states[:, plant.states.index("y")]
    assert moved.max() > 2.0 * BEGINS, "the filter follows the piston without its position"
    assert moved[-1] < ENDS
    assert at_ends == []
    assert np.array_equal(after.T, start(learning).T)


def test_a_movement_that_is_no_stroke_does_not_drift_what_is_known_in_c(learning, in_c, unseen):
    strokes, load = in_c(unseen)
    assert not strokes.any()
    calibrated = curve(learning, start(learning), curve_positions(learning))
    np.testing.assert_allclose(load[:, 2], calibrated.high, rtol=1e-12)

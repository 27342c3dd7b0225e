"""The vented rest on line: a sensor that moved is found rest by rest, and subtracted, however the samples are cut."""

import numpy as np
import pytest
from numpy.testing import assert_equal

from clutchid.codegen.kernels import kernels_in
from clutchid.codegen.records import new_record, values_in
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.observer import observe_recording, observer
from clutchid.observer.configuration import start
from clutchid.observer.inputs import taken_in, window_size
from clutchid.observer.rest import Rest, RestBefore
from clutchid.strokes.vented_rest import VentedRest, vented_rest
from clutchid.truck import drive, truck

OFFSET = 3e-4


@pytest.fixture(scope="module")
def log(worn, recorded_by):
    """The worn plant with its vented rests, position only."""
    return recorded_by(worn, seconds=6.0, seed=5, name="worn", driven=1).without("pressure_a")


@pytest.fixture(scope="module")
def calibration(log):
    return Calibration((), np.zeros((0, 0)), rest=vented_rest(log))


def moved(log, by=OFFSET):
    return log.with_columns(position=log["position"] + by)


def test_the_same_zero_gives_the_same_numbers_as_without_a_rest(plant, log, calibration):
    shifted, plain = (
        observe_recording(observer(plant, calibration=calibration), log),
        observe_recording(observer(plant), log),
    )
    assert np.array_equal(shifted.samples.states, plain.samples.states, equal_nan=True)
    assert shifted.health["rest_moved"] == 0.0
    assert np.all(shifted.samples.rest == 0.0)


def test_a_moved_zero_is_flagged_and_subtracted_and_the_load_is_nearer_to_that_without_it(plant, log, calibration):
    plain = observe_recording(observer(plant), log)
    loads = {}
    at = np.linspace(5e-3, 8e-3, 7)
    for zero in ("subtract", "keep"):
        joint = observer(plant, calibration=calibration, zero=zero)
        run = observe_recording(joint, moved(log))
        assert run.after.rest_shift == pytest.approx(OFFSET, abs=2e-5)
        assert run.health["rest_moved"] > 3.0
        loads[zero] = joint.load(run.after).force(at)
    true = observer(plant).load(plain.after).force(at)
    off = {zero: np.abs(load - true).max() for zero, load in loads.items()}
    # two strokes; the first was over before the piston returned to its rest
    assert off["subtract"] < 0.7 * off["keep"]


def test_strokes_count_from_the_vented_rest_wherever_the_sensor_reads_it(plant, log, calibration):
    joint = observer(plant, calibration=calibration)
    as_calibrated, far = (observe_recording(joint, moved(log, by)).strokes for by in (0.0, 1.8e-3))
    # from the first rest on, which shows the zero
    assert [row.time for row in far][1:] == pytest.approx([row.time for row in as_calibrated][1:], abs=0.01)
    assert len(far) == len(as_calibrated) > 1


def test_what_was_learnt_from_another_zero_is_forgotten(plant, log, calibration):
    joint = observer(plant, calibration=calibration)
    begins = int(np.argmax(observe_recording(joint, moved(log)).samples.rest > 0.0))
    before, after = (observe_recording(joint, moved(log).slice(0, n)).after for n in (begins, begins + 1))
    assert not np.array_equal(before.theta, start(joint).theta), "a stroke has taught something by then"
    assert after.zero == pytest.approx(OFFSET, abs=1e-4)
    assert after.number == 1
    for name in ("theta", "T", "sound"):
        assert_equal(getattr(after, name), getattr(start(joint), name))


def watched(rest, before, position, duties):
    """Shifts that become known while the rest is watched, with the samples behind them; the rest is changed."""
    size, changes = window_size(1e-3), []
    calibrated = new_record(
        RestBefore, exists=1, lowest=before.lowest, returned=before.returned, level=1e-5, range=1.25e-4, bin=size.bin,
        bins=size.bins, vents=50,
    )  # fmt: skip
    memory = np.zeros(size.bin), np.zeros(size.bins)
    for i, (y, (supply, exhaust)) in enumerate(zip(position.tolist(), duties.tolist(), strict=True)):
        if kernels_in("clutchid.observer.rest_rule").watch_rest(rest, calibrated, *memory, y, supply, exhaust):
            changes.append((i + 1, rest.shift))
    return changes


def nothing(**values):
    """The rest before the first sample."""
    return new_record(Rest, lowest=np.nan, **values)


@pytest.mark.parametrize("exchanged", [False, True])
def test_a_hole_keeps_the_shift_and_the_levels_where_no_sensor_can_have_been_exchanged(exchanged):
    levels = {"lowest": np.nan, "n_returned": 0} if exchanged else {"lowest": 1e-4, "n_returned": 2}
    rest = new_record(Rest, shift=2e-4, lowest=1e-4, n_returned=2, excursion=1, taken=1, n_medians=3, vents=7)
    kernels_in("clutchid.observer.rest_rule").new_stretch(rest, exchanged)
    assert_equal(values_in(rest), values_in(new_record(Rest, shift=2e-4, **levels)))


def test_rests_above_the_stop_change_no_shift_that_they_allow():
    before = VentedRest(0.0, 5e-4, 1e-5)
    y = np.concatenate([np.full(500, 1e-2), np.full(500, 5.5e-4)])
    duties = np.column_stack([np.zeros(1000), (np.arange(1000) > 450) * 1.0])
    assert [shift for _, shift in watched(nothing(), before, y, duties)] == [0.0], "the zero is known, and as before"
    assert watched(nothing(shift=1e-4), before, y, duties) == [(650, 1e-4)], "friction allows this shift too"
    assert watched(nothing(), before, y + 1e-3, duties)[0][1] == pytest.approx(1.05e-3)


def after_strokes(levels):
    """Positions in m of a stroke before each vented rest, and duty cycles."""
    y = np.concatenate([np.repeat([1e-2, level], 500) for level in levels])
    vents = np.tile(np.arange(1000) > 450, len(levels)) * 1.0
    return y, np.column_stack([np.zeros(y.size), vents])


@pytest.mark.parametrize("strokes", [2, 5])
@pytest.mark.parametrize("step", [3e-4, -3e-4, 2e-3])
def test_rests_that_agree_are_a_moved_sensor_also_where_friction_holds_the_piston_far_above_its_stop(step, strokes):
    before, rest = VentedRest(0.0, 5.66e-4, 6e-6), nothing()
    levels = 5.5e-4 + 1e-5 * np.array([0, -1, -1, 0, -1, 0, 0, 0, 1, 0]) + step * (np.arange(10) >= strokes)
    at_stop = np.concatenate([np.zeros(500), after_strokes(levels)[0]])
    duties = np.vstack([np.column_stack([np.zeros(500), np.ones(500)]), after_strokes(levels)[1]])
    moves = 500 + 1000 * strokes
    watched(rest, before, at_stop[:moves], duties[:moves])
    assert rest.shift == 0.0
    watched(rest, before, at_stop[moves : moves + 3000], duties[moves : moves + 3000])
    assert rest.shift == pytest.approx(step, abs=3e-5)


def test_rests_of_another_friction_are_no_moved_sensor():
    before, rest = VentedRest(0.0, 5e-4, 1e-5), nothing()
    y, duties = after_strokes(np.linspace(5e-4, 3.5e-4, 10))
    both = np.concatenate([np.zeros(500), y]), np.vstack([np.column_stack([np.zeros(500), np.ones(500)]), duties])
    watched(rest, before, *both)
    assert rest.shift == 0.0


def from_the_stop(rests):
    """Positions in m at the stop, then of a stroke before each vented rest, and duty cycles."""
    y = np.concatenate([np.zeros(500), *(np.r_[np.full(500, 1e-2), rest] for rest in rests)])
    return y, np.column_stack([np.zeros(y.size), np.ones(y.size)])


def creeping(to, by=3e-4, seconds=0.4, samples=500):
    return to + by * np.exp(-1e-3 * np.arange(samples) / seconds)


def test_a_piston_that_creeps_back_has_no_level():
    at_rest = from_the_stop([creeping(2e-4)] * 5)
    rest = nothing()
    changes = watched(rest, VentedRest(0.0, 3e-4, 1e-5), *at_rest)
    assert (rest.n_returned, rest.shift, len(changes)) == (0, 0.0, 1)


@pytest.mark.parametrize(("returned", "level"), [(3e-4, 5.5e-4), (1.8e-3, 3.5e-4)])
def test_rests_that_lie_otherwise_above_a_stop_that_stays_are_no_moved_sensor(returned, level):
    """The piston came to creep since the calibration, or the calibration has a hold of the position."""
    at_rest = from_the_stop([np.full(500, level)] * 4)
    rest = nothing()
    watched(rest, VentedRest(0.0, returned, 1e-5), *at_rest)
    assert (rest.shift, rest.lowest) == (0.0, 0.0)


def test_rests_that_came_down_before_two_of_them_are_a_moved_sensor():
    at_rest = from_the_stop([np.full(500, 1e-4)] * 3)
    assert watched(nothing(), VentedRest(0.0, 5e-4, 1e-5), *at_rest)[-1][1] == pytest.approx(-4e-4)


def test_a_stop_that_stays_has_not_moved_where_the_calibrated_rests_are_near_it():
    at_rest = from_the_stop([np.full(500, 3.5e-4)] * 2)
    rest = nothing()
    watched(rest, VentedRest(0.0, 7e-5, 1e-5), *at_rest)
    assert rest.shift == 0.0


@pytest.mark.parametrize("moves", [0.0, 1e-3])
def test_a_false_shift_ends_where_the_piston_creeps_below_the_stop_that_it_would_have(moves):
    y, duties = from_the_stop([np.full(300, 8e-4), creeping(0.0, 8e-4, 1.0, 8000)])
    y, duties = moves + y[500:], duties[500:]  # without its stop at the beginning
    rest = nothing()
    changes = watched(rest, VentedRest(0.0, 3e-4, 1e-5), y, duties)
    assert changes[0][1] == pytest.approx(moves + 5e-4), "taken for a moved sensor"
    assert rest.shift == pytest.approx(moves, abs=6e-5)


@pytest.mark.slow
@pytest.mark.parametrize("family", ["A", "B"])
def test_the_shift_on_line_is_that_of_the_whole_recording(family, plant):
    kind = truck(2, family)
    before = vented_rest(drive(kind, seconds=20, seed=1).log)
    joint = observer(plant, "states", calibration=Calibration((), np.zeros((0, 0)), rest=before))
    for options in ({}, {"offset": OFFSET}, {"sensor_zero": "kept", "wear": 2e-3}):
        driven = drive(kind, seconds=20, seed=2, pressure=False, **options)
        _, inputs = taken_in(joint, start(joint).inputs, np.nan, driven.log)
        assert inputs.rest.shift == pytest.approx(driven.truth.shift, abs=2.5e-5)

"""Innovations against those of the calibration recordings, and what happens where the filter diverges."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.joint_filter import Diverged
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.model import Actuator
from clutchid.observer import estimates_of, observe, observe_recording, observer, start
from clutchid.observer.flags import FLAGS, HEALED
from clutchid.observer.health import health, raised
from clutchid.observer.mismatch import MEMORY, MISMATCHED, mismatch_from, normalised
from clutchid.observer.prior import AIR_STD, deviation_by_air
from clutchid.observer.run import usual_nis
from fixtures.observing import assert_same, in_blocks

module = import_module("clutchid.observer.following")
RULE = kernels_in("clutchid.observer.mismatch_rule")


@pytest.fixture(scope="module")
def calibration(plant, recorded_by):
    calibrated = Calibration((), np.zeros((0, 0)))
    return replace(calibrated, nis=usual_nis(plant, calibrated, [recorded_by(plant, seconds=6.0, seed=8)]))


@pytest.fixture(scope="module")
def calibrated(plant, calibration):
    return observer(plant, calibration=calibration)


@pytest.fixture(scope="module")
def sound(calibrated, log):
    return observe_recording(calibrated, log)


@pytest.fixture(scope="module")
def strange_log(worn, recorded_by):
    """Of an actuator that the calibration is not of: its valves and its friction are others."""
    p = worn.parameters
    strange = worn.replace({"C_vs": 0.6 * p.C_vs, "C_ve": 1.5 * p.C_ve, "D_v": 3.0 * p.D_v, "V_0A": 2.0 * p.V_0A})
    return recorded_by(strange, seconds=8.0)


@pytest.fixture(scope="module")
def leaking(calibrated, worn, recorded_by):
    return observe_recording(calibrated, recorded_by(worn.replace({"C_A0": 1.5e-10}), seconds=8.0))


def test_the_usual_innovation_is_the_mean_while_the_piston_moves(plant, calibration, recorded_by):
    log = recorded_by(plant, seconds=6.0, seed=8)
    joint = observer(plant)
    _, samples = observe(joint, start(joint), log)
    e, variance = samples.innovations.T
    moving = np.isfinite(e) & (np.abs(samples.states[:, plant.states.index("v")]) > joint.joint.settings.least_speed)
    assert np.isfinite(normalised(joint, samples.states, samples.innovations)).sum() == moving.sum() > 50
    squared = np.minimum(e[moving] ** 2 / variance[moving], joint.joint.noise.outlier**2)
    assert calibration.nis == pytest.approx(np.mean(squared))
    wild = normalised(joint, samples.states, samples.innovations * [1e3, 1.0])
    assert np.nanmax(wild) == pytest.approx(joint.joint.noise.outlier**2), "an outlier counts as one at the gate"


def test_a_recording_without_position_has_no_usual_innovation(plant, calibration, log):
    assert np.isnan(usual_nis(plant, calibration, [log.with_columns(position=np.full(len(log), np.nan))]))


def test_a_recording_that_cannot_be_observed_is_left_out(plant, calibration, recorded_by):
    log = recorded_by(plant, seconds=6.0, seed=8)
    full = log.with_columns(duty_supply=1.01 * log["duty_supply"] / log["duty_supply"].max())
    assert np.isnan(usual_nis(plant, calibration, [full]))
    assert usual_nis(plant, calibration, [full, log, log.slice(0, 1)]) == calibration.nis


def test_another_load_is_not_unlike_the_calibration_but_another_actuator_is(calibrated, sound, strange_log):
    assert 0.5 < sound.after.mismatch < 1.5
    assert sound.health["unlike_calibration"] == 0.0
    strange = observe_recording(calibrated, strange_log)
    assert strange.after.mismatch > MISMATCHED
    assert strange.health["unlike_calibration"] > 0.0
    at = np.linspace(2e-3, 9e-3, 30)
    plain = strange.after._replace(nis=mismatch_from(1.0))
    by_air = deviation_by_air(AIR_STD, calibrated.actuator, calibrated.load(plain), at)
    both = [calibrated.load_deviation(state, at, as_calibrated=True) for state in (strange.after, plain)]
    wider, usual = (deviation**2 - by_air**2 for deviation in both)
    assert wider == pytest.approx(strange.after.mismatch * usual)


def test_a_leak_is_flagged_with_its_size_and_the_load_stays_right(calibrated, leaking, sound, worn):
    assert sound.health["leak"] == 0.0
    assert not sound.after.leaking
    assert leaking.after.leaking
    assert 0.0 < leaking.health["leak"] < 8.0
    leak = estimates_of(calibrated, leaking.after)["C_A0"]
    assert abs(leak.value - 1.5e-10) < 3.0 * leak.std
    at = np.linspace(2e-3, 9e-3, 30)
    error, without = (
        np.abs(calibrated.load(run.after).force(at) - worn.load.force(at)).max() for run in (leaking, sound)
    )
    assert error < without + 0.02 * worn.load.force(at).max()


def test_a_leak_is_flagged_from_the_end_of_a_stroke_on(leaking):
    whole = leaking.samples.leaking
    first = int(np.argmax(whole))
    assert leaking.log.time[first - 1] in [row.time for row in leaking.strokes]
    assert whole[first:].all()


def test_a_leak_is_not_below_0_and_only_a_model_with_the_energy_balance_has_one(calibrated, sound):
    at = [c.base for c in calibrated.joint.coordinates].index("C_A0")
    assert sound.after.theta[at] >= 0.0
    assert "C_A0" not in [c.base for c in observer(Actuator(model="isothermal")).joint.coordinates]


def test_the_running_mean_forgets_and_moves_at_corrections_in_motion_only(calibrated, sound):
    nis = normalised(calibrated, sound.samples.states, sound.samples.innovations) / calibrated.usual
    assert np.array_equal(np.isfinite(nis), np.isfinite(sound.samples.mismatch))
    values, ratio = nis[np.isfinite(nis)], 1.0
    for square in values:
        ratio += (square - ratio) / MEMORY
    assert sound.after.mismatch == pytest.approx(ratio, rel=1e-12)


def test_without_usual_innovations_nothing_is_compared(joint, log):
    run = observe_recording(joint, log)
    assert run.after.mismatch == 1.0
    assert np.isnan(run.samples.mismatch).all()
    assert run.health["unlike_calibration"] == 0.0


def followed_by(monkeypatch, changed):
    """Let `changed` follow the samples: it gets the plain function, the times of the segment, and its arguments."""
    plain, segment_of = module.follow, module.segment_of

    def follow(joint, state, inputs, span, number):
        times = follow.begin + np.concatenate([[0.0], np.cumsum(inputs.intervals[1])])
        return changed(plain, times, joint, state, inputs, span, number)

    def noted(samples, actuator):
        follow.begin = samples.time[0]
        return segment_of(samples, actuator)

    monkeypatch.setattr(module, "follow", follow)
    monkeypatch.setattr(module, "segment_of", noted)


def diverging(monkeypatch, at):
    """Let the filter diverge at some times, as often as it comes by."""

    def changed(plain, times, joint, state, inputs, span, number):
        for i in range(*span):
            if any(abs(times[i] - t) < 0.4e-3 for t in at):
                return Diverged("it diverged", i)
        return plain(joint, state, inputs, span, number)

    followed_by(monkeypatch, changed)


def test_a_filter_that_diverges_loses_a_sample_and_goes_back_to_the_stroke_before(joint, log, monkeypatch):
    plain, _ = observe(joint, start(joint), log)
    at = 4000
    diverging(monkeypatch, [log.time[at]])
    state, samples = observe(joint, start(joint), log)
    lost = np.flatnonzero(~np.isfinite(samples.states[:, 0]))
    assert lost.tolist() == [at]
    assert health(joint, raised(joint, log, samples), samples)["diverged"] == pytest.approx(1e-3)
    assert np.isfinite(state.T).all()
    assert not np.array_equal(state.theta, plain.theta)
    # the parameters right behind it are those at the end of the last stroke
    before, _ = observe(joint, start(joint), log.slice(0, at))
    behind, _ = observe(joint, before, log.slice(at, at + 1))
    assert np.array_equal(behind.theta, before.sound[0])
    assert np.array_equal(behind.T, before.sound[1])
    assert behind.filter is None


def test_blocks_of_any_length_give_the_same_numbers_also_where_the_filter_diverges(joint, log, monkeypatch):
    diverging(monkeypatch, log.time[[1200, 1201, 3500]])
    state, samples = observe(joint, start(joint), log)
    for lengths in ([20] * 300, [1201, 1, 4798], [3500, 2500]):
        other, blocks = in_blocks(joint, log, lengths)
        np.testing.assert_equal(blocks, samples)
        assert_same(other, state)


@pytest.mark.parametrize(("name", "value"), [("p_A", 1e9), ("p_A", 10.0), ("y", 0.04), ("y", -0.01)])
def test_states_that_no_actuator_has_are_divergence_although_they_are_finite(joint, log, monkeypatch, name, value):
    at, place = 2500, joint.actuator.states.index(name)

    def exploding(plain, times, joint, state, inputs, span, number):
        if span[1] > span[0] and times[span[1] - 1] > log.time[at] + 10e-3:
            return Diverged("it diverged", span[1] - 1)  # it grows before it is not finite
        samples = plain(joint, state, inputs, span, number)
        if not isinstance(samples, Diverged):
            samples.states[np.abs(times[slice(*span)] - log.time[at]) < 0.4e-3, place] = value
        return samples

    followed_by(monkeypatch, exploding)
    _, samples = observe(joint, start(joint), log.slice(0, at + 20))
    lost = np.flatnonzero(~np.isfinite(samples.states[:, 0]))
    assert at in lost
    assert not np.any(samples.states[:, place] == value)


def test_the_mismatch_of_ten_seconds_of_motion_counts_by_63_percent(calibrated):
    """An exponential memory of 1,000 corrections, 10 ms apart: docs/derivations_online.md#mismatch."""
    mismatch, means = mismatch_from(1.0), np.empty(1000)
    RULE.count_innovations(mismatch, np.full(1000, 3.0 * calibrated.usual), calibrated.usual, means)
    assert mismatch.running == means[-1] == pytest.approx(3.0 - 2.0 * np.exp(-1.0), rel=1e-3)


def strokes_of(mismatch, *strokes):
    """Count strokes of 100 corrections with an NIS each, with or without a fault; the means and what is kept."""
    for ratio, flags in strokes:
        RULE.count_innovations(mismatch, np.full(100, ratio), 1.0, np.empty(100))
        RULE.note_faults(mismatch, flags)
        RULE.end_of_stroke(mismatch)
        yield mismatch.running, mismatch.stored


def test_the_mismatch_of_a_fault_is_not_kept_and_heals_with_two_strokes_without_one():
    fault = 1 << [*FLAGS].index("contradiction")
    first, faulty, next_stroke, second = strokes_of(mismatch_from(1.0), (1.0, 0), (9.0, fault), (1.0, 0), (1.0, 0))
    assert first == (1.0, 1.0)
    assert faulty[0] > 1.7
    assert faulty[1] == 1.0
    assert next_stroke[0] > 1.6
    assert second == (1.0, 1.0)
    assert HEALED == 2


def test_a_mismatch_without_a_fault_stays_and_one_beside_faults_in_every_stroke_too():
    fault = 1 << [*FLAGS].index("position_missing")
    *_, (mean, stored) = strokes_of(mismatch_from(1.0), *[(3.0, 0)] * 4)
    assert mean == stored > 1.6
    *_, (mean, stored) = strokes_of(mismatch_from(1.0), *[(3.0, fault)] * 4)
    assert mean > 1.6
    assert stored == 1.0
    outlier = 1 << [*FLAGS].index("outlier")
    *_, (mean, stored) = strokes_of(mismatch_from(1.0), *[(3.0, outlier)] * 4)
    assert mean == stored > 1.6, "an outlier is no fault of a signal"

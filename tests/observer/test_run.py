"""A whole recording: samples and strokes as logs, and the health of its signals."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import Log
from clutchid.observer import curve, estimates_of, observe, observe_recording, observer, start
from clutchid.observer.by_stroke import curve_positions
from clutchid.observer.flags import ZERO_UNKNOWN
from clutchid.observer.health import FLAGS
from clutchid.observer.prior import AIR_STD, ASSUMED
from clutchid.observer.run import spacing
from clutchid.observer.state import FROZEN
from clutchid.strokes.sampled import velocity
from clutchid.strokes.vented_rest import vented_rest
from fixtures.changed_logs import picked, thinned


@pytest.fixture(scope="module")
def run(joint, log):
    return observe_recording(joint, log)


def moving(log):
    return int(np.argmax(np.abs(velocity(log.time, log["position"], 0.01)) > 0.1))


def test_the_samples_are_those_of_the_observer_and_keep_what_was_recorded(run, joint, log):
    _, samples = observe(joint, start(joint), log)
    estimates = run.estimates()
    for name, row in joint.actuator.state_rows.items():
        assert np.array_equal(estimates[row.column], samples.states[:, joint.actuator.states.index(name)])
    for name, unit in (("position", "m"), ("pressure_a", "Pa")):
        assert np.array_equal(estimates[f"{name}_measured [{unit}]"], log[name])
    for name in ("duty_supply", "duty_exhaust"):
        assert np.array_equal(estimates[name], log[name])
    assert np.array_equal(estimates["innovation"], samples.innovations[:, 0], equal_nan=True)
    assert estimates["innovation std"] ** 2 == pytest.approx(samples.innovations[:, 1], rel=1e-12, nan_ok=True)
    assert estimates["used [1]"].all()


def test_the_band_of_the_pressure_is_held_between_corrections(run, joint):
    estimates, every = run.estimates(), joint.joint.settings.every
    half = (estimates["pressure_a high"] - estimates["pressure_a low"]) / 2
    ended = half[every - 1 :: every]  # with the sample in which a correction ends
    assert half[every - 1 : -1] == pytest.approx(np.repeat(ended[:-1], every), abs=1e-6)
    at = joint.actuator.states.index("p_A")
    assert ended == pytest.approx(1.96 * run.samples.deviations[every - 1 :: every, at])


def test_a_row_of_a_stroke_has_the_load_and_parameters_as_they_were_known_then(run, joint, log):
    assert [row.number for row in run.strokes] == list(range(1, len(run.strokes) + 1))
    assert len(run.strokes) >= 2
    end = int(np.flatnonzero(log.time == run.strokes[1].time)[0]) + 1
    state, _ = observe(joint, start(joint), log.slice(0, end))
    table, at = run.load_by_stroke(), curve_positions(joint)
    for name, estimate in estimates_of(joint, state).items():
        unit = joint.actuator.unit(name)
        assert (table[f"{name} [{unit}]"][1], table[f"{name}_std [{unit}]"][1]) == (estimate.value, estimate.std)
    then = curve(joint, state, at)
    assert at[:3].tolist() == [0.0, 0.5e-3, 1e-3]
    assert at[-1] == pytest.approx(joint.actuator.parameters.y_max, abs=0.5e-3)
    for i in (0, 10, at.size - 1):
        name = f"load_{round(at[i] * 1e6):05d}um"
        loads = [table[f"{name}{side} [N]"][1] for side in ("", "_low", "_high")]
        assert loads == [then.force[i], then.low[i], then.high[i]]


def test_the_interval_of_a_weight_is_that_of_the_joint_covariance(run, joint):
    estimates = estimates_of(joint, run.after)
    for c, x, variance in zip(
        joint.joint.coordinates, run.after.theta, np.diag(run.after.T @ run.after.T.T), strict=True
    ):
        assert estimates[c.base].value == c.si(x)
        assert estimates[c.base].std == pytest.approx(np.sqrt(variance) * c.slope(x))
        assert estimates[c.base].low < estimates[c.base].value < estimates[c.base].high


def test_with_the_method_states_of_the_load_of_each_stroke_only_supply_and_air_are_not_known(plant, log):
    run = observe_recording(observer(plant, "states"), log)
    table = run.load_by_stroke()
    assert not table["theta_3_std [N]"].any()
    share = np.hypot(ASSUMED, AIR_STD * 5e-3 / plant.parameters.y_max)
    half = 1.96 * share * (plant.load.force(np.array([5e-3])) + plant.parameters.A_A * plant.parameters.P_0)
    found_half = table["load_05000um_high [N]"] - table["load_05000um [N]"]
    assert found_half == pytest.approx(np.full(len(table), float(half[0])))
    assert set(table["theta_3 [N]"]) == {plant.value("theta_3")}


def test_a_sound_recording_raises_no_flag(run):
    assert set(run.health) == {*FLAGS}
    assert not any(run.health.values())


def test_every_fault_is_flagged_with_its_seconds(joint, log):
    position, duty = log["position"].copy(), log["duty_supply"].copy()
    position[2000:2300] = np.nan
    at = moving(log)
    position[at : at + 500] = position[at]
    position[3500:3600] += np.interp(np.arange(100), [0, 30, 69, 99], [0.0, -1e-3, -1e-3, 0.0])
    position[[3700, 3800, 3801]] = 65.535e-3, 5e-3, 5e-3
    duty[4000:4200] = np.nan
    health = observe_recording(joint, log.with_columns(position=position, duty_supply=duty)).health
    assert health["position_missing"] == pytest.approx(0.3 + health["position_none"] + health["position_jumps"])
    assert health["position_none"] == pytest.approx(0.001)
    assert health["position_jumps"] == pytest.approx(0.002)
    assert health["position_frozen"] == pytest.approx(0.5 - FROZEN * 1e-3)
    assert health["position_beyond_stops"] == pytest.approx(1e-3 * np.sum(position < -5e-4))
    assert health["duty_missing"] == pytest.approx(0.2)
    assert health["time_missing"] == 0.0
    assert health["outlier"] > 0.0
    assert health["diverged"] == 0.0


def test_a_hole_in_time_is_flagged_also_between_two_parts(joint, log):
    first = observe_recording(joint, log.slice(0, 2000))
    rest = observe_recording(joint, log.slice(2500, len(log)), first.after)
    assert rest.health["time_missing"] == pytest.approx(0.5)
    whole = picked(log, np.r_[0:2000, 2500 : len(log)])
    assert observe_recording(joint, whole).health["time_missing"] == pytest.approx(0.5)


@pytest.mark.parametrize(("name", "value"), [("position", np.nan), ("duty_supply", np.nan), ("position", np.inf)])
def test_a_recording_without_one_usable_sample_is_refused(joint, log, name, value):
    with pytest.raises(DataError, match="no sample has a position and both duty cycles, all finite"):
        observe_recording(joint, log.slice(0, 500).with_columns(**{name: np.full(500, value)}))


def test_a_part_at_another_rate_is_refused(joint, log):
    slow = replace(thinned(log, 10), name="slow")
    with pytest.raises(
        DataError, match=r"slow: a sample every 10 ms, but the observer was started with one every 1 ms"
    ):
        observe_recording(joint, slow)


def test_the_spacing_is_that_of_the_first_samples_and_needs_two(log):
    jitter = log.time + 1e-6 * np.sin(np.arange(len(log)))
    assert spacing(Log(jitter, {})) == 1e-3
    with pytest.raises(DataError, match="1 samples; an observer needs at least two"):
        spacing(log.slice(0, 1))


def test_a_position_that_is_no_value_counts_as_missing(joint, log):
    spikes = np.random.default_rng(3).integers(100, len(log), 30)
    bad = np.isin(np.arange(len(log)), spikes)
    spiked = log.with_columns(position=np.where(bad, np.where(spikes[0] % 2, 65.535e-3, 0.0), log["position"]))
    present = np.abs(spiked["position"] - log["position"]) < 1e-3
    run = observe_recording(joint, spiked)
    missing = observe_recording(joint, log.with_columns(position=np.where(present, spiked["position"], np.nan)))
    assert np.array_equal(run.samples.states, missing.samples.states, equal_nan=True)
    assert run.health["position_none"] + run.health["position_jumps"] == pytest.approx(1e-3 * np.sum(~present))


def test_a_code_for_none_in_a_duty_cycle_is_a_missing_input(joint, log):
    duty = np.where(np.arange(len(log)) == 700, 655.35, log["duty_supply"])
    run = observe_recording(joint, log.with_columns(duty_supply=duty))
    assert run.health["duty_missing"] == pytest.approx(0.001)
    with pytest.raises(DataError, match="is not a duty cycle"):
        observe_recording(joint, log.with_columns(duty_supply=100.0 + log["duty_supply"]))


@pytest.fixture(scope="module")
def rested(plant, log):
    """An observer whose calibration has a vented rest."""
    return observer(plant, calibration=Calibration((), np.zeros((0, 0)), rest=vented_rest(log.slice(0, 4000))))


@pytest.fixture(scope="module")
def moved(log):
    return log.with_columns(position=log["position"] + 1e-3 * (np.arange(len(log)) >= 1300))


def test_a_position_that_jumps_and_stays_is_not_used_until_a_rest_has_shown_its_zero(rested, log, moved):
    run, sound = observe_recording(rested, moved), observe_recording(rested, log)
    assert run.health["position_jumps"] == pytest.approx(1.0, abs=0.01)
    assert run.health["zero_unknown"] > 0.0
    verdict = observed_verdict(indicators(run))
    assert any("jumped faster than a piston can move" in reason for reason in verdict.reasons)
    at = curve_positions(rested)
    load, truth = curve(rested, run.after, at), curve(rested, sound.after, at)
    inside = (truth.force > load.low) & (truth.force < load.high)
    assert verdict.trust == "none" or inside.all()
    first = observe_recording(rested, moved.slice(0, 1700))
    assert np.array_equal(
        observe_recording(rested, moved.slice(1700, len(log)), first.after).after.theta, run.after.theta
    )


def zero_shown(samples):
    """The sample from which the zero of a position that jumped is known."""
    return int(np.flatnonzero(samples.flagged(ZERO_UNKNOWN))[-1]) + 1


@pytest.mark.parametrize("hole", ["time", "duty", "another jump"])
def test_a_hole_after_a_jump_whose_zero_a_rest_has_shown_leaves_no_position_out(rested, log, moved, hole):
    shown = zero_shown(observe_recording(rested, moved).samples)
    begin = shown + 100
    later = {
        "time": picked(moved, np.r_[0:begin, begin + 100 : len(log)]),
        "duty": moved.with_columns(duty_supply=np.where(np.arange(len(log)) == begin, np.nan, moved["duty_supply"])),
        "another jump": moved.with_columns(
            position=moved["position"] + 1e-3 * (np.arange(len(log)) >= len(log) - 1500)
        ),
    }[hole]
    whole = observe_recording(rested, later)
    no_zero = whole.samples.flagged(ZERO_UNKNOWN)[shown : begin + 300]
    assert not no_zero.any()
    assert whole.after.jumped
    assert whole.after.unzeroed == (hole == "another jump")
    parts = observe_recording(rested, later.slice(0, begin + 50))
    second = observe_recording(rested, later.slice(begin + 50, len(later)), parts.after)
    assert second.after.unzeroed == whole.after.unzeroed
    assert np.array_equal(second.after.theta, whole.after.theta)


def test_a_jump_counts_until_two_strokes_have_ended_since_a_rest_has_shown_its_zero(rested, log, moved):
    run = observe_recording(rested, moved)
    assert run.after.jumped
    assert any(
        ("measured from the vented rest after the jump") in text for text in observed_verdict(indicators(run)).reasons
    )
    offset = moved["position"][-1] - log["position"][-1]
    again = Log(log.time + log.time[-1] + 1e-3, {**log.columns, "position": log["position"] + offset}, log.name)
    _, second, *_ = (row.time for row in observe_recording(rested, again, run.after).strokes)
    later = observe_recording(rested, again.slice(0, int(np.searchsorted(again.time, second)) + 1), run.after)
    assert not later.after.jumped
    assert not any("jumped" in text for text in observed_verdict(indicators(later)).reasons)


def test_without_a_rest_in_the_calibration_a_jump_leaves_the_load_as_it_was_and_says_why(joint, log, moved):
    run = observe_recording(joint, moved)
    begin = int(np.argmax(run.samples.flagged(ZERO_UNKNOWN)))
    assert run.samples.flagged(ZERO_UNKNOWN)[begin:].all()
    assert not np.isfinite(run.samples.states[begin:]).any()
    verdict = observed_verdict(indicators(run))
    assert verdict.trust == "none"
    assert any(
        ("the calibration has no vented rest to compare the new zero with") in reason for reason in verdict.reasons
    )
    assert np.array_equal(run.after.theta, observe_recording(joint, moved.slice(0, begin)).after.theta)


def test_a_zero_that_is_kept_is_not_said_to_be_unknown(plant, rested, moved):
    fixed_zero = observer(plant, calibration=rested.calibration, zero="keep")
    verdict = observed_verdict(indicators(observe_recording(fixed_zero, moved)))
    assert verdict.trust == "none"
    assert any("the vented rest after the jump is not subtracted" in reason for reason in verdict.reasons)


def test_positions_of_a_curve_are_real_numbers(joint):
    state = start(joint)
    assert curve(joint, state, 6e-3).force == curve(joint, state, [6e-3]).force
    assert np.isnan(curve(joint, state, np.ma.masked_array([1e-3, 6e-3], mask=[1, 0])).force).tolist() == [True, False]
    for position in ([6e-3 + 0j], ["6 mm"]):
        with pytest.raises(ParameterError, match=r"position holds .*: real numbers in m are needed"):
            curve(joint, state, position)


def test_a_block_is_a_log(joint, log):
    with pytest.raises(ParameterError, match=r"observe: block = .*: a Log is needed, not a tuple"):
        observe(joint, start(joint), (0.0, 1e-3, 0.0, 0.0))
    masked = np.ma.masked_array(log["position"][:10], mask=np.arange(10) > 4)
    _, samples = observe(joint, start(joint), log.slice(0, 10).with_columns(position=masked))
    assert samples.used.tolist() == [True] * 5 + [False] * 5

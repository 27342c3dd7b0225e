"""A recorded supply pressure: the observer follows it, however the sensor is scaled, and counts its accuracy."""

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import ACCURACY, RecordedConditions
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.observer import observe, observer, start
from clutchid.observer.flags import LIVE_FLAGS, SUPPLY_LOST, SUPPLY_UNLIKE
from clutchid.observer.inputs import taken_in
from clutchid.observer.live import after_block, live_run, with_check_sentences
from clutchid.observer.prior import load_deviation, supply_of
from clutchid.observer.run import observe_recording, unused_conditions
from clutchid.simulation import simulate

STROKE = np.linspace(2e-3, 9e-3, 30)

#: What the sensor shows of the pressure in the model.
SHOWN = 1.08


def calibration(supply, estimated):
    return Calibration((), np.zeros((0, 0)), conditions=RecordedConditions(supply=supply, supply_estimated=estimated))


@pytest.fixture(scope="module")
def usual_supply(plant):
    return calibration(SHOWN * plant.value("P_S"), plant.value("P_S"))


@pytest.fixture(scope="module")
def lower(plant, recorded_by):
    """A recording with 5 % less supply, by a vehicle that records it."""
    actuator = plant.replace({"P_S": 0.95 * plant.value("P_S")})
    log = recorded_by(actuator, seconds=6.0)
    supply = simulate(actuator, log).log["pressure_supply"]
    noisy = SHOWN * supply + 1e3 * np.random.default_rng(1).standard_normal(len(log))
    return log.with_columns(pressure_supply=noisy)


def off(joint, plant, log):
    """Error of the load over its largest value, the pressure's rms error, and the last state."""
    state, samples = observe(joint, start(joint), log)
    error = joint.load(state).force(STROKE) - plant.load.force(STROKE)
    late = slice(len(log) // 2, None)
    pressure = samples.states[late, plant.states.index("p_A")] - log["pressure_a"][late]
    return np.abs(error).max() / plant.load.force(STROKE).max(), float(np.sqrt(np.mean(pressure**2))), state


def test_less_supply_is_no_smaller_load_where_the_vehicle_records_it(plant, usual_supply, lower):
    load, pressure, _ = off(observer(plant, calibration=usual_supply), plant, lower)
    blind, blind_pressure, _ = off(observer(plant), plant, lower)
    assert blind > 0.02, "from the position alone it is taken for the load"
    assert load < 0.5 * blind
    assert pressure < 0.5 * blind_pressure


def test_a_supply_that_is_not_recorded_changes_nothing_but_the_band(plant, usual_supply, lower):
    without = lower.without("pressure_supply")
    joint, plain = observer(plant, calibration=usual_supply), observer(plant)
    (state, samples), (plain_state, plain_samples) = (observe(of, start(of), without) for of in (joint, plain))
    assert samples.states == pytest.approx(plain_samples.states, rel=1e-9, abs=1e-9)
    assert np.all(joint.load_deviation(state, STROKE) > plain.load_deviation(plain_state, STROKE))


def test_the_accuracy_of_the_sensor_is_a_part_of_the_band(plant, usual_supply):
    p, supply = plant.parameters, supply_of(plant, usual_supply)
    share = np.sqrt(2.0) * ACCURACY["P_S"] / (SHOWN * p.P_S)
    assert supply.ratio == pytest.approx(1.0 / SHOWN)
    assert supply.share == pytest.approx(share)
    expected = share * (plant.load.force(STROKE) + p.A_A * p.P_0)
    np.testing.assert_allclose(load_deviation(supply.share, plant, plant.load, STROKE), expected)


def test_all_pressures_scale_with_the_supply(plant, recorded_by):
    """What the band rests on: the motion is nearly the same with all absolute pressures, and so the forces, scaled."""
    more, p = 1.01, plant.parameters
    # the load that balances the scaled pressure where friction does not count: f + A_A P_0 scales
    higher = plant.load.force(STROKE) * more + (more - 1.0) * p.A_A * p.P_0
    joint = observer(plant, calibration=calibration(p.P_S, more * p.P_S))
    log = recorded_by(plant, seconds=6.0).with_columns(pressure_supply=np.full(6000, p.P_S))
    state, _ = observe(joint, start(joint), log)
    force = joint.load(state).force(STROKE)
    assert np.mean(force - plant.load.force(STROKE)) == pytest.approx(
        np.mean(higher - plant.load.force(STROKE)), rel=0.4
    )


def test_only_calibrations_that_estimate_what_was_recorded_are_used(plant):
    assert supply_of(plant, None) is None
    assert supply_of(plant, calibration(9e5, None)) is None
    assert observer(plant, "states", calibration=calibration(9e5, 9e5)).supply is not None


def test_samples_with_an_open_valve_or_without_a_value_do_not_count(plant, usual_supply, lower):
    joint = observer(plant, calibration=usual_supply)
    open_valve = (lower["duty_supply"] > 0.0) | (lower["duty_exhaust"] > 0.0)
    assert 0.1 < open_valve.mean() < 0.9
    wild = lower.with_columns(pressure_supply=np.where(open_valve, 1e4, lower["pressure_supply"]))
    gone = lower.with_columns(pressure_supply=np.where(open_valve, np.nan, lower["pressure_supply"]))
    (_, first), (_, second) = (observe(joint, start(joint), log) for log in (wild, gone))
    assert np.array_equal(first.states, second.states)


def test_a_column_that_cannot_be_used_is_one_sentence(plant, usual_supply, lower):
    assert unused_conditions(observer(plant, calibration=usual_supply), lower) == ()
    assert unused_conditions(observer(plant), lower.without("pressure_supply")) == ()
    for made, reason in (
        (observer(plant), "does not have it; record it there too"),
        (observer(plant, calibration=calibration(9e5, None)), "was saved before observers used it"),
        (
            observer(Actuator(model="isothermal"), calibration=usual_supply),
            ("the supply pressure of the model is constant"),
        ),
    ):
        (sentence,) = unused_conditions(made, lower)
        assert reason in sentence
        assert "A lower supply pressure then looks like a larger load." in sentence


def test_a_recorded_supply_that_the_calibration_lacks_is_not_called_missing(plant, usual_supply, lower):
    """In the reasons of the verdict, of a recording and of a live one."""
    for stored, use in ((None, "not used"), (usual_supply, "measured")):
        made = observer(plant, calibration=stored)
        live, _ = after_block(live_run(made, start(made)), lower, dict.fromkeys(LIVE_FLAGS, 0))
        assert {indicators(run).supply for run in (live, observe_recording(made, lower))} == {use}
    without = observe_recording(made, lower.without("pressure_supply"))
    assert indicators(without).supply == "not recorded"


@pytest.mark.parametrize("pressure", [20e5, 1e5, 0.0])
def test_a_recorded_supply_that_cannot_be_right_is_not_called_missing(plant, usual_supply, lower, pressure):
    """In the reasons of the verdict, of a recording and of a live one, which record it only at their beginning."""
    made = observer(plant, calibration=usual_supply)
    wrong = lower.with_columns(pressure_supply=np.where(lower.time < 4.0, pressure, np.nan))
    live = live_run(made, start(made))
    for part in (wrong.slice(0, 3000), wrong.slice(3000, len(wrong))):
        live, _ = after_block(live, part, dict.fromkeys(LIVE_FLAGS, 0))
    for run in (live, live.recent(), observe_recording(made, wrong)):
        indicated = indicators(run)
        assert (indicated.supply, run.assumes_supply) == ("not used", True)
        assert not any("record it" in reason for reason in observed_verdict(indicated).reasons)


def taken(joint, deviations):
    """Samples at rest with closed valves, whose supply pressure deviates by a share, and the intake after them."""
    time = 1e-3 * np.arange(len(deviations))
    still = dict.fromkeys(("position", "duty_supply", "duty_exhaust"), np.zeros(time.size))
    log = Log(time, {**still, "pressure_supply": joint.supply.recorded * (1.0 + np.asarray(deviations))})
    samples, after = taken_in(joint, start(joint).inputs, np.nan, log)
    return samples, after.intake


def flagged(samples, flag):
    return np.flatnonzero(samples["flags"] & flag)


def test_a_supply_that_is_lower_and_sags_in_strokes_is_used_and_gauge_for_absolute_is_not(plant, usual_supply):
    joint, t = observer(plant, calibration=usual_supply), 1e-3 * np.arange(20_000)
    sags = -0.05 - 0.08 * (t % 2.0 > 1.7)
    assert flagged(taken(joint, sags)[0], SUPPLY_UNLIKE).size == 0
    assert flagged(taken(joint, -0.11 + 0.02 * np.sin(t))[0], SUPPLY_UNLIKE).size == t.size


def test_a_supply_sensor_that_breaks_is_flagged_at_once_what_it_taught_is_forgotten_and_it_heals(plant, usual_supply):
    joint, at = observer(plant, calibration=usual_supply), np.arange(12_000)
    samples, after = taken(joint, np.where((at >= 2000) & (at < 5000), -0.55, 0.01))
    unlike = flagged(samples, SUPPLY_UNLIKE)
    assert 2000 <= unlike[0] <= 2010
    assert 5000 < unlike[-1] < 8000
    assert np.flatnonzero(samples["forgets"]).tolist() == [unlike[0]]
    assert after.supply_recorded == 1


def test_a_supply_that_is_gone_for_ten_seconds_is_lost_until_it_is_back(plant, usual_supply):
    joint, at = observer(plant, calibration=usual_supply), np.arange(20_000)
    samples, after = taken(joint, np.where((at >= 2000) & (at < 15_000), np.nan, 0.0))
    assert flagged(samples, SUPPLY_LOST).tolist() == list(range(12_000, 15_000))
    assert after.supply_recorded == 1
    assert flagged(taken(joint, np.full(20_000, np.nan))[0], SUPPLY_LOST).size == 0, "it was never there"


def test_a_load_from_a_supply_that_is_lost_or_wrong_is_not_good(plant, usual_supply, lower):
    joint = observer(plant, calibration=usual_supply)
    late = np.arange(len(lower)) >= 3000
    far = lower.with_columns(pressure_supply=lower["pressure_supply"] * np.where(late, 1.4, 1.0))
    wrong = observe_recording(joint, far)
    at = int(np.argmax(wrong.samples.flagged(SUPPLY_UNLIKE)))
    assert 3000 <= at < 4000
    before, after = (observe(joint, start(joint), far.slice(0, n))[0] for n in (at, at + 1))
    assert np.any(before.theta != start(joint).theta)
    np.testing.assert_array_equal(after.theta, start(joint).theta)
    assert (wrong.supply, wrong.assumes_supply) == ("not used", True)
    hole = np.where(late, lower.time + 20.0, lower.time)
    torn = Log(hole, {**lower.columns, "pressure_supply": np.where(late, np.nan, lower["pressure_supply"])}, "torn")
    lost = observe_recording(joint, torn)
    assert lost.supply == "lost"
    assert lost.health["supply_lost"] > 2.0
    assert any("the supply pressure was lost" in reason for reason in observed_verdict(indicators(lost)).reasons)


def test_a_supply_sensor_may_be_less_exact(plant, usual_supply, lower):
    narrow, wide = (observer(plant, calibration=usual_supply, supply_sensor_std=std) for std in (None, 0.03))
    (_, samples), (after, others) = (observe(of, start(of), lower) for of in (narrow, wide))
    np.testing.assert_array_equal(samples.states, others.states)
    for as_calibrated in (False, True):
        bands = [of.load_deviation(after, STROKE, as_calibrated=as_calibrated) for of in (narrow, wide)]
        assert np.all(bands[1] > 1.2 * bands[0])
    with pytest.raises(ParameterError, match=r"supply_sensor_std = 2: .* from 0 to 0\.5; some 0\.007 is the default"):
        observer(plant, supply_sensor_std=2.0)


def test_a_live_recording_says_it_too(plant, usual_supply, lower):
    for stored, said in ((usual_supply, False), (None, True)):
        joint = observer(plant, calibration=stored)
        run, _ = after_block(live_run(joint, start(joint)), lower.slice(0, 2000), dict.fromkeys(LIVE_FLAGS, 0))
        assert any("pressure_supply is not used" in sentence for sentence in with_check_sentences(run).checked) == said

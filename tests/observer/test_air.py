"""The temperature of the air on line: which one is in use, what follows from it, and that it is used."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from sympy import Symbol

from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.log import Log
from clutchid.model import Actuator, GroupChange, OwnModel, OwnParameter
from clutchid.observer import observe, observer, start
from clutchid.observer.air import at_air
from clutchid.observer.by_stroke import estimates_of, follow_strokes
from clutchid.observer.flags import AIR_LOST, AIR_REFUSED
from clutchid.observer.inputs import taken_in
from clutchid.observer.run import unused_conditions
from fixtures.cases import case_tables
from fixtures.observing import with_inputs

CASES = case_tables(__file__, "test_air")

CALIBRATED = 290.0


def calibration(temperature=CALIBRATED):
    return Calibration((), np.zeros((0, 0)), conditions=RecordedConditions(temperature=temperature))


@pytest.fixture(scope="module")
def joint(plant):
    return observer(plant, calibration=calibration())


@pytest.fixture(scope="module")
def cold(worn):
    """The worn actuator at 260 K: gas and walls, choked flow through the valves, and grease."""
    r = 260.0 / CALIBRATED
    powers = {"T_0": 1.0, "T_w": 1.0, "C_vs": -0.5, "C_ve": -0.5, "C_r": -0.5, "D_v": -0.5 / 0.085}
    return worn.replace({name: r**power * worn.value(name) for name, power in powers.items() if name in worn.acting})


@pytest.mark.parametrize(("used", "recorded", "changes", "refused"), CASES["temperatures"])
def test_a_temperature_is_in_use_until_one_counts_that_differs_by_more_than_the_error_of_a_sensor(
    joint, used, recorded, changes, refused
):
    samples = taken(joint, recorded, air=used, aired=6_000_000, air_count=1)
    in_use = [used, *samples["air"].tolist()]
    assert [[at, new] for at, (old, new) in enumerate(pairwise(in_use)) if new != old] == changes
    assert "".join(".x"[int(is_refused)] for is_refused in samples["flags"] & AIR_REFUSED != 0) == refused
    assert (taken(joint, [np.nan] * 2, air_refused=1)["flags"] & AIR_REFUSED != 0).all(), "until one counts"


def taken(joint, temperatures, **intake):
    """Samples a second apart with these temperatures of the air, which begin with some values of the intake."""
    time = np.arange(float(len(temperatures)))
    still = dict.fromkeys(("position", "duty_supply", "duty_exhaust"), np.zeros(time.size))
    log = Log(time, {**still, "temperature_ambient": np.array(temperatures)})
    before = with_inputs(start(joint), intake={"sampled": 1, **intake})
    return taken_in(joint, before.inputs, -1.0, log)[0]


def test_air_that_is_another_for_minutes_counts_and_that_of_a_minute_ago_is_not_known(joint):
    samples = taken(joint, np.full(400, 240.1), air=290.0, air_count=1000)
    assert np.argmax(samples["air"] == 240.1) == 224
    assert np.flatnonzero(samples["air_known"] == 0).tolist() == list(range(60, 224))


@pytest.mark.parametrize("wrong", [1, 20])
def test_a_first_temperature_that_is_wrong_is_outnumbered_by_the_next_ones(joint, wrong):
    samples = taken(joint, [*[233.0] * wrong, *[291.0] * 50])
    assert np.argmax(samples["air"] == CALIBRATED) == 2 * wrong
    assert np.flatnonzero(samples["flags"] & AIR_REFUSED).tolist() == list(range(wrong, 2 * wrong))


def test_infinity_is_no_temperature(joint):
    samples = taken(joint, [291.0, np.inf, np.nan, 291.0])
    assert (samples["flags"] & AIR_REFUSED != 0).tolist() == [False, True, True, False]


def test_a_minute_after_the_last_temperature_the_band_is_that_of_an_unknown_one_however_the_recording_is_cut(
    joint, worn, recorded_by
):
    """At the ends of strokes too; and the model stays at the last one."""
    log, y = recorded_by(worn, seconds=6.0).without("pressure_a"), np.linspace(2e-3, 9e-3, 30)
    log = replace(log, time=log.time + 59.0 * (log.time > 3.0))
    air = np.where(log.time < 1.5, 260.0, np.nan)
    recorded = log.with_columns(temperature_ambient=air)
    after, samples, rows = follow_strokes(joint, start(joint), recorded)
    never, _, _ = follow_strokes(joint, start(joint), log)
    before, _ = observe(joint, start(joint), recorded.slice(0, 2000))
    assert after.temperature == 260.0
    assert np.flatnonzero(samples.flagged(AIR_LOST)).tolist() == list(range(int(np.argmax(log.time > 61.5)), len(log)))
    share = [joint.load_deviation(s._replace(T=0.0 * s.T), y) / joint.load(s).force(y) for s in (before, after, never)]
    assert np.all(share[0] < share[1])
    np.testing.assert_allclose(share[1], share[2], rtol=0.1)
    state, pieces = start(joint), []
    for first in range(0, len(log), 700):
        state, _, ended = follow_strokes(joint, state, recorded.slice(first, min(first + 700, len(log))))
        pieces += ended
    assert len(rows) > 1
    for row, piece in zip(rows, pieces, strict=True):
        np.testing.assert_array_equal(row.curve.high, piece.curve.high)
    assert state.inputs.intake.aired == after.inputs.intake.aired


def test_a_sensor_that_fails_for_a_second_changes_nothing(joint, worn, recorded_by):
    log = recorded_by(worn, seconds=3.0).without("pressure_a")
    failing = np.where((log.time > 1.0) & (log.time < 2.0), 233.15, 291.0)
    usual, other = (
        observe(joint, start(joint), log.with_columns(temperature_ambient=recorded))
        for recorded in (np.full(len(log), 291.0), failing)
    )
    np.testing.assert_array_equal(other[1].states, usual[1].states)
    np.testing.assert_array_equal(other[0].theta, usual[0].theta)


def test_gas_walls_valves_and_grease_of_the_model_are_those_at_the_temperature(joint, cold, worn):
    colder = at_air(joint, 260.0).joint
    usual = joint.joint.mapped.actuator
    for name in ("T_0", "T_w", "C_vs", "C_ve", "D_v"):
        expected = cold.value(name) / worn.value(name) * usual.value(name)
        assert colder.mapped.actuator.value(name) == pytest.approx(expected, rel=1e-12)
    at = [c.base for c in colder.coordinates].index("D_v")
    assert colder.free.numbers[at, 0] == colder.coordinates[at].mean == colder.mapped.actuator.value("D_v")
    assert at_air(joint, CALIBRATED) is at_air(joint, 0.0) is joint


def test_an_own_parameter_changes_by_what_its_row_has_in_its_unit(plant):
    sealed = OwnModel(
        base="isothermal",
        parameters={
            "F_1": OwnParameter(
                120.0, "N", "force of a second seal", range=(110.0, 1e4), std=40.0,
                changes=(GroupChange("temperature and grease", -30.0, "warmer"),),
            )
        },
        terms={"f_f": Symbol("f_f") + Symbol("F_1") * Symbol("y") / Symbol("y_max")},
    )  # fmt: skip
    observed = observer(Actuator(model=sealed), calibration=calibration())
    colder, warmest = (at_air(observed, kelvin).joint.mapped.actuator.value("F_1") for kelvin in (289.0, 363.0))
    assert colder == pytest.approx(120.0 + 30.0 / 0.085 / CALIBRATED, abs=0.02)
    assert warmest == 110.0


@pytest.fixture(scope="module")
def followed(joint, cold, recorded_by):
    """A recording of the cold actuator, followed with and without its temperature."""
    log = recorded_by(cold, seconds=6.0).without("pressure_a")
    recorded = log.with_columns(temperature_ambient=260.0 + 1.5 * np.sin(log.time))
    return recorded, [observe(joint, start(joint), made)[0] for made in (recorded, log)]


def test_a_cold_actuator_has_the_right_load_where_its_temperature_is_recorded(joint, cold, followed):
    _, states = followed
    y = np.linspace(2e-3, 9e-3, 30)
    right, wrong = (np.sqrt(np.mean((joint.load(s).force(y) - cold.load.force(y)) ** 2)) for s in states)
    assert right < 0.5 * wrong
    measured, unmeasured = (joint.load_deviation(state, y) for state in states)
    assert np.all(measured < unmeasured)
    friction = estimates_of(joint, states[0])["D_v"]
    assert friction.low < cold.value("D_v") < friction.high


def test_a_temperature_like_that_of_the_calibration_changes_the_band_only(joint, worn, recorded_by):
    log = recorded_by(worn, seconds=3.0).without("pressure_a")
    plain, (measured, samples) = (
        observe(joint, start(joint), log),
        observe(joint, start(joint), log.with_columns(temperature_ambient=np.full(3000, 291.5))),
    )
    np.testing.assert_array_equal(samples.states, plain[1].states)
    assert measured.temperature == CALIBRATED


def test_a_temperature_that_the_calibration_lacks_is_not_used_and_that_is_said(plant, worn, recorded_by):
    log = recorded_by(worn, seconds=3.0).with_columns(temperature_ambient=np.full(3000, 260.0))
    without = observer(plant, calibration=calibration(None))
    assert without.air is None
    assert observe(without, start(without), log)[0].temperature == 0.0
    (sentence,) = unused_conditions(without, log)
    assert "temperature_ambient is not used, because the calibration does not have it" in sentence
    assert unused_conditions(observer(plant, calibration=calibration()), log) == ()

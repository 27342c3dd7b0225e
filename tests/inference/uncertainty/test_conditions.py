"""Ambient temperature and supply pressure of recordings: means, differences to a calibration, and bad columns."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.inference.uncertainty.change_prior import HYPOTHESES, assumed_change, change_covariance, log_odds
from clutchid.inference.uncertainty.conditions import (
    ACCURACY,
    NOT_RECORDED,
    Assumption,
    RecordedConditions,
    assumed_conditions,
    by_supply,
    condition_problems,
    condition_warnings,
    conditions_of,
    known_conditions,
    unlike_conditions,
    with_estimated_supply,
)
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.preparation.inspection import inspect

ACTUATOR = Actuator(model="energy-balance")
CALIBRATED = RecordedConditions(293.0, 9.5e5)
ROOT_2 = np.sqrt(2.0)


def recorded(temperature=None, supply=None, duty=0.0, name="run"):
    """1 s with these columns."""
    columns = {"duty_supply": duty, "duty_exhaust": 0.0, "temperature_ambient": temperature, "pressure_supply": supply}
    ones = np.ones(100)
    return Log(np.arange(100) / 100, {n: v * ones for n, v in columns.items() if v is not None}, name)


def test_conditions_are_means_over_the_recordings_that_have_them():
    logs = [recorded(290.0, 9e5), recorded(294.0), recorded()]
    assert conditions_of(logs, ACTUATOR) == RecordedConditions(292.0, 9e5)
    assert conditions_of([recorded()], ACTUATOR) == NOT_RECORDED


def test_a_supply_pressure_counts_while_no_valve_is_open_and_always_where_one_is_always_open():
    duty = np.repeat([0.0, 1.0], 50)
    supply = np.where(duty > 0.0, 7e5, 9e5)
    assert conditions_of([recorded(supply=supply, duty=duty)], ACTUATOR).supply == 9e5
    assert conditions_of([recorded(supply=supply, duty=0.5)], ACTUATOR).supply == 8e5


def test_missing_samples_do_not_count_and_an_empty_column_is_none():
    holes = np.where(np.arange(100) % 2 == 0, 280.0, np.nan)
    assert conditions_of([recorded(holes, np.nan)], ACTUATOR) == RecordedConditions(280.0, None)
    assert condition_warnings([recorded(np.nan, np.nan)], NOT_RECORDED, {}) == []


def test_the_temperature_counts_by_its_difference_and_the_supply_by_its_ratio():
    conditions = known_conditions(recorded(263.0, 0.95 * 9.5e5), ACTUATOR, CALIBRATED, {})
    assert conditions["T_0"].mean == pytest.approx(ACTUATOR.value("T_0") - 30.0, abs=1e-9)
    assert conditions["T_0"].std == pytest.approx(ROOT_2 * ACCURACY["T_0"])
    assert conditions["P_S"].mean == pytest.approx(0.95 * ACTUATOR.value("P_S"))
    assert conditions["P_S"].std == pytest.approx(ROOT_2 * ACCURACY["P_S"] * ACTUATOR.value("P_S") / 9.5e5)


def test_what_either_recording_lacks_is_not_known():
    assert known_conditions(recorded(), ACTUATOR, CALIBRATED, {}) == {}
    assert known_conditions(recorded(263.0, 9e5), ACTUATOR, NOT_RECORDED, {}) == {}
    assert [*known_conditions(recorded(263.0, 9e5), ACTUATOR, RecordedConditions(supply=9.5e5), {})] == ["P_S"]


def test_a_value_of_the_user_replaces_the_column_and_without_a_calibrated_one_it_is_the_parameter_itself():
    priors = {"T_0": Prior(278.0, 1.5)}
    conditions = known_conditions(recorded(263.0), ACTUATOR, CALIBRATED, priors)
    assert conditions["T_0"].mean == pytest.approx(ACTUATOR.value("T_0") - 15.0, abs=1e-9)
    assert conditions["T_0"].std == pytest.approx(2.5)
    assert known_conditions(recorded(), ACTUATOR, NOT_RECORDED, priors) == priors


def test_a_condition_that_the_calibration_lacks_is_one_sentence():
    (sentence,) = condition_warnings([recorded(263.0, 9e5)], RecordedConditions(supply=9e5), {})
    assert sentence == (
        "run: temperature_ambient is not used, because the calibration does not have it; record it in the calibration "
        "recording too, and save the calibration again."
    )
    assert condition_warnings([recorded(263.0)], NOT_RECORDED, {"T_0": Prior(263.0, 1.0)}) == []


@pytest.mark.parametrize(
    ("columns", "check", "grade", "part"),
    [
        (
            {"temperature": 20.0},
            "ambient temperature",
            "bad",
            "outside -60 to 90 °C; correct the unit in the heading",
        ),
        ({"temperature": np.linspace(280.0, 300.0, 100)}, "ambient temperature", "bad", "changes by 20 K in 0.99 s"),
        # what no air supply has is no value, and a fit does without; taken as values they would be refused
        ({"supply": 8.5e5 - 8e5}, "values of pressure_supply", "suspect", "0.5 bar"),
    ],
)
def test_a_column_that_contradicts_itself_is_one_sentence(columns, check, grade, part):
    log = recorded(**columns)
    with pytest.raises(DataError, match="run: ") as error:
        conditions_of([log], ACTUATOR)
    assert part in str(error.value)
    assert "\n" not in str(error.value)
    checks = {row.name: row for row in inspect(log, ACTUATOR).checks}[check]
    assert (checks.grade, part in checks.sentence) == (grade, True)


def test_an_inspection_shows_what_is_recorded():
    checks = {row.name: row for row in inspect(recorded(263.15, 9e5), ACTUATOR).checks}
    assert (checks["ambient temperature"].value, checks["recorded supply pressure"].value) == ("-10 degC", "9 bar")
    assert checks["ambient temperature"].grade == "good"


def test_the_estimated_supply_is_the_mean_of_the_samples_that_the_recorded_one_is_the_mean_of():
    duty = np.repeat([0.0, 1.0], 50)
    log = recorded(supply=np.where(np.arange(100) < 10, np.nan, 9e5), duty=duty)
    estimated = Log(log.time, {"pressure_supply": np.arange(100) * 1e3}, log.name)
    estimated_conditions = with_estimated_supply(RecordedConditions(supply=9e5), [log], [estimated])
    assert estimated_conditions == RecordedConditions(None, 9e5, np.mean(np.arange(10, 50)) * 1e3)
    for conditions, states in (
        (NOT_RECORDED, estimated),
        (RecordedConditions(supply=9e5), estimated.without("pressure_supply")),
    ):
        assert with_estimated_supply(conditions, [log], [states]) == conditions


def test_what_is_not_known_is_assumed_as_calibrated_within_the_prior_of_its_change():
    logs = [recorded(name="a"), recorded(280.0, 9e5, name="b")]
    supply, air = assumed_conditions(logs, ["T_0@b", "P_S@b"], ACTUATOR)
    assert (supply.name, supply.recordings, supply.recorded) == ("P_S", ("a",), False)
    assert (supply.value, air.value) == (ACTUATOR.value("P_S"), ACTUATOR.value("T_0"))
    assert supply.half_width == pytest.approx(assumed_change("P_S") * supply.value)
    # recorded, but not in the calibration
    assert [assumption.recorded for assumption in assumed_conditions(logs[1:], [], ACTUATOR)] == [True, True]
    # measured, or fitted for all recordings together
    assert assumed_conditions(logs, ["P_S", "T_0@a", "T_0@b"], ACTUATOR) == ()
    assert all(isinstance(assumption, Assumption) for assumption in (supply, air))


def test_the_assumed_change_covers_95_of_100_draws_of_the_prior():
    generator = np.random.default_rng(1)
    weights = np.exp([log_odds(hypothesis) for hypothesis in HYPOTHESES])
    drawn = generator.choice(len(HYPOTHESES), 200_000, p=weights / weights.sum())
    for name in ("P_S", "T_0"):
        variance = [change_covariance(ACTUATOR, [name], hypothesis)[0, 0] for hypothesis in HYPOTHESES]
        changes = np.sqrt(variance)[drawn] * generator.standard_normal(drawn.size) / ACTUATOR.value(name)
        # three standard deviations of a share of 5 % in as many draws
        assert np.mean(np.abs(changes) > assumed_change(name)) == pytest.approx(
            0.05, abs=3 * np.sqrt(0.05 * 0.95 / drawn.size)
        )


def test_a_supply_of_1_percent_more_balances_a_load_that_is_larger_by_its_own_and_by_that_of_the_ambient_pressure():
    p, force = ACTUATOR.parameters, 4000.0
    pressure = p.P_0 + force / p.A_A
    assert 1.01 * pressure * p.A_A - p.P_0 * p.A_A == pytest.approx(force + 0.01 * by_supply(ACTUATOR, force))


@pytest.mark.parametrize(("seconds", "possible"), [(70.0, False), (80.0, True)])
def test_air_warms_by_5_kelvin_and_another_in_every_5_seconds(seconds, possible):
    log = Log(np.linspace(0.0, seconds, 100), {"temperature_ambient": np.linspace(280.0, 300.0, 100)})
    assert (condition_problems(log, ACTUATOR) == {}) == possible


def test_recordings_of_a_calibration_under_unlike_conditions_are_named_with_the_way_out():
    warm, cold = recorded(300.0, 9e5, name="warm"), recorded(270.0, 8e5, name="cold")
    air, supply = unlike_conditions([warm, recorded(), cold])
    assert air.startswith("the air differs (-3.15 °C in cold, 26.9 °C in warm), and a calibration has one set")
    assert air.endswith("calibrate with recordings of one condition, and estimate the others from it.")
    assert supply.startswith("the supply differs (8 bar in cold, 9 bar in warm)")
    assert unlike_conditions([warm, recorded(295.0, 8.9e5)]) == ()
    assert unlike_conditions([warm, recorded()]) == ()

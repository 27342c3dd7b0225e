"""Loads of two estimators, where the supply pressure is recorded."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.filtered_load import FILTER_WEIGHT, filtered_weights, load_per_supply, with_filtered_load
from clutchid.estimation.problem import fit_problem
from clutchid.estimation.request import FitRequest, FreeParameters
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.uncertainty.conditions import RecordedConditions, conditions_of, with_estimated_supply
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import Log
from clutchid.observer import observe_recording, observer

SUPPLY = 9.5e5
NONE, VALVES = (), ("valves",)


@pytest.fixture(scope="module")
def calibrated_load(calibrated):
    """A calibration whose recording had the same supply pressure as the worn one."""
    log = calibrated.recordings["log"].measured
    log = log.with_columns(pressure_supply=np.full(len(log), SUPPLY))
    conditions = conditions_of([log], calibrated.actuator)
    estimated = with_estimated_supply(conditions, [log], [calibrated.recordings["log"].simulated])
    return replace(calibrated.calibration, conditions=estimated)


@pytest.fixture(scope="module")
def recorded(worn_log):
    return worn_log.with_columns(pressure_supply=np.full(len(worn_log), SUPPLY))


@pytest.fixture(scope="module")
def filtered(recorded, calibrated, calibrated_load):
    return filtered_weights(recorded, calibrated.actuator, calibrated_load)


@pytest.fixture(scope="module")
def problem(recorded, calibrated, calibrated_load):
    return fit_problem(
        [recorded], calibrated.actuator, FreeParameters(calibrated.actuator.load.names, ("position",)), calibrated_load
    )


def posterior(problem, valves=0.0):
    k = len(problem.coordinates)
    covariances = np.array([np.eye(k), np.eye(k)])
    weights = np.array([1.0 - valves, valves])
    return Mixture((NONE, VALVES), weights, weights, np.zeros((2, k)), covariances)


def test_the_filtered_load_is_that_of_the_observer(filtered, recorded, calibrated, calibrated_load):
    joint = observer(calibrated.actuator, calibration=calibrated_load)
    run = observe_recording(joint, recorded)
    assert filtered == pytest.approx(np.array(joint.load(run.after).theta))


@pytest.mark.parametrize("valves", [0.0, 0.25, 1.0])
def test_the_load_moves_half_way_to_it_as_far_as_the_valves_have_not_changed(
    problem, filtered, recorded, calibrated, calibrated_load, valves
):
    before = posterior(problem, valves)
    after = with_filtered_load(before, problem, [recorded], calibrated.actuator, calibrated_load)
    loads = [i for i, c in enumerate(problem.coordinates) if c.base in calibrated.actuator.load.names]
    moved = problem.si(after.x) - problem.si(before.x)
    expected = FILTER_WEIGHT * (1.0 - valves) * (filtered - problem.si(before.x)[loads])
    assert moved[loads] == pytest.approx(expected, abs=1e-6)
    assert np.delete(moved, loads) == pytest.approx(0.0)
    np.testing.assert_allclose(after.covariance, before.covariance)


def test_an_observer_without_trust_in_its_load_has_none(recorded, calibrated, calibrated_load):
    # innovations are compared with those of the calibration
    for nis, is_used in ((calibrated_load.nis, True), (0.1 * calibrated_load.nis, False)):
        weights = filtered_weights(recorded, calibrated.actuator, replace(calibrated_load, nis=nis))
        assert (weights is not None) == is_used


def test_without_a_supply_pressure_that_can_be_used_there_is_none(
    recorded, worn_log, calibrated, calibrated_load, problem
):
    older = replace(calibrated_load, conditions=RecordedConditions(None, SUPPLY))
    absent = recorded.with_columns(pressure_supply=np.full(len(recorded), np.nan))
    for log, calibration in ((worn_log, calibrated_load), (recorded, older), (absent, calibrated_load)):
        assert filtered_weights(log, calibrated.actuator, calibration) is None
        mixed = posterior(problem)
        assert with_filtered_load(mixed, problem, [log], calibrated.actuator, calibration) is mixed


def test_a_recording_that_is_too_slow_for_an_observer_has_none(recorded, calibrated, calibrated_load):
    slow = Log(recorded.time[::10], {name: values[::10] for name, values in recorded.columns.items()}, "slow")
    assert filtered_weights(slow, calibrated.actuator, calibrated_load) is None


def test_the_load_per_supply_is_that_of_a_reading_with_another_supply(problem):
    k, names = len(problem.coordinates), [c.base for c in problem.coordinates]
    at, weights = names.index("P_S"), [i for i, name in enumerate(names) if name in problem.actuator.load.names]
    x = np.zeros(k)
    # 1 % more supply is taken for a load that is larger by 0.8 % everywhere
    direction = np.zeros(k)
    direction[at] = 0.01 * problem.si(x)[at] / problem.slopes(x)[at]
    direction[weights] = 0.008 * problem.si(x)[weights] / problem.slopes(x)[weights]
    covariance = np.outer(direction, direction) + 1e-12 * np.eye(k)
    mixed = Mixture((NONE,), np.ones(1), np.ones(1), x[None], covariance[None])
    assert load_per_supply(problem, mixed) == pytest.approx(0.8, rel=1e-3)
    assert load_per_supply(replace(problem, changing=()), mixed) is None
    assert load_per_supply(problem, None) is None


@pytest.mark.slow
def test_a_reading_with_a_recorded_supply_pressure_says_what_it_is_worth_and_has_a_band(
    recorded, calibrated, calibrated_load, worn
):
    fit = fit_with(
        SHOOTING, [recorded], calibrated.actuator, FitRequest(("position",), ("load",), calibration=calibrated_load)
    )
    curve, y = fit.load_curve, np.linspace(0.5e-3, 20e-3, 40)
    force, low, high = (np.interp(y, curve.position, column) for column in (curve.force, curve.low, curve.high))
    assert np.all((low <= worn.load.force(y)) & (worn.load.force(y) <= high))
    assert np.all((low < force) & (force < high))
    assert 0.2 < fit.load_per_supply < 2.0

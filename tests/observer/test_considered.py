"""A considered supply pressure: what its change does to load and pressure for the gains as they are, no more."""

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.model import Actuator, Load
from clutchid.observer import observe, observer, read_state, start, write_state
from clutchid.observer.prior import SUPPLY_STD
from clutchid.simulation import simulate

STROKE = np.linspace(3e-3, 9e-3, 25)


@pytest.fixture(scope="module")
def one(plant):
    return observer(plant)


@pytest.fixture(scope="module")
def recorded(plant, recorded_by):
    """A recording with a share of the supply pressure, whose sensor shows the pressure of the model."""

    def made(share):
        actuator = plant.replace({"P_S": share * plant.value("P_S")})
        log = recorded_by(actuator, seconds=6.0)
        return log.with_columns(pressure_supply=simulate(actuator, log).log["pressure_supply"])

    return made


@pytest.fixture(scope="module")
def sound(recorded):
    return recorded(1.0).without("pressure_supply")


def test_no_mean_and_no_gain_knows_of_it(plant, one, sound):
    (first, found), (second, others) = (
        observe(each, start(each), sound) for each in (one, observer(plant, supply_std=0.0))
    )
    assert np.array_equal(first.theta, second.theta)
    assert np.array_equal(first.T, second.T)
    assert np.array_equal(found.states, others.states)
    assert np.array_equal(found.innovations, others.innovations, equal_nan=True)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_it_is_what_another_supply_does_to_load_and_pressure(plant, one, recorded, sound, share):
    (before, _), (state, _) = (
        observe(one, start(one), log) for log in (sound, recorded(share).without("pressure_supply"))
    )
    moved = one.load(state).force(STROKE) - one.load(before).force(STROKE)
    expected = -(share - 1.0) / SUPPLY_STD * one.actuator.load.phi(STROKE) @ one.prior.weights @ before.G[:, 0]
    assert moved == pytest.approx(expected, rel=0.3, abs=0.2 * np.abs(expected).max())
    assert np.abs(moved).max() > 0.02 * one.load(before).force(STROKE).max()


def test_the_bands_hold_another_supply_and_say_what_they_are_without_it(plant, one, recorded):
    log = recorded(0.95).without("pressure_supply")
    state, found = observe(one, start(one), log)
    off = np.abs(one.load(state).force(STROKE) - plant.load.force(STROKE))
    assert np.all(off < 1.96 * one.load_deviation(state, STROKE))
    assert np.mean(off < 1.96 * one.load_deviation(state, STROKE, as_calibrated=True)) < 0.5
    at, corrected = plant.states.index("p_A"), np.isfinite(found.deviations[:, 0])
    error = np.abs(found.states[:, at] - log["pressure_a"])[corrected]
    late = slice(error.size // 2, None)
    assert np.mean(error[late] < 1.96 * found.deviations[corrected, at][late]) > 0.9


def test_it_vanishes_where_the_supply_is_recorded_and_comes_back_where_the_sensor_is_lost(plant, recorded):
    supply = plant.value("P_S")
    known = RecordedConditions(supply=supply, supply_estimated=supply)
    one = observer(plant, calibration=Calibration((), np.zeros((0, 0)), conditions=known))
    log = recorded(1.0)
    with_sensor, _ = observe(one, start(one), log)
    without, _ = observe(one, start(one), log.without("pressure_supply"))
    assert np.abs(with_sensor.G).max() < 0.2 * np.abs(without.G).max()
    values = np.where(log.time < 2.0, log["pressure_supply"], np.nan)
    lost, _ = observe(one, start(one), log.with_columns(pressure_supply=values))
    assert np.linalg.norm(lost.G) > 1.2 * np.linalg.norm(with_sensor.G)


@pytest.mark.parametrize("method", ["paper", "adaptive", "rls"])
def test_an_observer_that_has_no_column_takes_a_share_of_the_load(plant, method):
    actuator = Actuator(plant.parameters, Load((9.0e5, -0.3e5, 0.6e5)), "isothermal")
    one = observer(actuator, method)
    state, p = start(one), actuator.parameters
    both = one.load_deviation(state, STROKE), one.load_deviation(state, STROKE, as_calibrated=True)
    share = 0.025 * (actuator.load.force(STROKE) + p.A_A * p.P_0)
    assert np.sqrt(both[0] ** 2 - both[1] ** 2) == pytest.approx(share)


def test_states_keep_it_and_another_standard_deviation_is_refused(plant, one, sound, tmp_path):
    state, _ = observe(one, start(one), sound.slice(0, 3000))
    write_state(one, state, tmp_path / "state.toml")
    assert np.array_equal(read_state(one, tmp_path / "state.toml").G, state.G)
    assert np.abs(state.G).max() > 0.0
    with pytest.raises(ParameterError, match="another calibration or method"):
        read_state(observer(plant, supply_std=0.02), tmp_path / "state.toml")
    for wrong in (-0.01, 0.6, np.nan):
        with pytest.raises(ParameterError, match=r"is a share of it from 0 to 0\.5"):
            observer(plant, supply_std=wrong)

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
def joint(plant):
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


def test_no_mean_and_no_gain_knows_of_it(plant, joint, sound):
    (first, estimates), (second, others) = (
        observe(considering, start(considering), sound) for considering in (joint, observer(plant, supply_std=0.0))
    )
    assert np.array_equal(first.theta, second.theta)
    assert np.array_equal(first.T, second.T)
    assert np.array_equal(estimates.states, others.states)
    assert np.array_equal(estimates.innovations, others.innovations, equal_nan=True)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_it_is_what_another_supply_does_to_load_and_pressure(plant, joint, recorded, sound, share):
    (before, _), (state, _) = (
        observe(joint, start(joint), log) for log in (sound, recorded(share).without("pressure_supply"))
    )
    moved = joint.load(state).force(STROKE) - joint.load(before).force(STROKE)
    expected = -(share - 1.0) / SUPPLY_STD * joint.actuator.load.phi(STROKE) @ joint.prior.weights @ before.G[:, 0]
    assert moved == pytest.approx(expected, rel=0.3, abs=0.2 * np.abs(expected).max())
    assert np.abs(moved).max() > 0.02 * joint.load(before).force(STROKE).max()


def test_the_bands_hold_another_supply_and_say_what_they_are_without_it(plant, joint, recorded):
    log = recorded(0.95).without("pressure_supply")
    state, estimates = observe(joint, start(joint), log)
    off = np.abs(joint.load(state).force(STROKE) - plant.load.force(STROKE))
    assert np.all(off < 1.96 * joint.load_deviation(state, STROKE))
    assert np.mean(off < 1.96 * joint.load_deviation(state, STROKE, as_calibrated=True)) < 0.5
    at, corrected = plant.states.index("p_A"), np.isfinite(estimates.deviations[:, 0])
    error = np.abs(estimates.states[:, at] - log["pressure_a"])[corrected]
    late = slice(error.size // 2, None)
    assert np.mean(error[late] < 1.96 * estimates.deviations[corrected, at][late]) > 0.9


def test_it_vanishes_where_the_supply_is_recorded_and_comes_back_where_the_sensor_is_lost(plant, recorded):
    supply = plant.value("P_S")
    conditions = RecordedConditions(supply=supply, supply_estimated=supply)
    joint = observer(plant, calibration=Calibration((), np.zeros((0, 0)), conditions=conditions))
    log = recorded(1.0)
    with_sensor, _ = observe(joint, start(joint), log)
    without, _ = observe(joint, start(joint), log.without("pressure_supply"))
    assert np.abs(with_sensor.G).max() < 0.2 * np.abs(without.G).max()
    values = np.where(log.time < 2.0, log["pressure_supply"], np.nan)
    lost, _ = observe(joint, start(joint), log.with_columns(pressure_supply=values))
    assert np.linalg.norm(lost.G) > 1.2 * np.linalg.norm(with_sensor.G)


def test_an_observer_that_has_no_column_takes_a_share_of_the_load(plant):
    actuator = Actuator(plant.parameters, Load((9.0e5, -0.3e5, 0.6e5)), "isothermal")
    joint = observer(actuator, "paper")
    state, p = start(joint), actuator.parameters
    both = joint.load_deviation(state, STROKE), joint.load_deviation(state, STROKE, as_calibrated=True)
    share = 0.025 * (actuator.load.force(STROKE) + p.A_A * p.P_0)
    assert np.sqrt(both[0] ** 2 - both[1] ** 2) == pytest.approx(share)


def test_states_keep_it_and_a_standard_deviation_that_is_none_is_refused(plant, joint, sound, tmp_path):
    state, _ = observe(joint, start(joint), sound.slice(0, 3000))
    write_state(joint, state, tmp_path / "state.toml")
    assert np.array_equal(read_state(joint, tmp_path / "state.toml").G, state.G)
    assert np.abs(state.G).max() > 0.0
    for wrong in (-0.01, 0.6, np.nan):
        with pytest.raises(ParameterError, match=r"is a share of it from 0 to 0\.5"):
            observer(plant, supply_std=wrong)

"""The carrier of the valves is found where there is one, and only there."""

import numpy as np
import pytest

from clutchid import truck as virtual
from clutchid.errors import DataError
from clutchid.estimation.automatic import AUTOMATIC
from clutchid.model import Actuator
from clutchid.preparation.pulses import (
    PERIODS,
    centred,
    find_carrier,
    find_phase,
    on_off,
    pulsed,
)
from fixtures.changed_logs import spoiled, thinned
from fixtures.duty_cycles import commanded

pytestmark = pytest.mark.slow

PERIOD, PHASE = 0.01, 0.3

#: Of the calibration recordings of the hybrids in benchmarks/results/hybrids.md.
SEED = 2103381653


@pytest.fixture(scope="module")
def switched(plant):
    """The plant with valves that a carrier of 10 ms switches, at 0.3 of its period, and a prompt pressure sensor."""
    return plant.replace({"T_pwm": PERIOD, "s_pwm": PHASE, "s_vs": 0.07, "s_ve": 0.07, "tau_p": 0.0})


@pytest.fixture(scope="module")
def log(switched, recorded_by):
    return recorded_by(switched, seconds=6.0, name="switched")


def apart(first, other):
    """Distance of two phases on the circle, rounded: the phases that are tried are twentieths."""
    return round(abs(centred(first - other)), 9)


@pytest.mark.parametrize("wanted", [PERIOD, 0.02])
def test_period_and_phase_are_found_in_a_recording_with_pressure(plant, switched, recorded_by, wanted):
    period, phase = find_carrier(recorded_by(switched.replace({"T_pwm": wanted}), seconds=6.0), plant)
    assert period == wanted
    assert apart(phase, PHASE) <= 0.05


@pytest.mark.parametrize("phase", [0.0, -0.42])
def test_any_phase_is_found(plant, switched, recorded_by, phase):
    log = recorded_by(switched.replace({"s_pwm": phase}), seconds=4.0)
    assert apart(find_carrier(log, plant, (PERIOD,))[1], phase) <= 0.05


@pytest.mark.parametrize(
    ("number", "seed"), [(2071, 943635715), (2073, 1415277649), (2081, 687545777), (2092, 926099093)]
)
def test_the_grid_of_the_duty_cycles_is_the_carrier_of_trucks_whose_longer_periods_explain_much(number, seed):
    """Five times the period, or twice, explains more of what is left beside its own mean than the true one does."""
    kind = virtual.truck(number)
    log = virtual.drive(kind, seconds=30.0, seed=seed).log
    assert find_carrier(log, Actuator(model=AUTOMATIC))[0] == kind.T_pwm


def test_a_recording_without_a_carrier_has_none(plant, drive_log):
    assert find_carrier(drive_log, plant) == (0.0, 0.0)


def test_a_spool_that_lags_behind_duty_cycles_on_a_grid_has_none():
    """The grid leaves a trace in the pressure, but far less than valves that open and close in each period would."""
    kind = virtual.truck(6, family="B")
    assert (kind.valve, kind.duty) == ("spool", "latched")
    log = virtual.drive(kind, seconds=15.0, seed=1135876684).log
    assert find_carrier(log, Actuator(model=AUTOMATIC)) == (0.0, 0.0)


@pytest.mark.parametrize(("family", "period"), [("h:1", 0.0), ("h:8", 0.0), ("h:15", 0.0), ("h:4", 0.01)])
def test_the_lag_of_a_valve_behind_its_duty_cycles_is_no_carrier_of_a_long_period(family, period):
    """Pulses of 50 ms explained more than 1 % of three of them; those of 47 or 53 ms explain nearly as much."""
    log = virtual.drive(virtual.truck(0, family=family), seconds=30.0, seed=SEED).log
    assert find_carrier(log, Actuator(model=AUTOMATIC))[0] == period


def test_a_recording_slower_than_the_carrier_has_none(plant, log):
    bus = thinned(log, 10)
    assert find_carrier(bus, plant)[0] != PERIOD
    assert find_carrier(bus, plant, tuple(period for period in PERIODS if period < 0.025)) == (0.0, 0.0)


def test_missing_pressure_does_not_hide_the_carrier(plant, log):
    torn = spoiled(log, "pressure_a", [*range(500, 560), *range(0, len(log), 50)])
    period, phase = find_carrier(torn, plant)
    assert period == PERIOD
    assert apart(phase, PHASE) <= 0.05


def test_without_pressure_the_period_cannot_be_found(plant, log):
    with pytest.raises(DataError, match="no column 'pressure_a'"):
        find_carrier(log.without("pressure_a"), plant)


def test_a_late_pressure_sensor_shows_the_carrier_late(plant, switched, recorded_by):
    log = recorded_by(switched.replace({"tau_p": 2e-3}), seconds=4.0, seed=None)
    late = centred(find_carrier(log, plant, (PERIOD,))[1] - PHASE)
    # 2 ms are 0.2 of the period; the lag of the sensor is free beside the phases of the valves, which take it up
    assert 0.05 <= late <= 0.25


@pytest.mark.parametrize("lag", [0.0, 2e-3])
@pytest.mark.parametrize("phase", [PHASE, -0.15])
def test_the_phase_is_found_from_position_alone_whatever_the_lag_of_its_sensor(switched, recorded_by, phase, lag):
    lagging = switched.replace({"tau_y": lag, "e_y": 3e-5})
    log = recorded_by(lagging.replace({"s_pwm": phase}), seconds=5.0).without("pressure_a")
    # the fine grid has steps of 0.02: a neighbour but one at most; a lag taken for a phase would be 0.1 off
    assert apart(find_phase(log, lagging.replace({"s_pwm": 0.0})), phase) < 0.05


def test_a_centred_phase_is_the_same_phase():
    for phase in np.linspace(-2, 2, 41):
        assert -0.5 <= centred(phase) < 0.5
        turns = centred(phase) - phase
        assert turns == pytest.approx(round(turns), abs=1e-12)


def test_the_phase_of_a_recording_with_a_grid_is_that_of_the_grid(plant, recorded_by):
    log = recorded_by(plant, seconds=4.0)
    duty = np.repeat(np.random.default_rng(2).random(len(log) // 10), 10)
    command = log.with_columns(duty_supply=np.roll(duty, 3), duty_exhaust=np.zeros(len(log)))
    actuator = plant.replace({"T_pwm": 0.01})
    for with_pressure in (True, False):
        assert pulsed(command, actuator, with_pressure).actuator.parameters.s_pwm == pytest.approx(0.3, abs=1e-6)


def test_an_on_off_unit_has_no_carrier_in_its_pressure(plant, recorded_by):
    log = recorded_by(plant, seconds=4.0)
    bang = log.with_columns(**{name: np.round(log[name]) for name in ("duty_supply", "duty_exhaust")})
    assert on_off(bang)
    assert find_carrier(bang, plant) == (0.0, 0.0)
    assert find_carrier(bang, plant, (PERIOD,)) == (0.0, 0.0)


def test_the_phase_of_an_on_off_unit_is_that_of_its_commands(plant):
    bang = commanded(4000, 2, shift=1)
    for with_pressure in (True, False):
        s_pwm = pulsed(bang, plant.replace({"T_pwm": 2e-3}), with_pressure).actuator.parameters.s_pwm
        assert apart(s_pwm, 0.5) < 1e-6


def test_the_phase_in_a_pressure_is_found_less_the_lag_of_its_sensor(plant, switched, recorded_by):
    late = switched.replace({"tau_p": 2e-3})
    log = recorded_by(late, seconds=4.0, seed=None)
    _, phase = find_carrier(log, late, (PERIOD,))
    assert pulsed(log, late, True).actuator.value("s_pwm") == pytest.approx(centred(phase - 0.2))

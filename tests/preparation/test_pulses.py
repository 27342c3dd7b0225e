"""Recordings that are slower than the pulses of the valves or the changes of their duty cycles."""

from dataclasses import replace

import numpy as np
import pytest

import clutchid
from clutchid.errors import DataError
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.request import FitRequest
from clutchid.estimation.shooting import SHOOTING
from clutchid.estimation.verification import on_samples
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.preparation.pulses import (
    GRID_STEP,
    STAMP_STD,
    Duties,
    centred,
    duties_in,
    find_phase,
    lacks_changes,
    pulsed,
)
from clutchid.simulation.sensors import lagged
from fixtures.changed_logs import thinned

#: The carrier of the drives in these tests: a new duty cycle every 10 ms.
PERIOD = 0.01


@pytest.fixture(scope="module")
def switched(plant):
    """The plant with valves that a carrier switches, whose periods start with those of the drive."""
    return plant.replace({"T_pwm": PERIOD, "s_pwm": 0.0, "s_vs": 0.07, "s_ve": 0.07})


@pytest.fixture(scope="module")
def bus(switched, recorded_by):
    """6 s of the plant with a load that is 8 % higher, at 100 Hz, position only."""
    load = switched.load
    worn = switched.replace({name: 1.08 * value for name, value in zip(load.names, load.theta, strict=True)})
    return thinned(recorded_by(worn, seconds=6.0, name="bus", driven=1), 10, first=4).without("pressure_a")


@pytest.fixture(scope="module")
def continuous(plant):
    """The plant with duty cycles that its control unit changes every millisecond, and averaged valves."""
    return replace(plant, duty_period=0.0)


@pytest.fixture(scope="module")
def between(worn, driven):
    """10 s of the worn plant in a closed position loop at 1 kHz, of which a bus has every tenth sample."""
    log = driven(worn, name="between")
    position = lagged(log["position"], worn.parameters.tau_y, 1e-3)
    noise = 3e-5 * np.random.default_rng(4).standard_normal(len(log))
    return thinned(log.with_columns(position=position + noise), 10, first=3).without("pressure_a")


def test_a_recorder_of_1_khz_needs_nothing(switched, drive_log):
    pulse = pulsed(drive_log, switched, True)
    assert pulse.log is drive_log
    assert pulse.warning is None


def test_the_phase_of_a_slow_recording_is_found(switched, bus):
    assert abs(centred(find_phase(bus, switched))) < 0.1
    pulse = pulsed(bus, switched, False)
    assert np.diff(pulse.log.time).max() < 1.1 * GRID_STEP
    assert len(pulse.log) <= 12 * len(bus), "the samples, the starts of periods, and eleven intervals between"
    assert pulse.phase_std == pytest.approx(STAMP_STD / PERIOD)


@pytest.mark.slow
def test_a_load_is_read_from_100_hz(switched, bus):
    calibration = Calibration((), np.zeros((0, 0)))
    fit = fit_with(SHOOTING, [bus], switched, FitRequest(("position",), ("load",), calibration=calibration))
    y = np.linspace(0.5e-3, 20e-3, 40)
    true = 1.08 * switched.load.force(y)
    assert np.sqrt(np.mean((fit.actuator.load.force(y) - true) ** 2)) < 0.01 * true.max()
    assert "s_pwm@bus" in fit.parameters
    recording = fit.recordings["bus"]
    assert recording.measured is bus
    assert np.array_equal(recording.simulated.time, bus.time)
    assert np.sqrt(np.mean((recording.simulated["position"] - bus["position"]) ** 2)) < 1e-3


@pytest.mark.slow
def test_a_load_is_read_from_duty_cycles_that_change_between_the_samples(continuous, between):
    assert duties_in(between, continuous) is Duties.INTERPOLATED
    fit = clutchid.fit(
        between, continuous, free=("load",), request=clutchid.FitRequest(calibration=Calibration((), np.zeros((0, 0))))
    )
    assert fit.method == "prediction-error", "multiple shooting has no noise of the flow within its windows"
    y = np.linspace(0.5e-3, 15e-3, 40)
    true = 1.08 * continuous.load.force(y)
    assert np.sqrt(np.mean((fit.actuator.load.force(y) - true) ** 2)) < 0.02 * true.max()
    low, high = (np.interp(y, fit.load_curve.position, limit) for limit in (fit.load_curve.low, fit.load_curve.high))
    assert np.mean((low <= true) & (true <= high)) >= 0.9


def test_each_recording_has_its_duty_cycles_in_one_of_four_ways(switched, bus, between):
    actuators = {period: replace(switched, duty_period=period) for period in (None, 0.0, 5e-3, 0.01, 0.02)}
    whole = bus.with_columns(duty_supply=np.round(bus["duty_supply"]), duty_exhaust=np.round(bus["duty_exhaust"]))
    assert {p: duties_in(bus, actuator) for p, actuator in actuators.items()} == {
        0.0: Duties.INTERPOLATED, **dict.fromkeys((None, 5e-3, 0.01, 0.02), Duties.LATCHED),
    }  # fmt: skip
    assert duties_in(whole, actuators[0.01]) is Duties.UNKNOWN
    averaged = {period: actuator.replace({"T_pwm": 0.0}) for period, actuator in actuators.items()}
    assert [duties_in(bus, averaged[period]) for period in (None, 0.0, 3e-3, 0.02) if period in averaged] == [
        Duties.RECORDED, Duties.INTERPOLATED, Duties.LATCHED,
    ]  # fmt: skip
    assert [lacks_changes(bus, averaged[period]) for period in (None, 0.0, 5e-3, 0.01, 0.02)] == [
        False, True, True, False, False,
    ]  # fmt: skip


def test_a_recording_without_the_edges_of_on_off_valves_is_refused_in_one_sentence(switched, bus):
    whole = bus.with_columns(duty_supply=np.round(bus["duty_supply"]), duty_exhaust=np.round(bus["duty_exhaust"]))
    with pytest.raises(DataError) as caught:
        clutchid.fit(
            whole, switched, free=("load",), request=clutchid.FitRequest(calibration=Calibration((), np.zeros((0, 0))))
        )
    assert str(caught.value) == (
        "bus: a sample every 10 ms does not show when the on/off valves switch, so the load would have errors of "
        "tens of percent; record at 1 kHz."
    )


@pytest.mark.slow
def test_a_simulation_on_a_finer_raster_is_given_at_the_samples(adapted, worn_log):
    worn = adapted.recordings["worn"]
    assert on_samples(worn, worn_log) is worn
    coarse = on_samples(worn, thinned(worn_log, 7))
    assert np.array_equal(coarse.simulated["pressure_a"], worn.simulated["pressure_a"][::7])
    assert len(coarse.measured) == len(coarse.simulated)

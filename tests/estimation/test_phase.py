"""The phase of the carrier from position alone, although the clutch is worn and the grease is cold."""

import numpy as np
import pytest

import clutchid
from clutchid.estimation import phase
from clutchid.estimation.phase import filtered_phase, phase_finder
from clutchid.estimation.request import FreeParameters
from clutchid.inference.filter.filtering import filtered
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.numerics.failure import Failure
from clutchid.preparation.pulses import centred, find_phase
from fixtures.changed_logs import thinned

EXACT = Calibration((), np.zeros((0, 0)))
#: Between two of the ten phases that are tried.
PHASE = 0.26


@pytest.fixture(scope="module")
def calibrated():
    """A calibrated actuator whose valves a carrier switches."""
    actuator = clutchid.Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines(clutchid.Load()))
    return actuator.replace(T_pwm=0.01, s_vs=0.07, s_ve=0.07, t_vs=0.1, t_ve=0.1)


@pytest.fixture(scope="module")
def cold_and_worn(calibrated):
    """Six seconds of it with twice the viscous friction and a tenth more load; no grid shows the carrier."""
    duty = clutchid.bundled_recording().slice(0, 6000).without("pressure_a").without("position")
    noise = np.random.default_rng(2).standard_normal((2, len(duty)))
    dithered = {
        name: np.clip(duty[name] + 1e-5 * np.abs(noise[1]), 0.0, 1.0) for name in ("duty_supply", "duty_exhaust")
    }
    driven = duty.with_columns(**dithered)
    return changed(calibrated, driven, noise[0])


def changed(calibrated, driven, noise):
    """A drive with the position of a piston with twice the viscous friction and a tenth more load."""
    loads = {name: 1.1 * calibrated.value(name) for name in calibrated.load.names}
    actuator = calibrated.replace({"D_v": 2.0 * calibrated.value("D_v"), "s_pwm": PHASE, **loads})
    return driven.with_columns(position=clutchid.simulate(actuator, driven).log["position"] + 3e-5 * noise)


@pytest.mark.slow
def test_cold_grease_and_a_worn_clutch_are_not_taken_for_another_phase(calibrated, cold_and_worn):
    timing = filtered_phase(cold_and_worn, calibrated, EXACT)
    assert abs(centred(timing - PHASE)) < 0.03
    assert abs(centred(find_phase(cold_and_worn, calibrated) - PHASE)) > 0.05  # the reason for the filter


@pytest.fixture(scope="module")
def slow_log(calibrated, cold_and_worn):
    """Twelve seconds of it at 100 Hz, with duty cycles that are renewed at the starts of the periods."""
    duty = clutchid.bundled_recording().slice(0, 12000)
    period, noise = (
        np.floor(duty.time / 0.01 - PHASE).astype(int) + 1,
        np.random.default_rng(3).standard_normal(len(duty)),
    )
    renewed = {name: duty[name][np.minimum(10 * period, len(duty) - 1)] for name in ("duty_supply", "duty_exhaust")}
    driven = clutchid.Log(duty.time, renewed, name="slow")
    return thinned(changed(calibrated, driven, noise), 10, first=6)


@pytest.mark.slow
def test_phases_of_a_slow_recording_share_gains_although_each_has_a_time_grid_of_its_own(calibrated, slow_log):
    assert abs(centred(filtered_phase(slow_log, calibrated, EXACT) - PHASE)) < 0.05


@pytest.mark.slow
def test_a_phase_at_which_the_filter_fails_gives_no_gains(calibrated, cold_and_worn, monkeypatch):
    passes = []

    def failing_first(*arguments, **options):
        passes.append(arguments)
        return Failure("diverged") if len(passes) == 1 else filtered(*arguments, **options)

    monkeypatch.setattr(phase, "filtered", failing_first)
    assert abs(centred(filtered_phase(cold_and_worn, calibrated, EXACT) - PHASE)) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("recording", "every"), [("cold_and_worn", 1), ("slow_log", 10)])
def test_holes_in_duty_cycles_and_position_do_not_hide_the_phase(calibrated, request, recording, every):
    log = request.getfixturevalue(recording)
    duty, position = (log[name].copy() for name in ("duty_supply", "position"))
    duty[2500 // every : 2600 // every], position[4000 // every : 4030 // every] = np.nan, np.nan
    torn = log.with_columns(duty_supply=duty, position=position)
    assert abs(centred(filtered_phase(torn, calibrated, EXACT) - PHASE)) < 0.05


def test_only_a_load_that_is_read_from_a_calibration_needs_the_filter(calibrated):
    reading = FreeParameters(calibrated.load.names, ("position",))
    assert phase_finder(calibrated, reading, None) is find_phase
    assert (
        phase_finder(calibrated, FreeParameters(calibrated.load.names, ("position", "pressure_a")), EXACT) is find_phase
    )
    assert phase_finder(calibrated, reading, EXACT).func is filtered_phase


@pytest.mark.slow
def test_a_reading_uses_the_phase_that_the_filter_found(calibrated, cold_and_worn):
    reading = clutchid.fit(cold_and_worn, calibrated, free="load,D_v", request=clutchid.FitRequest(calibration=EXACT))
    assert reading.parameters["D_v"].value == pytest.approx(2.0 * calibrated.value("D_v"), rel=0.15)
    assert abs(centred(reading.parameters["s_pwm@truck1_calibration"].value - PHASE)) < 0.05

"""What is sound is called sound: no check cries wolf."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.estimation.assess.missing_excitation import missing_excitation
from clutchid.log import Log
from clutchid.measurements import read
from clutchid.model import Actuator
from clutchid.preparation.inspection import inspect
from clutchid.strokes.excitation import excitation
from clutchid.strokes.vented_pressure import VENTED_KEY
from clutchid.truck import MANOEUVRES, truck
from fixtures.changed_logs import thinned


def not_good(log, actuator=None):
    checks = inspect(log, actuator).checks
    return {f.name: f.grade for f in checks if f.grade != "good"}


@pytest.mark.parametrize("number", [1, 3, 7, 9, 16])
def test_a_day_of_a_virtual_truck_is_good_but_for_the_supply_that_it_cannot_tell(recorded, number):
    log = recorded(number)
    assert truck(number).drive == ("bang-bang" if number == 1 else "pwm")
    assert not_good(log) == {"supply pressure": "undetermined"}
    assert inspect(log).warnings == ()


@pytest.mark.parametrize("manoeuvre", sorted(MANOEUVRES))
def test_every_manoeuvre_is_without_a_warning_in_the_controller(recorded, manoeuvre):
    assert inspect(recorded(2, manoeuvre, dropouts=4)).warnings == ()


@pytest.mark.parametrize("manoeuvre", sorted(MANOEUVRES))
def test_on_the_bus_only_the_rate_is_slow(recorded, manoeuvre):
    reasons = not_good(recorded(4, manoeuvre, recorder="bus"))
    assert reasons.pop("sample rate") == "suspect"
    assert set(reasons.values()) <= {"undetermined"}


def test_the_recordings_of_the_three_trucks_are_good(shared):
    paths = sorted((shared / "data" / "trucks").glob("*/*.csv"))
    assert len({path.parent for path in paths}) == 3
    for path in paths:
        assert not_good(read(path)) == {"supply pressure": "undetermined"}, path.name


def test_a_recording_that_never_vents_assumes_a_vented_pressure_and_says_so(recorded):
    log = recorded(7)
    begin = int(np.argmax(log["position"] > 8e-3))
    moving = log.slice(begin, len(log))
    moving = moving.with_columns(duty_exhaust=np.minimum(moving["duty_exhaust"], 0.3))
    check = next(check for check in inspect(moving).checks if check.name == "vented pressure")
    assert (check.grade, check.value) == ("undetermined", "not settled")
    assert "so a calibration assumes 1.030 bar (std 6.0 kPa) there; record a second at rest" in check.sentence
    assert check.sentence.endswith(", or give --ambient.")
    stated = replace(moving, metadata={VENTED_KEY: "95e3"})
    (check,) = [check for check in inspect(stated).checks if check.name == "vented pressure"]
    assert "assumes 0.950 bar (std 2.0 kPa) there" in check.sentence
    assert "--ambient" not in check.sentence
    (sentence,) = [
        text for text in missing_excitation(excitation(moving), Actuator()) if "settle" in text or "vented rest" in text
    ]
    assert sentence.endswith(("with the exhaust valve open.", "with the clutch engaged."))
    assert not any("settle" in text for text in missing_excitation(excitation(log), Actuator()))


def test_holes_and_missing_samples_change_no_verdict(recorded):
    log, rng = recorded(7), np.random.default_rng(0)
    missing, there = np.zeros(len(log), dtype=bool), np.ones(len(log), dtype=bool)
    for start in rng.integers(0, len(log), 15):
        missing[start : start + rng.integers(5, 60)] = True
    for start in rng.integers(0, len(log), 4):
        there[start : start + rng.integers(50, 400)] = False
    holed = {name: np.where(missing & (name not in ("duty_supply", "duty_exhaust")), np.nan, v)[there]
             for name, v in log.columns.items()}  # fmt: skip
    assert not_good(Log(log.time[there], holed)) == {"supply pressure": "undetermined"}


def test_ten_times_the_rate_changes_no_verdict(recorded):
    log = recorded(7)
    time = np.arange(0, log.time[-1], 1e-4)
    held = np.searchsorted(log.time, time, side="right") - 1
    smooth = np.convolve(np.pad(log["position"], 5, "edge"), np.ones(11) / 11, "valid")
    noisy = np.interp(time, log.time, smooth) + 3e-5 * np.random.default_rng(0).standard_normal(time.size)
    inputs = {name: log[name][held] for name in ("duty_supply", "duty_exhaust")}
    fast = Log(time, {"position": 12e-6 * np.round(noisy / 12e-6), **inputs})
    assert not_good(fast) == {"supply pressure": "undetermined"}


def test_jitter_of_the_stamps_changes_no_verdict(recorded):
    log = thinned(recorded(7), 5)
    late = log.time + np.random.default_rng(0).uniform(0, 1.5e-3, len(log))
    assert not_good(Log(late, dict(log.columns))) == not_good(log)


def test_values_that_a_logger_repeats_count_once(recorded, check_of):
    log = recorded(7)
    last = np.arange(len(log)) // 10 * 10
    held = Log(log.time, {name: values[last] for name, values in log.columns.items()})
    assert not_good(held) == {"sample rate": "suspect", "supply pressure": "undetermined"}
    assert check_of(held, "sample rate").value == "100 Hz, repeated at 1000 Hz"


@pytest.mark.parametrize("number", [5, 7, 8])
def test_coarse_steps_are_no_shift(recorded, check_of, number):
    log = recorded(number)
    coarse = log.with_columns(position=2e-4 * np.round(log["position"] / 2e-4))
    assert check_of(coarse, "time shift").grade == "good"


def test_a_simulation_without_noise_is_not_saturated_nor_stuck(drive, truth):
    reasons = not_good(drive, truth)
    assert set(reasons.values()) == {"undetermined"}
    assert {"saturation of position", "supply pressure"} <= set(reasons)


def test_an_end_stop_is_no_saturation_because_noise_goes_on(recorded, check_of):
    log = recorded(3, "strokes")
    # two thirds of this recording stand at one of the ends
    y = log["position"]
    assert np.mean((y > 0.9 * y.max()) | (y < 0.05 * y.max())) > 0.6
    assert check_of(log, "saturation of position").grade == "good"


def test_a_piston_that_stands_near_its_end_under_an_open_valve_is_not_stuck(check_of):
    time = np.arange(0, 6, 1e-3)
    phase = time % 1
    y = np.interp(phase, (0.0, 0.2, 0.75, 0.95), (0.0, 0.024, 0.024, 0.0))
    y[time < 1] *= 25 / 24  # the first stroke ends a millimetre further
    y += 2e-5 * np.random.default_rng(0).standard_normal(time.size)
    supply = 1.0 * ((phase < 0.2) | ((phase > 0.35) & (phase < 0.7)))
    log = Log(time, {"position": y, "duty_supply": supply, "duty_exhaust": 1.0 * (phase > 0.75)})
    assert check_of(log, "stuck position").grade == "good"


def test_of_a_recording_without_inputs_motion_or_samples_only_the_motion_is_judged():
    n = 500
    time, zero, gone = np.arange(n) * 1e-3, np.zeros(n), np.full(n, np.nan)
    inputs = {"duty_supply": zero, "duty_exhaust": zero}
    for log in (
        Log(np.zeros(0), {}),
        Log(time[:1], {"position": zero[:1], "duty_supply": zero[:1], "duty_exhaust": zero[:1]}),
        Log(time, {"position": gone, "duty_supply": gone, "duty_exhaust": gone, "pressure_a": gone}),
        Log(time, {"position": zero}),
        Log(time, inputs),
        Log(time, {**inputs, "position": zero, "pressure_a": zero + 1.1e5}),
    ):
        grades = not_good(log)
        assert grades.pop("motion", None) == ("bad" if "position" in log else None)
        assert grades.pop("unit of pressure_a", "bad") == "bad"  # it never changes
        assert set(grades.values()) == {"undetermined"}


@pytest.mark.slow
@given(st.integers(0, 2**31), st.integers(1, 300), st.floats(1e-5, 10.0), st.floats(0.0, 0.5))
def test_any_recording_is_inspected_without_an_error(seed, samples, step, missing):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.exponential(step, samples) + 1e-9)
    columns = {
        "position": rng.normal(0.01, 0.01, samples),
        "duty_supply": rng.integers(0, 2, samples) * rng.uniform(size=samples),
        "duty_exhaust": rng.integers(0, 2, samples) * rng.uniform(size=samples),
        "pressure_a": rng.uniform(0, 1e6, samples) * 10.0 ** rng.integers(-6, 2),
    }
    holed = {name: np.where(rng.uniform(size=samples) < missing, np.nan, v) for name, v in columns.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert inspect(Log(time, holed)).table()


def test_a_recording_without_conditions_has_a_note_on_each_and_none_otherwise(recorded):
    log = recorded(7)
    supply, air = inspect(log).notes
    assert supply.startswith("supply pressure not recorded: an estimate assumes that of its calibration within 6 %")
    assert air.startswith("air temperature not recorded: an estimate assumes that of its calibration within 14 K")
    assert all(note in inspect(log).table() for note in (supply, air))
    with_conditions = log.with_columns(
        pressure_supply=np.full(len(log), 9e5), temperature_ambient=np.full(len(log), 290.0)
    )
    assert inspect(with_conditions).notes == ()
    assert inspect(with_conditions.without("pressure_supply")).notes == (supply,)

"""Samples that are no values, and good ones that stay: tables of corruptions, and of what trucks and sensors do."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from clutchid.codegen.records import values_in
from clutchid.log import INPUTS, Log
from clutchid.measurements import read
from clutchid.model import Actuator
from clutchid.strokes.values import limits, new_watch, values_of, watched
from clutchid.strokes.vented_rest import other_zeros
from clutchid.truck import drive

ACTUATOR = Actuator()


@pytest.fixture(scope="module")
def log():
    return drive(1, seed=3, seconds=8.0).log


#: Values in SI that stand for none, by channel: codes of 16 bit, 0, a number without sense, one within the range.
CODES = {"position": (65.535e-3, 0.0, -3e34, 12e-3), "pressure_a": (65.535e5, 0.0, 9e5)}

#: Number of places, and samples in each.
COUNTS = ((1, 1), (30, 1), (5, 3), (3, 20), (2, 120))

#: What differs less than this from the truth, in SI, harms no fit.
HARMLESS = {"position": 8e-4, "pressure_a": 6e4}


def corrupted(log, channel, code, places, length):
    """A recording with a code for none in some places, and a mask of the samples that are wrong."""
    wrong = np.zeros(len(log), dtype=bool)
    for at in np.random.default_rng(places + length).integers(300, len(log) - 300, places):
        wrong[at : at + length] = True
    values = np.where(wrong, code, log[channel])
    return log.with_columns(**{channel: values}), np.abs(values - log[channel]) > HARMLESS[channel]


@pytest.mark.parametrize(("channel", "count"), [*product(CODES, COUNTS)])
def test_what_is_no_value_is_missing_counted_and_said_with_its_time(log, channel, count):
    for code in CODES[channel]:
        bad, wrong = corrupted(log, channel, code, *count)
        values = values_of(bad, ACTUATOR)
        missing = np.isnan(values.log[channel])
        assert np.array_equal(missing & wrong, wrong), code
        assert not np.any(missing & (bad[channel] == log[channel]))
        if wrong.any():
            first = log.time[np.argmax(missing)]
            assert sum(fault.samples for fault in values.faults) == missing.sum()
            assert any(f"{channel}: " in text and f"at {first:.3f} s" in text for text in values.warned.warnings)
        assert np.array_equal(values_of(values.log, ACTUATOR).log[channel], values.log[channel], equal_nan=True)


@pytest.mark.parametrize("steps_at", [60, 1000, 260])
def test_no_rounding_of_a_clock_decides_on_a_sample(steps_at):
    """The same samples a while later: their times are rounded otherwise.

    A step is believed after twice as long as there were values before it, and 10 intervals, and after 1 s; a gap of
    50 ms is the longest over which it is judged.
    """
    at = np.arange(steps_at + 1200)
    position = 1e-6 * at + 8e-3 * (at >= steps_at)
    bounds, closed = limits(ACTUATOR, "position", 1e-3), dict.fromkeys(INPUTS, np.zeros(at.size))
    gap = 49 * (at >= 200) * (steps_at == 260)
    logs = [Log((late + at + gap) * 1e-3, {"position": position, **closed}) for late in range(0, 4000, 7)]
    judged = [watched(new_watch(), bounds, log, "position", log.duties())[0] for log in logs]
    assert judged[0].any()
    assert all(np.array_equal(verdicts, judged[0]) for verdicts in judged)


def test_a_supply_or_a_duty_cycle_outside_of_what_there_is_counts_as_missing(log):
    bad = log.with_columns(pressure_supply=np.where(log.time < 1.0, 9.5, 9.5e5))
    values = values_of(bad, ACTUATOR)
    assert np.array_equal(np.isnan(values.log["pressure_supply"]), log.time < 1.0)
    assert values.faults[0].sentence.startswith(
        "pressure_supply: 1,000 samples outside what an air supply has (3 to 16"
    )
    duty = log["duty_supply"].copy()
    duty[[100, 4000]] = 655.35
    values = values_of(log.with_columns(duty_supply=duty), ACTUATOR)
    assert np.flatnonzero(np.isnan(values.log["duty_supply"])).tolist() == [100, 4000]


@pytest.mark.parametrize(("step", "at"), [*product((-2e-3, -1e-3, 1e-3, 2e-3), (1500, 3000, 6200))])
def test_a_position_that_jumps_and_stays_ends_a_segment_and_has_another_zero(log, step, at):
    values = values_of(log.with_columns(position=log["position"] + step * (np.arange(len(log)) >= at)), ACTUATOR)
    (fault,) = values.faults
    assert (fault.kind, fault.first) == ("seam", log.time[at])
    assert f"at {log.time[at]:.3f} s" in fault.sentence
    assert np.flatnonzero(np.isnan(values.log["duty_supply"])).tolist() == [at]
    assert not np.isnan(values.log["position"]).any()
    (problem,) = other_zeros(values)
    assert f"jumps at {log.time[at]:.3f} s" in problem
    assert "cut the recording there" in problem


def test_two_recordings_of_one_truck_that_are_joined_are_two_segments(log):
    parts = np.r_[0 : 3000 + int(np.argmax(log["position"][3000:] > 15e-3)), 0 : len(log)]
    joined = Log(1e-3 * np.arange(parts.size), {name: values[parts] for name, values in log.columns.items()}, "joined")
    checked = values_of(joined, ACTUATOR)
    assert [fault.kind for fault in checked.faults] == ["seam"]
    assert np.isnan(checked.log["duty_supply"]).sum() == 1
    assert len(other_zeros(checked)) <= 1


@pytest.mark.parametrize(("at", "length"), [*product((1000, 2500, 6000), (200, 800))])
def test_samples_that_a_logger_repeats_in_all_channels_are_missing_also_the_inputs(log, at, length):
    columns = {name: values.copy() for name, values in log.columns.items()}
    for values in columns.values():
        values[at : at + length] = values[at]
    checked = values_of(Log(log.time, columns, "held"), ACTUATOR)
    for name in ("position", "pressure_a", *INPUTS):
        assert np.array_equal(np.flatnonzero(np.isnan(checked.log[name])), np.arange(at + 1, at + length)), name
    assert [fault.kind for fault in checked.faults] == ["repeated"]
    assert f"{length - 1} samples that repeat the samples before them" in checked.faults[0].sentence
    # a sensor that is stuck alone is for the checks
    stuck = log.with_columns(position=columns["position"], pressure_a=columns["pressure_a"])
    moving = np.ptp(log["duty_supply"][at : at + length]) + np.ptp(log["duty_exhaust"][at : at + length]) > 0.0
    assert not moving or not any(fault.kind == "repeated" for fault in values_of(stuck, ACTUATOR).faults)


@pytest.mark.parametrize("kind", ["all channels", "position at its limit", "beyond the stops"])
def test_a_recording_without_a_step_is_judged_once_for_all_actuators(log, kind):
    columns = {name: values.copy() for name, values in log.columns.items()}
    if kind == "all channels":
        for values in columns.values():
            values[1000:1800] = values[1000]
    elif kind == "beyond the stops":
        columns["position"][1000:1100] = 65.535e-3
    else:
        columns["position"] = np.minimum(columns["position"], np.quantile(columns["position"], 0.6))
    first = values_of(recording := Log(log.time, columns), ACTUATOR)
    for supply in (8.2e5, 10e5):
        other = ACTUATOR.replace(P_S=supply)
        assert first.hold_for(other)
        again = values_of(recording, other)
        judged = values_of(Log(log.time, columns), other)
        assert again.hold_for(other)
        assert again.faults == judged.faults == first.faults
        assert values_of(recording, other.replace(P_S=supply - 1e3)).log is again.log
        assert all(np.array_equal(again.log[name], judged.log[name], equal_nan=True) for name in columns)


def test_a_part_of_any_length_has_the_same_verdicts(log):
    bad, _ = corrupted(log, "position", 0.0, 30, 3)
    bad = bad.with_columns(position=bad["position"] + 1e-3 * (np.arange(len(log)) >= 5000))
    bounds = limits(ACTUATOR, "position", 1e-3)
    whole, _, last = watched(new_watch(), bounds, bad, "position", bad.duties())
    watch, parts = new_watch(), []
    for part in np.array_split(np.arange(len(log)), [1, 2, 700, 4999, 5000, 5003, 5700]):
        block = bad.slice(part[0], part[-1] + 1)
        verdicts, _, watch = watched(watch, bounds, block, "position", block.duties())
        parts.append(verdicts)
    assert np.array_equal(np.concatenate(parts), whole)
    np.testing.assert_equal(values_in(watch), values_in(last))


def thinned(log, step):
    """Every so many samples of a recording."""
    return Log(log.time[::step], {name: values[::step] for name, values in log.columns.items()}, log.name)


def held(log, step):
    """A recording whose sensor is read anew in every so many samples."""
    return log.with_columns(position=log["position"][np.arange(len(log)) // step * step])


def lost(log):
    """A recording whose logger fills lost messages of the position with the last one."""
    rng, values = np.random.default_rng(5), log["position"].copy()
    for at in rng.integers(0, len(log) - 60, 20):
        values[at : at + rng.integers(2, 40)] = values[at]
    return log.with_columns(position=values)


def noisy(log, std):
    return log.with_columns(position=log["position"] + std * np.random.default_rng(2).standard_normal(len(log)))


#: What sensors and loggers do to a recording that is good.
SENSORS = {
    "as recorded": lambda log: log,
    "noise": lambda log: noisy(log, 1e-4),
    "more noise": lambda log: noisy(log, 2e-4),
    "quantised": lambda log: log.with_columns(position=1e-4 * np.round(log["position"] / 1e-4)),
    "coarse": lambda log: log.with_columns(position=4e-4 * np.round(log["position"] / 4e-4)),
    "slow sensor": lambda log: held(log, 10),
    "vibration": lambda log: log.with_columns(position=log["position"] + 3e-4 * np.sin(207.0 * log.time)),
    "100 Hz": lambda log: thinned(log, 10),
    "20 Hz": lambda log: thinned(log, 50),
    "lost messages": lost,
    "jitter": lambda log: Log(log.time + np.random.default_rng(4).uniform(0, 5e-4, len(log)), log.columns, log.name),
}

#: What drives are like: changes since the calibration, wear, drop-outs, another zero or supply, the bus.
DRIVES = {
    "mix": {},
    "full strokes": {"manoeuvre": "strokes"},
    "cold and worn": {"change": ("cold",), "wear": 3e-3, "cycles": 3e5},
    "warm, zero kept, drop-outs": {"change": ("warm",), "sensor_zero": "kept", "wear": 2e-3, "dropouts": 10},
    "offset, much supply": {"offset": 3e-3, "supply": 11e5, "conditions": True},
    "bus": {"recorder": "bus"},
}


@pytest.mark.slow
@pytest.mark.parametrize(("family", "truck"), [("A", 0), ("A", 3405), ("B", 3405), ("h:3", 0), ("h:11", 0)])
def test_no_good_sample_of_a_truck_is_lost(family, truck):
    for name, options in DRIVES.items():
        log = drive(truck, family=family, seed=truck + 3, seconds=6.0, **options).log
        for sensor, changed in SENSORS.items():
            recording = changed(log)
            assert values_of(recording, ACTUATOR).log is recording, (name, sensor)


def test_no_good_sample_of_a_measurement_is_lost(shared):
    files = [*(shared / "data" / "trucks").glob("*/*.csv"), shared / "data" / "hunt" / "40_burst_stamps.parquet"]
    for file in files:
        log = read(file)
        assert values_of(log, ACTUATOR).log is log, file
    cylinder = shared / "data" / "wbident_pneumatic_cylinder" / "cylinder_1kHz.csv"
    log = read(cylinder, required=("time", "position"))
    log = log.with_columns(**dict.fromkeys(INPUTS, np.zeros(len(log))))
    assert values_of(log, ACTUATOR).log is log


def test_a_recording_without_faults_is_judged_once_for_an_actuator_and_anew_for_another_one(log):
    stroke = 20e-3 * np.clip(np.minimum(log.time - 1.0, 1.6 - log.time) / 0.1, 0.0, 1.0)
    moving = Log(log.time, {**log.columns, "position": stroke}, log.name)
    assert values_of(moving, ACTUATOR).log is moving
    judged = dict(moving.derived)
    assert values_of(moving, ACTUATOR).log is moving
    assert judged == moving.derived != {}
    assert values_of(moving, ACTUATOR.replace(y_max=10e-3)).faults
    assert values_of(moving, ACTUATOR).log is moving


@pytest.mark.parametrize("seed", range(4))
def test_a_recording_that_was_judged_for_others_is_judged_as_a_new_one(log, seed):
    random = np.random.default_rng(seed)
    stroke = 20e-3 * np.clip(np.minimum(log.time - 1.0, 1.6 - log.time) / random.uniform(0.03, 0.2), 0.0, 1.0)
    moving = Log(log.time, {**log.columns, "position": stroke}, log.name)
    judged = []
    for share in np.exp(random.normal(0.0, 1.0, 20)):
        actuator = ACTUATOR.replace({"C_vs": share * ACTUATOR.value("C_vs"), "M": ACTUATOR.value("M") / share})
        values, anew = values_of(moving, actuator), values_of(replace(moving), actuator)
        assert values.faults == anew.faults
        assert np.array_equal(values.log["position"], anew.log["position"], equal_nan=True)
        judged.append(bool(values.faults))
    assert not all(judged)

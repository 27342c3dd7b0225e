"""The pressure of the vented chamber: which rests count, and how well they know it."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.measurements.source import UNIT_KEY
from clutchid.strokes.vented_pressure import (
    ABSOLUTE,
    LARGEST_ZERO,
    OFFSET_PRIOR,
    VENTED_KEY,
    sensor_zero,
    vented_pressure,
    vented_prior,
    without_zeros,
)

AMBIENT, NOISE, RATE = 1.0e5, 2e3, 1000.0


def recording(*phases, noise=NOISE, rate=RATE, seed=0, quantum=500.0):
    """Phases of (seconds, pressure in Pa over their time, supply, exhaust, position in m) as a recording."""
    columns = {name: [] for name in ("pressure_a", "duty_supply", "duty_exhaust", "position")}
    for seconds, pressure, *values in phases:
        t = np.arange(round(seconds * rate)) / rate
        columns["pressure_a"].append(np.broadcast_to(pressure(t) if callable(pressure) else pressure, t.shape))
        for name, value in zip(("duty_supply", "duty_exhaust", "position"), values, strict=True):
            columns[name].append(np.full(t.size, value))
    joined = {name: np.concatenate(parts) for name, parts in columns.items()}
    read = joined["pressure_a"] + noise * np.random.default_rng(seed).standard_normal(joined["position"].size)
    joined["pressure_a"] = quantum * np.round(read / quantum) if quantum else read
    return Log(np.arange(read.size) / rate, joined)


def decay(above, tau, level=AMBIENT):
    """A pressure that falls from so far above a level with a time constant in s."""
    return lambda t: level + above * np.exp(-t / tau)


CLOSED, OPEN = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
STROKE = (0.5, 4e5, 1.0, 0.0, 0.02)
HOLD = (0.5, 4e5, 0.0, 0.0, 0.02)
DOWN = (0.1, decay(3e5, 0.05), 0.0, 1.0, 0.01)
VENTING = (0.5, decay(4e4, 0.06), *OPEN)


@pytest.mark.parametrize(
    "phases",
    [
        ((0.3, AMBIENT, *CLOSED), STROKE, HOLD, DOWN, VENTING),
        (STROKE, HOLD, DOWN, VENTING),
        (HOLD, DOWN, VENTING, (1.0, AMBIENT + 6e3, *CLOSED), STROKE, HOLD, DOWN, VENTING),
        # the air warms up behind closed valves; the rest after it lies lower
        ((0.4, AMBIENT + 6e3, *CLOSED), STROKE, HOLD, DOWN, VENTING),
        ((2.0, AMBIENT, *OPEN), STROKE, HOLD),
        (STROKE, HOLD, DOWN, (3.0, decay(4e4, 0.1), *OPEN)),
    ],
    ids=["at the start", "after a stroke", "starts in a stroke", "warms up at the start", "open at the start", "ends"],
)
@pytest.mark.parametrize(
    "options", [{}, {"rate": 100.0, "noise": 700.0}, {"noise": 0.0, "quantum": 0.0}], ids=["1 kHz", "100 Hz", "exact"]
)
def test_settled_rests_show_the_vented_pressure(phases, options):
    vented = vented_pressure(recording(*phases, **options))
    assert vented is not None
    assert abs(vented.mean - AMBIENT) < 3.0 * vented.std
    assert 100.0 <= vented.std < 2.5e3


@pytest.mark.parametrize(
    "phases",
    [
        (STROKE, HOLD),
        ((0.5, 3e5, 0.0, 0.0, 0.015), STROKE, HOLD),
        ((0.5, 1.3e5, *CLOSED), STROKE, HOLD),
        ((0.4, decay(3e4, 0.5), *OPEN), STROKE, HOLD),
        (HOLD, DOWN, (0.4, decay(4e4, 0.6), *OPEN), STROKE, HOLD),
        (HOLD, DOWN, (0.1, decay(4e4, 0.03), *OPEN), STROKE, HOLD),
        # a duty cycle within the dead zone does not open the valve
        (HOLD, DOWN, (0.5, decay(4e4, 0.06, AMBIENT + 1e4), 0.0, 0.16, 0.0), STROKE, HOLD),
        (HOLD, DOWN, (0.1, decay(4e4, 0.03, AMBIENT + 5e3), *OPEN), (0.6, AMBIENT + 5e3, *CLOSED), STROKE),
        ((0.4, AMBIENT + 1.2e4, *CLOSED), STROKE, HOLD, DOWN, (0.15, decay(4e4, 0.03), *OPEN)),
        ((0.4, AMBIENT, 0.0, 0.0, 0.01), (0.4, AMBIENT, *CLOSED), (0.05, 3e5, 1.0, 0.0, 0.02)),
    ],
    ids=[
        "no rest", "closed in mid-stroke", "above the prior", "decays at the start", "slow decay", "too short",
        "dead zone", "closed after a stroke", "above a later pressure", "another place",
    ],
)  # fmt: skip
def test_what_is_not_settled_does_not_count(phases):
    assert vented_pressure(recording(*phases)) is None


def test_a_slow_decay_that_the_noise_hides_is_in_the_standard_deviation():
    """At the start nothing shows how fast the chamber vents."""
    for seed in range(20):
        vented = vented_pressure(recording((0.2, decay(2e3, 0.5), *OPEN), STROKE, HOLD, seed=seed))
        assert vented is None or abs(vented.mean - AMBIENT) < 3.0 * vented.std


def test_several_rests_know_it_better_than_one_and_one_that_lies_higher_is_left_out():
    cycle = (STROKE, HOLD, DOWN, VENTING)
    single, many = (vented_pressure(recording(*cycle * count)) for count in (1, 6))
    assert many.std < single.std
    higher = (STROKE, HOLD, DOWN, (0.5, decay(4e4, 0.06, AMBIENT + 2e4), *OPEN))
    with_one = vented_pressure(recording(*cycle * 3, *higher, *cycle * 2))
    assert abs(with_one.mean - AMBIENT) < 3.0 * with_one.std


def test_a_long_rest_counts_by_its_length():
    """4 s at the ambient pressure and 0.4 s at 400 Pa below it: nearer to the long one, at less than half."""
    rests = STROKE, HOLD, DOWN, (4.0, AMBIENT, *OPEN), STROKE, HOLD, DOWN, (0.4, AMBIENT - 400.0, *OPEN)
    below = [AMBIENT - vented_pressure(recording(*rests, noise=500.0, seed=seed)).mean for seed in range(5)]
    assert 0.0 < np.mean(below) < 200.0


def test_columns_of_a_slower_sensor_show_it_too():
    """They have a sample in ten, and none between."""
    log = recording((0.3, AMBIENT, *CLOSED), STROKE, HOLD, DOWN, VENTING)
    every = np.where(np.arange(len(log)) % 10 == 0, 1.0, np.nan)
    vented = vented_pressure(log.with_columns(**{name: log[name] * every for name in ("pressure_a", "position")}))
    assert abs(vented.mean - AMBIENT) < 3.0 * vented.std


def test_a_recording_without_a_needed_column_shows_nothing():
    log = recording(STROKE, HOLD, DOWN, VENTING)
    for name in log.columns:
        assert vented_pressure(log.without(name)) is None
    assert vented_pressure(log.slice(0, 1)) is None


@pytest.mark.parametrize(
    ("metadata", "prior"),
    [
        ({"ambient_Pa": "101300.0"}, ABSOLUTE[:2]),
        ({"ambient_Pa": "95000.0", VENTED_KEY: "95000.0"}, (95e3, OFFSET_PRIOR.std)),
        ({"ambient_Pa": "101300.0", UNIT_KEY: "bar(g)"}, (101300.0, OFFSET_PRIOR.std)),
    ],
    ids=["absolute", "--ambient", "gauge"],
)
def test_before_a_rest_is_seen_the_file_says_what_is_known(metadata, prior):
    assert vented_prior(replace(recording(STROKE), metadata=metadata))[:2] == prior


def test_a_rest_that_contradicts_what_is_known_does_not_count_unless_it_lies_below():
    log = recording((0.3, AMBIENT, *CLOSED), STROKE, HOLD)
    counts = {
        stated: vented_pressure(replace(log, metadata={VENTED_KEY: stated})) for stated in ("90e3", "98e3", "110e3")
    }
    assert [pressure is not None for pressure in counts.values()] == [False, True, True]


#: Metadata of a gauge column, and of an absolute one with and without a stated ambient pressure.
GAUGE, STATED, UNSTATED = {"ambient_Pa": "100000.0", UNIT_KEY: "bar(g)"}, {VENTED_KEY: "100000.0"}, {}
VENTS = ((0.4, AMBIENT, *CLOSED), STROKE, HOLD, DOWN, VENTING)


def with_zero(zero, metadata, phases=VENTS):
    """A recording whose pressure sensor has an error of zero in Pa."""
    log = recording(*phases)
    return replace(log.with_columns(pressure_a=log["pressure_a"] + zero), metadata=metadata)


@pytest.mark.parametrize("phases", [VENTS, VENTS[1:], ((1.0, AMBIENT, *OPEN), STROKE, HOLD)])
@pytest.mark.parametrize("metadata", [GAUGE, STATED])
@pytest.mark.parametrize("zero", [-15e3, 0.0, 4e3, 15e3, 30e3])
def test_a_flat_rest_shows_the_zero_of_the_sensor(zero, metadata, phases):
    log = with_zero(zero, metadata, phases)
    rest = vented_pressure(log)
    assert abs(rest.mean - AMBIENT - zero) < 3.0 * rest.std
    taken, sentence = sensor_zero(log)
    if abs(zero) < 3.0 * OFFSET_PRIOR.std:
        assert (taken, sentence) == (0.0, "")
        assert without_zeros([log]) == [log]
    else:
        assert taken == rest.mean - AMBIENT
        (sound,) = without_zeros([log])
        assert vented_pressure(sound).mean == pytest.approx(AMBIENT)
        assert sensor_zero(sound) == (0.0, "")


@pytest.mark.parametrize(
    ("zero", "metadata", "sentence"),
    [
        (8.5e3, GAUGE, (
            "pressure_a settles at 0.085 bar(g) with the chamber vented: the zero of the sensor is off by +0.085 "
            "bar, which is subtracted."
        )),
        (-2e4, GAUGE, (
            "pressure_a settles at -0.200 bar(g) with the chamber vented: the zero of the sensor is off by -0.200 "
            "bar, which is subtracted."
        )),
        (3e4, STATED, (
            "pressure_a settles at 1.300 bar with the chamber vented, where the ambient pressure is 1 bar: the zero "
            "of the sensor is off by +0.300 bar, which is subtracted."
        )),
        (3e4, UNSTATED, (
            "pressure_a settles at 1.300 bar with the chamber vented, where the ambient pressure is about 1.03 bar: "
            "the zero of the sensor is off by +0.270 bar, which is subtracted."
        )),
        (-2e4, UNSTATED, (
            "pressure_a settles at 0.800 bar with the chamber vented: the reason is altitude, as a calibration "
            "assumes, or the zero of the sensor is off by -0.23 bar; give the ambient pressure with --ambient."
        )),
    ],
    ids=["gauge", "gauge below 0", "--ambient", "above all air", "altitude"],
)  # fmt: skip
def test_a_zero_is_said_in_the_unit_of_the_file(zero, metadata, sentence):
    log = with_zero(zero, metadata)
    exact = np.round(log["pressure_a"] / 1e4) * 1e4 if zero != 8.5e3 else 108500.0 + 0.0 * log["pressure_a"]
    taken, said = sensor_zero(log.with_columns(pressure_a=np.where(log["position"] > 0.0, log["pressure_a"], exact)))
    assert said == sentence
    assert (taken == 0.0) == ("altitude" in sentence)


@pytest.mark.parametrize(
    "phases",
    [
        # trapped air: no later rest has the exhaust valve open, or it lies elsewhere
        ((0.5, AMBIENT + 2e4, *CLOSED), STROKE, HOLD),
        ((0.5, AMBIENT + 2e4, *CLOSED), STROKE, HOLD, (0.1, decay(3e5, 0.05, AMBIENT + 5e4), 0.0, 1.0, 0.01)),
        ((0.5, AMBIENT + 2e4, *CLOSED), STROKE, HOLD, DOWN, (0.5, decay(4e4, 0.06, AMBIENT + 3e4), *OPEN)),
        # it creeps
        ((0.5, decay(4e4, 1.0), *OPEN), STROKE, HOLD),
        ((0.5, AMBIENT + LARGEST_ZERO + 1e4, *OPEN), STROKE, HOLD),
    ],
    ids=["trapped", "closes too early", "another level", "creeps", "too much"],
)
def test_a_chamber_that_is_not_vented_shows_no_zero(phases):
    for metadata in (GAUGE, STATED):
        assert sensor_zero(with_zero(0.0, metadata, phases)) == (0.0, "")


def test_recordings_beside_one_with_a_zero_count_from_their_own_rests_too():
    """That of one sensor may lie on both sides of what is taken for sound."""
    means = {
        zeros: [vented_pressure(log).mean for log in without_zeros([with_zero(zero, GAUGE) for zero in zeros])]
        for zeros in ((8.5e3, 4e3), (3e3, 4e3))
    }
    assert means[8.5e3, 4e3] == [pytest.approx(AMBIENT)] * 2
    assert means[3e3, 4e3] == [vented_pressure(with_zero(zero, GAUGE)).mean for zero in (3e3, 4e3)]
    absolute = with_zero(4e3, UNSTATED)
    assert without_zeros([with_zero(8.5e3, GAUGE), absolute])[1] is absolute

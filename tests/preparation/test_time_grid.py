"""Slow recordings on a finer time grid: what is known of the duty cycles there, and what is not."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.preparation.time_grid import in_clock, interpolated, latched

PERIOD, STEP = 0.01, 2.5e-4
CLOSED = {"duty_supply": 0.0, "duty_exhaust": 0.0}


def slow(duty, step=0.01):
    time = 0.003 + step * np.arange(len(duty))
    return Log(
        time, {"duty_supply": np.array(duty), "duty_exhaust": np.zeros(time.size), "position": 1e-3 * time}, "slow"
    )


def changes(fine):
    return fine.time[1:][np.diff(fine["duty_supply"]) != 0.0]


def test_samples_stay_and_duty_cycles_change_where_periods_start():
    log = slow([0.0, 0.5, 0.8, 0.8])
    fine, open_std = latched(log, PERIOD, 0.2, STEP, CLOSED)
    at = np.searchsorted(fine.time, log.time)
    assert np.array_equal(fine.time[at], log.time)
    assert np.array_equal(fine["position"][at], log["position"])
    assert np.isnan(np.delete(fine["position"], at)).all()
    assert np.diff(fine.time).max() < 1.1 * STEP
    assert changes(fine) == pytest.approx([0.012, 0.022], abs=1e-9), "two tenths of a period after each hundredth"
    assert fine["duty_supply"][-1] == 0.8
    assert np.array_equal(open_std, np.zeros(len(fine) - 1)), "every period has a sample"


def test_a_period_that_starts_with_a_sample_but_for_rounding_starts_there():
    log = slow([0.0, 0.5, 0.8, 0.8])
    for late in (-1e-9, 0.0, 1e-9):
        fine, _ = latched(log, PERIOD, 0.3 + late, PERIOD / 5, CLOSED)
        assert len(fine) == 3 * 5 + 1
        assert changes(fine) == pytest.approx([0.013, 0.023], abs=1e-9)


def test_duty_cycles_change_later_for_a_position_that_is_late():
    fine, _ = latched(slow([0.0, 0.5, 0.8, 0.8]), PERIOD, 0.2, STEP, CLOSED, delay=2e-3)
    assert changes(fine) == pytest.approx([0.014, 0.024], abs=1e-9)


def test_a_period_without_a_sample_has_the_mean_of_its_neighbours_and_an_unknown_opening():
    # samples every second period: the one between has the duty cycle before or that after
    log = slow([0.2, 0.2, 0.6, 0.6, 0.6, 0.6], step=0.02)
    fine, open_std = latched(log, PERIOD, 0.0, STEP, CLOSED)
    numbers = np.floor(fine.time / PERIOD + 1e-9)
    duty = [fine["duty_supply"][numbers == n] for n in range(10)]
    assert [float(values[0]) for values in duty] == pytest.approx([0.2] * 3 + [0.4] + [0.6] * 6)
    assert all(np.ptp(values) == 0.0 for values in duty)
    deviations = [float(np.sqrt(np.sum(open_std[numbers[:-1] == n] ** 2))) for n in range(9)]
    half = 0.5 * 0.4 * PERIOD
    assert deviations == pytest.approx([0, half, 0, half, 0, half, 0, 0, 0]), "also beside a change: it may be another"


def test_messages_with_jitter_stay_in_their_periods():
    # every message is sent 0.1 ms after its period began, and stamped up to 0.5 ms earlier or later
    duty = np.repeat([0.1, 0.5, 0.3, 0.7], 25)
    sent = 1e-4 + PERIOD * np.arange(duty.size)
    stamps = sent + np.random.default_rng(1).uniform(-5e-4, 5e-4, sent.size)
    log = Log(stamps, {"duty_supply": duty, "duty_exhaust": 0.0 * duty, "position": 0.0 * duty}, "slow")
    fine, _ = latched(log, PERIOD, 0.0, STEP, CLOSED)
    inside = (fine.time > sent[0]) & (fine.time < sent[-1])
    true = duty[np.floor(fine.time[inside] / PERIOD + 1e-9).astype(int)]
    assert np.array_equal(fine["duty_supply"][inside], true)


def test_a_period_is_that_by_the_clock_of_messages_that_are_in_step_with_it():
    slow_clock = 0.99995 * 0.01 * np.arange(1000) + np.random.default_rng(2).uniform(0.0, 3e-4, 1000)
    assert [in_clock(period, slow_clock) / period for period in (0.005, 0.01, 0.02)] == pytest.approx(
        [0.99995] * 3, abs=3e-6
    )
    assert in_clock(0.0073, slow_clock) == 0.0073, "of another period it says nothing"
    assert in_clock(0.01, 1.01 * slow_clock) == 0.01, "no quartz is 1 % off"


def test_duty_cycles_that_change_at_any_time_are_interpolated():
    fine, open_std = interpolated(slow([0.0, 0.0, 0.5, 0.5, 0.5, 0.5]), 0.0, 0.005, CLOSED)
    assert fine["duty_supply"] == pytest.approx([0, 0, 0.125, 0.375, *[0.5] * 7]), "the means over each interval"
    over = np.sqrt(np.add.reduceat(open_std**2, np.arange(0, 10, 2)))
    assert over == pytest.approx(np.array([1, 1, 1, 0, 0]) * 0.5 * 0.01 / np.sqrt(12.0))


def test_a_valve_opens_from_the_duty_cycle_at_which_it_is_closed():
    fine, _ = interpolated(slow([0.0, 0.5]), 0.0, 0.005, {**CLOSED, "duty_supply": 0.1})
    assert fine["duty_supply"] == pytest.approx([0.2, 0.4, 0.5])
    fine, _ = interpolated(slow([0.0, 0.05]), 0.0, 0.005, {**CLOSED, "duty_supply": 0.1})
    assert fine["duty_supply"] == pytest.approx([0.0, 0.0, 0.05])


def test_into_a_hole_in_time_no_samples_are_put():
    log = slow([0.0] * 20)
    gone = replace(log, time=np.where(np.arange(20) < 10, log.time, log.time + 0.5))
    fine, open_std = latched(gone, PERIOD, 0.0, STEP, CLOSED)
    inside = np.concatenate(
        [part.time for part in (latched(gone.slice(*at), PERIOD, 0.0, STEP, CLOSED)[0] for at in ((0, 10), (10, 20)))]
    )
    assert fine.time == pytest.approx(inside)
    assert open_std.size == len(fine) - 1
    assert np.diff(fine.time).max() == pytest.approx(0.51)


def test_duty_cycles_of_messages_of_their_own_are_used_where_they_were_sent():
    log = slow([0.0, 0.0, 0.5, 0.5, 0.5, 0.5])
    sent = {name: (log.time - 0.005, log[name]) for name in CLOSED}
    fine, open_std = interpolated(replace(log, edges=sent), 0.0, 0.005, CLOSED)
    early, _ = interpolated(log, 0.0, 0.005, CLOSED)
    assert fine["duty_supply"][:-1] == pytest.approx(early["duty_supply"][1:])
    assert fine.time[np.flatnonzero(open_std)[[0, -1]]] == pytest.approx([0.003, 0.023]), "until 5 ms later at most"
    whole, _ = latched(replace(log, edges=sent), PERIOD, 0.9, STEP, CLOSED)
    assert changes(whole) == pytest.approx([0.009], abs=STEP), "sent at 18 ms, in the period from 9 to 19 ms"


def test_a_duty_cycle_that_is_missing_stays_missing():
    log = slow([0.2, 0.2, np.nan, 0.2, 0.2])
    sent = {name: (log.time - 0.005, np.nan_to_num(log[name])) for name in CLOSED}
    for recording in (log, replace(log, edges=sent)):
        fine, _ = interpolated(recording, 0.0, 0.005, CLOSED)
        assert np.isnan(fine["duty_supply"][(fine.time > 0.0229) & (fine.time < 0.0329)]).all()


@pytest.mark.parametrize(
    "finer", [lambda log: latched(log, PERIOD, 0.2, STEP, CLOSED), lambda log: interpolated(log, 1e-3, STEP, CLOSED)]
)
def test_the_warnings_of_the_recording_stay(finer):
    log = replace(slow([0.0, 0.5, 0.8, 0.8]), warnings=("slow: the position is coarse.",))
    assert finer(log)[0].warnings == log.warnings

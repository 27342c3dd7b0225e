"""Stamps as loggers leave them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.log import HOLE
from clutchid.measurements.clock import AT_START, Tolerance, matched, moved, repair, runs_of, steadied
from clutchid.measurements.source import Places
from clutchid.model import Actuator
from clutchid.observer.intake import BRIDGED
from clutchid.strokes.values import limits


@given(st.lists(st.integers(0, 40), min_size=1, max_size=80), st.lists(st.integers(0, 80), max_size=4))
def test_mended_stamps_grow_whatever_the_blocks(ticks, cuts):
    time = np.array(ticks) / 10
    edges = [0, *sorted(cut % (time.size + 1) for cut in cuts), time.size]
    clock, times = AT_START, []
    for a, b in pairwise(edges):
        repaired = repair(time[a:b], Places(first=a + 1), clock)
        clock = repaired.clock
        assert repaired.rows.size == repaired.time.size
        times.append(repaired.time)
    assert np.all(np.diff(np.concatenate(times)) > 0)


@given(st.lists(st.floats(1e-3, 10), min_size=1, max_size=50))
def test_stamps_that_grow_are_left_alone(steps):
    time = np.cumsum(steps)
    repaired = repair(time, Places())
    assert np.array_equal(repaired.time, time)
    assert repaired.messages == ()


def test_two_runs_in_one_file_are_put_apart_and_told():
    run = np.arange(100) / 100
    repaired = repair(np.r_[run, run, run], Places("line", 2))
    assert repaired.rows.tolist() == list(range(3 * run.size))
    assert np.flatnonzero(np.diff(repaired.time) > 0.05).tolist() == [99, 199]
    assert repaired.messages == (
        "the clock restarts at line 102 (0 s after 0.99 s), line 202 (0 s after 0.99 s); "
        "each run becomes a separate segment, 0.2 s after the previous one.",
    )
    again = repair(run, Places("line", 302), repaired.clock)
    assert again.time[0] == pytest.approx(repaired.time[-1] + 0.2)


@pytest.mark.parametrize("usual", [1e-4, 1e-3, 0.01, 0.1])
@pytest.mark.parametrize("shared", [False, True])
def test_a_run_after_a_restart_lies_behind_what_all_call_a_hole(usual, shared):
    run = usual * np.arange(9000)
    time = repair(np.r_[run, run], Places(), shared=shared).time
    gap = time[9000] - time[8999]
    assert gap > 1.5 * max(HOLE * usual, 1e-6 * BRIDGED + usual)
    assert gap > 1.5 * limits(Actuator(), "position", usual).gap  # over which a step is judged


def test_repeats_late_samples_and_samples_without_a_stamp_are_reported_and_dropped():
    time = np.array([0.0, 0.1, 0.2, 0.2, 0.3, 0.25, np.nan, 0.4])
    repaired = repair(time, Places())
    assert repaired.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert repaired.rows.tolist() == [0, 1, 3, 4, 7]
    assert repaired.messages == (
        "samples with the time stamp of an earlier one replace it: 1 (row 4).",
        "samples out of order in time are dropped: 1 (row 6).",
        "samples without a time stamp are dropped: 1 (row 7).",
    )


def test_where_the_newest_sample_comes_first_it_alone_is_left():
    assert repair(np.arange(30, 0, -1) * 0.1, Places()).time.tolist() == [3.0]


RUN = np.arange(1000) * 0.01


def repaired(stamps):
    result = repair(np.asarray(stamps), Places())
    return result.time, result.messages


@pytest.mark.parametrize("ahead", [6.0, -6.0, 4e9, -0.5])
@pytest.mark.parametrize("rows", [[500], [500, 501], [200, 700]])
def test_one_or_two_stamps_far_from_those_around_them_are_left_out(ahead, rows):
    stamps = RUN + 7.0
    stamps[rows] += ahead
    result = repair(stamps, Places())
    assert np.array_equal(result.rows, np.delete(np.arange(1000), rows))
    assert np.array_equal(result.time, np.delete(RUN + 7.0, rows))
    assert any("left out" in sentence for sentence in result.messages)


def test_a_hole_is_no_jump():
    stamps = RUN + 3600.0 * (np.arange(1000) >= 400)
    time, messages = repaired(stamps)
    assert np.array_equal(time, stamps)
    assert messages == ()


@pytest.mark.parametrize("size", [3, 16, 40])
@pytest.mark.parametrize("tick", [0.0, 2e-6])
def test_bursts_get_the_mean_rate(size, tick):
    number = np.arange(4000)
    stamps = 1e-3 * size * (number // size) + tick * (number % size)
    time, (sentence,) = repaired(stamps)
    assert time.size == 4000
    assert np.allclose(np.diff(time), 1e-3, rtol=1e-3, atol=0)
    assert f"bursts of {size}" in sentence


@pytest.mark.parametrize("gap", [0.05, 0.2, 5.0, -2.0])
def test_bursts_go_on_behind_a_gap_or_a_restart(gap):
    number = np.arange(4000)
    stamps = 0.01 * (number // 5) + gap * (number >= 2003)
    time, messages = repaired(stamps)
    assert time.size == 4000
    assert any("bursts of 5" in sentence for sentence in messages)
    steps = np.diff(time)
    assert np.allclose(np.delete(steps, 2002), 2e-3, rtol=1e-3, atol=0)
    assert steps[2002] > 0.03


@pytest.mark.parametrize("slower", [6, 7, 20])
def test_a_rate_that_changes_is_no_burst(slower):
    stamps = np.r_[np.arange(750) * 0.002, 1.5 + np.arange(200) * 0.002 * slower]
    time, messages = repaired(stamps)
    assert np.array_equal(time, stamps)
    assert messages == ()


@given(st.lists(st.integers(5, 60), max_size=6))
def test_groups_without_a_common_order_share_one_shift(lengths):
    fast, slow = [np.arange(60) * 0.01], [np.arange(12) * 0.05 + 0.002]
    for length in lengths:
        fast.append(np.arange(10 * length) * 0.01)
        slow.append(np.arange(2 * length) * 0.05 + 0.002)
    tolerances = [Tolerance.of(0.01), Tolerance.of(0.05)]
    clocks = [
        runs_of(np.arange(stamps.size), stamps, -np.inf, tolerance)
        for stamps, tolerance in zip(map(np.concatenate, (fast, slow)), tolerances, strict=True)
    ]
    shifts, _, problem = matched(clocks, tolerances)
    assert problem == ""
    begins = [np.cumsum([0, *(run.size for run in group)])[:-1] for group in (fast, slow)]
    times = [
        moved(np.concatenate(group), 0, runs, steps)
        for group, runs, steps in zip((fast, slow), clocks, shifts, strict=True)
    ]
    first = [time[begin] for time, begin in zip(times, begins, strict=True)]
    assert np.allclose(first[1] - first[0], 0.002, rtol=0, atol=1e-9)
    assert all(np.all(np.diff(time) > 0) for time in times)


def test_bursts_that_are_delivered_together_after_a_stall_are_no_gap():
    at = np.repeat(np.arange(1, 201) * 16e-3, 16) + np.tile(np.arange(16) * 1e-6, 200)
    held = slice(100 * 16, 104 * 16)
    at[held] = 104 * 16e-3 + np.arange(64) * 1e-6
    steady = steadied(at)
    assert steady is not None
    np.testing.assert_allclose(np.diff(steady[0]), 1e-3, rtol=1e-2)

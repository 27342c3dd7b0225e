"""Stamps as loggers leave them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.measurements.source import Places
from clutchid.measurements.time_axis import AT_START, repair


@given(st.lists(st.integers(0, 40), min_size=1, max_size=80), st.lists(st.integers(0, 80), max_size=4))
def test_mended_stamps_grow_whatever_the_blocks(ticks, cuts):
    time = np.array(ticks) / 10
    edges = [0, *sorted(cut % (time.size + 1) for cut in cuts), time.size]
    clock, found = AT_START, []
    for a, b in pairwise(edges):
        repaired = repair(time[a:b], Places(first=a + 1), clock)
        clock = repaired.clock
        assert repaired.kept.size == repaired.time.size
        found.append(repaired.time)
    assert np.all(np.diff(np.concatenate(found)) > 0)


@given(st.lists(st.floats(1e-3, 10), min_size=1, max_size=50))
def test_stamps_that_grow_are_left_alone(steps):
    time = np.cumsum(steps)
    repaired = repair(time, Places())
    assert np.array_equal(repaired.time, time)
    assert repaired.messages == ()


def test_two_runs_in_one_file_are_put_apart_and_told():
    run = np.arange(100) / 100
    repaired = repair(np.r_[run, run, run], Places("line", 2))
    assert repaired.kept.tolist() == list(range(3 * run.size))
    assert np.flatnonzero(np.diff(repaired.time) > 0.05).tolist() == [99, 199]
    assert repaired.messages == (
        "the clock restarts at line 102 (0 s after 0.99 s), line 202 (0 s after 0.99 s); "
        "each run becomes a separate segment, 0.2 s after the previous one.",
    )
    again = repair(run, Places("line", 302), repaired.clock)
    assert again.time[0] == pytest.approx(repaired.time[-1] + 0.2)


def test_repeats_late_samples_and_samples_without_a_stamp_are_reported_and_dropped():
    time = np.array([0.0, 0.1, 0.2, 0.2, 0.3, 0.25, np.nan, 0.4])
    repaired = repair(time, Places())
    assert repaired.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert repaired.kept.tolist() == [0, 1, 3, 4, 7]
    assert repaired.messages == (
        "1 sample repeats the time stamp of another (row 4); the later one is kept.",
        "1 sample out of order in time (row 6) is dropped.",
        "1 sample without a time stamp (row 7) is dropped.",
    )


def test_a_block_of_nothing_changes_nothing():
    first = repair(np.arange(5.0), Places())
    empty = repair(np.empty(0), Places(), first.clock)
    assert empty.time.size == 0
    assert empty.clock == first.clock

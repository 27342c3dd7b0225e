"""Stamps as loggers leave them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.io.clock import mend
from clutchid.io.table import Places


@given(st.lists(st.integers(0, 40), min_size=1, max_size=80), st.lists(st.integers(0, 80), max_size=4))
def test_mended_stamps_grow_whatever_the_blocks(ticks, cuts):
    time = np.array(ticks) / 10
    edges = [0, *sorted(cut % (time.size + 1) for cut in cuts), time.size]
    clock, found = None, []
    for a, b in pairwise(edges):
        mended = mend(time[a:b], Places(first=a + 1), clock)
        clock = mended.clock
        assert mended.kept.sum() == mended.time.size
        found.append(mended.time)
    assert np.all(np.diff(np.concatenate(found)) > 0)


@given(st.lists(st.floats(1e-3, 10), min_size=1, max_size=50))
def test_stamps_that_grow_are_left_alone(steps):
    time = np.cumsum(steps)
    mended = mend(time, Places())
    assert np.array_equal(mended.time, time)
    assert mended.told == ()


def test_two_runs_in_one_file_are_put_apart_and_told():
    run = np.arange(100) / 100
    mended = mend(np.r_[run, run, run], Places("line", 2))
    assert mended.kept.all()
    assert np.flatnonzero(np.diff(mended.time) > 0.05).tolist() == [99, 199]
    assert mended.told == (
        "the clock starts again at line 102 (0 s after 0.99 s), line 202 (0 s after 0.99 s); "
        "each run is a segment of its own, 0.2 s behind the one before.",
    )
    again = mend(run, Places("line", 302), mended.clock)
    assert again.time[0] == pytest.approx(mended.time[-1] + 0.2)


def test_repeats_late_samples_and_samples_without_a_stamp_are_told_and_left_out():
    time = np.array([0.0, 0.1, 0.2, 0.2, 0.3, 0.25, np.nan, 0.4])
    mended = mend(time, Places())
    assert mended.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert mended.kept.tolist() == [True, True, False, True, True, False, False, True]
    assert mended.told == (
        "1 sample repeats the stamp of another (row 4); the later one is kept.",
        "1 sample out of order in time (row 6) is left out.",
        "1 sample without a stamp (row 7) is left out.",
    )


def test_a_block_of_nothing_changes_nothing():
    first = mend(np.arange(5.0), Places())
    empty = mend(np.empty(0), Places(), first.clock)
    assert empty.time.size == 0
    assert empty.clock == first.clock

"""Bins: medians over what is finite, what stands where nothing is, and which valve is closed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.recordings.strokes.rest_level import RestLevel, raw_bins, relative_to_rest, samples_in_bin
from clutchid.recordings.strokes.stream import Samples


def samples(position, first: int = 0, **columns) -> Samples:
    position = np.array(position, dtype=float)
    time = (first + np.arange(position.size)) * 1e-3
    return Samples(first, time, {"position": position, **{k: np.array(v, float) for k, v in columns.items()}})


@given(st.lists(st.sampled_from([1.0, 2.0, 4.0, 8.0, 16.0, float("nan")]), min_size=1, max_size=40), st.integers(1, 12))
def test_the_position_of_a_bin_is_the_median_of_what_is_finite_in_it(values, width):
    found = raw_bins(samples(values), width, np.nan)
    for number, first in enumerate(range(0, len(values), width)):
        part = np.array(values[first : first + width])
        known = part[np.isfinite(part)]
        expected = np.median(known) if known.size else np.nan
        np.testing.assert_equal(found.position[number], expected)
        assert (found.first[number], found.count[number]) == (first, part.size)


def test_of_an_even_number_of_samples_the_median_is_halfway_between_the_middle_two():
    assert raw_bins(samples([0.0, 1.0, 3.0, 9.0]), 4, np.nan).position.tolist() == [2.0]
    assert raw_bins(samples([0.0, np.nan, 3.0, np.inf]), 4, np.nan).position.tolist() == [1.5]


def test_where_no_position_is_known_the_last_known_one_stands_and_at_the_beginning_the_first():
    gone = [np.nan, np.nan]
    bins = raw_bins(samples([*gone, 1.0, 1.0, *gone, *gone, 2.0, 2.0, *gone]), 2, np.nan)
    np.testing.assert_array_equal(bins.position, [np.nan, 1, np.nan, np.nan, 2, np.nan])
    assert bins.filled.tolist() == [1, 1, 1, 1, 2, 2]
    assert raw_bins(samples([*gone, 1.0, 1.0]), 2, 7.0).filled.tolist() == [7, 1]
    assert raw_bins(samples(gone), 2, 7.0).filled.tolist() == [7]


def test_the_supply_is_closed_in_a_bin_where_no_sample_opens_it():
    supply = [0.0, 0.02, 0.0, 0.021, 0.0, 0.0]
    assert raw_bins(samples(np.zeros(6), duty_supply=supply), 2, np.nan).closed.tolist() == [True, False, True]
    assert raw_bins(samples(np.zeros(6)), 2, np.nan).closed.all()


def test_bins_are_numbered_and_timed_as_the_samples_of_the_recording():
    bins = raw_bins(samples(np.zeros(25), first=100, pressure_a=np.arange(25)), 10, np.nan)
    assert bins.first.tolist() == [100, 110, 120]
    assert bins.time.tolist() == [0.1, 0.11, 0.12]
    assert bins.count.tolist() == [10, 10, 5]
    assert bins.pressure.tolist() == [4.5, 14.5, 22.0]


@pytest.mark.parametrize(("interval", "expected"), [(1e-3, 10), (1e-4, 100), (0.01, 1), (0.1, 1), (7e-3, 1), (0.0, 1)])
def test_a_bin_is_ten_milliseconds_or_one_sample(interval, expected):
    assert samples_in_bin(interval) == expected


def test_a_bin_is_at_rest_within_the_band_on_either_side_of_the_level_and_still_where_it_creeps_no_more():
    known = RestLevel(level=1e-3, reach=20e-3, noise=0.0, quantum=0.0)
    assert (known.band, known.creep) == (0.4e-3, 0.2e-3)
    steps = [0.55e-3, 0.65e-3, 1e-3, 1.35e-3, 1.45e-3]
    found = relative_to_rest(raw_bins(samples(np.repeat(steps, 30)), 10, np.nan), known, 3)
    assert found.inside.tolist() == np.repeat([False, True, True, True, False], 3).tolist()
    assert found.still.tolist() == [
        *(True, True, True),  # 0.1 mm to the next level
        *(True, True, False),  # 0.35 mm
        *(False, True, False),
        *(False, True, True),
        *(True, True, True),
    ]

"""Bins of samples, and what is learnt of the rest, the noise and the reach, block by block."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.strokes.rest_level import (
    RestLevel,
    quantum_of,
    raw_bins,
    relative_to_rest,
    samples_in_bin,
    updated_levels,
    windows_of,
)
from clutchid.strokes.stream import StrokeSamples
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_rest_level")

WIDTH = 15
REACH = 22e-3


def block(reach: float = REACH, zero: float = 0.0, noise: float = 2e-5, seed: int = 0, strokes: int = 6) -> np.ndarray:
    """Bins of 10 ms of strokes of 1 s with rests of 3 s between them."""
    t = np.arange(400 * strokes) * 0.01 % 4.0
    y = np.interp(t, [0.0, 2.0, 2.15, 2.8, 3.0], [0.0, 0.0, reach, reach, 0.0])
    return y + zero + noise * np.random.default_rng(seed).standard_normal(t.size)


def after(before: RestLevel | None, position: np.ndarray) -> RestLevel:
    return updated_levels(before, position, np.ones(position.size, dtype=bool), WIDTH, 0.0)


def test_the_first_block_tells_level_and_reach():
    level = after(None, block(zero=3e-3))
    # medians of hundreds of bins; the reach adds the largest of some hundred deviations, 3 to 4 of the noise
    assert level.level == pytest.approx(3e-3, abs=5e-6)
    assert level.reach == pytest.approx(REACH, abs=1e-4)
    # the range of 15 samples of white noise is 3.5 standard deviations, the calmest tenth has less
    assert 2 * 2e-5 < level.noise < 3.5 * 2e-5


def test_an_outlying_reach_fades_by_a_fiftieth_of_what_it_is_too_much_with_every_block_that_moves():
    level = after(None, block())
    level = RestLevel(level.level, 2 * REACH, level.noise, 0.0)
    for number in range(1, 20):
        level = after(level, block(seed=number))
        # each block sees the reach but for the noise of its highest bin
        assert level.reach == pytest.approx(REACH + 0.98**number * REACH, abs=1e-4)


def test_a_longer_reach_counts_at_once_and_a_rest_forgets_none():
    level = after(None, block(reach=10e-3))
    longer = after(level, block(reach=20e-3))
    assert longer.reach == pytest.approx(20e-3, abs=1e-4)
    still = after(longer, 2e-5 * np.random.default_rng(1).standard_normal(2000))
    assert still.reach == longer.reach


def test_a_block_that_never_moves_has_no_reach():
    assert np.isnan(after(None, 2e-5 * np.random.default_rng(0).standard_normal(2000)).reach)


def test_a_few_bins_teach_nothing():
    level = after(None, block())
    assert after(level, block(zero=5e-3)[: 4 * WIDTH - 1]) is level


def test_the_noise_grows_and_shrinks_by_a_quarter_with_a_block_at_most():
    level = after(None, block())
    loud, quiet = after(level, block(noise=4e-4)), after(level, block(noise=0.0))
    assert loud.noise == pytest.approx(1.25 * level.noise, rel=1e-12)
    assert quiet.noise == pytest.approx(level.noise / 1.25, rel=1e-12)


def test_a_rest_below_the_level_is_the_new_level_and_one_above_only_after_three_blocks_without_the_old_one():
    level = after(None, block(zero=3e-3))
    assert after(level, block(zero=1e-3)).level == pytest.approx(1e-3, abs=5e-6)
    levels, lost = [], []
    for _ in range(5):
        level = after(level, block(zero=5e-3))
        levels.append(level.level)
        lost.append(level.lost)
    assert lost == [1, 2, 3, 0, 0]
    assert levels == pytest.approx([3e-3] * 3 + [5e-3] * 2, abs=5e-6)


def test_blocks_without_any_rest_count_as_lost_where_the_piston_moves():
    level = after(None, block())
    turning = 0.5 * REACH * (1 - np.cos(2 * np.pi * np.arange(2400) * 0.01))
    for lost in (1, 2):
        level = after(level, turning)
        assert (level.level, level.lost) == (pytest.approx(0.0, abs=5e-6), lost)


def test_a_piston_that_stands_at_its_far_end_alone_has_its_rest_where_it_turns_around():
    t = np.arange(2400) * 0.01 % 2.0
    y = np.interp(t, [0.0, 1.0, 1.5, 2.0], [REACH, REACH, 0.0, REACH])
    level = after(None, y + 2e-5 * np.random.default_rng(0).standard_normal(t.size))
    # the lowest bin, and its noise
    assert level.level == pytest.approx(0.0, abs=1e-4)


def test_a_level_that_drifts_within_the_band_is_followed():
    level = after(None, block())
    for zero in (0.2e-3, 0.4e-3, 0.6e-3):
        level = after(level, block(zero=zero))
        assert level.level == pytest.approx(zero, abs=5e-6)


def test_a_rest_while_the_supply_is_open_is_no_vented_one():
    position = block(zero=3e-3)
    level = updated_levels(None, position, np.zeros(position.size, dtype=bool), WIDTH, 0.0)
    assert level.level == position.min()


@pytest.mark.parametrize(
    ("reach", "noise", "quantum", "width", "value"),
    CASES["bands"],
)
def test_the_band_of_the_rest_is_as_wide_as_noise_quantum_or_reach_need(reach, noise, quantum, width, value):
    assert getattr(RestLevel(0.0, reach, noise, quantum), width) == pytest.approx(value, rel=1e-12)


def test_the_quantum_is_the_smallest_change_that_is_no_rounding():
    steps = np.array([0.0, 2e-5, 6e-5, 6e-5 + 1e-17, np.nan, 1e-4])
    assert quantum_of(steps) == pytest.approx(2e-5)
    assert quantum_of(np.full(10, 3e-3)) == 0.0


@pytest.mark.parametrize(("seconds", "bins"), [(0.01, 15), (0.05, 3), (0.1, 3)])
def test_still_means_for_0_15_s_and_three_bins_at_least(seconds, bins):
    assert windows_of(seconds) == bins


def samples(position, first: int = 0, **columns) -> StrokeSamples:
    position = np.array(position, dtype=float)
    time = (first + np.arange(position.size)) * 1e-3
    return StrokeSamples(first, time, {"position": position, **{k: np.array(v, float) for k, v in columns.items()}})


@given(st.lists(st.sampled_from([1.0, 2.0, 4.0, 8.0, 16.0, float("nan")]), min_size=1, max_size=40), st.integers(1, 12))
def test_the_position_of_a_bin_is_the_median_of_what_is_finite_in_it(values, width):
    bins = raw_bins(samples(values), width, np.nan)
    for number, first in enumerate(range(0, len(values), width)):
        part = np.array(values[first : first + width])
        finite = part[np.isfinite(part)]
        expected = np.median(finite) if finite.size else np.nan
        np.testing.assert_equal(bins.position[number], expected)
        assert (bins.first[number], bins.count[number]) == (first, part.size)


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
    level = RestLevel(level=1e-3, reach=20e-3, noise=0.0, quantum=0.0)
    assert (level.band, level.creep) == (0.4e-3, 0.2e-3)
    steps = [0.55e-3, 0.65e-3, 1e-3, 1.35e-3, 1.45e-3]
    at_rest = relative_to_rest(raw_bins(samples(np.repeat(steps, 30)), 10, np.nan), level, 3)
    assert at_rest.inside.tolist() == np.repeat([False, True, True, True, False], 3).tolist()
    # the steps are 0.1, 0.35, 0.35 and 0.1 mm high
    moving = [(1, 2), (2, 0), (2, 2), (3, 0)]
    assert [(i // 3, i % 3) for i in np.flatnonzero(~at_rest.still)] == moving

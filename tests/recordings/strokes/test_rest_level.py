"""What is learnt of the rest, the noise and the reach, block by block."""

import numpy as np
import pytest

from clutchid.recordings.strokes.rest_level import RestLevel, quantum_of, updated, windows_of

WIDTH = 15
REACH = 22e-3


def block(reach: float = REACH, zero: float = 0.0, noise: float = 2e-5, seed: int = 0, strokes: int = 6) -> np.ndarray:
    """Bins of 10 ms of strokes of 1 s with rests of 3 s between them."""
    t = np.arange(400 * strokes) * 0.01 % 4.0
    y = np.interp(t, [0.0, 2.0, 2.15, 2.8, 3.0], [0.0, 0.0, reach, reach, 0.0])
    return y + zero + noise * np.random.default_rng(seed).standard_normal(t.size)


def after(before: RestLevel | None, position: np.ndarray) -> RestLevel:
    return updated(before, position, np.ones(position.size, dtype=bool), WIDTH, 0.0)


def test_the_first_block_tells_level_and_reach():
    found = after(None, block(zero=3e-3))
    # medians of hundreds of bins; the reach adds the largest of some hundred deviations, 3 to 4 of the noise
    assert found.level == pytest.approx(3e-3, abs=5e-6)
    assert found.reach == pytest.approx(REACH, abs=1e-4)
    # the range of 15 samples of white noise is 3.5 standard deviations, the calmest tenth has less
    assert 2 * 2e-5 < found.noise < 3.5 * 2e-5


def test_an_outlying_reach_fades_by_a_fiftieth_of_what_it_is_too_much_with_every_block_that_moves():
    known = after(None, block())
    known = RestLevel(known.level, 2 * REACH, known.noise, 0.0)
    for number in range(1, 20):
        known = after(known, block(seed=number))
        # each block sees the reach but for the noise of its highest bin
        assert known.reach == pytest.approx(REACH + 0.98**number * REACH, abs=1e-4)


def test_a_longer_reach_counts_at_once_and_a_rest_forgets_none():
    known = after(None, block(reach=10e-3))
    longer = after(known, block(reach=20e-3))
    assert longer.reach == pytest.approx(20e-3, abs=1e-4)
    still = after(longer, 2e-5 * np.random.default_rng(1).standard_normal(2000))
    assert still.reach == longer.reach


def test_a_block_that_never_moves_has_no_reach():
    assert np.isnan(after(None, 2e-5 * np.random.default_rng(0).standard_normal(2000)).reach)


def test_a_few_bins_teach_nothing():
    known = after(None, block())
    assert after(known, block(zero=5e-3)[: 4 * WIDTH - 1]) is known


def test_the_noise_grows_and_shrinks_by_a_quarter_with_a_block_at_most():
    known = after(None, block())
    loud, quiet = after(known, block(noise=4e-4)), after(known, block(noise=0.0))
    assert loud.noise == pytest.approx(1.25 * known.noise, rel=1e-12)
    assert quiet.noise == pytest.approx(known.noise / 1.25, rel=1e-12)


def test_a_rest_below_the_level_is_the_new_level_and_one_above_only_after_three_blocks_without_the_old_one():
    known = after(None, block(zero=3e-3))
    assert after(known, block(zero=1e-3)).level == pytest.approx(1e-3, abs=5e-6)
    levels, lost = [], []
    for _ in range(5):
        known = after(known, block(zero=5e-3))
        levels.append(known.level)
        lost.append(known.lost)
    assert lost == [1, 2, 3, 0, 0]
    assert levels == pytest.approx([3e-3] * 3 + [5e-3] * 2, abs=5e-6)


def test_blocks_without_any_rest_count_as_lost_where_the_piston_moves():
    known = after(None, block())
    turning = 0.5 * REACH * (1 - np.cos(2 * np.pi * np.arange(2400) * 0.01))
    for lost in (1, 2):
        known = after(known, turning)
        assert (known.level, known.lost) == (pytest.approx(0.0, abs=5e-6), lost)


def test_a_piston_that_stands_at_its_far_end_alone_has_its_rest_where_it_turns_around():
    t = np.arange(2400) * 0.01 % 2.0
    y = np.interp(t, [0.0, 1.0, 1.5, 2.0], [REACH, REACH, 0.0, REACH])
    found = after(None, y + 2e-5 * np.random.default_rng(0).standard_normal(t.size))
    # the lowest bin, and its noise
    assert found.level == pytest.approx(0.0, abs=1e-4)


def test_a_level_that_drifts_within_the_band_is_followed():
    known = after(None, block())
    for zero in (0.2e-3, 0.4e-3, 0.6e-3):
        known = after(known, block(zero=zero))
        assert known.level == pytest.approx(zero, abs=5e-6)


def test_a_rest_while_the_supply_is_open_is_no_vented_one():
    position = block(zero=3e-3)
    found = updated(None, position, np.zeros(position.size, dtype=bool), WIDTH, 0.0)
    assert found.level == position.min()


def test_the_band_of_the_rest_is_as_wide_as_noise_quantum_or_reach_need():
    assert RestLevel(0.0, np.nan, 1e-4, 0.0).band == pytest.approx(2e-4, rel=1e-12)
    assert RestLevel(0.0, 1e-3, 1e-6, 1e-4).band == pytest.approx(1.5e-4, rel=1e-12)
    assert RestLevel(0.0, 20e-3, 1e-6, 1e-6).band == pytest.approx(4e-4, rel=1e-12)
    assert RestLevel(0.0, 20e-3, 1e-6, 1e-6).near == pytest.approx(1.2e-6, rel=1e-12)
    assert RestLevel(0.0, 20e-3, 1e-7, 1e-6).near == pytest.approx(1.01e-6, rel=1e-12)
    assert RestLevel(0.0, np.nan, 1e-4, 0.0).near == pytest.approx(1.2e-4, rel=1e-12)
    assert RestLevel(0.0, 20e-3, 1e-6, 1e-6).creep == pytest.approx(2e-4, rel=1e-12)
    assert RestLevel(0.0, np.nan, 1e-6, 1e-4).creep == pytest.approx(2e-4, rel=1e-12)


def test_the_quantum_is_the_smallest_change_that_is_no_rounding():
    steps = np.array([0.0, 2e-5, 6e-5, 6e-5 + 1e-17, np.nan, 1e-4])
    assert quantum_of(steps) == pytest.approx(2e-5)
    assert quantum_of(np.full(10, 3e-3)) == 0.0


@pytest.mark.parametrize(("seconds", "bins"), [(0.01, 15), (0.05, 3), (0.1, 3)])
def test_still_means_for_0_15_s_and_three_bins_at_least(seconds, bins):
    assert windows_of(seconds) == bins

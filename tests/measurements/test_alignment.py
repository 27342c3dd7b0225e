"""Channels with stamps of their own on one raster: held or interpolated, nothing across a hole, in any blocks."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from clutchid.measurements.time_axis import ChannelStream, SampleBlock, align, aligned

stamps = st.lists(st.integers(0, 400), min_size=1, max_size=60, unique=True).map(lambda t: np.array(sorted(t)) / 100)


@given(stamps, stamps, st.booleans(), st.floats(0.01, 3))
def test_nothing_is_known_further_from_a_sample_than_it_may_stand(at, time, hold, longest):
    values = align(at, time, np.ones(time.size), longest, hold=hold)
    before = np.array([at[i] - time[time <= at[i]].max() if (time <= at[i]).any() else np.inf for i in range(at.size)])
    after = np.array([time[time >= at[i]].min() - at[i] if (time >= at[i]).any() else np.inf for i in range(at.size)])
    allowed = before <= longest if hold else (before + after <= longest) | (before == 0)
    assert np.array_equal(np.isfinite(values), allowed)


@given(stamps, st.floats(-3, 3), st.floats(-3, 3))
def test_a_straight_line_is_interpolated_without_error(time, slope, level):
    at = np.linspace(time[0], time[-1], 37)
    values = align(at, time, level + slope * time, np.inf, hold=False)
    assert np.allclose(values, level + slope * at, rtol=0, atol=1e-12)


def test_a_missing_sample_is_not_bridged():
    time, values = np.arange(5.0), np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    between = align(np.array([0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5]), time, values, 9.0, hold=False)
    assert np.array_equal(between, [0.5, 1.0, np.nan, np.nan, np.nan, 3.0, 3.5], equal_nan=True)
    held = align(np.array([1.5, 2.5, 3.5]), time, values, 9.0, hold=True)
    assert np.array_equal(held, [1.0, np.nan, 3.0], equal_nan=True)


def blocks(time, columns, cuts):
    edges = [0, *sorted(cut % (time.size + 1) for cut in cuts), time.size]
    for a, b in pairwise(edges):
        yield SampleBlock(time[a:b], {name: values[a:b] for name, values in columns.items()})


@given(stamps, stamps, st.lists(st.integers(0, 99), max_size=5), st.lists(st.integers(0, 99), max_size=5))
def test_blocks_give_what_the_whole_gives(base, time, base_cuts, cuts):
    own = {"pressure_a": np.cos(base)}
    other = {"position": np.sin(time), "duty_supply": np.floor(time)}
    longest = {"position": 0.4, "duty_supply": 0.7}
    followers = [ChannelStream(blocks(time, other, cuts), longest)]
    aligned_blocks = [
        block for block, _ in aligned(ChannelStream(blocks(base, own, base_cuts), {"pressure_a": 1.0}), followers)
    ]
    joined = {
        name: np.concatenate([block.columns[name] for block in aligned_blocks]) for name in aligned_blocks[0].columns
    }
    assert np.array_equal(np.concatenate([block.time for block in aligned_blocks]), base)
    assert np.array_equal(joined["pressure_a"], own["pressure_a"])
    for name, hold in (("position", False), ("duty_supply", True)):
        whole = align(base, time, other[name], longest[name], hold=hold)
        assert np.array_equal(joined[name], whole, equal_nan=True)


def test_samples_of_an_input_with_time_stamps_of_its_own_are_kept_as_edges():
    base, own = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.5, 1.5, 2.5, 3.5])
    duty = {"duty_supply": np.array([0.1, 0.2, 0.3, 0.4])}

    def found(stamps, cuts=()):
        others = [ChannelStream(blocks(stamps, duty, cuts), {"duty_supply": 9.0})]
        return list(aligned(ChannelStream(blocks(base, {"position": base}, cuts), {"position": 9.0}), others))

    [((_, columns), edges)] = found(own)
    assert np.array_equal(columns["duty_supply"], [np.nan, 0.1, 0.2, 0.3], equal_nan=True)
    assert [list(part) for part in edges["duty_supply"]] == [[0.5, 1.5, 2.5], [0.1, 0.2, 0.3]]
    assert found(base)[0][1] == {}, "on the grid of the position nothing is late"
    _, (_, later) = found(own, (2,))
    assert [list(part) for part in later["duty_supply"]] == [[0.5, 1.5, 2.5], [0.1, 0.2, 0.3]], "with the held one"

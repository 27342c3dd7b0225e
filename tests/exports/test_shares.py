"""Shares of a correction in C by sample."""

import itertools

import pytest

from clutchid.exports.filter import FilterSize, correction_shares, phases, shares

SIZE = FilterSize(
    states=10, sensors=2, parameters=29, of_model=6, of_sensors=1, drifts=29, model_parameters=65, weights=22,
    pieces=21, window=8, considered=1,
)  # fmt: skip


@pytest.mark.parametrize(("first", "last"), [(0.0, 0.0), (4.0, 2.0)])
def test_the_dearest_sample_is_as_cheap_as_whole_items_allow(first, last):
    costs = [3.0, 1.0, 4.0, 1.0, 5.0, 2.0, 2.0, 6.0]
    counts = shares(costs, 4, first, last)
    assert counts[-1] == len(costs)
    parts = [sum(costs[a:b]) for a, b in zip([0, *counts[:-1]], counts, strict=True)]
    dearest = max(parts[0] + first, *parts[1:-1], parts[-1] + last)
    assert dearest <= (sum(costs) + first + last) / 4 + max(costs)


@pytest.mark.parametrize("every", [1, 3, 10])
def test_all_items_of_a_correction_are_in_its_samples(every):
    counts = correction_shares(SIZE, every)
    assert len(counts) == every
    assert counts == sorted(counts)
    # what was known is copied; constants, deviation, curve and trust are the observer's
    assert counts[-1] == 1 + sum(len(phase.cost) for phase in phases(SIZE)) + 4


def test_the_rows_of_the_root_are_all_in_items_of_about_as_many_entries():
    rows = SIZE.rows
    assert (rows[0], rows[-1]) == (0, SIZE.parameters)
    entries = [b * (b + 1) // 2 - a * (a + 1) // 2 for a, b in itertools.pairwise(rows)]
    assert max(entries) < 1.5 * min(entries)

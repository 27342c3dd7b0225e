"""The comparison with kept results: what it lets pass, and what it lists."""

import re

import pytest

from golden.comparison import differences


def listed(golden, now):
    return differences({"/value": golden}, {"/value": now}, lambda _: 1e-6)


@pytest.mark.parametrize(
    ("golden", "now"),
    [
        (3.0, 3.0 + 1e-6),
        ([float("inf"), float("nan")], [float("inf"), float("nan")]),
        ("4.00 kN at 8 mm", "3.99 kN at 8 mm"),  # one rounding to the printed digits
        (None, None),
    ],
)
def test_a_difference_by_rounding_passes(golden, now):
    assert listed(golden, now) == []


@pytest.mark.parametrize(
    ("golden", "now", "line"),
    [
        (3.0, 3.00001, "/value: kept 3, now 3.00001: 1e-05 apart, allowed 3e-06"),
        ([1.0, 1e6], [1.00001, 1e6], r"/value: kept 1, now 1.00001\[0\]"),
        ([1.0, 2.0], [1.0, 2.1], r"/value: kept 2, now 2.1\[1\]: 0.1 apart, allowed 2e-06"),
        ([1.0, 2.0], [1.0], "kept 2 values, now 1"),
        ([1.0, float("inf")], [1.0, float("nan")], r"kept inf, now nan\[1\]"),
        (12, 13, "kept 12, now 13"),
        (1.0, None, "kept 1.0, now None"),
        ("of 12 readings", "of 12 recordings", "kept of 12 readings\n"),
        ("3 % were off", "6 % were off", "now  6 % were off"),
        ("1.0 and 2.0", "1.1 and 2.1", "now  1.1 and 2.1"),
    ],
)
def test_anything_else_is_listed_with_what_is_allowed(golden, now, line):
    assert re.search(line, listed(golden, now)[0])


def test_rounding_turns_one_number_of_a_group_not_two():
    stored, now = {"/a": "1.0 N", "/b": "the 1.0 N", "/c": "20 %"}, {"/a": "1.1 N", "/b": "the 1.1 N", "/c": "20 %"}
    assert differences(stored, now, lambda _: 1e-6) == []
    assert len(differences(stored, {**now, "/c": "21 %"}, lambda _: 1e-6)) == 3


def test_a_column_is_compared_with_its_range_and_names_are_the_same():
    stored = {"/column samples": [0.5, 300.0, 300.1], "/gone": 1.0}
    (sample, gone, new) = sorted(
        differences(stored, {"/column samples": [0.5, 300.0, 300.1 + 1e-6], "/new": 1.0}, lambda _: 1e-6)
    )
    assert "allowed 5e-07" in sample
    # of a curve that passes through zero the largest number counts
    assert differences({"/force_N": [0.0, 4e3]}, {"/force_N": [1e-3, 4e3]}, lambda _: 1e-6) == []
    assert (gone, new) == ("/gone: kept, but not there now.", "/new: new.")

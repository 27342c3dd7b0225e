"""Where a partitioned simulation takes the measured position again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.errors import ParameterError
from clutchid.simulation import Partition


def test_every_so_many_samples_means_after_so_many_and_not_at_the_start():
    assert Partition(every=10).resets(35).tolist() == [10, 20, 30]
    assert Partition(every=10).resets(30).tolist() == [10, 20]
    assert Partition(every=1).resets(4).tolist() == [1, 2, 3]
    assert Partition(every=10).resets(10).tolist() == []


@given(st.integers(1, 200), st.integers(1, 1000))
def test_parts_are_as_long_as_each_other_but_for_half_a_sample_at_either_end(parts, n):
    starts = Partition(parts=parts).resets(n)
    assert np.all((starts > 0) & (starts < n))
    assert np.all(np.diff(starts) > 0)
    if parts <= n:
        assert starts.size == parts - 1
        assert np.abs(starts - np.arange(1, parts) * n / parts).max(initial=0.0) <= 0.5 * (1 + 1e-12)
    else:
        # no part without a sample
        assert starts.tolist() == list(range(1, n))


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        ({}, "give exactly one of the two"),
        ({"every": 2, "parts": 2}, "give exactly one of the two"),
        ({"every": 0}, "every = 0: a number of samples is at least 1"),
        ({"parts": 0}, "parts = 0: a number of parts is at least 1"),
        ({"parts": 2, "carry": "r"}, "carry = 'r'"),
    ],
)
def test_a_partition_that_is_none_is_refused_in_words(given_, words):
    with pytest.raises(ParameterError, match=words):
        Partition(**given_)

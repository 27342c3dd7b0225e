"""Parts of a table as one."""

import numpy as np

from clutchid.measurements.source import Places, Table, joined_tables


def test_each_sample_of_joined_parts_keeps_its_place_and_its_invalid_cells():
    by_line = Table((), {0: np.array([1.0, 2.0])}, 2, Places("line", 2), unread={0: np.array([1])})
    numbered = Table((), {0: np.array([3.0])}, 1, Places("line", numbers=np.array([7])), unread={0: np.array([0])})
    whole = joined_tables([by_line, numbered])
    assert (whole.numbers[0].tolist(), whole.size) == ([1.0, 2.0, 3.0], 3)
    assert [whole.places.number(row) for row in range(3)] == [2, 3, 7]
    assert whole.unread[0].tolist() == [1, 2]

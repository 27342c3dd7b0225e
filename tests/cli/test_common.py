"""What commands have in common: progress, and resets."""

from unittest.mock import Mock

import pytest

from clutchid.cli.common import progress_of, progress_words
from clutchid.errors import ParameterError
from clutchid.simulation import Partition
from clutchid.verbs.options import life_limit, partition_of


@pytest.fixture
def passing():
    """A clock in s that a test sets forward."""
    return Mock(return_value=1000.0)


def test_elsewhere_than_on_a_terminal_progress_says_nothing(passing, capsys):
    with progress_of("track", clock=passing) as progress:
        passing.return_value += 61.0
        progress(1, 2)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("count", "seconds", "words"),
    [
        (50, 20.0, "50 of 1,000 recordings, 2.5 a second, 6 min left"),
        (1, 600.0, "1 of 1,000 recordings, 6 an hour, 7 d left"),
        (1000, 1.0, "1,000 of 1,000 recordings, 1,000 a second, 0 s left"),
    ],
)
def test_a_rate_is_in_the_unit_of_time_in_which_it_is_one_or_more(count, seconds, words):
    assert progress_words(count, 1000, seconds) == words


def test_what_a_reset_takes_needs_a_reset():
    with pytest.raises(ParameterError, match="--take position: there are no resets; give --every N or --parts N"):
        partition_of(None, None, None, "position")
    assert partition_of(1, None, "q", "position") == Partition(every=1, carry="q", take="position")
    assert partition_of(1, None, None).take == "all"


def test_the_limit_of_a_life_is_in_millimetres():
    assert (life_limit(0.2), life_limit(-0.2)) == pytest.approx((2e-4, -2e-4))

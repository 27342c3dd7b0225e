"""What commands have in common: progress a line a minute where standard error is no terminal, and resets."""

from unittest.mock import Mock

import pytest

from clutchid.cli.common import PROGRESS_PERIOD, progress_of, progress_words
from clutchid.errors import ParameterError
from clutchid.simulation import Partition
from clutchid.verbs.options import life_limit, partition_of


@pytest.fixture
def passing():
    """A clock in s that a test sets forward."""
    return Mock(return_value=1000.0)


def test_a_line_a_minute_says_what_is_done_the_rate_and_the_time_left(passing, capsys):
    with progress_of("fleet", clock=passing) as progress:
        for count in range(1, 31):
            passing.return_value += 10.0
            progress(count, 120)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 30 * 10.0 / PROGRESS_PERIOD
    assert lines[0] == "fleet: 6 of 120 recordings, 6 a minute, 19 min left"
    assert lines[-1] == "fleet: 30 of 120 recordings, 6 a minute, 15 min left"


def test_work_of_less_than_a_minute_says_nothing(passing, capsys):
    with progress_of("track", clock=passing) as progress:
        for count in range(1, 60):
            passing.return_value += 1.0
            progress(count, 60)
    assert capsys.readouterr() == ("", "")


def test_on_a_terminal_there_is_a_bar_and_no_line(passing, capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with progress_of("track", clock=passing) as progress:
        passing.return_value += 61.0
        progress(1, 2)
    assert "\ntrack: 1 of 2 recordings" not in capsys.readouterr().err


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

"""Progress of work on many items: how many are done, at what rate, and how long the rest takes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from clutchid.cli.common import progress_bar
from clutchid.cli.terminal import put

#: Time in s from one line of progress to the next where standard error is not a terminal.
EVERY = 60.0

#: Units of a rate by their length in s, and of a time that is left.
_RATES = ((1.0, "a second"), (60.0, "a minute"), (3600.0, "an hour"))
_SPANS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"))


@contextmanager
def progress_of(
    title: str, items: str = "recordings", clock: Callable[[], float] = monotonic
) -> Iterator[Callable[[int, int], None]]:
    """Progress on standard error: a bar on a terminal, elsewhere a line a minute; call it with items done and all.

    Parameters
    ----------
    clock : s
        Time from any origin.
    """
    begin = last = clock()
    with progress_bar(title) as show:

        def progress(done: int, total: int) -> None:
            nonlocal last
            now = clock()
            words = progress_words(done, total, items, now - begin)
            show(words, done / total)
            if now - last >= EVERY and not sys.stderr.isatty():
                put(f"{title}: {words}", to=sys.stderr)
                last = now

        yield progress


def progress_words(done: int, total: int, items: str, seconds: float) -> str:
    """Items done of all, at least one, their rate so far, and the time left at that rate.

    Examples
    --------
    >>> progress_words(30, 1200, "recordings", 60.0)
    '30 of 1,200 recordings, 30 a minute, 39 min left'
    """
    rate = done / max(seconds, 1e-3)
    return f"{done:,} of {total:,} {items}, {_rate(rate)}, {_span((total - done) / rate)} left"


def _rate(rate: float) -> str:
    """A rate in 1/s with two digits, in the smallest unit of time in which it is 1 or more."""
    size, unit = next((each for each in _RATES if rate * each[0] >= 1.0), _RATES[-1])
    return f"{float(f'{rate * size:.2g}'):,g} {unit}"


def _span(seconds: float) -> str:
    """A time in words."""
    for size, unit in _SPANS:
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"

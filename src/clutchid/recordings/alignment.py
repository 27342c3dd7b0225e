"""Resample channels with different time stamps to one time grid: duty cycles are held, measurements interpolated.

Holes are not filled, and only one block of each channel is in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from clutchid.log import INPUTS, FloatArray, Samples


@dataclass(frozen=True, eq=False, slots=True)
class Stream:
    """Channels with common time stamps, block by block: (time stamps in s, values by quantity in SI).

    `longest` is, by quantity, the time in s for which a sample remains valid.
    """

    blocks: Iterator[tuple[FloatArray, Mapping[str, FloatArray]]]
    longest: Mapping[str, float]


def align(at: FloatArray, stamps: FloatArray, values: FloatArray, longest: float, *, hold: bool) -> FloatArray:
    """Resample a channel at the instants `at`.

    Parameters
    ----------
    at : s
        Instants, increasing.
    stamps : s
        Time stamps of the channel, strictly increasing.
    values
        Samples of the channel; NaN if missing.
    longest : s
        A gap longer than this is a hole, in which values are unknown.
    hold
        Whether a sample is held until the next one (an input), or interpolated linearly (a measurement).

    Returns
    -------
    Values at `at`; NaN in a hole, next to a missing sample, and before the first and after the last sample (a held one
    remains valid for `longest`).

    Examples
    --------
    >>> at = np.array([0.0, 0.5, 1.0, 1.5, 9.0])
    >>> align(at, np.array([0.0, 1.0, 8.0]), np.array([2.0, 4.0, 5.0]), 2.0, hold=True)
    array([2., 2., 4., 4., 5.])
    >>> align(at, np.array([0.0, 1.0, 8.0]), np.array([2.0, 4.0, 5.0]), 2.0, hold=False)
    array([ 2.,  3.,  4., nan, nan])
    """
    if not stamps.size:
        return np.full(at.size, np.nan)
    before = np.searchsorted(stamps, at, side="right") - 1
    first = np.maximum(before, 0)
    if hold:
        known = (before >= 0) & (at - stamps[first] <= longest)
        return np.where(known, values[first], np.nan)
    after = np.minimum(first + 1, stamps.size - 1)
    width = stamps[after] - stamps[first]
    exact = (before >= 0) & (at == stamps[first])
    known = (before >= 0) & (width > 0) & (width <= longest)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (at - stamps[first]) / np.where(width > 0, width, 1.0)
        between = values[first] + share * (values[after] - values[first])
    return np.where(exact, values[first], np.where(known, between, np.nan))


def aligned(
    base: Stream, others: list[Stream]
) -> Iterator[tuple[FloatArray, dict[str, FloatArray], dict[str, Samples]]]:
    """Resample all streams at the time stamps of `base`, block by block: time stamps, columns, and edges.

    Edges are the samples of inputs that have time stamps between those of `base`.

    Raises
    ------
    DataError
        As the streams do.
    """
    followers = [_Follower(stream) for stream in others]
    for time, columns in base.blocks:
        merged, edges = dict(columns), dict[str, Samples]()
        for follower in followers:
            found, between = follower.at(time)
            merged.update(found)
            edges.update(between)
        yield time, merged, edges


class _Follower:
    """A stream with a moving window of samples around the requested instants."""

    def __init__(self, stream: Stream) -> None:
        self._blocks = stream.blocks
        self._longest = stream.longest
        self._time: FloatArray = np.empty(0)
        self._columns: dict[str, FloatArray] = {name: np.empty(0) for name in stream.longest}

    def at(self, instants: FloatArray) -> tuple[dict[str, FloatArray], dict[str, Samples]]:
        """The channels of the stream at `instants`, which must not decrease from call to call, and edges of inputs."""
        if not instants.size:
            return {name: np.empty(0) for name in self._columns}, {}
        self._reach(float(instants[-1]))
        found = {
            name: align(instants, self._time, values, self._longest[name], hold=name in INPUTS)
            for name, values in self._columns.items()
        }
        until = self._time[: np.searchsorted(self._time, instants[-1], side="right")].copy()
        between = bool(until.size) and not np.isin(until, instants).all()
        edges = {name: (until, self._columns[name][: until.size].copy()) for name in INPUTS if name in self._columns}
        self._forget(float(instants[-1]))
        return found, edges if between else {}

    def _reach(self, end: float) -> None:
        """Read until there is a sample after `end`, or the stream ends."""
        times, parts = [self._time], [self._columns]
        while not (times[-1].size and times[-1][-1] > end):
            block = next(self._blocks, None)
            if block is None:
                break
            times.append(block[0])
            parts.append(dict(block[1]))
        if len(times) > 1:
            self._time = np.concatenate(times)
            self._columns = {name: np.concatenate([part[name] for part in parts]) for name in self._columns}

    def _forget(self, end: float) -> None:
        """Drop samples before the last one up to `end`, which may still be held."""
        keep = max(int(np.searchsorted(self._time, end, side="right")) - 1, 0)
        self._time = self._time[keep:].copy()
        self._columns = {name: values[keep:].copy() for name, values in self._columns.items()}

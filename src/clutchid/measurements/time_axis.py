"""Channels with stamps of their own on one time axis, block by block: held, or interpolated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.log import INPUTS, FloatArray, Samples


class SampleBlock(NamedTuple):
    """Consecutive samples of channels with common time stamps: time in s, values by quantity in SI."""

    time: FloatArray
    columns: Mapping[str, FloatArray]

    def take(self, rows: slice | NDArray[np.int64] | NDArray[np.bool_]) -> SampleBlock:
        """Some of the samples; a view for a slice."""
        return SampleBlock(self.time[rows], {name: values[rows] for name, values in self.columns.items()})

    def split(self, until: float) -> tuple[SampleBlock, SampleBlock]:
        """The samples up to the time `until` in s, and those after it."""
        count = int(np.searchsorted(self.time, until, side="right"))
        return self.take(slice(count)), self.take(slice(count, None))

    def since(self, time: float) -> SampleBlock:
        """The samples from the last one up to `time` in s on, which may be held there."""
        return self.take(slice(max(int(np.searchsorted(self.time, time, side="right")) - 1, 0), None))

    def earlier(self, delay: float) -> SampleBlock:
        """The samples with time stamps earlier by `delay` in s."""
        return self._replace(time=self.time - delay) if delay else self

    def followed_by(self, *others: SampleBlock) -> SampleBlock:
        """These samples and the next ones, as a copy that keeps no other samples in memory."""
        blocks = (self, *others)
        columns = {name: np.concatenate([block.columns[name] for block in blocks]) for name in self.columns}
        return SampleBlock(np.concatenate([block.time for block in blocks]), columns)


def no_samples(names: Iterable[str]) -> SampleBlock:
    """An empty block with these columns."""
    return SampleBlock(np.empty(0), {name: np.empty(0) for name in names})


@dataclass(frozen=True, eq=False, slots=True)
class ChannelStream:
    """Channels with common time stamps, block by block.

    `longest` is, by quantity, the time in s for which a sample remains valid.
    """

    blocks: Iterator[SampleBlock]
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
        valid = (before >= 0) & (at - stamps[first] <= longest)
        return np.where(valid, values[first], np.nan)
    after = np.minimum(first + 1, stamps.size - 1)
    width = stamps[after] - stamps[first]
    exact = (before >= 0) & (at == stamps[first])
    valid = (before >= 0) & (width > 0) & (width <= longest)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (at - stamps[first]) / np.where(width > 0, width, 1.0)
        between = values[first] + share * (values[after] - values[first])
    return np.where(exact, values[first], np.where(valid, between, np.nan))


def aligned(base: ChannelStream, others: Sequence[ChannelStream]) -> Iterator[tuple[SampleBlock, dict[str, Samples]]]:
    """Resample all streams at the time stamps of `base`, block by block: samples, and edges.

    Edges are the samples of inputs that have time stamps between those of `base`.

    Raises
    ------
    DataError
        As the streams do.
    """
    followers = [_Follower(stream) for stream in others]
    for block in base.blocks:
        merged, edges = dict(block.columns), dict[str, Samples]()
        for follower in followers:
            values, between = follower.at(block.time)
            merged.update(values)
            edges.update(between)
        yield SampleBlock(block.time, merged), edges


class _Follower:
    """A stream with a moving window of samples around the requested instants."""

    def __init__(self, stream: ChannelStream) -> None:
        self._stream = stream
        self._window = no_samples(stream.longest)

    def at(self, instants: FloatArray) -> tuple[Mapping[str, FloatArray], dict[str, Samples]]:
        """The channels of the stream at `instants`, which must not decrease from call to call, and edges of inputs."""
        if not instants.size:
            return no_samples(self._stream.longest).columns, {}
        end = float(instants[-1])
        window = self._window = self._window.followed_by(*self._blocks_until(end))
        columns = {
            name: align(instants, window.time, values, self._stream.longest[name], hold=name in INPUTS)
            for name, values in window.columns.items()
        }
        until, _ = window.split(end)
        edges: dict[str, Samples] = {}
        if until.time.size and not np.isin(until.time, instants).all():
            until = until.followed_by()
            edges = {name: (until.time, until.columns[name]) for name in INPUTS if name in until.columns}
        self._window = window.since(end).followed_by()
        return columns, edges

    def _blocks_until(self, end: float) -> Iterator[SampleBlock]:
        """The next blocks, until there is a sample after `end` or the stream ends."""
        last = self._window
        while not (last.time.size and last.time[-1] > end):
            block = next(self._stream.blocks, None)
            if block is None:
                return
            yield block
            last = block

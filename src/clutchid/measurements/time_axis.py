"""Time stamps: repair of those of loggers, and resampling of channels to one time grid, block by block.

Thresholds: benchmarks/results/thresholds.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.log import HOLE, INPUTS, FloatArray, Samples
from clutchid.measurements.clock import AT_START, JUMP_AHEAD, Clock, Tolerance, runs_of, sentences, shifts_of
from clutchid.measurements.source import Places, Rows
from clutchid.messages import quantity


def hole_starts(time: FloatArray) -> NDArray[np.int64]:
    """Samples after which the interval to the next one exceeds 5 median intervals.

    Examples
    --------
    >>> hole_starts(np.array([0.0, 1.0, 2.0, 3.0, 9.0, 10.0])).tolist()
    [3]
    """
    steps = sample_intervals(time)
    with np.errstate(over="ignore"):
        if steps.max(initial=0.0) <= HOLE * steps.min(initial=np.inf, where=steps > 0):  # none without a median
            return np.empty(0, dtype=np.int64)
        return np.flatnonzero(steps > HOLE * usual_interval(time))


def sample_intervals(time: FloatArray) -> FloatArray:
    """Interval from each sample to the next."""
    with np.errstate(over="ignore"):
        return np.diff(time)


def usual_interval(time: FloatArray) -> float:
    """Median of the positive intervals; infinity if there are none."""
    steps = sample_intervals(time)
    forward = steps[steps > 0]
    with np.errstate(over="ignore"):  # of two longest intervals the mean is infinite
        return float(np.median(forward)) if forward.size else math.inf


class RepairedTime(NamedTuple):
    """Rows of a block that are kept, their time stamps in s, messages about changes, and the state of the clock."""

    rows: Rows
    time: FloatArray
    messages: tuple[str, ...]
    clock: Clock


def repair(stamps: FloatArray, places: Places, clock: Clock = AT_START, *, shared: bool = False) -> RepairedTime:
    """Repair time stamps so that they increase strictly.

    A sample without a time stamp is dropped. Of samples with equal time stamps the last is kept. Samples that are out
    of order by up to five usual intervals are dropped. If the clock goes back further, `clutchid.measurements.clock`
    says why: a run after a restart is placed after the previous one with a hole between them, so that each is a
    separate segment.

    Parameters
    ----------
    stamps : s
        As written in the file.
    places
        Location of the samples in the file, for the messages.
    clock
        State of the clock after the previous block.
    shared
        Whether it is the clock of several messages, repaired already: what is out of order is sorted.

    Examples
    --------
    A logger that was started twice in one file, and one repeated sample:

    >>> found = repair(np.array([0.0, 0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.0, 0.1]), Places())
    >>> [round(float(t), 6) for t in found.time]
    [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2.6, 2.7]
    >>> print(*found.messages, sep="\\n")
    samples with the time stamp of an earlier one replace it: 1 (row 3).
    the clock restarts at row 9 (0 s after 0.6 s); each run becomes a separate segment, 2 s after the previous one.
    """
    rows, time, said, after = clocked = on_clock(stamps, places, clock, shared=shared)
    if rows.size == stamps.size and (time > np.append(clock.last, time[:-1])).all():
        return clocked
    if shared and time.size and (np.diff(time) < 0).any():
        order = np.argsort(time, kind="stable")
        rows, time = rows[order], time[order]
    ahead = np.r_[clock.last, np.maximum.accumulate(np.r_[clock.last, time])[1:-1]]
    late, same = time < ahead, time == ahead
    changed = {
        "with the time stamp of an earlier one replace it": rows[same],
        "out of order in time are dropped": rows[late],
        "without a time stamp are dropped": np.flatnonzero(~np.isfinite(stamps)),
    }
    messages = [f"samples {what}: {r.size:,} ({places.ranges(r)})." for what, r in changed.items() if r.size]
    last = _last_of_each(time, late | (time == clock.last))  # the previous block may end at this time stamp
    return RepairedTime(rows[last], time[last], (*messages, *said), after)


def on_clock(stamps: FloatArray, places: Places, clock: Clock, *, shared: bool) -> RepairedTime:
    """Rows that have a stamp, their stamps without restarts and bursts; they may still repeat, or be out of order."""
    rows = np.flatnonzero(np.isfinite(stamps))
    time = stamps[rows]
    with np.errstate(over="ignore"):
        steps = np.diff(time, prepend=clock.written if math.isfinite(clock.written) else np.empty(0))
        ordered = steps.size > 0 and 0.0 < steps.min() <= steps.max() <= min(HOLE * steps.min(), JUMP_AHEAD)
    if ordered and clock.shift == 0.0:
        last = float(time[-1])  # as it should be: nothing is to be found
        usual = clock.usual if math.isfinite(clock.usual) else float(steps.mean())
        return RepairedTime(rows, time, (), Clock(last, last, 0.0, usual))
    usual = clock.usual if math.isfinite(clock.usual) else usual_interval(time)
    steady = steadied(time)
    said = []
    if steady is not None:
        time, sentence = steady
        said, usual = [sentence], usual_interval(time)
    tolerance = Tolerance.of(usual, shared=shared)
    runs = runs_of(rows, time, clock.written, tolerance)
    shifts, changes, after = shifts_of(runs, tolerance, clock)
    if any(shifts):
        time = time + np.repeat(shifts, [run.size for run in runs])
        rows, time = rows[np.isfinite(time)], time[np.isfinite(time)]
    said += sentences(changes, places, tolerance.apart)
    last = float(max(clock.last, time.max(initial=-math.inf)))
    return RepairedTime(rows, time, tuple(said), replace(after, last=last))


#: Bursts: as many at least, half of them without a gap, of as many samples on average, with no more than this share of
#: the time within one.
_BURSTS, _LEAST, _WITHIN = 20, 2.5, 0.2


def steadied(time: FloatArray) -> tuple[FloatArray, str] | None:
    """Stamps at the mean rate and a sentence, where a logger stamps in bursts; else None.

    Bursts come at regular intervals of at most `JUMP_AHEAD`; a longer one, or a step back, begins anew. The last sample
    of one is the newest, so that a line through these has the rate.

    Examples
    --------
    >>> bursts = np.repeat(np.arange(100) * 16e-3, 16) + np.tile(np.arange(16) * 1e-6, 100)
    >>> time, sentence = steadied(bursts)
    >>> round(float(np.ptp(np.diff(time))), 9), sentence
    (0.0, 'the time stamps arrive in bursts of 16 every 0.016 s; the mean rate of 1000 Hz is used instead.')
    >>> steadied(np.arange(1600) * 1e-3) is None
    True
    """
    steps = sample_intervals(time)
    with np.errstate(over="ignore"):
        last = np.append((steps < 0) | (steps > HOLE * np.median(steps)), True) if steps.size else np.empty(0)
        if np.count_nonzero(last) <= _BURSTS:
            return None
        longest = min(JUMP_AHEAD, _LEAST * float(np.median(steps[last[:-1]])))
        parts = np.split(np.arange(time.size), np.flatnonzero((steps < 0) | (steps > longest)) + 1)
    rows = max(parts, key=len)
    ends = np.flatnonzero(last[rows])
    sizes, between = np.diff(ends), np.diff(time[rows][ends])
    inside = time[rows][ends[1:]] - time[rows][ends[:-1] + 1]
    period = float(np.median(between)) if ends.size > _BURSTS / 2 else 0.0
    if not period > 0.0 or np.median(sizes) < _LEAST or ends.size * _LEAST > rows.size:
        return None
    if np.median(inside) > _WITHIN * period or np.mean(np.abs(between - period) < period / 2) < 1 - _WITHIN:
        return None
    rate = float(np.polyfit(ends, time[rows][ends], 1)[0])
    even = time.copy()
    for part in parts:
        number, newest = np.arange(part.size), last[part]
        line = rate * number + np.median((time[part] - rate * number)[newest])
        late, stall = time[part] - line, steps[max(part[0] - 1, 0) : part[-1]].max(initial=0.0)
        if np.abs(late[newest]).max() <= period and -period <= late.min() and late.max() <= period + stall:
            even[part] = line
    return even, (
        f"the time stamps arrive in bursts of {round(period / rate)} every {quantity(float(f'{period:.4g}'), 's')}; "
        f"the mean rate of {1 / rate:.5g} Hz is used instead."
    )


def _last_of_each(time: FloatArray, late: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Of the samples that are not late, the last one of each time stamp."""
    rows = np.flatnonzero(~late)
    return rows[np.append(time[rows[1:]] != time[rows[:-1]], True)] if rows.size else rows


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

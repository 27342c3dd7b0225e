"""A finer time grid for a slow recording: its samples stay, and between them only the duty cycles are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from clutchid.log import INPUTS, FloatArray, Log, holes
from clutchid.strokes.sampled import IndexArray

#: Shortest interval of a grid in s: a period that starts this close to a sample starts with it.
_SHORTEST_STEP = 2e-5

#: An interval may be longer than the step by this part of it, as stamps are rounded and jitter.
_GRID_ROUNDING = 0.1

#: Messages and periods are in step if an interval is a multiple of a quarter of the period, up to the drift of two
#: quartzes; largest jitter of messages at equal intervals, in intervals.
_PARTS, _MAX_DRIFT, _MAX_JITTER = 4, 3e-4, 0.2


def latched(
    log: Log, period: float, phase: float, step: float, closed: Mapping[str, float], delay: float = 0.0
) -> tuple[Log, FloatArray]:
    """`log` on a finer time grid with duty cycles that the control unit renews at the start of each period.

    Each period has the duty cycles of its last sample; those of a period without a sample are interpolated. To which
    period a sample belongs is decided by time stamps without jitter.

    Parameters
    ----------
    log : Log
        With both duty cycles; its samples are kept with their time stamps.
    period : s
        Of the duty cycles, in the clock of the time stamps, see `in_clock`.
    phase : 1
        Of the periods relative to the time stamps.
    step : s
        Longest interval of the time grid, which also has the starts of the periods.
    closed : 1
        Largest duty cycle of each valve at which it is closed.
    delay : s
        Of the duty cycles, to match a position that was recorded late.

    Returns
    -------
    log : Log
    open_std : (n - 1,) in s
        Standard deviation of the time that a fully open valve is open in each interval of the grid.
    """
    stamps, sampled = _sampled(log)
    numbers = _period_number(_regular(stamps)[0], period, phase)
    last = np.flatnonzero(np.append(numbers[1:] > numbers[:-1], True))
    grid = _Grid(log, step, _starts(log.time, period, phase * period + delay))
    wanted = _period_number(grid.middle - delay, period, phase)
    duties = {name: _between(wanted, numbers[last], sampled[name][last], closed[name]) for name in INPUTS}
    without = np.diff(numbers[last]) - 1.0
    # a change at the start of any of these periods or of the next: a uniform number of them has the later duty cycle
    spread = period * np.sqrt(without * (without + 2.0) / 12.0)
    size = _unknown_opening({name: sampled[name][last] for name in INPUTS}, spread)
    between = np.searchsorted(numbers[last], wanted[:-1], side="right") - 1
    between[np.isin(wanted[:-1], numbers[last])] = -1
    return grid.with_duties(log, duties), _spread_evenly(size, between)


def interpolated(
    log: Log, held: float, step: float, closed: Mapping[str, float], delay: float = 0.0
) -> tuple[Log, FloatArray]:
    """`log` on a finer time grid with duty cycles that change between the samples, interpolated linearly.

    Parameters
    ----------
    log : Log
        With both duty cycles; its samples are kept with their time stamps.
    held : s
        For which the control unit holds a duty cycle, much less than an interval between samples. The duty cycle in a
        sample acts until then.
    step, closed, delay
        As in `latched`, which also says what is returned.
    """
    grid, (stamps, sampled) = _Grid(log, step), _sampled(log)
    middle = grid.middle - 0.5 * held - delay
    duties = {name: _between(middle, stamps, sampled[name], closed[name]) for name in INPUTS}
    size = _unknown_opening(sampled, np.diff(stamps) / np.sqrt(12.0))
    between = np.searchsorted(stamps, grid.time[:-1], side="right") - 1
    return grid.with_duties(log, duties), _spread_evenly(size, between)


def _sampled(log: Log) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Duty cycles where they were sampled: in messages of their own, or with the other columns."""
    own = [log.edges[name] for name in INPUTS if name in log.edges]
    if len(own) == len(INPUTS) and np.array_equal(own[0][0], own[1][0]):
        return own[0][0], {name: log.edges[name][1] for name in INPUTS}
    return log.time, {name: log[name] for name in INPUTS}


def _spread_evenly(size: FloatArray, between: IndexArray) -> FloatArray:
    """Standard deviations `size` of spans over their intervals; `between` is the span of each, -1 if it has none."""
    at = np.where((between >= 0) & (between < size.size), between, size.size)
    count = np.bincount(at, minlength=size.size + 1)
    shares: FloatArray = np.append(size, 0.0) / np.sqrt(np.maximum(count, 1))
    return shares[at]


def in_clock(period: float, time: FloatArray) -> float:
    """`period` in s by the clock of time stamps whose messages are sent in step with it, else as it is.

    Examples
    --------
    A clock that is 50 ppm fast has two samples in a period of 20 ms, or seems to:

    >>> f"{in_clock(0.02, 1.00005 * 0.01 * np.arange(500.0)):.6f} s"
    '0.020001 s'
    """
    ratio = _PARTS * _regular(time)[1] / period
    away = ratio / max(1, round(ratio)) - 1.0
    return period * (1.0 + away) if abs(away) < _MAX_DRIFT else period


def _regular(time: FloatArray) -> tuple[FloatArray, float]:
    """Time stamps without jitter, and their interval, of messages at equal intervals; others as they are."""
    gaps = np.diff(time)
    numbers = np.concatenate([[0.0], np.cumsum(np.round(gaps / np.median(gaps)))])
    interval, start = np.polyfit(numbers, time, 1)
    even: FloatArray = start + interval * numbers
    jitters = float(np.percentile(np.abs(time - even), 99.0)) < _MAX_JITTER * interval
    return (even, float(interval)) if jitters else (time, float(np.median(gaps)))


def _between(at: FloatArray, stamps: FloatArray, duty: FloatArray, closed: float) -> FloatArray:
    """Duty cycle interpolated linearly in the opening of the valve: it opens from the duty cycle `closed` on."""
    opened = np.interp(at, stamps, np.maximum(duty, closed))
    held: FloatArray = duty[np.maximum(np.searchsorted(stamps, at, side="right") - 1, 0)]
    return np.where(opened > closed, opened, np.minimum(held, closed))


def _unknown_opening(duties: Mapping[str, FloatArray], spread: FloatArray) -> FloatArray:
    """Standard deviation in s of the opening between known duty cycles.

    A duty cycle that changes once, at any time, opens the valve on average for the time of the interpolation; `spread`
    in s is the standard deviation of the time of the change.
    """
    changes = np.nan_to_num(sum((np.abs(np.diff(values)) for values in duties.values()), np.zeros(spread.size)))
    nearby: FloatArray = np.maximum.reduce([changes, np.append(changes[1:], 0.0), np.append(0.0, changes[:-1])])
    return nearby * spread


class _Grid:
    """Times of a finer grid: the samples of `log`, `breaks`, and between them equal intervals of at most `step` s.

    `first` are the places of the samples in it, `middle` the middle of each interval, and the last sample.
    """

    def __init__(self, log: Log, step: float, breaks: FloatArray | None = None) -> None:
        added = np.zeros(0) if breaks is None else breaks[_apart(breaks, log.time)]
        points = np.sort(np.concatenate([log.time, added]))
        gaps, at = np.diff(points), np.searchsorted(points, log.time)
        hole = np.repeat(holes(log.time), np.diff(at))
        parts: IndexArray = np.where(hole, 1, np.ceil(gaps / step * (1.0 - _GRID_ROUNDING))).astype(np.intp)
        start = np.concatenate([[0], np.cumsum(parts)])
        of = np.repeat(np.arange(gaps.size), parts)
        inside = (np.arange(start[-1]) - start[of]) / parts[of]
        self.time: FloatArray = np.append(points[of] + gaps[of] * inside, log.time[-1])
        self.middle = self.time + 0.5 * np.append(np.diff(self.time), 0.0)
        self.first = start[at]

    def with_duties(self, log: Log, duties: Mapping[str, FloatArray]) -> Log:
        """`log` on the grid with duty cycles there; other columns are missing between the samples."""
        columns = dict.fromkeys(log.columns, self.time)
        for name, values in log.columns.items():
            if name in duties:
                held = values[np.searchsorted(log.time, self.time, side="right") - 1]
                columns[name] = np.where(np.isnan(held), np.nan, duties[name])
            else:
                columns[name] = np.full(self.time.size, np.nan)
                columns[name][self.first] = values
        return Log(self.time, columns, log.name, log.metadata, log.warnings)


def _starts(time: FloatArray, period: float, first: float) -> FloatArray:
    """Starts of the periods within the time stamps, one of which is at `first` s."""
    numbers = np.arange(np.ceil((time[0] - first) / period), np.floor((time[-1] - first) / period) + 1.0)
    return first + period * numbers


def _apart(breaks: FloatArray, time: FloatArray) -> NDArray[np.bool_]:
    """Mask of the `breaks` within `time`, no closer to its stamps than `_SHORTEST_STEP`, nor in a hole."""
    after = np.searchsorted(time, breaks).clip(1, time.size - 1)
    inside = (breaks - time[after - 1] > _SHORTEST_STEP) & (time[after] - breaks > _SHORTEST_STEP)
    usable: NDArray[np.bool_] = inside & ~holes(time)[after - 1]
    return usable


def _period_number(time: FloatArray, period: float, phase: float) -> FloatArray:
    """Number of the period at each time stamp."""
    return np.floor(time / period - phase + 1e-9)

"""The clock of a file: restarts, counters that wrap, jumps ahead and back, lone stamps, and bursts, and their repair.

Stamps in the order of the file are cut into runs wherever they step back, or far ahead. Each run gets one shift, for
all that is stamped by this clock; one or two stamps far from those around them are left out.

Thresholds: benchmarks/results/thresholds.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from clutchid.log import HOLE, BoolArray, FloatArray
from clutchid.measurements.source import Places, Rows
from clutchid.messages import SHOWN, listed, quantity

#: Time in s by which a stamp may lie behind the latest one where several devices write to one log.
WINDOW = 0.05

#: Time in s by which a stamp may lie ahead of the latest one without a second sample that confirms it.
JUMP_AHEAD = 0.2

#: Gap between two runs that are placed one after the other, which is long enough to be a hole: in usual intervals; and
#: at least, in s, longer than what is bridged on line, or a step is judged over; and where several messages share it.
_APART, _APART_LEAST, _APART_SHARED = 20.0, 0.1, 1.0

#: As many stamps far from those around them are lone ones; more are a jump.
LONE = 2

#: Runs among which the one is looked for that goes on where the clock was before a jump.
_AHEAD = 16

#: Samples on line that wait at most for what shows whether a clock that has jumped goes on as before.
_HELD = 1000

#: Share of its length by which the runs of several groups may differ where they are matched by number.
_NEAR = 0.1

#: Changes after which a clock goes on as before.
_PASSING = ("lone", "excursion")

#: A period must be as many times the tolerance by which it is recognised.
_SURE = 50.0

#: Times in s after which clocks begin again: counters of 16 and 32 bits, 12 and 24 hours; the end of summer time.
_PERIODS = {
    **{2.0**bits * tick: f"its counter of {bits} bits wraps" for bits in (16, 32) for tick in (1e-3, 1e-4, 1e-5, 1e-6)},
    **{2.0**32 * tick: "its counter of 32 bits wraps" for tick in (1e-7, 1e-8, 1e-9)},
    86400.0: "midnight passes", 43200.0: "its twelve hours begin again", 3600.0: "it is set back by an hour",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Intervals of a clock in s: the usual one; steps `behind` and `ahead` that cut it; `apart`, between two runs."""

    usual: float
    behind: float
    ahead: float
    apart: float

    @classmethod
    def of(cls, usual: float, *, shared: bool = False, late: float = 0.0) -> Tolerance:
        """Tolerance of a clock with this usual interval; several messages that share one may be disordered.

        `late` is the time in s by which samples may come late that are sorted.
        """
        hole = HOLE * usual
        behind, least = max(WINDOW if shared else late, hole), _APART_SHARED if shared else _APART_LEAST
        return cls(usual, behind, max(JUMP_AHEAD, hole), max(least, _APART * usual))

    def goes_on(self, step: float) -> bool:
        """Whether a step in s from the greatest stamp before does not cut the clock."""
        return -self.behind <= step <= self.ahead


class Run(NamedTuple):
    """Consecutive stamps without a step that cuts them: row of the first, their number, first and greatest in s."""

    row: int
    size: int
    first: float
    last: float

    @property
    def length(self) -> float:
        """Time in s from the first stamp to the greatest."""
        return self.last - self.first

    def joined(self, other: Run) -> Run:
        """This run and the one that goes on with it."""
        return Run(self.row, self.size + other.size, self.first, max(self.last, other.last))


class ClockChange(NamedTuple):
    """Change of a clock at a row: its kind, the stamp there and the stamp before it in s, and an amount.

    The amount, in s, is by how much the stamps are moved; where stamps are left out, their number.
    """

    kind: str
    row: int
    stamp: float
    before: float
    amount: float


@dataclass(frozen=True, slots=True)
class Clock:
    """State of a clock after some runs: last stamp as written and as repaired, shift, and usual interval, in s."""

    written: float = -math.inf
    last: float = -math.inf
    shift: float = 0.0
    usual: float = math.inf


AT_START = Clock()


def hole_starts(time: FloatArray) -> Rows:
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


def cuts(time: FloatArray, before: float, tolerance: Tolerance) -> Rows:
    """The stamps at which a run begins; `before` is the stamp in front of them, without one (-inf) the first is one."""
    if not time.size or not math.isfinite(tolerance.behind):
        return np.zeros(min(time.size, 1) if before == -math.inf else 0, dtype=np.int64)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(time, prepend=before)
    return np.flatnonzero((steps < -tolerance.behind) | (steps > tolerance.ahead))


def runs_of(rows: Rows, time: FloatArray, before: float, tolerance: Tolerance) -> list[Run]:
    """The runs of finite stamps in s at these rows; the first one goes on from `before` where nothing cuts it."""
    if not time.size:
        return []
    begins = np.unique(np.r_[0, cuts(time, before, tolerance)])
    ends = np.r_[begins[1:], time.size]
    greatest = np.maximum.reduceat(time, begins)
    fields = rows[begins].tolist(), (ends - begins).tolist(), time[begins].tolist(), greatest.tolist()
    return list(map(Run, *fields))


def joined_runs(runs: Iterable[Run], tolerance: Tolerance) -> list[Run]:
    """Runs of consecutive blocks, where one goes on with the one before it as one."""
    joined: list[Run] = []
    for run in runs:
        goes_on = bool(joined) and tolerance.goes_on(run.first - joined[-1].last)
        joined.append(joined.pop().joined(run) if goes_on else run)
    return joined


def shifts_of(
    runs: Sequence[Run], tolerance: Tolerance, clock: Clock = AT_START, *, whole: bool = True
) -> tuple[list[float], list[ClockChange], Clock]:
    """The shift in s of each run, NaN where its stamps are left out; the changes; and the clock after them.

    Unless these are the runs of the `whole` recording, the last ones have no shift yet where stamps that come later may
    still show that the clock goes on as before: for `JUMP_AHEAD` s after it has jumped.

    Examples
    --------
    A stamp 6 s ahead is left out; a clock that begins again goes on behind:

    >>> runs = [Run(0, 100, 0.0, 1.0), Run(100, 1, 7.0, 7.0), Run(101, 99, 1.02, 2.0), Run(200, 9, 0.0, 0.1)]
    >>> shifts, changes, _ = shifts_of(runs, Tolerance.of(0.01))
    >>> [round(shift, 6) for shift in shifts], [change.kind for change in changes]
    ([0.0, nan, 0.0, 2.2], ['lone', 'restart'])
    """
    clock = replace(clock, usual=tolerance.usual)
    shifts: list[float] = []
    changes: list[ClockChange] = []
    change: ClockChange | None
    i = 0
    while i < len(runs):
        back = _return(runs, i, clock.written, tolerance, whole=whole)
        if back is None:
            break
        if back > i:
            moved, change = _passing(runs[i:back], runs[back].first, clock)
        else:
            clock, change = _followed(runs[i], clock, tolerance)
            moved = [clock.shift]
        shifts += moved
        changes += [change] if change else []
        i = max(back, i + 1)
    return shifts, changes, clock


def _followed(run: Run, clock: Clock, tolerance: Tolerance) -> tuple[Clock, ClockChange | None]:
    """The clock after a run with which it goes on, or begins again after a period or at a restart."""
    step, shift, change = run.first - clock.written, clock.shift, None
    written = max(clock.written, run.last)
    if step < -tolerance.behind:
        written = run.last
        period = _period(step, tolerance.usual)
        kind, amount = (_PERIODS[period], period) if period else ("restart", tolerance.apart)
        shift += period or tolerance.apart - step
        change = ClockChange(kind, run.row, run.first, clock.written, amount)
    return replace(clock, written=written, last=max(clock.last, run.last + shift), shift=shift), change


def _passing(runs: Sequence[Run], back: float, clock: Clock) -> tuple[list[float], ClockChange]:
    """Shifts of runs in front of the stamp `back` in s, with which the clock goes on; NaN where they are lone stamps.

    More stamps than these are moved into the middle of the time that is left for them.
    """
    count = sum(run.size for run in runs)
    if count <= LONE:
        return [math.nan] * len(runs), ClockChange("lone", runs[0].row, runs[0].first, clock.written, float(count))
    begin = clock.written + max((back - clock.written - _span(runs, clock.usual)) / 2, 0.0)
    shifts = []
    for run in runs:
        begin += clock.usual
        shifts.append(clock.shift + begin - run.first)
        begin += run.length
    amount = shifts[-1] - clock.shift
    return shifts, ClockChange("excursion", runs[0].row, runs[0].first, clock.written, amount)


def _return(runs: Sequence[Run], i: int, written: float, tolerance: Tolerance, *, whole: bool) -> int | None:
    """The run with which the clock goes on as before, where run `i` is a jump that ends in front of it; else `i`.

    None where the recording is not `whole` and such a run may still come.
    """
    if written == -math.inf:
        lone = len(runs) > i + 1 and runs[i].size <= LONE < runs[i + 1].size
        step = runs[i + 1].first - runs[i].last if lone else 0.0
        return i + 1 if step < -tolerance.behind else i
    if tolerance.goes_on(runs[i].first - written):
        return i
    disordered = runs[i].first < written - tolerance.behind
    for m in range(i + 1, min(len(runs), i + 1 + _AHEAD)):
        disordered |= runs[m].first < runs[m - 1].last - tolerance.behind
        between = runs[i:m]
        if not whole and not _short(between):
            return i
        span, step = _span(between, tolerance.usual), runs[m].first - written
        lone = sum(run.size for run in between) <= LONE
        least = -tolerance.behind if lone else span - tolerance.ahead
        if disordered and least <= step <= span + tolerance.ahead and step >= -tolerance.behind:
            return m
    return i if whole or not _short(runs[i:]) else None


def _short(runs: Sequence[Run]) -> bool:
    """Whether a jump to these runs is so short that its end is waited for."""
    size, last = sum(run.size for run in runs), max(run.last for run in runs)
    return size <= LONE or (len(runs) <= _AHEAD and size <= _HELD and last - runs[0].first < JUMP_AHEAD)


def _span(runs: Sequence[Run], usual: float) -> float:
    """Time in s that runs take one after the other."""
    return sum(run.length + usual for run in runs) + usual


def _period(step: float, usual: float) -> float:
    """The period after which a clock that steps back has begun again; 0 where it is none of the known ones."""
    slack = HOLE * usual
    return next((period for period in _PERIODS if abs(step + period) <= slack <= period / _SURE), 0.0)


def sentences(changes: Sequence[ClockChange], places: Places, apart: float) -> Iterator[str]:
    """Changes of clocks and their repair, a sentence each kind; runs lie `apart` in s after a restart."""
    by_kind: dict[str, list[ClockChange]] = {}
    for change in changes:
        by_kind.setdefault(change.kind, []).append(change)
    for kind, group in by_kind.items():
        shown = [
            f"{places.word} {places.number(change.row)} ({quantity(change.stamp, 's')}"
            + (f" after {quantity(change.before, 's')})" if math.isfinite(change.before) else ")")
            for change in group[:SHOWN]
        ]
        where = listed(shown, total=len(group))
        count = int(sum(change.amount for change in group if kind == "lone"))
        amounts = listed([quantity(change.amount, "s") for change in group[:SHOWN]], total=len(group))
        yield {
            "restart": f"the clock restarts at {where}; each run becomes a separate segment, "
            f"{quantity(apart, 's')} after the previous one.",
            "lone": f"time stamps far from those around them are left out: {count:,}, at {where}.",
            "excursion": (f"the clock jumps at {where} and later returns; the part in between is moved by {amounts}."),
        }.get(kind, f"the clock: {kind} at {where}; {quantity(abs(group[0].amount), 's')} are corrected from there on.")


def moved(stamps: FloatArray, first: int, runs: Sequence[Run], shifts: Sequence[float]) -> FloatArray:
    """Stamps from the row `first` on, each with the shift in s of its run; NaN where they are left out."""
    number = np.searchsorted([run.row for run in runs], np.arange(first, first + stamps.size), side="right") - 1
    repaired: FloatArray = stamps + np.take(shifts, np.maximum(number, 0))
    return repaired


def matched(
    clocks: Sequence[Sequence[Run]], tolerances: Sequence[Tolerance]
) -> tuple[list[list[float]], list[list[ClockChange]], str]:
    """The shifts of the runs of all groups of a file that have no common order, what changes, or why there are none.

    Restarts are matched by number; those of one number must be near each other in all groups.
    """
    apart = max(tolerance.apart for tolerance in tolerances)
    tolerances = [replace(tolerance, apart=apart) for tolerance in tolerances]
    resolved = [shifts_of(runs, tolerance) for runs, tolerance in zip(clocks, tolerances, strict=True)]
    changes = [group for _, group, _ in resolved]
    steps = [[change for change in group if change.kind not in _PASSING] for group in changes]
    counts = {len(group) for group in steps}
    if len(counts) > 1:
        shown = " and ".join(str(count) for count in sorted(counts))
        return [], changes, _apart_sentence(f"{shown} times")
    common = [0.0]
    slack = max(JUMP_AHEAD, HOLE * max(tolerance.usual for tolerance in tolerances))
    for same in zip(*steps, strict=True):
        ends = [change.before for change in same]
        if max(ends) - min(ends) > slack + _NEAR * abs(max(ends)):
            when = f"after {quantity(min(ends), 's')} and after {quantity(max(ends), 's')}"
            return [], changes, _apart_sentence(when)
        restart = max(ends) - min(change.stamp for change in same) + apart
        periodic = all(change.kind == same[0].kind != "restart" for change in same)
        common.append(common[-1] + (same[0].amount if periodic else restart))
    every = []
    for runs, (shifts, _, _), group in zip(clocks, resolved, steps, strict=True):
        places = np.searchsorted([change.row for change in group], [run.row for run in runs], side="right").tolist()
        base = {n: shift for n, shift in reversed(list(zip(places, shifts, strict=True))) if not math.isnan(shift)}
        every.append([shift - base.get(n, 0.0) + common[n] for shift, n in zip(shifts, places, strict=True)])
    return every, changes, ""


def _apart_sentence(when: str) -> str:
    return (
        f"the clocks of its groups restart {when}, so it is unclear which samples belong together; cut the file at a "
        "restart, or export each run separately."
    )


class RepairedTime(NamedTuple):
    """Rows of a block that are kept, their time stamps in s, messages about changes, and the state of the clock."""

    rows: Rows
    time: FloatArray
    messages: tuple[str, ...]
    clock: Clock


def repair(
    stamps: FloatArray, places: Places, clock: Clock = AT_START, *, shared: bool = False, mask: BoolArray | None = None
) -> RepairedTime:
    """Repair time stamps so that they increase strictly.

    A sample without a time stamp is dropped. Of samples with equal time stamps the last is kept. Samples that are out
    of order by up to five usual intervals are dropped. If the clock goes back further, a run after a restart is placed
    after the previous one with a hole between them, so that each is a separate segment.

    Parameters
    ----------
    stamps : s
        As written in the file.
    places
        Location of the samples in the file, for the messages.
    clock
        State of the clock after the previous block.
    shared
        Whether it is the clock of several messages: what is out of order is sorted.
    mask
        Rows that have a sample, which share their clock with the others; by default all.

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
    rows, time, said, after = _on_clock(stamps, places, clock, shared=shared)
    if mask is not None:
        rows, time = rows[mask[rows]], time[mask[rows]]
    after = replace(after, last=float(max(clock.last, time.max(initial=-math.inf))))
    complete = rows.size == (stamps.size if mask is None else np.count_nonzero(mask))
    if complete and (time > np.append(clock.last, time[:-1])).all():
        return RepairedTime(rows, time, said, after)
    if shared and time.size and (np.diff(time) < 0).any():
        order = np.argsort(time, kind="stable")
        rows, time = rows[order], time[order]
    ahead = np.r_[clock.last, np.maximum.accumulate(np.r_[clock.last, time])[1:-1]]
    late, same = time < ahead, time == ahead
    changed = {
        "with the time stamp of an earlier one replace it": rows[same],
        "out of order in time are dropped": rows[late],
        "without a time stamp are dropped": np.flatnonzero(~np.isfinite(stamps) & (mask is None or mask)),
    }
    messages = [f"samples {what}: {r.size:,} ({places.ranges(r)})." for what, r in changed.items() if r.size]
    samples = np.flatnonzero(~late & (time != clock.last))  # the previous block may end at this time stamp
    last = samples[np.append(np.diff(time[samples]) != 0.0, True)[: samples.size]]
    return RepairedTime(rows[last], time[last], (*messages, *said), after)


def _on_clock(
    stamps: FloatArray, places: Places, clock: Clock, *, shared: bool
) -> tuple[Rows, FloatArray, tuple[str, ...], Clock]:
    """Rows that have a stamp, their stamps without restarts and bursts; they may still repeat, or be out of order."""
    rows = np.flatnonzero(np.isfinite(stamps))
    time = stamps[rows]
    with np.errstate(over="ignore"):
        steps = np.diff(time, prepend=clock.written if math.isfinite(clock.written) else np.empty(0))
        ordered = steps.size > 0 and 0.0 < steps.min() <= steps.max() <= min(HOLE * steps.min(), JUMP_AHEAD)
    if ordered and clock.shift == 0.0:
        usual = clock.usual if math.isfinite(clock.usual) else float(steps.mean())
        return rows, time, (), replace(clock, written=float(time[-1]), usual=usual)  # nothing is to be found
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
    return rows, time, (*said, *sentences(changes, places, tolerance.apart)), after


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
    ends = np.flatnonzero(last[rows[:-1]])  # the last burst may be cut
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

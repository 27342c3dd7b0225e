"""Follow a recording block by block while it arrives, in constant memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clutchid.inspection import inspect
from clutchid.log import Log
from clutchid.observe.by_stroke import StrokeRow
from clutchid.observe.health import FLAGS, LIVE_FLAGS, live_health
from clutchid.observe.observer import Observed, Observer, ObserverState
from clutchid.observe.recording import ObservedRecording, follow_block, too_slow, usable

#: Time in s of the samples, and number of the strokes, that are kept for a report.
RECENT, STROKES = 120.0, 1000

#: Time in s of the first samples that the checks of a recording look at.
CHECKED = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class LiveRun:
    """A recording that has not ended: its last parts and strokes, and what is known of all of it.

    `health` are the seconds of each fault so far; `begin` is the time in s of the first sample, NaN before; `checked`
    the sentences of the checks of its first samples, None before there were enough.
    """

    observer: Observer
    before: ObserverState
    after: ObserverState
    parts: tuple[ObservedRecording, ...] = ()
    strokes: tuple[StrokeRow, ...] = ()
    health: Mapping[str, float] | None = None
    begin: float = np.nan
    usable: bool = False
    checked: tuple[str, ...] | None = None

    def recent(self) -> ObservedRecording:
        """The last `RECENT` seconds and `STROKES` strokes with the states before and after the whole recording."""
        log = joined([part.log for part in self.parts])
        samples = Observed(*(np.concatenate(each) for each in zip(*(part.samples for part in self.parts), strict=True)))
        found = replace(log, warnings=self.checked or ())
        health = self.health or dict.fromkeys((*FLAGS, *LIVE_FLAGS), 0.0)
        return ObservedRecording(self.observer, found, self.before, self.after, samples, self.strokes, health)


def live_run(observer: Observer, state: ObserverState) -> LiveRun:
    """A recording before its first sample."""
    return LiveRun(observer, state, state)


def gone_on(run: LiveRun, block: Log, left_out: Mapping[str, int]) -> tuple[LiveRun, ObservedRecording]:
    """A recording after a block of its samples, and that block; blocks of any length give the same numbers.

    Parameters
    ----------
    left_out
        Number of samples by live flag, see `clutchid.observe.health.LIVE_FLAGS`.

    Raises
    ------
    DataError
        As `clutchid.observe.observe`.
    """
    part = follow_block(run.observer, run.after, block)
    found = live_health(run.observer, run.after.tail.time, block, part.samples, left_out)
    part = replace(part, health=found)
    total = found if run.health is None else {name: run.health[name] + seconds for name, seconds in found.items()}
    last = block.time[-1] if len(block) else -np.inf
    parts = (*(one for one in run.parts if one.log.time[-1] >= last - RECENT), *([part] if len(block) else []))
    after = replace(
        run,
        after=part.after,
        parts=parts,
        strokes=(*run.strokes, *part.strokes)[-STROKES:],
        health=total,
        begin=float(block.time[0]) if len(block) and np.isnan(run.begin) else run.begin,
        usable=run.usable or usable(block),
    )
    return (checked(after) if last - after.begin >= CHECKED else after), part


def checked(run: LiveRun) -> LiveRun:
    """The recording with the sentences of its checks, if it had none: warnings here, for it goes on."""
    if run.checked is not None or not run.usable:
        return run
    log, actuator = joined([part.log for part in run.parts]), run.observer.actuator
    first = log.slice(0, int(np.searchsorted(log.time, run.begin + CHECKED, side="right")))
    slow = too_slow(first, actuator) if len(first) > 1 else ""
    return replace(run, checked=(*inspect(first, actuator).warnings, *([slow] if slow else [])))


def joined(logs: Sequence[Log]) -> Log:
    """Consecutive parts of a recording as one."""
    if len(logs) == 1:
        return logs[0]
    first = logs[0]
    columns = {name: np.concatenate([log[name] for log in logs]) for name in first.columns}
    return Log(np.concatenate([log.time for log in logs]), columns, first.name, first.metadata)

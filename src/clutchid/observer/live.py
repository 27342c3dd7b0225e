"""Follow a recording block by block while it arrives, in constant memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from clutchid.log import Log, concatenated
from clutchid.observer.by_stroke import StrokeRow
from clutchid.observer.configuration import Observer
from clutchid.observer.flags import FLAGS, LIVE_FLAGS
from clutchid.observer.following import Observed
from clutchid.observer.health import live_health
from clutchid.observer.run import (
    ObservedRecording,
    SupplyUse,
    duration,
    follow_block,
    too_slow,
    unused_conditions,
    usable,
)
from clutchid.observer.state import ObserverState
from clutchid.preparation.inspection import inspect

#: Time in s of the samples, and number of the strokes, that are kept for a report.
RECENT, RECENT_STROKES = 120.0, 1000

#: Time in s of the first samples that the checks of a recording look at.
CHECKED = 30.0

#: Sentences about the clock of the recording that are kept.
SENTENCES = 20


@dataclass(frozen=True, slots=True, eq=False)
class LiveRun:
    """A recording that has not ended: its last parts and strokes, and what is known of all of it.

    `health` are the seconds of each fault so far; `begin` and `latest` are the times in s of the first and of the last
    sample, NaN before them; `checked` are the sentences of the checks of its first samples, None before there were
    enough; `clock` are the last sentences about repairs of its clock; `supply` as in `ObservedRecording`.
    """

    observer: Observer
    before: ObserverState
    after: ObserverState
    parts: tuple[ObservedRecording, ...] = ()
    strokes: tuple[StrokeRow, ...] = ()
    health: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys((*FLAGS, *LIVE_FLAGS), 0.0))
    begin: float = np.nan
    latest: float = np.nan
    usable: bool = False
    checked: tuple[str, ...] | None = None
    clock: tuple[str, ...] = ()
    supply: SupplyUse = "not recorded"

    @property
    def assumes_supply(self) -> bool:
        """As that of an `ObservedRecording`."""
        return self.supply != "measured"

    @property
    def seconds(self) -> float:
        """Time in s from the first sample to the end of the last one."""
        return duration(self.observer, np.array([self.begin, self.latest]))

    def recent(self) -> ObservedRecording:
        """The last `RECENT` seconds and `RECENT_STROKES` strokes with the states before and after the whole recording.

        The metadata are those of the latest samples, where the origin of the time moves with the clock of a bus.
        """
        log, said = concatenated([part.log for part in self.parts]), (*(self.checked or ()), *self.clock)
        log = replace(log, metadata=self.parts[-1].log.metadata, warnings=said)
        columns = zip(*(part.samples for part in self.parts), strict=True)
        samples = Observed(*(np.concatenate(arrays) for arrays in columns))
        return ObservedRecording(
            self.observer, log, self.before, self.after, samples, self.strokes, self.health, self.seconds, self.supply
        )


def live_run(observer: Observer, state: ObserverState) -> LiveRun:
    """A recording before its first sample."""
    latest = float(state.tail.time[-1]) if state.tail.time.size else np.nan
    return LiveRun(observer, state, state, latest=latest)


def after_block(run: LiveRun, block: Log, left_out: Mapping[str, int]) -> tuple[LiveRun, ObservedRecording]:
    """A recording after a block of its samples, and that block; blocks of any length give the same numbers.

    Parameters
    ----------
    left_out
        Number of samples by live flag, see `clutchid.observer.flags.LIVE_FLAGS`.

    Raises
    ------
    DataError
        As `clutchid.observer.observe`.
    """
    before = np.array([run.latest])[np.isfinite([run.latest])]
    part = follow_block(run.observer, run.after, block)
    of_feed = live_health(run.observer, before, block, left_out)
    health = {**part.health, **of_feed, "repeated": part.health["repeated"] + of_feed["repeated"]}
    part = replace(part, health=health)
    total = {name: run.health[name] + seconds for name, seconds in health.items()}
    last = block.time[-1] if len(block) else -np.inf
    old = next((i for i, earlier in enumerate(run.parts) if earlier.log.time[-1] >= last - RECENT), len(run.parts))
    parts = (*run.parts[old:], part) if len(block) else run.parts
    after = replace(
        run,
        after=part.after,
        parts=parts,
        strokes=(*run.strokes, *part.strokes)[-RECENT_STROKES:],
        health=total,
        begin=float(block.time[0]) if len(block) and np.isnan(run.begin) else run.begin,
        latest=float(block.time[-1]) if len(block) else run.latest,
        usable=run.usable or usable(block),
        clock=(*run.clock, *block.warnings)[-SENTENCES:],
        supply=run.supply if part.supply == "not recorded" else part.supply,
    )
    return (with_check_sentences(after) if last - after.begin >= CHECKED else after), part


def with_check_sentences(run: LiveRun) -> LiveRun:
    """The recording with the sentences of its checks, if it had none: warnings here, for it goes on."""
    if run.checked is not None or not run.usable:
        return run
    log, actuator = concatenated([part.log for part in run.parts]), run.observer.actuator
    first = log.slice(0, int(np.searchsorted(log.time, run.begin + CHECKED, side="right")))
    slow = too_slow(first, actuator) if len(first) > 1 else ""
    unused = unused_conditions(run.observer, first)
    return replace(run, checked=(*inspect(first, actuator).warnings, *filter(None, (slow,)), *unused))

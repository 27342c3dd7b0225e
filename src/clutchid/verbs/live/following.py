"""Observe a live recording: follow samples as they arrive until a signal, and complete the files.

What fails beside it, such as a disk that is full, costs what comes later in that file; the state is saved every minute.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NamedTuple

from clutchid.errors import DataError, ExportError
from clutchid.systems import HANG_UPS, STOPS
from clutchid.verbs.live.arriving import arriving
from clutchid.verbs.live.files import FileTroubles, Outputs, left_by_earlier_run
from clutchid.verbs.live.streams import Stopped, published_lines, say_unhurried

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.measurements.live.arrival import LiveBlock
    from clutchid.observer.live import LiveRun
    from clutchid.observer.run import ObservedRecording
    from clutchid.verbs.observing import ObserveRequest
    from clutchid.verbs.reading import Reading

#: Time in s from one saved state to the next; as much is lost where the power is.
MINUTE = 60.0


class Followed(NamedTuple):
    """A live recording that has ended.

    Attributes
    ----------
    run
        Its last strokes and samples, with the health of all of it.
    fault
        Why it ended, if that was a fault of the recording.
    troubles
        Faults of the files, as sentences.
    moved
        Places of files that could not be written where they were asked for; None is nowhere.
    said
        The warnings of the recording that were said while it went on.
    """

    run: ObservedRecording
    fault: str
    troubles: Sequence[str]
    moved: Mapping[Path, Path | None]
    said: frozenset[str]


def follow_live(
    reading: Reading, content: ParameterFile, request: ObserveRequest, outputs: Outputs, *, say_checks: bool
) -> Followed:
    """Follow a live recording until it ends or is stopped, publish its results, and write all files.

    Parameters
    ----------
    say_checks
        Whether the checks of the recording are said while it goes on.

    Raises
    ------
    DataError, ExportError, ParameterError
        If nothing could be observed, or a file cannot be begun; nothing is written then.
    """
    from clutchid.measurements.spool import SPOOLED
    from clutchid.observer.live import live_run
    from clutchid.verbs.observing import observer_of

    if outputs.out.suffix.lower() not in SPOOLED:
        raise ExportError(f"--out {outputs.out}: a live recording is written as {' or '.join(SPOOLED)}, in any length.")
    files, left = FileTroubles(), left_by_earlier_run(outputs, request.resume)
    with stop_signals() as stopped:
        with closing(arriving(reading, content, request.resume, stopped)) as blocks:
            first = next(blocks)
            observer, state = observer_of(first.log, content, request, reading.zero)
            if left and request.resume is not None:
                again = f"rows from {first.log.time[0]:g} s on come again in {outputs.out} and its load by stroke"
                say_unhurried([f"{' and '.join(map(str, left))}: {again}; leave them out when you join the files."])
            run, fault, said = _observed(
                live_run(observer, state), chain([first], blocks), outputs, files, stopped, say_checks=say_checks
            )
        files.write_at_the_end(outputs, run.recent(), content)
    return Followed(run.recent(), fault, files.troubles, files.moved, said)


@contextmanager
def stop_signals() -> Iterator[Stopped]:
    """Function that says whether a signal of `STOPS` or `HANG_UPS` came; a second one of `STOPS` stops at once.

    A terminal that is closed sends SIGHUP, several times: it stops nothing at once, and is left ignored where it is.
    """
    signals: list[int] = []

    def stop(number: int, _frame: FrameType | None) -> None:
        if signals and number in STOPS:
            raise KeyboardInterrupt
        signals.append(number)

    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    hang_ups = [number for number in HANG_UPS if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, stop) for number in (*STOPS, *hang_ups)}
    try:
        yield lambda: bool(signals)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def shown_clock(sentences: Sequence[str], said: int) -> Sequence[str]:
    """New sentences about the clock that are shown after `said` earlier ones: as many as are kept, and then one more.

    Examples
    --------
    >>> shown_clock(["the clock restarts."], 0), shown_clock(["the clock restarts."], 21)
    (['the clock restarts.'], [])
    """
    from clutchid.observer.live import SENTENCES

    shown = list(sentences[: max(SENTENCES - said, 0)])
    last = f"further warnings about the clock are not shown; the last {SENTENCES} of them come with the result."
    return [*shown, last] if said <= SENTENCES < said + len(sentences) else shown


def _observed(
    run: LiveRun,
    blocks: Iterator[LiveBlock],
    outputs: Outputs,
    files: FileTroubles,
    stopped: Stopped,
    *,
    say_checks: bool,
) -> tuple[LiveRun, str, frozenset[str]]:
    """The recording, whose samples and strokes are written as they come; the fault that ended it; and what was said.

    Raises
    ------
    DataError
        If nothing could be observed.
    """
    from clutchid.observer.live import after_block, with_check_sentences
    from clutchid.observer.run import no_sample

    fault, saved, count = "", time.monotonic(), 0
    said: frozenset[str] = frozenset()
    with (
        published_lines(stopped) if outputs.publish else nullcontext() as publish,
        files.spooled(outputs.out) as add_samples,
        files.spooled(outputs.by_stroke) as add_strokes,
    ):
        try:
            for block in blocks:
                before = run
                run, part = after_block(run, block.log, block.left_out._asdict())
                now = run.usable and time.monotonic() - saved >= MINUTE
                add_samples(part.estimates(), now=now)
                if part.strokes or part.before is run.before or now:
                    add_strokes(part.load_by_stroke(), now=now)
                if now:
                    saved = time.monotonic()
                    files.save(outputs.save, run)
                clock, count = shown_clock(part.log.warnings, count), count + len(part.log.warnings)
                new = (*(run.checked or () if before.checked is None else ()), *clock)
                if say_checks and new and say_unhurried(new):
                    said |= {*new}
                if publish:
                    publish(run, part)
        except DataError as error:
            fault = str(error)
        if not run.usable:
            raise DataError(fault or no_sample(run.parts[-1].log.name))
    return with_check_sentences(run), fault, said

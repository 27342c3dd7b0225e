"""Observe a live recording: follow samples while they arrive; a signal ends it, and files are whole.

What fails beside it, such as a disk that is full, costs what comes later in that file; the state is saved every minute.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from clutchid.cli.common import BAD_INPUT, DONE, FAILED, complain
from clutchid.cli.observe_output import FileTroubles, ObserveOptions, answer, offer
from clutchid.cli.observe_sinks import (
    Sink,
    Stopped,
    published_frames,
    published_lines,
    say_unhurried,
    unhurried_errors,
    view,
)
from clutchid.errors import DataError, ExportError
from clutchid.systems import HANG_UPS, STOPS
from clutchid.verbs.live import Begun, arriving, begun, steps

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.observer.live import LiveRun

#: Time in s from one saved state to the next; as much is lost where the power is.
MINUTE = 60.0


def observe_live(log: Path, content: ParameterFile, options: ObserveOptions) -> int:
    """Follow a live recording until it ends or is stopped; write all files, and say what was found.

    Raises
    ------
    DataError, ExportError, ParameterError
        If nothing could be observed, or a file cannot be begun; nothing is written then.
    """
    from clutchid.measurements.spool import SPOOLED

    if options.out.suffix.lower() not in SPOOLED:
        raise ExportError(f"--out {options.out}: a live recording is written as {' or '.join(SPOOLED)}, in any length.")
    kept, left = FileTroubles(), offer(options)
    with stop_signals() as stopped:
        with closing(arriving(options.live(log), content, stopped)) as blocks:
            run, trouble = _followed(begun(blocks, content, options.live(log)), options, kept, left, stopped)
        kept.write_rest(options, run.recent(), content)
    with unhurried_errors():
        return _answered(run, trouble, content, options, kept)


def _answered(run: LiveRun, trouble: str, content: ParameterFile, options: ObserveOptions, kept: FileTroubles) -> int:
    """Say what was found, and what went wrong; the exit code."""
    failed = " ".join(kept.troubles)
    status = "bad_input" if trouble else "failed"
    message = " ".join(filter(None, (trouble, failed)))
    answer(run.recent(), content, options, trouble=(status, message), moved=kept.moved)
    if not message:
        return DONE
    if options.json:
        return BAD_INPUT if trouble else FAILED
    return complain(message, as_json=False, status=status)


@contextmanager
def stop_signals() -> Iterator[Stopped]:
    """Function that says whether a signal of `STOPS` or `HANG_UPS` came; a second one of `STOPS` stops at once.

    A terminal that is closed sends SIGHUP, several times: it stops nothing at once, and is left ignored where it is.
    """
    asked: list[int] = []

    def ask(number: int, _frame: FrameType | None) -> None:
        if asked and number in STOPS:
            raise KeyboardInterrupt
        asked.append(number)

    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    hang_ups = [number for number in HANG_UPS if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, ask) for number in (*STOPS, *hang_ups)}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _followed(
    begin: Begun, options: ObserveOptions, kept: FileTroubles, left: Sequence[Path], stopped: Stopped
) -> tuple[LiveRun, str]:
    """The recording, whose samples and strokes are written as they come; and why it ended if that was a fault.

    `left` are files of an earlier run; what comes again is cut from them where this one goes on from it.
    """
    from clutchid.observer.live import checked

    if options.resume is not None:
        kept.cut(left, float(begin.first.time[0]))
    run, trouble, saved = begin.run, "", time.monotonic()
    with (
        _sinks(options, stopped) as sinks,
        kept.spooled(options.out) as add_samples,
        kept.spooled(options.by_stroke) as add_strokes,
    ):
        for step in steps(begin):
            if isinstance(step, DataError):
                trouble = str(step)
                break
            before, run, part = step
            now = run.usable and time.monotonic() - saved >= MINUTE
            add_samples(part.estimates(), now=now)
            if part.strokes or part.before is run.before or now:
                add_strokes(part.load_by_stroke(), now=now)
            if now:
                saved = time.monotonic()
                kept.save(options.save, run)
            if before.checked is None and run.checked and not options.json:
                say_unhurried(run.checked)
            for sink in sinks:
                sink(before, run, part)
    return checked(run), trouble


@contextmanager
def _sinks(options: ObserveOptions, stopped: Stopped) -> Iterator[list[Sink]]:
    """Sinks of the results of each block, besides the files."""
    with ExitStack() as stack:
        sinks = []
        every = None if options.publish_every is None else 1e-3 * options.publish_every
        if options.bus and options.results_dbc:
            sinks.append(stack.enter_context(published_frames(options.bus, every, options.results_dbc, stopped)))
        elif options.publish is not None:
            sinks.append(stack.enter_context(published_lines(every or 0.0, stopped)))
        if options.view:
            sinks.append(stack.enter_context(view(stopped)))
        yield sinks

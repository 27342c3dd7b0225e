"""Observe a live recording: follow samples while they arrive; a signal ends it, and files are whole.

What fails beside it, such as a disk that is full, costs what comes later in that file; the state is saved every minute.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, TextIO

import numpy as np

from clutchid.cli.common import BAD_INPUT, DONE, FAILED, complain
from clutchid.cli.observe_output import Files, FileTroubles, answer, offer
from clutchid.cli.observe_sinks import (
    Sink,
    Stopped,
    published_frames,
    published_lines,
    say_unhurried,
    unhurried_errors,
    view,
)
from clutchid.errors import DataError, ExportError, ParameterError
from clutchid.log import INPUTS, Log
from clutchid.names import printable
from clutchid.recordings.live.bus import BusName, bus_name
from clutchid.workflow import observer_of

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.observer.live import LiveRun
    from clutchid.observer.state import Tail
    from clutchid.recordings.live.arrival import LiveBlock
    from clutchid.recordings.strokes.vented_rest import Zero

#: What stands for standard input, and for standard output.
STANDARD_INPUT = STANDARD_OUTPUT = "-"

#: Signals that end a recording, and stop the command at once when they come again.
STOPS = (signal.SIGINT, signal.SIGTERM)

#: Time in s from one saved state to the next; as much is lost where the power is.
MINUTE = 60.0


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a live recording is read and observed, and where its results go.

    `resume` is the state to go on from, `publish_every` the time in ms from one published sample to the next, `ambient`
    the pressure in Pa for gauge units.
    """

    method: str
    channel_map: Path | None
    dbc: tuple[Path, ...]
    resume: Path | None
    follow: bool
    publish: str | None
    publish_every: float | None
    view: bool
    as_json: bool
    ambient: float = math.nan
    zero: Zero = "subtract"

    @property
    def bus(self) -> BusName | None:
        """The bus that results go to, if they do."""
        return bus_name(self.publish or "")

    @property
    def messages(self) -> TextIO:
        """Where sentences go: standard output, unless lines are published there."""
        return sys.stderr if self.publish == STANDARD_OUTPUT else sys.stdout

    def check(self, log: Path) -> None:
        """Check that the options go together and with the recording.

        Raises
        ------
        ParameterError
            If they do not.
        """
        if (self.publish is not None or self.view) and not (self.follow or is_live(log)):
            option = "--view" if self.publish is None else f"--publish {self.publish}"
            raise ParameterError(f"{option}: is for a live recording; give -, can:CHANNEL, or --follow {log}.")
        if self.publish not in (None, STANDARD_OUTPUT) and self.bus is None:
            raise ParameterError(
                f"--publish {self.publish}: results go to -, standard output, or to a bus, such as can:can0."
            )
        if self.publish == STANDARD_OUTPUT and self.as_json:
            raise ParameterError("--publish - and --json both write on standard output; leave one of them out.")
        if self.publish_every is not None and not 0.0 <= self.publish_every < math.inf:
            raise ParameterError(f"--publish-every {self.publish_every:g}: a time in ms is at least 0, for example 20.")


def is_live(log: Path) -> bool:
    """Whether a recording arrives while it is observed."""
    return str(log) == STANDARD_INPUT or bus_name(str(log)) is not None


def observe_live(files: Files, content: ParameterFile, options: LiveOptions) -> int:
    """Follow a live recording until it ends or is stopped; write all files, and say what was found.

    Raises
    ------
    DataError, ExportError, ParameterError
        If nothing could be observed, or a file cannot be begun; nothing is written then.
    """
    _check_format(files)
    kept, left = FileTroubles(), offer(files)
    with stop_signals() as stopped:
        with closing(_blocks(files.log, content, options, stopped)) as blocks:
            run, trouble = _followed(blocks, files, content, options, kept, left, stopped)
        kept.write_rest(files, run.recent(), content)
    with unhurried_errors():
        return _answered(run, trouble, files, content, options, kept)


def _answered(
    run: LiveRun, trouble: str, files: Files, content: ParameterFile, options: LiveOptions, kept: FileTroubles
) -> int:
    """Say what was found, and what went wrong; the exit code."""
    failed = " ".join(kept.troubles)
    status = "bad_input" if trouble else "failed"
    message = " ".join(filter(None, (trouble, failed)))
    answer(
        run.recent(), content, files, as_json=options.as_json, trouble=(status, message), to=options.messages,
        moved=kept.moved,
    )  # fmt: skip
    if not message:
        return DONE
    if options.as_json:
        return BAD_INPUT if trouble else FAILED
    return complain(message, as_json=False, status=status)


def _check_format(files: Files) -> None:
    from clutchid.recordings.spool import SPOOLED

    if files.out.suffix.lower() not in SPOOLED:
        raise ExportError(f"--out {files.out}: a live recording is written as {' or '.join(SPOOLED)}, in any length.")


@contextmanager
def stop_signals() -> Iterator[Stopped]:
    """Function that says whether Ctrl-C, SIGTERM or SIGHUP came; a second one stops at once, as everywhere else.

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
    hang_up = [signal.SIGHUP] if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN else []
    before = {number: signal.signal(number, ask) for number in (*STOPS, *hang_up)}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _blocks(log: Path, content: ParameterFile, options: LiveOptions, stopped: Stopped) -> Generator[LiveBlock]:
    """Blocks of the recording as they arrive, with a duty cycle for both valves of the model."""
    from clutchid.observer.state_file import saved_origin
    from clutchid.recordings.live.bus import bus_blocks, from_bus
    from clutchid.recordings.live.feed import from_descriptor, from_growing_file
    from clutchid.recordings.live.text import text_blocks
    from clutchid.recordings.map.channel_map import read_map

    channels = None if options.channel_map is None else read_map(options.channel_map)
    equipment = content.actuator.equipment
    required = ("time", "position", *equipment.recorded)
    if (bus := bus_name(str(log))) is not None:
        frames = from_bus(bus, stopped)
        name = printable(bus.channel)
        origin = None if options.resume is None else saved_origin(options.resume)
        blocks = bus_blocks(frames, name, options.dbc, channels, options.ambient, required, origin)
    elif str(log) == STANDARD_INPUT:
        if sys.stdin is None:
            raise DataError(
                "standard input: is closed; name a file, or send samples, as in: cat LOG | clutchid observe -"
            )
        pieces = from_descriptor(sys.stdin.fileno(), stopped)
        blocks = text_blocks(pieces, "stdin", channels, options.ambient, required)
    else:
        pieces = from_growing_file(log, stopped)
        blocks = text_blocks(pieces, printable(log.stem), channels, options.ambient, required)
    for block in blocks:
        yield replace(block, log=equipment.driven(block.log))


def _followed(
    blocks: Iterator[LiveBlock],
    files: Files,
    content: ParameterFile,
    options: LiveOptions,
    kept: FileTroubles,
    left: Sequence[Path],
    stopped: Stopped,
) -> tuple[LiveRun, str]:
    """The recording, whose samples and strokes are written as they come; and why it ended if that was a fault.

    `left` are files of an earlier run; what comes again is cut from them where this one goes on from it.
    """
    from clutchid.observer.live import after_block, checked, live_run
    from clutchid.observer.recording import no_sample

    first = next(blocks)
    one, state = observer_of(first.log, content, options.method, options.resume, options.zero)
    if options.follow and options.resume is not None:
        blocks = _behind(state.tail, chain([first], blocks), options.resume)
        first = next(blocks)
    if options.resume is not None:
        kept.cut(left, float(first.log.time[0]))
    run = live_run(one, state)
    trouble, saved = "", time.monotonic()
    with (
        _sinks(options, files, stopped) as sinks,
        kept.spooled(files.out) as add_samples,
        kept.spooled(files.by_stroke) as add_strokes,
    ):
        for block in _until_trouble(first, blocks):
            if isinstance(block, DataError):
                trouble = str(block)
                break
            before = run
            run, part = after_block(run, block.log, block.left_out._asdict())
            now = run.usable and time.monotonic() - saved >= MINUTE
            add_samples(part.estimates(), now=now)
            if part.strokes or part.before is run.before or now:
                add_strokes(part.load_by_stroke(), now=now)
            if now:
                saved = time.monotonic()
                kept.save(files.save, run)
            if before.checked is None and run.checked and not options.as_json:
                say_unhurried(run.checked)
            for sink in sinks:
                sink(before, run, part)
        if not run.usable:
            raise DataError(trouble or no_sample(first.log.name))
    return checked(run), trouble


def _behind(tail: Tail, blocks: Iterator[LiveBlock], resumed: Path) -> Iterator[LiveBlock]:
    """The blocks of a file behind the samples that a state has had, which must be in it, unless it begins later.

    Raises
    ------
    DataError
        If the file has other samples there, or none behind them.
    """
    latest = float(tail.time[-1]) if tail.time.size else -math.inf
    had: list[Log] = []
    name = ""
    for block in blocks:
        log, name = block.log, block.log.name
        new = int(np.searchsorted(log.time, latest, side="right"))
        old = log.slice(int(np.searchsorted(log.time[:new], tail.time[:1].min(initial=math.inf))), new)
        had += [old] if new else []
        if new == len(log):
            continue
        if had and not _same_samples(had, tail):
            raise DataError(
                f"{name}: has other samples up to {latest:g} s than the recording that {resumed} comes from, and time "
                "must go on; follow that recording, or start without --resume."
            )
        yield replace(block, log=log.slice(new, len(log)))
        yield from blocks
        return
    raise DataError(f"{name}: has no sample behind {latest:g} s, where {resumed} is; there is nothing to observe.")


def _same_samples(logs: Sequence[Log], tail: Tail) -> bool:
    """Whether the samples are those that a state remembers, by their stamps and duty cycles."""
    time = np.concatenate([log.time for log in logs])
    duties = np.concatenate([np.column_stack([log[name] for name in INPUTS]) for log in logs])
    return np.array_equal(time, tail.time) and np.array_equal(duties, tail.duties, equal_nan=True)


def _until_trouble(first: LiveBlock, blocks: Iterator[LiveBlock]) -> Iterator[LiveBlock | DataError]:
    """The blocks, and last the fault that ended them, if one did: what came before it counts."""
    yield first
    try:
        yield from blocks
    except DataError as error:
        yield error


@contextmanager
def _sinks(options: LiveOptions, files: Files, stopped: Stopped) -> Iterator[list[Sink]]:
    """What takes the results of each block besides the files."""
    with ExitStack() as stack:
        sinks = []
        every = None if options.publish_every is None else 1e-3 * options.publish_every
        if options.bus is not None:
            sinks.append(stack.enter_context(published_frames(options.bus, every, files.results_dbc, stopped)))
        elif options.publish is not None:
            sinks.append(stack.enter_context(published_lines(every or 0.0, stopped)))
        if options.view:
            sinks.append(stack.enter_context(view(stopped)))
        yield sinks

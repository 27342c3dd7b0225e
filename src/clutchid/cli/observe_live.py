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
from dataclasses import replace
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import numpy as np

from clutchid.cli.common import BAD_INPUT, DONE, FAILED, complain
from clutchid.cli.observe_output import STANDARD_INPUT, FileTroubles, ObserveOptions, answer, offer
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
from clutchid.log import INPUTS, Log
from clutchid.measurements.checks import AMBIENT
from clutchid.measurements.live.bus import bus_name
from clutchid.names import printable
from clutchid.parameters import known_ambient
from clutchid.systems import HANG_UPS, STOPS
from clutchid.verbs.observing import observer_of
from clutchid.verbs.options import pressure

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.measurements.live.arrival import LiveBlock
    from clutchid.observer.live import LiveRun
    from clutchid.observer.state import Tail

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
        with closing(_blocks(log, content, options, stopped)) as blocks:
            run, trouble = _followed(blocks, content, options, kept, left, stopped)
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


def _blocks(log: Path, content: ParameterFile, options: ObserveOptions, stopped: Stopped) -> Generator[LiveBlock]:
    """Blocks of the recording as they arrive, with a duty cycle for both valves of the model."""
    from clutchid.measurements.live.bus import bus_blocks, from_bus
    from clutchid.measurements.live.feed import from_descriptor, from_growing_file
    from clutchid.measurements.live.text import text_blocks
    from clutchid.measurements.map.channel_map import read_map
    from clutchid.observer.state_file import saved_origin

    files = options.files
    channels = None if files.map is None else read_map(files.map)
    ambient = pressure(files.ambient) or known_ambient(content.actuator.parameters.P_0) or AMBIENT
    equipment = content.actuator.equipment
    required = ("time", "position", *equipment.recorded)
    if (bus := bus_name(str(log))) is not None:
        frames = from_bus(bus, stopped)
        name = printable(bus.channel)
        origin = None if options.resume is None else saved_origin(options.resume)
        blocks = bus_blocks(frames, name, tuple(files.dbc or ()), channels, ambient, required, origin)
    elif str(log) == STANDARD_INPUT:
        if sys.stdin is None:
            raise DataError(
                "standard input: is closed; name a file, or send samples, as in: cat LOG | clutchid observe -"
            )
        pieces = from_descriptor(sys.stdin.fileno(), stopped)
        blocks = text_blocks(pieces, "stdin", channels, ambient, required)
    else:
        pieces = from_growing_file(log, stopped)
        blocks = text_blocks(pieces, printable(log.stem), channels, ambient, required)
    for block in blocks:
        yield replace(block, log=equipment.driven(block.log))


def _followed(
    blocks: Iterator[LiveBlock],
    content: ParameterFile,
    options: ObserveOptions,
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
        _sinks(options, stopped) as sinks,
        kept.spooled(options.out) as add_samples,
        kept.spooled(options.by_stroke) as add_strokes,
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
                kept.save(options.save, run)
            if before.checked is None and run.checked and not options.json:
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

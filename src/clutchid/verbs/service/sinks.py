"""Sinks of the results of a live recording, besides files: lines on standard output, frames on a bus."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.documents.console import discard_output
from clutchid.systems import is_closed_pipe
from clutchid.verbs.service.streams import Stopped, as_printed, outgoing, say_unhurried, sender_to

if TYPE_CHECKING:
    from clutchid.measurements.live.bus_name import BusName
    from clutchid.observer.live import LiveRun
    from clutchid.observer.recording import ObservedRecording
    from clutchid.verbs.service.files import Outputs

#: Takes the recording before a block, after it, and the block.
Sink = Callable[["LiveRun", "LiveRun", "ObservedRecording"], None]


@contextmanager
def sinks_of(outputs: Outputs, stopped: Stopped) -> Iterator[list[Sink]]:
    """Sinks of the results of each block, besides the files."""
    with ExitStack() as stack:
        sinks = []
        every = None if outputs.every is None else 1e-3 * outputs.every
        if outputs.bus and outputs.results_dbc:
            sinks.append(stack.enter_context(published_frames(outputs.bus, every, outputs.results_dbc, stopped)))
        elif outputs.publish is not None:
            sinks.append(stack.enter_context(published_lines(every or 0.0, stopped)))
        yield sinks


@contextmanager
def published_lines(every: float, stopped: Stopped) -> Iterator[Sink]:
    """Results as JSON lines on standard output, written block by block; a sample each `every` seconds, 0 for all.

    Where standard output is closed, full or fails, the recording goes on without it; where nobody reads it, what does
    not fit is left out until somebody does. Once `stopped`, nothing waits for a reader.
    """
    from clutchid.documents.observe_lines import observe_lines

    with outgoing(sys.stdout) as out:
        send = as_printed if out is None else sender_to(out, stopped)
        open_, stalled = True, False

        def publish(before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
            nonlocal open_, stalled
            lines = observe_lines(before, after, part, every) if open_ else []
            if not lines:
                return
            earlier = stalled
            try:
                stalled = not send("".join(f"{line}\n" for line in lines).encode(), wait=not stalled)
            except OSError as error:
                open_ = False
                discard_output()
                reason = "closed" if is_closed_pipe(error) else f"lost ({error.strerror or error})"
                say_unhurried([f"standard output was {reason}: nothing is published any more, the recording goes on."])
                return
            if stalled and not earlier and not stopped():
                left = "standard output is not read: results are left out there until it is, the recording goes on."
                say_unhurried([left])

        yield publish
        if open_:  # the last line is whole where somebody reads
            with suppress(OSError):
                send(b"", wait=True)


@contextmanager
def published_frames(name: BusName, every: float | None, dbc: Path, stopped: Stopped) -> Iterator[Sink]:
    """Results as frames on a bus, a sample each `every` seconds, by default `clutchid.exports.frames.PERIOD`.

    Where the bus does not take them, the recording goes on without them, and says so once. `dbc` is written once
    the bus is open.
    """
    from clutchid.exports.frames import MESSAGES, PERIOD, observe_frames, results_dbc
    from clutchid.files import write_text
    from clutchid.measurements.live.bus import sender

    sent, failed, cycle = 0, False, PERIOD if every is None else every
    with sender(name, stopped) as send:
        write_text(results_dbc(cycle), dbc)

        def publish(before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
            nonlocal sent, failed
            frames = observe_frames(before, after, part, cycle, sent)
            sent += len(frames) // len(MESSAGES)
            for begin in range(0, len(frames), len(MESSAGES)):
                if (reason := send(frames[begin : begin + len(MESSAGES)])) and not failed:
                    failed = True
                    say_unhurried([f"{name}: does not take every frame ({reason}); the recording goes on."])

        yield publish

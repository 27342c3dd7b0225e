"""Where results of a live recording go besides files: lines on standard output, frames on a bus, a view of them."""

from __future__ import annotations

import errno
import os
import select
import stat
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.cli.terminal import discard_output, put, say

if TYPE_CHECKING:
    from clutchid.io.live.bus import BusName
    from clutchid.observe.live import LiveRun
    from clutchid.observe.recording import ObservedRecording

#: Takes the recording before a block, after it, and the block.
Sink = Callable[["LiveRun", "LiveRun", "ObservedRecording"], None]

Stopped = Callable[[], bool]

#: Time in s after which a reader of standard output that takes nothing is not waited for; the same once it is stopped,
#: and where the reader had stalled and takes something again.
STALL, STALL_STOPPED, STALL_AGAIN = 2.0, 0.2, 0.05

#: Time in s after which a wait asks whether it is stopped.
PATIENCE = 0.1

#: Time in s from one picture of the view to the next.
FRAME = 0.25


@contextmanager
def published_lines(every: float, stopped: Stopped) -> Iterator[Sink]:
    """Results as JSON lines on standard output, written block by block; a sample each `every` seconds, 0 for all.

    Where standard output is closed, full or fails, the recording goes on without it; where nobody reads it, what does
    not fit is left out until somebody does. Once `stopped`, nothing waits for a reader.
    """
    from clutchid.report.observe_lines import observe_lines

    with _standard_output() as descriptor:
        unsent, open_, stalled = b"", True, False

        def send(text: bytes) -> None:
            nonlocal unsent, open_, stalled
            try:
                if descriptor is None:
                    put(text.decode().removesuffix("\n"))
                    return
                unsent = _sent(descriptor, unsent, stopped, wait=not stalled)
                unsent = unsent or _sent(descriptor, text, stopped, wait=True)
            except OSError as error:
                unsent, open_ = b"", False
                discard_output()
                reason = "closed" if error.errno == errno.EPIPE else f"lost ({error.strerror or error})"
                say([f"standard output was {reason}: nothing is published any more, the recording goes on."])
                return
            if unsent and not stalled and not stopped():
                say(["standard output is not read: results are left out there until it is, the recording goes on."])
            stalled = bool(unsent)

        def publish(before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
            lines = observe_lines(before, after, part, every) if open_ else []
            if lines:
                send("".join(f"{line}\n" for line in lines).encode())

        yield publish
        if descriptor is not None and unsent:  # the last line is whole where somebody reads
            with suppress(OSError):
                _sent(descriptor, unsent, stopped, wait=True)


@contextmanager
def _standard_output() -> Iterator[int | None]:
    """Descriptor of standard output; None where it has none.

    A pipe and a terminal are opened anew where that is possible, so that they do not block, for us alone.
    """
    try:
        descriptor = sys.stdout.fileno()
        sys.stdout.flush()
    except (OSError, ValueError):
        yield None
        return
    own = -1
    with suppress(OSError):
        if stat.S_ISFIFO(os.fstat(descriptor).st_mode) or os.isatty(descriptor):
            own = os.open(f"/proc/self/fd/{descriptor}", os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        yield descriptor if own < 0 else own
    finally:
        if own >= 0:
            os.close(own)


def _sent(descriptor: int, text: bytes, stopped: Stopped, *, wait: bool) -> bytes:
    """What standard output did not take of a text: it is given `STALL` seconds from one part to the next to `wait`.

    Without it the first part must go at once, as after a stall.
    """
    since, patience = time.monotonic(), STALL if wait else 0.0
    while text:
        patience = min(patience, STALL_STOPPED) if stopped() else patience
        rest = max(since + patience - time.monotonic(), 0.0)
        if not select.select([], [descriptor], [], min(rest, PATIENCE))[1]:
            if rest == 0.0:
                break
            continue
        with suppress(BlockingIOError):
            text = text[os.write(descriptor, text[: select.PIPE_BUF]) :]
            since, patience = time.monotonic(), max(patience, STALL_AGAIN)
    return text


@contextmanager
def published_frames(name: BusName, every: float | None, dbc: Path) -> Iterator[Sink]:
    """Results as frames on a bus, a sample each `every` seconds, by default `clutchid.report.observe_frames.PERIOD`.

    Where the bus does not take them, the recording goes on without them, and says so once. `dbc` is written once
    the bus is open.
    """
    from clutchid.io.files import write_text
    from clutchid.io.live.bus import sender
    from clutchid.report.observe_frames import MESSAGES, PERIOD, observe_frames, results_dbc

    sent, failed = 0, False
    with sender(name) as send:
        write_text(results_dbc(), dbc)

        def publish(before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
            nonlocal sent, failed
            frames = observe_frames(before, after, part, PERIOD if every is None else every, sent)
            sent += len(frames) // len(MESSAGES)
            for frame in frames:
                if (reason := send(*frame)) and not failed:
                    failed = True
                    say([f"{name}: does not take every frame ({reason}); the recording goes on."])

        yield publish


@contextmanager
def view() -> Iterator[Sink]:
    """A view of load curve, pressure and health on standard error, redrawn a few times a second.

    Nothing if that is no terminal.
    """
    if not sys.stderr.isatty():
        yield lambda _before, _after, _part: None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from clutchid.report.observe_view import observe_view

    shown = -FRAME
    last: Callable[[], Text] | None = None
    with Live(console=Console(stderr=True), auto_refresh=False, redirect_stdout=False) as picture:

        def show(_before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
            nonlocal shown, last
            last = partial(drawn, after, part)
            if time.monotonic() - shown >= FRAME:
                picture.update(last(), refresh=True)
                shown = time.monotonic()

        def drawn(after: LiveRun, part: ObservedRecording) -> Text:
            return Text(observe_view(after, part, picture.console.width))

        yield show
        if last is not None:
            picture.update(last(), refresh=True)

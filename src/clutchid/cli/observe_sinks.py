"""Sinks of the results of a live recording, besides files: lines on standard output, frames on a bus, a view."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from functools import partial
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TextIO

from clutchid.cli.terminal import discard_output, printable_lines, put
from clutchid.systems import Outgoing, is_closed_pipe

if TYPE_CHECKING:
    from clutchid.measurements.live.bus import BusName
    from clutchid.observer.live import LiveRun
    from clutchid.observer.recording import ObservedRecording

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
    from clutchid.documents.observe_lines import observe_lines

    with _outgoing(sys.stdout) as out:
        send = _as_printed if out is None else _sender(out, stopped)
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


class _Send(Protocol):
    """Sends a text, behind what was left of those before; whether all of it was taken.

    What is left over is kept, and a text that comes while there is some is left out. `wait` is whether the rest of the
    text before is waited for.
    """

    def __call__(self, text: bytes, *, wait: bool) -> bool: ...


def _as_printed(text: bytes, *, wait: bool) -> bool:
    del wait
    if text:
        put(text.decode().removesuffix("\n"))
    return True


def _sender(out: Outgoing, stopped: Stopped, patience: float | None = None) -> _Send:
    """Function that sends to `out`, which is given `patience` seconds, by default `STALL`, to take a part."""

    def send(text: bytes, *, wait: bool) -> bool:
        each = STALL if patience is None else patience
        if _left(out, stopped, each if wait else 0.0):
            return False
        out.send(text)
        return not _left(out, stopped, each)

    return send


@contextmanager
def _outgoing(stream: TextIO) -> Iterator[Outgoing | None]:
    """A standard stream that is written without waiting for its reader; None where it has no descriptor."""
    with ExitStack() as stack:
        try:
            stream.flush()
            out = stack.enter_context(Outgoing(stream.fileno()))
        except (AttributeError, OSError, ValueError):
            yield None
            return
        yield out


def _left(out: Outgoing, stopped: Stopped, patience: float) -> int:
    """Number of bytes that were not taken: there are `patience` seconds from one part to the next.

    With 0 the first part must have gone, as after a stall.
    """
    since = time.monotonic()
    while out.left:
        patience = min(patience, STALL_STOPPED) if stopped() else patience
        rest = max(since + patience - time.monotonic(), 0.0)
        if out.wait(min(rest, PATIENCE)):
            since, patience = time.monotonic(), max(patience, STALL_AGAIN)
        elif rest == 0.0:
            break
    return out.left


@contextmanager
def published_frames(name: BusName, every: float | None, dbc: Path, stopped: Stopped) -> Iterator[Sink]:
    """Results as frames on a bus, a sample each `every` seconds, by default `clutchid.exports.frames.PERIOD`.

    Where the bus does not take them, the recording goes on without them, and says so once. `dbc` is written once
    the bus is open.
    """
    from clutchid.exports.frames import MESSAGES, PERIOD, observe_frames, results_dbc
    from clutchid.files import write_text
    from clutchid.measurements.live.bus import sender

    sent, failed = 0, False
    with sender(name, stopped) as send:
        write_text(results_dbc(), dbc)

        def publish(before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
            nonlocal sent, failed
            frames = observe_frames(before, after, part, PERIOD if every is None else every, sent)
            sent += len(frames) // len(MESSAGES)
            for begin in range(0, len(frames), len(MESSAGES)):
                if (reason := send(frames[begin : begin + len(MESSAGES)])) and not failed:
                    failed = True
                    say_unhurried([f"{name}: does not take every frame ({reason}); the recording goes on."])

        yield publish


class _Collected(StringIO):
    """Text that is given as a whole where it is flushed: what is not taken then is left out."""

    def __init__(self, send: _Send, terminal: bool) -> None:
        super().__init__()
        self._send, self._terminal = send, terminal

    def isatty(self) -> bool:
        return self._terminal

    def flush(self) -> None:
        text = self.getvalue()
        self.seek(0)
        self.truncate()
        if text:
            self._send(text.encode(), wait=False)


@contextmanager
def view(stopped: Stopped) -> Iterator[Sink]:
    """A view of load curve, pressure and health on standard error, redrawn a few times a second.

    Nothing if that is no terminal, or one that hangs up; one that is stopped misses pictures.
    """
    if not sys.stderr.isatty():
        yield lambda _before, _after, _part: None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from clutchid.documents.observe_view import observe_view

    shown = -FRAME
    last: Callable[[], Text] | None = None
    with _outgoing(sys.stderr) as out:
        open_, deliver = True, _as_printed if out is None else _sender(out, stopped, STALL_AGAIN)

        def send(text: bytes, *, wait: bool) -> bool:
            nonlocal open_
            try:
                return not open_ or deliver(text, wait=wait)
            except OSError:
                open_ = False
                return True

        console = Console(file=_Collected(send, True), force_terminal=True)
        with Live(console=console, auto_refresh=False, redirect_stdout=False) as picture:

            def show(_before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
                nonlocal shown, last
                last = partial(drawn, after, part)
                if open_ and time.monotonic() - shown >= FRAME:
                    picture.update(last(), refresh=True)
                    shown = time.monotonic()

            def drawn(after: LiveRun, part: ObservedRecording) -> Text:
                return Text(observe_view(after, part, picture.console.width))

            yield show
            if last is not None:
                picture.update(last(), refresh=True)


@contextmanager
def unhurried_errors() -> Iterator[None]:
    """Standard error that is written at the end of the ``with`` block, and waits for no reader that takes nothing."""
    with _outgoing(sys.stderr) as out:
        if out is None:
            yield
            return
        collected = _Collected(_sender(out, lambda: False, STALL_STOPPED), sys.stderr.isatty())
        try:
            with redirect_stderr(collected):
                yield
        finally:
            with suppress(OSError):
                collected.flush()


def say_unhurried(warnings: Iterable[str]) -> None:
    """Say warnings while the recording goes on, also where nobody hears them: a closed terminal ends nothing.

    One that is stopped, or a pipe that nobody reads, is waited for as one that publishes and is stopped.
    """
    text = "".join(f"warning: {printable_lines(warning)}\n" for warning in warnings)
    shown = hasattr(sys.stderr, "rich_proxied_file")  # above the view, which does not block
    with suppress(OSError, ValueError), _outgoing(sys.stderr) as out:
        if out is None or shown:
            put(text.removesuffix("\n"), to=sys.stderr)
        else:
            encoding = sys.stderr.encoding or "utf-8"
            _sender(out, lambda: False, STALL_STOPPED)(text.encode(encoding, "backslashreplace"), wait=True)

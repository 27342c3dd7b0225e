"""Standard output and standard error of a service, which never wait for a slow reader."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from io import StringIO
from typing import TYPE_CHECKING, Protocol, TextIO

from clutchid.documents.console import discard_output, printable_lines, put
from clutchid.systems import Outgoing, is_closed_pipe

if TYPE_CHECKING:
    from clutchid.observer.live import LiveRun
    from clutchid.observer.run import ObservedRecording

Stopped = Callable[[], bool]

#: Takes the recording after a block, and the block.
Publish = Callable[["LiveRun", "ObservedRecording"], None]

#: Time in s after which a reader of standard output that takes nothing is not waited for; the same once it is stopped,
#: and where the reader had stalled and takes something again.
_STALL, _STALL_STOPPED, _STALL_AGAIN = 2.0, 0.2, 0.05

#: Time in s after which a wait asks whether it is stopped.
_PATIENCE = 0.1


@contextmanager
def _outgoing(stream: TextIO) -> Iterator[Outgoing | None]:
    """A standard stream that does not wait for its reader; None if it has no descriptor."""
    with ExitStack() as stack:
        try:
            stream.flush()
            out = stack.enter_context(Outgoing(stream.fileno()))
        except (AttributeError, OSError, ValueError):
            yield None
            return
        yield out


class _Send(Protocol):
    """Function that sends a text after the rest of earlier texts; whether all of it was taken.

    What is left over is kept, and a text that comes while there is some is left out. `wait` is whether the rest of the
    text before is waited for.
    """

    def __call__(self, text: bytes, *, wait: bool) -> bool: ...


def _as_printed(text: bytes, *, wait: bool) -> bool:
    """Send a text as `put` does, where a stream has no descriptor."""
    del wait
    if text:
        put(text.decode().removesuffix("\n"))
    return True


def _sender_to(out: Outgoing, stopped: Stopped, patience: float) -> _Send:
    """Function that sends to `out`, which is given `patience` seconds to take a part."""

    def send(text: bytes, *, wait: bool) -> bool:
        if _left(out, stopped, patience if wait else 0.0):
            return False
        out.send(text)
        return not _left(out, stopped, patience)

    return send


def _left(out: Outgoing, stopped: Stopped, patience: float) -> int:
    """Number of bytes that were not taken, with `patience` seconds for each part.

    With 0 the first part must have gone, as after a stall.
    """
    since = time.monotonic()
    while out.left:
        patience = min(patience, _STALL_STOPPED) if stopped() else patience
        rest = max(since + patience - time.monotonic(), 0.0)
        if out.wait(min(rest, _PATIENCE)):
            since, patience = time.monotonic(), max(patience, _STALL_AGAIN)
        elif rest == 0.0:
            break
    return out.left


class _Collected(StringIO):
    """Text that is sent as a whole when it is flushed; the rest that the reader does not take is dropped."""

    def __init__(self, send: _Send, terminal: bool) -> None:
        super().__init__()
        self._send, self._terminal = send, terminal

    def isatty(self) -> bool:
        """Whether it stands for a terminal."""
        return self._terminal

    def flush(self) -> None:
        """Send what was collected."""
        text = self.getvalue()
        self.seek(0)
        self.truncate()
        if text:
            self._send(text.encode(), wait=False)


@contextmanager
def unhurried_errors() -> Iterator[None]:
    """Standard error that is written at the end of the ``with`` block, without waiting for a slow reader."""
    with _outgoing(sys.stderr) as out:
        if out is None:
            yield
            return
        collected = _Collected(_sender_to(out, lambda: False, _STALL_STOPPED), sys.stderr.isatty())
        try:
            with redirect_stderr(collected):
                yield
        finally:
            with suppress(OSError):
                collected.flush()


def say_unhurried(warnings: Iterable[str]) -> bool:
    """Print warnings while the recording goes on, and return whether they were taken; a closed terminal is no error.

    A stopped terminal, or a pipe that nobody reads, is given as much time as a stopped publisher.
    """
    text = "".join(f"warning: {printable_lines(warning)}\n" for warning in warnings)
    with suppress(OSError, ValueError), _outgoing(sys.stderr) as out:
        if out is None:
            put(text.removesuffix("\n"), to=sys.stderr)
            return True
        encoding = sys.stderr.encoding or "utf-8"
        return _sender_to(out, lambda: False, _STALL_STOPPED)(text.encode(encoding, "backslashreplace"), wait=True)
    return False


@contextmanager
def published_lines(stopped: Stopped) -> Iterator[Publish]:
    """Function that writes the results of a block as JSON lines on standard output.

    Where standard output is closed, full or fails, the recording goes on without it; where nobody reads it, what does
    not fit is left out until somebody does. Once `stopped`, nothing waits for a reader.
    """
    from clutchid.documents.observation_lines import observe_lines

    with _outgoing(sys.stdout) as out:
        send = _as_printed if out is None else _sender_to(out, stopped, _STALL)
        open_, stalled = True, False

        def publish(after: LiveRun, part: ObservedRecording) -> None:
            nonlocal open_, stalled
            lines = observe_lines(after, part) if open_ else []
            if not lines:
                return
            earlier = stalled
            try:
                stalled = not send("".join(f"{line}\n" for line in lines).encode(), wait=not stalled)
            except OSError as error:
                open_ = False
                discard_output()
                reason = "closed" if is_closed_pipe(error) else f"lost ({error.strerror or error})"
                say_unhurried([f"standard output was {reason}: nothing more is published; the recording goes on."])
                return
            if stalled and not earlier and not stopped():
                left = (
                    "standard output is not read: results are skipped there until it is read again; the recording "
                    "goes on."
                )
                say_unhurried([left])

        yield publish
        if open_:  # the last line is whole where somebody reads
            with suppress(OSError):
                send(b"", wait=True)

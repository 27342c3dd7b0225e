"""Where results of a live recording go besides files: lines on standard output, frames on a bus, a view of them."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.cli.terminal import printable_lines

if TYPE_CHECKING:
    from clutchid.io.live.bus import BusName
    from clutchid.observe.live import LiveRun
    from clutchid.observe.recording import ObservedRecording

#: Takes the recording before a block, after it, and the block.
Sink = Callable[["LiveRun", "LiveRun", "ObservedRecording"], None]

#: Time in s from one picture of the view to the next.
FRAME = 0.25


@contextmanager
def published_lines(every: float) -> Iterator[Sink]:
    """Results as JSON lines on standard output, flushed block by block; a sample each `every` seconds, 0 for all.

    Where nobody reads them any more, the recording goes on without them.
    """
    from clutchid.report.observe_lines import observe_lines

    open_ = True

    def publish(before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
        nonlocal open_
        lines = observe_lines(before, after, part, every) if open_ else []
        try:
            if lines:
                print("\n".join(lines), flush=True)
        except BrokenPipeError:
            open_ = False
            _discard_output()
            say(["standard output was closed: nothing is published any more, the recording goes on."])

    yield publish


@contextmanager
def published_frames(name: BusName, every: float | None, dbc: Path) -> Iterator[Sink]:
    """Results as frames on a bus, a sample each `every` seconds, by default `clutchid.report.observe_frames.PERIOD`.

    Where the bus does not take them, the recording goes on without them, and says so once. `dbc` is written.
    """
    from clutchid.io.live.bus import sender
    from clutchid.report.files import write_text
    from clutchid.report.observe_frames import MESSAGES, PERIOD, observe_frames, results_dbc

    write_text(results_dbc(), dbc)
    sent, failed = 0, False
    with sender(name) as send:

        def publish(before: LiveRun, after: LiveRun, part: ObservedRecording) -> None:
            nonlocal sent, failed
            frames = observe_frames(before, after, part, PERIOD if every is None else every, sent)
            sent += len(frames) // len(MESSAGES)
            for frame in frames:
                if (reason := send(*frame)) and not failed:
                    failed = True
                    say([f"{name}: does not take every frame ({reason}); the recording goes on."])

        yield publish


def _discard_output() -> None:
    """Let go to the null device what is left for standard output, which Python would write again at its end."""
    with suppress(OSError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


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


def say(warnings: Iterable[str]) -> None:
    """Say warnings while the recording goes on."""
    for warning in warnings:
        print(f"warning: {printable_lines(warning)}", file=sys.stderr, flush=True)

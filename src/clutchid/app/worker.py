"""The process of one job: a pickled task on standard input, events as JSON lines on standard output.

It is started before a job is there, with its imports done, and waits. It ends with all that it started when the server
closes its standard input, as when it is killed.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from clutchid.app.records import Task
from clutchid.documents.json_text import json_text
from clutchid.systems import end_session
from clutchid.verbs.failures import failure

#: Interval in s between two events about the same stage.
_GLANCE = 0.1


class Events:
    """Messages of a job as JSON lines; progress within a stage is thinned out."""

    def __init__(self, descriptor: int) -> None:
        self._file = os.fdopen(descriptor, "w", encoding="utf-8")
        self._stage, self._last = "", 0.0

    def say(self, event: str, **values: Any) -> None:
        """Write an event at once."""
        self._file.write(json_text({"event": event, **values}) + "\n")
        self._file.flush()

    def part(self, result: dict[str, Any]) -> None:
        """Report a partial result."""
        self.say("part", result=result)

    def progress(self, stage: str, share: float | None, words: str) -> None:
        """Report progress: a new stage at once, the same stage at most ten times a second."""
        now = time.monotonic()
        if stage != self._stage or now - self._last >= _GLANCE:
            self._stage, self._last = stage, now
            self.say("progress", stage=stage, share=share, words=words)


def main() -> None:
    """Wait for a task, do it, and report the result or the failure."""
    events = Events(os.dup(1))
    os.dup2(2, 1)  # what a library prints is no event
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which ends its jobs
    from clutchid.app import tasks  # with all that a job needs

    events.say("ready")
    try:
        task: Task = pickle.load(sys.stdin.buffer)  # of the server alone, which started this process
    except EOFError:
        return
    threading.Thread(target=_end_with_server, daemon=True).start()
    do_task(task, tasks.TASKS[type(task)], events)


def do_task(task: Task, work: Callable[..., dict[str, Any]], events: Events) -> None:
    """Do one task, and report its result or its failure."""
    try:
        events.say("done", result=work(task, events))
    except Exception as error:
        message, status = failure(error, debug=False)
        message = without_folders(message, task)
        trace = "" if status == "bad_input" else "".join(traceback.format_exception(error))
        events.say("failed", message=message, status=status, traceback=trace)


def without_folders(message: str, task: Task) -> str:
    """A message with file names instead of paths, which may be those of the server's folder."""
    folders = {path.parent for path in _paths(task) if path.parent != path.parent.parent}
    for folder in sorted(folders, key=lambda folder: -len(folder.parts)):
        message = message.replace(f"{folder}{os.sep}", "")
    return message


def _paths(value: object) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif is_dataclass(value):
        yield from (path for field in fields(value) for path in _paths(getattr(value, field.name)))
    elif isinstance(value, tuple):
        yield from (path for member in value for path in _paths(member))


def _end_with_server() -> None:
    """End this process and its group when standard input is closed."""
    sys.stdin.read()
    end_session()


if __name__ == "__main__":
    main()

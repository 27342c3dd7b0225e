"""One piece of work in a process of its own, with limits of time and memory: whatever it does, only that process ends.

Work that may have ended a worker is done so once more, which tells the work that ends every worker from the work that
was merely there when one was lost.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import psutil

from clutchid.processes import end_with_parent

#: Interval in s at which time and memory are looked at.
_GLANCE = 0.05

_START = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from clutchid.fleet.alone import main; main()"


class Lost(NamedTuple):
    """Work without a result: `status` is "killed", "timed_out" or "failed", with a sentence."""

    status: str
    message: str


class Limits(NamedTuple):
    """What one piece of work may take: time in s, and memory of its process in bytes; 0 for no limit."""

    seconds: float = 0.0
    memory: int = 0


def alone(work: Callable[[Any], Any], item: Any, limits: Limits) -> Any:
    """The result of `work` on `item` in a process of its own, or how it was `Lost`."""
    try:
        return _alone(work, item, limits)
    except OSError as error:  # as on a full disk
        reason = error.strerror or type(error).__name__
        return Lost("killed", f"ended its worker, and a process of its own could not be started ({reason}).")


def _alone(work: Callable[[Any], Any], item: Any, limits: Limits) -> Any:
    with tempfile.TemporaryDirectory(prefix="clutchid-") as folder:
        given, found = Path(folder, "given"), Path(folder, "found")
        given.write_bytes(pickle.dumps((work, item)))
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", _START, json.dumps(sys.path), str(given), str(found),
             str(os.getpid())],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        try:
            lost = _watched(process, limits)
        finally:
            process.kill()
            process.wait()
        if lost is not None:
            return lost
        return pickle.loads(found.read_bytes())  # written by our own process, in a folder of ours


def main() -> None:
    """Do the work that a file describes, and write what came of it."""
    end_with_parent(int(sys.argv[4]))
    given, found = map(Path, sys.argv[2:4])
    work, item = pickle.loads(given.read_bytes())
    found.write_bytes(pickle.dumps(work(item)))


def _watched(process: subprocess.Popen[bytes], limits: Limits) -> Lost | None:
    """Wait for the process; how it was lost, if it was."""
    begin = time.monotonic()
    while process.poll() is None:
        if limits.seconds and time.monotonic() - begin > limits.seconds:
            return Lost("timed_out", f"took longer than {limits.seconds:g} s; allow more with --timeout.")
        if limits.memory and _memory(process.pid) > limits.memory:
            size = limits.memory / 1e9
            return Lost(
                "killed", f"needs more than {size:.3g} GB of memory; allow more with --memory, or use fewer workers."
            )
        time.sleep(_GLANCE)
    if process.returncode == 0:
        return None
    return Lost(
        "killed", f"{_ending(process.returncode)} on this recording, twice; the recording or a library is at fault."
    )


def _memory(pid: int) -> int:
    """Bytes of a process and its readers in memory."""
    try:
        process = psutil.Process(pid)
        return sum(int(one.memory_info().rss) for one in (process, *process.children(recursive=True)))
    except psutil.Error:
        return 0


def _ending(code: int) -> str:
    """How a process ended, in words."""
    if code > 0 or os.name != "posix":
        return f"the process ended with code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    also = ", as where memory runs out," if name == "SIGKILL" else ""
    return f"the process was ended by {name}{also}"

"""`Worker`: a process that answers questions, and the watch over its memory and time."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import IO, Literal, NamedTuple

from clutchid.processes.frames import MessageParts, receive, send
from clutchid.systems import DETACHED, ending, interpreter

#: Interval in s at which memory and time are looked at while an answer is awaited.
_GLANCE = 0.05

#: Bytes that wait in the pipe at most, where the system lets one choose.
_PIPE = 1 << 20

_START = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[1]); "
    "from clutchid.processes.serving import main; main(*sys.argv[2:])"
)


class Limits(NamedTuple):
    """Limits of one answer: time in s, and memory of the process in bytes; 0 for no limit."""

    seconds: float = 0.0
    memory: int = 0


NO_LIMITS = Limits()


class WorkerEnd(NamedTuple):
    """End of a worker without an answer: over its limit of `memory` or `time`, or by itself; `how` in words."""

    why: Literal["memory", "time", "itself"]
    how: str = ""


class Memory(NamedTuple):
    """Memory of a process in bytes: what is `resident`, and what counts against the limit of its allocations."""

    resident: int
    allocated: int


class Worker:
    """A process that answers questions, one at a time, until it ends.

    It has a folder of its own for temporary files, which goes with it.

    Parameters
    ----------
    service
        What it does: ``module:function``, which makes a `clutchid.processes.serving.Service`.
    allocations
        Bytes above which an allocation fails at once in it; 0 for no limit.
    environment
        Variables in addition to those of this process.

    Raises
    ------
    OSError
        If it cannot be started, as on a full disk.
    """

    def __init__(self, service: str, *, allocations: int = 0, environment: Mapping[str, str] | None = None) -> None:
        self.owner = os.getpid()
        folder = tempfile.mkdtemp(prefix="clutchid-")
        try:
            temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)
            self._process = _started(service, allocations, {**(environment or {}), **temporary})
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        self.end = weakref.finalize(self, _end, self._process, folder, self.owner)
        self._answers: queue.Queue[list[bytearray] | None] = queue.Queue(maxsize=1)
        assert self._process.stdout is not None
        threading.Thread(target=_collect, args=(self._process.stdout, self._answers), daemon=True).start()
        self._lock = threading.Lock()

    @property
    def alive(self) -> bool:
        """Whether it can answer: started by this process and still running."""
        return self.end.alive and self.owner == os.getpid() and self._process.poll() is None

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def ask(self, question: MessageParts, limits: Limits) -> list[bytearray] | WorkerEnd:
        """The answer to a question; without one, the worker has ended."""
        with self._lock, self._ended_on_error():
            answer = self._exchanged(question, limits) if self.end.alive else WorkerEnd("itself", "it was ended before")
        if isinstance(answer, WorkerEnd):
            self.end()
        return answer

    @contextmanager
    def _ended_on_error(self) -> Iterator[None]:
        """End the worker after an exception such as Ctrl-C, as its next answer would belong to the question before."""
        try:
            yield
        except BaseException:
            self.end()
            raise

    def _exchanged(self, question: MessageParts, limits: Limits) -> list[bytearray] | WorkerEnd:
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):  # it has ended: that is found below
            send(self._process.stdin, question)
        begin = time.monotonic()
        while True:
            try:
                answer = self._answers.get(timeout=_GLANCE)
            except queue.Empty:
                if limits.memory and self.memory().resident > limits.memory:
                    return WorkerEnd("memory")
                if limits.seconds and time.monotonic() - begin > limits.seconds:
                    return WorkerEnd("time")
                continue
            return WorkerEnd("itself", ending(self._process.wait())) if answer is None else answer

    def memory(self) -> Memory:
        """Memory that the process has now; none once it has ended."""
        import psutil

        try:
            memory = psutil.Process(self.pid).memory_info()
        except psutil.Error:
            return Memory(0, 0)
        return Memory(memory.rss, getattr(memory, "data", memory.rss))


def _started(service: str, allocations: int, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    """A worker process.

    It ends with the thread that started it, so that one which lasts as long as this process starts all of them.
    """
    python, additions = interpreter()
    command = [python, "-P", "-c", _START, json.dumps(sys.path), str(os.getpid()), service, str(allocations)]
    return _starter(os.getpid()).submit(_popen, command, {**os.environ, **additions, **environment}).result()


def _popen(command: list[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pipesize=_PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        **DETACHED,  # Ctrl-C is for clutchid, which ends its workers itself
    )


@cache
def _starter(_process: int) -> ThreadPoolExecutor:
    """The thread that starts the workers of this process; it does not survive a fork."""
    return ThreadPoolExecutor(1, "clutchid-starter")


def _end(process: subprocess.Popen[bytes], folder: str, owner: int) -> None:
    """End a worker of this process, and remove its files."""
    if owner != os.getpid():
        return
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        with contextlib.suppress(OSError):
            if stream is not None:
                stream.close()
    shutil.rmtree(folder, ignore_errors=True)


def _collect(stream: IO[bytes], answers: queue.Queue[list[bytearray] | None]) -> None:
    """Put every answer into the queue, and None behind the last."""
    with contextlib.suppress(EOFError, OSError, ValueError):
        while True:
            answers.put(receive(stream))
    answers.put(None)

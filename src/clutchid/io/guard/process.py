"""`ReaderProcess`: the process that opens foreign files, and the watch over its memory and time."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from clutchid.errors import DataError, MissingExtra
from clutchid.io.guard.limits import memory, seconds, too_large, too_long
from clutchid.io.guard.messages import Arrays, Message, receive, send

Answer = tuple[Message, Arrays]

#: Interval in s at which memory and time are looked at while an answer is awaited.
_GLANCE = 0.05

#: Bytes that wait in the pipe at most, where the system lets one choose.
_PIPE = 1 << 20

_START = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from clutchid.io.guard.worker import main; main()"
_SPOILED = "it is damaged, or of a kind that its library cannot read; copy it again or convert it to Parquet or CSV."


class ReaderProcess:
    """A process that answers questions about files; it is used up when it ends, however it ends."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self.forgotten: deque[int] = deque()
        self._folder = tempfile.mkdtemp(prefix="clutchid-")
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _START, json.dumps(sys.path), str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pipesize=_PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self._folder), "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,  # Ctrl-C is for clutchid, which ends the reader itself
        )
        self._answers: queue.Queue[Answer | None] = queue.Queue(maxsize=1)
        assert self._process.stdout is not None
        threading.Thread(target=_collect, args=(self._process.stdout, self._answers), daemon=True).start()
        self._lock = threading.Lock()
        self._ended = False

    @property
    def alive(self) -> bool:
        """Whether it can be asked: nobody ended it, and it did not end."""
        return not self._ended and self._process.poll() is None

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def ask(self, question: Message, path: Path) -> Answer:
        """The answer to a question about the file at `path`.

        Raises
        ------
        DataError
            If the file cannot be read, or the process ended or had to be ended on it; the text names the file.
        MissingExtra
            If a library is not installed.
        """
        with self._lock, self._ended_on_error():
            if self._ended:
                raise DataError(f"{path}: the reader process has ended since it was opened; open the file again.")
            forget = [self.forgotten.popleft() for _ in range(len(self.forgotten))]
            message, arrays = self._exchanged({**question, "forget": forget}, path)
        if "failed" in message:
            raise _error(message, path)
        return message, arrays

    def end(self) -> None:
        """End the process, and remove what it left on the disk."""
        self._ended = True
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if stream is not None:
                    stream.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    @contextmanager
    def _ended_on_error(self) -> Iterator[None]:
        """After an error or Ctrl-C between a question and its answer nothing that the process says can be trusted."""
        try:
            yield
        except BaseException:
            self.end()
            raise

    def _exchanged(self, question: Message, path: Path) -> Answer:
        assert self._process.stdin is not None
        limit = seconds(path.stat().st_size if path.exists() else 0)
        with contextlib.suppress(OSError):  # it has ended: that is found below
            send(self._process.stdin, {**question, "limit": limit})
        deadline = time.monotonic() + limit
        while True:
            try:
                answer = self._answers.get(timeout=_GLANCE)
            except queue.Empty:
                if self._resident() > memory():
                    raise DataError(f"{path}: {too_large()}") from None
                if time.monotonic() > deadline:
                    raise DataError(f"{path}: {too_long(limit)}") from None
                continue
            if answer is None:
                raise DataError(f"{path}: the reader process ended on it ({self._reason()}): {_SPOILED}")
            return answer

    def _resident(self) -> int:
        """Bytes of memory that the process has; 0 once it has ended."""
        import psutil

        try:
            return int(psutil.Process(self.pid).memory_info().rss)
        except psutil.Error:
            return 0

    def _reason(self) -> str:
        code = self._process.wait()
        try:
            return signal.Signals(-code).name if code < 0 else f"exit code {code}"
        except ValueError:
            return f"signal {-code}"


def _collect(stream: IO[bytes], answers: queue.Queue[Answer | None]) -> None:
    """Put every answer into the queue, and None behind the last."""
    with contextlib.suppress(EOFError, OSError, ValueError):
        while True:
            answers.put(receive(stream))
    answers.put(None)


def _error(message: Message, path: Path) -> DataError | MissingExtra:
    """The error that the reader process answered with."""
    texts = {
        "data": message["text"],
        "missing": message["text"],
        "memory": f"{path}: {too_large()}",
        "unreadable": f"{path}: cannot be read ({message['text']}).",
        "unexpected": f"{path}: cannot be read ({message['text']}): {_SPOILED}",
    }
    kind = MissingExtra if message["failed"] == "missing" else DataError
    error = kind(texts[message["failed"]])
    error.add_note(f"In the reader process:\n{message['traceback']}")
    return error


_current: list[ReaderProcess] = []


def reader() -> ReaderProcess:
    """The reader process of this command, started when it is needed first and again after it ended."""
    process = _current.pop() if _current else None
    if process is not None and process.owner == os.getpid():
        if process.alive:
            _current.append(process)
            return process
        process.end()
    _current.append(ReaderProcess())
    return _current[0]


@atexit.register
def _end() -> None:
    if _current and _current[0].owner == os.getpid() and _current[0].alive:
        _current[0].end()

"""`ReaderProcess`: the worker process that opens foreign files, and what is said when it ends on one."""

from __future__ import annotations

from collections import deque
from pathlib import Path

from clutchid.errors import DataError, MissingExtra
from clutchid.processes import Ended, Limits, Worker
from clutchid.recordings.guard.limits import memory, seconds, too_large, too_long
from clutchid.recordings.guard.messages import Arrays, Message, decoded, encoded

Answer = tuple[Message, Arrays]

_SPOILED = "it is damaged, or of a kind that its library cannot read; copy it again or convert it to Parquet or CSV."


class ReaderProcess:
    """A worker process that answers questions about files; it is used up when it ends, however it ends.

    An allocation of much more than the limit of memory fails at once in it; the rest is watched.
    """

    def __init__(self) -> None:
        self.forgotten: deque[int] = deque()
        environment = {"OPENBLAS_NUM_THREADS": "1"}
        self.worker = Worker(
            "clutchid.recordings.guard.service:reader_service", allocations=2 * memory(), environment=environment
        )

    def ask(self, question: Message, path: Path) -> Answer:
        """The answer to a question about the file at `path`.

        Raises
        ------
        DataError
            If the file cannot be read, or the process ended or had to be ended on it; the text names the file.
        MissingExtra
            If a library is not installed.
        """
        if not self.worker.end.alive:
            raise DataError(f"{path}: the reader process has ended since it was opened; open the file again.")
        forget = [self.forgotten.popleft() for _ in range(len(self.forgotten))]
        limits = Limits(seconds(path.stat().st_size if path.exists() else 0), memory())
        parts = self.worker.ask(encoded({**question, "forget": forget}), limits)
        if isinstance(parts, Ended):
            raise DataError(f"{path}: {_without_answer(parts, limits)}")
        message, arrays = decoded(parts)
        if "failed" in message:
            raise _error(message, path)
        return message, arrays


def _without_answer(ended: Ended, limits: Limits) -> str:
    """Why there is no answer."""
    if ended.why == "itself":
        return f"the reader process ended on it ({ended.how}): {_SPOILED}"
    return too_large() if ended.why == "memory" else too_long(limits.seconds)


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


def reader(path: Path) -> ReaderProcess:
    """The reader process of this command, started when it is needed first and again after it ended.

    Raises
    ------
    DataError
        If it cannot be started; the text names the file at `path`, which is to be read.
    """
    if not (_current and _current[0].worker.alive):
        try:
            _current[:] = [ReaderProcess()]
        except OSError as error:
            reason = error.strerror or type(error).__name__
            raise DataError(f"{path}: no process to read it in could be started ({reason}).") from error
    return _current[0]

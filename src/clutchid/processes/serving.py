"""Worker process: a service that answers the questions of the process that started it."""

from __future__ import annotations

import os
import pickle
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import IO, NamedTuple

from clutchid.errors import ClutchidError
from clutchid.processes.frames import MessageParts, receive, send
from clutchid.systems import end_with_parent, limit_allocations


class Service(NamedTuple):
    """Service of a worker: `answer` a question, and work after each answer, while nobody waits."""

    answer: Callable[[MessageParts], MessageParts]
    afterwards: Callable[[], None] = lambda: None


def main(parent: str, name: str, allocations: str) -> None:
    """Serve until the other side has gone; output of libraries is discarded.

    Parameters
    ----------
    parent
        Number of the process that started this one.
    name
        The function that makes the service, ``module:function``.
    allocations
        Bytes above which an allocation fails at once, where the system can do that; 0 for no limit.
    """
    end_with_parent(int(parent))
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    limit_allocations(int(allocations))
    module, _, function = name.partition(":")
    _serve(getattr(import_module(module), function)(), sys.stdin.buffer, answers)


def _serve(service: Service, questions: IO[bytes], answers: IO[bytes]) -> None:
    """Answer every question, in turn, until there are no more."""
    while True:
        try:
            send(answers, service.answer(receive(questions)))
        except (EOFError, BrokenPipeError):
            return
        service.afterwards()


def work_service() -> Service:
    """Does pieces of work: a question is a function with its item, the answer its result or the error it raised."""
    return Service(_worked)


def _worked(question: MessageParts) -> MessageParts:
    """The answer to pickled work, with the time of the processor in s that it took.

    Both sides are this program, so that pickle carries no foreign data.
    """
    work, item = pickle.loads(question[0])
    begin = time.process_time()
    answer: tuple[str, object]
    try:
        answer = ("result", work(item))
    except ClutchidError as error:
        answer = ("error", error)
    except Exception as error:
        answer = ("unexpected", f"{type(error).__name__}: {error}")
    return [pickle.dumps((*answer, time.process_time() - begin), protocol=5)]

"""`Pool`: worker processes that are kept for pieces of work, with one thread of linear algebra each."""

from __future__ import annotations

import os
import pickle
import platform
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from typing import Any, Generic, NamedTuple, TypeVar, cast

from clutchid.errors import ClutchidError, ParameterError
from clutchid.processes.worker import NO_LIMITS, Limits, Worker, WorkerEnd

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

#: Environment of a worker: one thread of linear algebra, `clutchid.numerics.threads` and polars; memory is given back.
_ENVIRONMENT = {
    **dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"), "1"),
    **{"MALLOC_ARENA_MAX": "1", "MALLOC_TRIM_THRESHOLD_": "65536"},
}

#: Workers that may be asked for, a processor of this machine, and on the smallest one.
_PER_PROCESSOR, _AT_LEAST = 4, 16

#: Attempts at a piece of work: if it ends a new worker too, the work is at fault.
_ATTEMPTS = 2


class LostWork(NamedTuple):
    """Work without a result: `status` is "killed", "timed_out" or "failed", with a sentence."""

    status: str
    message: str


class Timing(NamedTuple):
    """Cost of a piece of work, and where it was done; empty where it was not done.

    Attributes
    ----------
    wall, processor : s
        Time that passed, and that of the processor for its worker process; the latter is not known of lost work.
    host, worker
        Name of the machine, and number of the worker process.
    attempt
        How many times it was begun.
    """

    wall: float = float("nan")
    processor: float = float("nan")
    host: str | None = None
    worker: int | None = None
    attempt: int = 0


#: Timing of work that was not done.
_NOT_DONE = Timing()


@dataclass(frozen=True, slots=True)
class FinishedWork(Generic[_Item, _Result]):
    """An item with its result, or how it was lost, and what that cost."""

    item: _Item
    result: _Result | LostWork
    timing: Timing = _NOT_DONE


class Pool:
    """Worker processes, started on demand and kept for the next piece of work.

    Several threads may give it work; each waits for its own.
    """

    def __init__(self, limits: Limits = NO_LIMITS) -> None:
        self._limits = limits
        self._lock = threading.Lock()
        self._workers: set[Worker] = set()
        self._idle: list[Worker] = []
        self._ended = False

    def do(self, work: Callable[[_Item], _Result], item: _Item) -> FinishedWork[_Item, _Result]:
        """The result of `work`, a function of a module or a partial of one, on an item; or how it was lost.

        Work that ends its worker, or needs more memory than it may, is given to a new one once more, so that what other
        work has left behind does not count.

        Raises
        ------
        ClutchidError
            If the work raises one; any other error is a result that is `LostWork`.
        """
        begin = time.perf_counter()
        try:
            result, timing = self._done(work, item)
        except OSError as error:  # as on a full disk
            result = LostWork("killed", f"no worker could be started ({error.strerror or type(error).__name__}).")
            timing = _NOT_DONE
        return FinishedWork(item, result, timing._replace(wall=time.perf_counter() - begin, host=platform.node()))

    def rest(self) -> None:
        """End idle workers."""
        with self._lock:
            idle, self._idle = self._idle, []
            self._workers -= set(idle)
        for worker in idle:
            worker.end()

    def end(self) -> None:
        """End all workers; their work is lost, and the pool accepts no more."""
        with self._lock:
            self._ended, workers = True, list(self._workers)
        for worker in workers:
            worker.end()

    def _done(self, work: Callable[[_Item], _Result], item: _Item) -> tuple[_Result | LostWork, Timing]:
        question = [pickle.dumps((work, item), protocol=5)]
        lost, timing = LostWork("killed", "the workers have already ended."), _NOT_DONE
        for attempt in range(_ATTEMPTS):
            worker, is_new = self._worker(new=attempt > 0)
            if self._ended:
                worker.end()
                break
            timing = Timing(worker=worker.pid, attempt=attempt + 1)
            answer = worker.ask(question, self._limits)
            with self._lock:
                (self._workers.discard if isinstance(answer, WorkerEnd) else self._idle.append)(worker)
            if not isinstance(answer, WorkerEnd):
                kind, content, processor = pickle.loads(answer[0])
                return cast("_Result | LostWork", _result(kind, content)), timing._replace(processor=processor)
            lost = _lost(answer, self._limits)
            if answer.why == "time" or (answer.why == "memory" and is_new):
                break
        return lost, timing

    def _worker(self, *, new: bool) -> tuple[Worker, bool]:
        """An idle worker, or a new one; and whether it is new."""
        with self._lock:
            while self._idle and not new:
                worker = self._idle.pop()
                if worker.alive:
                    return worker, False
                self._workers.discard(worker)
        worker = Worker("clutchid.processes.serving:work_service", environment=_ENVIRONMENT)
        with self._lock:
            self._workers.add(worker)
        return worker, True


def check_workers(workers: int) -> None:
    """Check the number of workers.

    Raises
    ------
    ParameterError
        If there is none, or so many that this machine cannot use them.
    """
    if workers < 1:
        raise ParameterError(f"--workers {workers}: must be at least 1.")
    processors = os.cpu_count() or 1
    most = max(_AT_LEAST, _PER_PROCESSOR * processors)
    if workers > most:
        raise ParameterError(
            f"--workers {workers}: this machine has {processors} processors, and takes {most} workers at most; more "
            "than one worker per processor is hardly faster."
        )


def results(
    work: Callable[[_Item], _Result], items: Iterable[_Item], workers: int, limits: Limits = NO_LIMITS
) -> Iterator[FinishedWork[_Item, _Result]]:
    """Items with their results in order of completion; even one worker is a process, so that results are identical.

    Parameters
    ----------
    work
        A function of a module, or a partial of one.
    items
        Are asked for as workers become free, so that there may be any number.
    workers
        Number of processes, at least 1.
    limits
        What one item may take.

    Raises
    ------
    ClutchidError
        If the work raises one.
    """
    waiting, pool, threads = iter(items), Pool(limits), ThreadPoolExecutor(workers)
    running: set[Future[FinishedWork[_Item, _Result]]] = set()

    def submitted() -> set[Future[FinishedWork[_Item, _Result]]]:
        some = islice(waiting, 2 * workers - len(running))  # one at work and one waiting for each worker
        return {threads.submit(pool.do, work, item) for item in some}

    try:
        running |= submitted()
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            running |= submitted()
            for future in finished:
                yield future.result()
    finally:
        pool.end()
        threads.shutdown(cancel_futures=True)


def _result(kind: str, content: Any) -> Any:
    if kind == "error":
        assert isinstance(content, ClutchidError)
        raise content
    if kind == "unexpected":
        return LostWork("failed", f"an error that clutchid did not expect, {content}.")
    return content


def _lost(ended: WorkerEnd, limits: Limits) -> LostWork:
    """Loss of work, in words."""
    if ended.why == "time":
        return LostWork("timed_out", f"took longer than {limits.seconds:g} s; allow more with --timeout.")
    if ended.why == "memory":
        size = limits.memory / 1e9
        return LostWork(
            "killed", f"needs more than {size:.3g} GB of memory; allow more with --memory, or use fewer workers."
        )
    how = f"{ended.how}, as happens when memory runs out" if ended.how == "SIGKILL" else ended.how
    return LostWork("killed", f"its process ended on it ({how}), twice; the recording or a library is at fault.")

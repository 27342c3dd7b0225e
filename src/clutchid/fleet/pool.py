"""Processes that share the work on many recordings, with one thread of linear algebra each; none is lost with them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import get_context
from typing import TypeVar

from clutchid.errors import ParameterError
from clutchid.fleet.alone import Limits, Lost, alone
from clutchid.processes import end_with_parent

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Environment variables that limit the threads of a process: linear algebra, `numerics.threads`, and polars.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")


#: Workers that may be asked for, a processor of this machine, and on the smallest one.
_PER_PROCESSOR, _AT_LEAST = 4, 16


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
            "than one a processor are hardly faster."
        )


def results(
    work: Callable[[Item], Result], items: Iterable[Item], workers: int
) -> Iterator[tuple[Item, Result | Lost]]:
    """Items with their results in order of completion; even one worker is a process, so results are identical.

    If a process is lost, all end with it. Those items that it may have had are then done in processes of their own, so
    that only the item that ends its process is `Lost`; the others go on.

    Parameters
    ----------
    work
        A function of a module, whose errors are raised here.
    workers
        Number of processes, at least 1.
    """
    todo = list(items)
    with _one_thread():
        while todo:
            count, left = min(workers, len(todo)), dict(enumerate(todo))
            for k, result in _together(work, todo, count):
                yield left.pop(k), result
            todo = list(left.values())
            suspects, todo = todo[: 2 * count + 1], todo[2 * count + 1 :]  # at work, and in the queue of the pool
            with ThreadPoolExecutor(count) as threads:
                yield from zip(suspects, threads.map(partial(alone, work, limits=Limits()), suspects), strict=True)


def _together(work: Callable[[Item], Result], todo: list[Item], count: int) -> Iterator[tuple[int, Result]]:
    """Results by the index of their item, until all are there or a process is lost."""
    futures: dict[Future[Result], int] = {}
    with spawned(count) as pool:
        with suppress(BrokenProcessPool):
            for k, item in enumerate(todo):
                futures[pool.submit(work, item)] = k
        for future in as_completed(futures):
            if not isinstance(future.exception(), BrokenProcessPool):
                yield futures[future], future.result()


def spawned(count: int) -> ProcessPoolExecutor:
    """New processes, started as work is given to them, that end with the thread that gives it."""
    return ProcessPoolExecutor(count, get_context("spawn"), initializer=end_with_parent, initargs=(os.getpid(),))


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread in new processes, because the workers already use all cores."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value

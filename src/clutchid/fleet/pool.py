"""Processes that share the work on many recordings, with one thread of linear algebra each."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from typing import TypeVar

from clutchid.errors import ParameterError

Item = TypeVar("Item")
Result = TypeVar("Result")

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")


def check_workers(workers: int) -> None:
    """Check the number of workers.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if workers < 1:
        raise ParameterError(f"--workers {workers}: must be at least 1.")


def results(work: Callable[[Item], Result], items: Iterable[Item], workers: int) -> Iterator[Result]:
    """Results of `work` on all items in order of completion; even one worker is a process, so results are identical.

    Parameters
    ----------
    work
        A function of a module, whose errors are raised here.
    workers
        Number of processes, at least 1.
    """
    todo = list(items)
    if not todo:
        return
    count = min(workers, len(todo))
    with _one_thread(), ProcessPoolExecutor(count, get_context("spawn"), initializer=end_with_parent) as pool:
        for future in as_completed([pool.submit(work, item) for item in todo]):
            yield future.result()


def end_with_parent() -> None:
    """Let this worker end when the process that started it is gone, however it went."""

    def wait() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


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

"""Workers that share the work on many items, on this machine or on many: Dask. No item is lost with its worker."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from itertools import islice
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from clutchid.errors import ParameterError, SolveError
from clutchid.extras import missing
from clutchid.fleet import pool
from clutchid.fleet.alone import Limits, Lost, alone
from clutchid.fleet.pool import THREADS, check_workers
from clutchid.fleet.scheduler import Tls, answered, check_scheduler, security_of

if TYPE_CHECKING:
    from distributed import Client, Future

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Items at the scheduler at a time: enough for hundreds of workers, and its memory does not grow with the fleet.
WINDOW = 1000

#: Items that are given to the scheduler together.
BATCH = 100

#: Time in s that a scheduler, its first worker, and then all of its workers have to answer.
ANSWER = 4.0

#: How often an item is given out, from the second time on in a process of its own: a worker that is lost then was not
#: ended by the item, but by others or from outside.
ATTEMPTS = 5

#: Address of this machine that no other one reaches.
LOOPBACK = "127.0.0.1"

#: Time in s in which a local worker starts on a busy machine.
START = "120s"


@dataclass(frozen=True, slots=True)
class Place:
    """Where work is done: processes on this machine, or the workers of the scheduler at an address.

    `memory` is that of a worker in bytes, and `seconds` what one item may take; 0 for no limit. `tls` has the files of
    certificates of a scheduler at a tls:// address.
    """

    workers: int = 1
    scheduler: str = ""
    memory: int = 0
    seconds: float = 0.0
    tls: Tls | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Cluster:
    """Workers that are ready; `dashboard` is the address of the scheduler's page, or empty."""

    client: Client
    place: Place
    dashboard: str


@dataclass(frozen=True, slots=True)
class Done(Generic[Item, Result]):
    """An item with its result, or how it was lost, and the time in s that it took."""

    item: Item
    result: Result | Lost
    seconds: float


@contextmanager
def cluster(place: Place) -> Iterator[Cluster]:
    """Workers that are ready to work; those of this machine end with the block.

    Raises
    ------
    MissingExtra
        Without Dask, or without `cryptography` for workers on this machine.
    ParameterError
        If there is no worker, the scheduler does not answer, or its workers have another version of clutchid.
    """
    check_workers(place.workers)
    try:
        import dask
        import distributed  # noqa: F401

        if not place.scheduler:
            import cryptography  # noqa: F401
    except ImportError as error:
        library = "cryptography" if error.name == "cryptography" else "Dask"
        raise missing("sharing the work between workers", library, "fleet") from error
    with _quiet(), dask.config.set(_settings(place)), _client(place) as client:
        dashboard = client.dashboard_link if find_spec("bokeh") or place.scheduler else ""
        if place.scheduler:
            check_scheduler(client, place.scheduler, ANSWER)
        yield Cluster(client, place, dashboard)


def results(on: Cluster, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Done[Item, Result]]:
    """Results in order of completion; what ends its worker, or takes too long, is a value with a sentence.

    Parameters
    ----------
    work
        A function of a module, or a partial of one, that returns whatever happens.
    items
        Are asked for as workers become free, so that there may be any number.

    Raises
    ------
    SolveError
        If the connection to the scheduler is lost.
    """
    from distributed import as_completed

    waiting, todo = iter(items), as_completed()
    attempts: dict[Future[Any], tuple[Item, int]] = {}
    first = partial(_timed, work, on.place.seconds)
    again = partial(_timed_alone, work, Limits(on.place.seconds, on.place.memory))

    def submit(some: Sequence[Item], attempt: int) -> None:
        futures = on.client.map(again if attempt else first, some, pure=False)
        attempts.update((future, (item, attempt)) for future, item in zip(futures, some, strict=True))
        todo.update(futures)

    submit(list(islice(waiting, WINDOW)), 0)
    for batch in todo.batches():
        for future, (found, seconds) in _outcomes(batch, on):
            item, attempt = attempts.pop(future)
            if isinstance(found, _Again) and attempt + 1 < ATTEMPTS:
                submit([item], attempt + 1)
            else:
                yield Done(item, found.lost if isinstance(found, _Again) else found, seconds)
        if len(attempts) <= WINDOW - BATCH:
            submit(list(islice(waiting, WINDOW - len(attempts))), 0)


def shared(work: Callable[[Item], Result], items: Sequence[Item], place: Place) -> Iterator[tuple[Item, Result | Lost]]:
    """Items with their results from the workers of a scheduler, or from processes of this machine, without Dask.

    Raises
    ------
    MissingExtra, ParameterError, SolveError
        As `cluster` and `results`.
    """
    if not place.scheduler or not items:
        yield from pool.results(work, items, place.workers)
        return
    with cluster(place) as on:
        yield from ((done.item, done.result) for done in results(on, work, items))


@dataclass(frozen=True, slots=True)
class _Again:
    """The worker was lost; the work may be at fault, or not."""

    lost: Lost


def _outcomes(futures: Sequence[Future[Any]], on: Cluster) -> list[tuple[Future[Any], tuple[Any, float]]]:
    """Results and times of futures that are done, brought here together."""
    from distributed import CancelledError

    finished = {future: future for future in futures if future.status == "finished"}
    found: dict[Future[Any], tuple[Any, float]] = {}
    with suppress(TimeoutError, OSError, KeyError, CancelledError):  # a worker went with a result
        found = on.client.sync(on.client._gather, finished, errors="skip", callback_timeout=ANSWER)
    return [(future, found[future] if future in found else _lost(future, on)) for future in futures]


def _lost(future: Future[Any], on: Cluster) -> tuple[Any, float]:
    """How the result of a future was lost.

    Raises
    ------
    SolveError
        If the connection to the scheduler is lost.
    """
    from distributed import KilledWorker

    error = future.exception() if future.status == "error" else None
    if error is None and on.client.status == "running" and future.status in ("finished", "lost", "pending"):
        return _Again(Lost("killed", "its worker was lost with the result, again and again.")), 0.0
    if error is None:
        where = f"the scheduler {on.place.scheduler}" if on.place.scheduler else "the scheduler"
        raise SolveError(
            f"the connection to {where} was lost; what is done is kept, run the same command again to go on."
        )
    if isinstance(error, KilledWorker):
        return _Again(Lost("killed", f"{ATTEMPTS} workers that were given this recording were lost.")), 0.0
    return Lost("failed", f"an error that clutchid did not expect, {type(error).__name__}: {error}."), 0.0


def _timed(work: Callable[[Item], Result], limit: float, item: Item) -> tuple[Result, float]:
    """Result and time in s. Over `limit` this process ends, as a kernel that runs cannot be interrupted otherwise."""
    timer = getattr(signal, "setitimer", None)  # not on Windows, where time is only limited alone
    begin = time.perf_counter()
    if limit and timer is not None:
        timer(signal.ITIMER_REAL, limit)
    try:
        return work(item), time.perf_counter() - begin
    finally:
        if limit and timer is not None:
            timer(signal.ITIMER_REAL, 0.0)


def _timed_alone(work: Callable[[Item], Result], limits: Limits, item: Item) -> tuple[Result | Lost, float]:
    """Result and time in s of a process of its own, which has the memory of its worker where none is said."""
    from distributed import get_worker

    begin = time.perf_counter()
    memory = limits.memory or get_worker().memory_manager.memory_limit or 0
    return alone(work, item, limits._replace(memory=memory)), time.perf_counter() - begin


def _settings(place: Place) -> dict[str, Any]:
    """How Dask behaves: a task whose worker is lost comes back at once; workers neither spill nor pause, but end."""
    threads = dict.fromkeys(THREADS, "1")
    return {
        "distributed.scheduler.allowed-failures": 0,
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.scheduler.work-stealing": False,
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.terminate": 0.95,
        "distributed.nanny.pre-spawn-environ": {**threads, "MALLOC_ARENA_MAX": "1", "MALLOC_TRIM_THRESHOLD_": "65536"},
        "distributed.worker.profile.enabled": False,
        "distributed.comm.timeouts.connect": f"{ANSWER:g}s" if place.scheduler else START,
        "distributed.comm.retry.count": 0,
        "distributed.admin.tick.limit": "1h",
        **_pages(place),
    }


def _pages(place: Place) -> dict[str, Any]:
    """No pages of local workers, and of the local scheduler only the dashboard: they have no authentication."""
    if place.scheduler:
        return {}
    routes: dict[str, Any] = {"distributed.worker.http.routes": []}
    return routes if find_spec("bokeh") else {**routes, "distributed.scheduler.http.routes": []}


@contextmanager
def _client(place: Place) -> Iterator[Client]:
    from distributed import Client, LocalCluster
    from distributed.security import Security

    if not place.scheduler:
        memory = place.memory or "auto"
        with (
            LocalCluster(
                n_workers=place.workers, threads_per_worker=1, processes=True, memory_limit=memory,
                host=LOOPBACK, dashboard_address=f"{LOOPBACK}:0", security=Security.temporary(),
                silence_logs=logging.CRITICAL,
            ) as local,
            Client(local) as client,
        ):  # fmt: skip
            yield client
        return
    security = security_of(place.scheduler, place.tls)
    try:
        asyncio.run(answered(place.scheduler, security, ANSWER))
        client = Client(place.scheduler, timeout=f"{ANSWER:g}s", security=security)
    except Exception as error:  # whatever listens there may answer anything
        raise ParameterError(
            f"--scheduler {place.scheduler}: does not answer within {ANSWER:g} s ({type(error).__name__}); an address "
            "is like tcp://host:8786, or tls://host:8786 for one with certificates, and the scheduler is started with "
            "`dask scheduler`."
        ) from error
    with client:
        yield client


@contextmanager
def _quiet() -> Iterator[None]:
    """No lines of Dask's own on standard error: what goes wrong with a worker is a row of the results."""
    roots = {"distributed", "tornado", "asyncio", "bokeh"}
    below = {
        name for name in logging.root.manager.loggerDict if name.split(".")[0] in roots
    }  # have levels of their own
    loggers = [logging.getLogger(name) for name in sorted(roots | below)]
    levels = [one.level for one in loggers]
    for one in loggers:
        one.setLevel(logging.CRITICAL + 1)
    before = os.environ.get("DASK_LOGGING__DISTRIBUTED")
    os.environ["DASK_LOGGING__DISTRIBUTED"] = "critical"
    try:
        yield
    finally:
        for one, level in zip(loggers, levels, strict=True):
            one.setLevel(level)
        if before is None:
            os.environ.pop("DASK_LOGGING__DISTRIBUTED")
        else:
            os.environ["DASK_LOGGING__DISTRIBUTED"] = before

"""Work on many items, by worker processes of this machine, or of others through a Dask scheduler.

Dask only spreads the items: each of its workers has a worker process of clutchid that does the work, so that what an
item does to its process is the same everywhere.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import psutil

from clutchid import processes
from clutchid.errors import ClutchidError, ParameterError, SolveError, missing
from clutchid.processes import FinishedWork, Limits, LostWork, Pool, Timing, check_workers
from clutchid.version import installed_version

if TYPE_CHECKING:
    from distributed import Client, Future
    from distributed.security import Security


@cache
def version_and_source() -> dict[str, str]:
    """Version and source hash of clutchid, including its templates and tables."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*")):
        if path.suffix in (".py", ".j2", ".toml"):
            digest.update(path.read_bytes())
    return {"clutchid": installed_version(), "source": digest.hexdigest()[:16]}


def security_of(address: str) -> Security:
    """Security of the connection to a scheduler, by Dask's configuration.

    Raises
    ------
    ParameterError
        If the address needs certificates, and the configuration has none.
    """
    from distributed.security import Security

    configured = Security()
    if address.startswith("tls://") and not (configured.tls_ca_file and configured.tls_client_cert):
        raise ParameterError(
            f"--scheduler {address}: a connection by TLS needs certificates; name their files in Dask's configuration "
            "(distributed.comm.tls), see docs/commands/fleet.md."
        )
    return configured


async def answered(address: str, security: Security, seconds: float) -> None:
    """Ask the scheduler for its identity; a `Client` waits much longer where no answer comes."""
    from distributed import rpc

    async with rpc(address, connection_args=security.get_connection_args("client")) as scheduler:
        await asyncio.wait_for(scheduler.identity(n_workers=0), seconds)


def check_scheduler(client: Client, address: str, seconds: float) -> None:
    """Check that a scheduler has workers, which answer within some seconds, and that all have this clutchid.

    Raises
    ------
    ParameterError
        If one of this is not so.
    """
    try:
        client.wait_for_workers(1, timeout=seconds)
    except TimeoutError:
        raise ParameterError(
            f"--scheduler {address}: has no workers; start them with `dask worker {address} --nthreads 1`."
        ) from None
    try:
        here = client.sync(client._run_on_scheduler, version_and_source, callback_timeout=seconds)
        versions = client.sync(client._run, version_and_source, on_error="return", callback_timeout=seconds)
    except TimeoutError:
        raise ParameterError(
            f"--scheduler {address}: a worker does not answer within {seconds:g} s; end it, or start it again."
        ) from None
    except Exception as error:  # its Python has no clutchid
        here, versions = error, {}
    for who, answer in [("the scheduler", here), *((f"worker {name}", of) for name, of in versions.items())]:
        if isinstance(answer, BaseException):
            raise ParameterError(f"--scheduler {address}: {who} has no clutchid of this version ({answer}).")
        if answer != version_and_source():
            raise ParameterError(
                f"--scheduler {address}: {who} has another clutchid than this process, or other sources; "
                "install the same version everywhere."
            )


_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

#: Items at the scheduler at a time: enough for hundreds of workers, and its memory does not grow with the fleet.
_WINDOW = 1000

#: Items that are given to the scheduler together.
_BATCH = 100

#: Time in s that a scheduler, its first worker, and then all of its workers have to answer.
ANSWER = 4.0

#: Attempts at an item whose worker of Dask was lost, which is not ended by the item but from outside.
_ATTEMPTS = 5

#: Files in which Linux says what memory the processes of a container may have together.
_CONTAINER = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


@dataclass(frozen=True, slots=True)
class Workers:
    """Worker processes: on this machine, or those of the scheduler at an address.

    `memory` is that of one item in bytes; 0 for this machine's by the number of its processors, or for what the workers
    of the scheduler have. `seconds` is what one item may take; 0 for no limit.
    """

    workers: int = 1
    scheduler: str = ""
    memory: int = 0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        check_workers(self.workers)


#: One worker on this machine.
ONE_WORKER = Workers()


def results(
    work: Callable[[_Item], _Result], items: Iterable[_Item], workers: Workers
) -> Iterator[FinishedWork[_Item, _Result]]:
    """Results in order of completion; work that ends its process or takes too long is a `LostWork` with a sentence.

    Parameters
    ----------
    work
        A function of a module, or a partial of one.
    items
        Are asked for as workers become free, so that there may be any number.

    Raises
    ------
    ClutchidError
        If the work raises one.
    MissingExtra
        Without Dask, for a scheduler.
    ParameterError
        If there is no worker, the scheduler does not answer, or its workers have another version of clutchid.
    SolveError
        If the connection to the scheduler is lost.
    """
    if workers.scheduler:
        with connected(workers) as client:
            yield from _spread(client, work, items, workers)
    else:
        limits = Limits(workers.seconds, workers.memory or _memory_of_machine() // (os.cpu_count() or 1))
        yield from processes.results(work, items, workers.workers, limits)


@contextmanager
def connected(workers: Workers) -> Iterator[Client]:
    """The connection to a scheduler whose workers are ready.

    Raises
    ------
    MissingExtra, ParameterError
        As `results`.
    """
    try:
        import dask
        import distributed
    except ImportError as error:
        raise missing("sharing the work between machines", "Dask", "fleet") from error
    settings = {
        "distributed.comm.timeouts.connect": f"{ANSWER:g}s",
        "distributed.comm.retry.count": 0,
        "distributed.admin.tick.limit": "1h",
    }
    with _quiet(), dask.config.set(settings):
        security = security_of(workers.scheduler)
        try:
            asyncio.run(answered(workers.scheduler, security, ANSWER))
            client = distributed.Client(workers.scheduler, timeout=f"{ANSWER:g}s", security=security)
        except Exception as error:  # whatever listens there may answer anything
            raise ParameterError(
                f"--scheduler {workers.scheduler}: does not answer within {ANSWER:g} s ({type(error).__name__}); an "
                "address is like tcp://host:8786, or tls://host:8786 for one with certificates, and the scheduler is "
                "started with `dask scheduler`."
            ) from error
        with client:
            check_scheduler(client, workers.scheduler, ANSWER)
            yield client


def _spread(
    client: Client, work: Callable[[_Item], _Result], items: Iterable[_Item], workers: Workers
) -> Iterator[FinishedWork[_Item, _Result]]:
    """Results of the workers of a scheduler; an item whose worker is lost is submitted again."""
    from distributed import as_completed

    waiting, todo = iter(items), as_completed()
    attempts: dict[Future[Any], tuple[_Item, int]] = {}
    there = partial(_done_there, work, Limits(workers.seconds, workers.memory))

    def submit(some: Sequence[_Item], attempt: int) -> None:
        futures = client.map(there, some, pure=False)
        attempts.update((future, (item, attempt)) for future, item in zip(futures, some, strict=True))
        todo.update(futures)

    submit(list(islice(waiting, _WINDOW)), 1)
    for batch in todo.batches():
        for future, outcome in _outcomes(client, batch, workers.scheduler):
            item, attempt = attempts.pop(future)
            if outcome is None and attempt < _ATTEMPTS:
                submit([item], attempt + 1)
            elif isinstance(outcome, FinishedWork):
                timing = outcome.timing
                yield replace(outcome, timing=timing._replace(attempt=timing.attempt + attempt - 1))
            else:
                lost = outcome or LostWork("killed", f"{_ATTEMPTS} workers were lost with it.")
                yield FinishedWork(item, lost, Timing(attempt=attempt))
        if len(attempts) <= _WINDOW - _BATCH:
            submit(list(islice(waiting, _WINDOW - len(attempts))), 1)
    with suppress(TimeoutError, OSError):
        client.sync(client._run, _rest, callback_timeout=ANSWER)


def _done_there(work: Callable[[_Item], _Result], limits: Limits, item: _Item) -> FinishedWork[_Item, _Result]:
    """On a worker of Dask: the result of its worker process; by default with the memory limit of that worker."""
    from distributed import get_worker

    memory = limits.memory or get_worker().memory_manager.memory_limit or 0
    return _pool_there(limits._replace(memory=memory)).do(work, item)


@cache
def _pool_there(limits: Limits) -> Pool:
    """The worker processes of a worker of Dask, kept from item to item."""
    pool = Pool(limits)
    _pools.append(pool)
    return pool


_pools: list[Pool] = []


def _rest() -> None:
    """On a worker of Dask: end the worker processes that have no work."""
    for pool in _pools:
        pool.rest()


def _outcomes(
    client: Client, futures: Sequence[Future[Any]], scheduler: str
) -> list[tuple[Future[Any], FinishedWork[Any, Any] | LostWork | None]]:
    """Results of futures that are done, brought here together; None for one whose worker of Dask was lost.

    Raises
    ------
    ClutchidError
        If the work raised one.
    SolveError
        If the connection to the scheduler is lost.
    """
    from distributed import CancelledError

    finished = {future: future for future in futures if future.status == "finished"}
    gathered: dict[Future[Any], FinishedWork[Any, Any]] = {}
    with suppress(TimeoutError, OSError, KeyError, CancelledError):  # a worker went with a result
        gathered = client.sync(client._gather, finished, errors="skip", callback_timeout=ANSWER)
    return [(work, gathered[work] if work in gathered else _lost(client, work, scheduler)) for work in futures]


def _lost(client: Client, future: Future[Any], scheduler: str) -> LostWork | None:
    """Loss of the result of a future; None if its worker was lost."""
    from distributed import KilledWorker

    error = future.exception() if future.status == "error" else None
    if isinstance(error, ClutchidError):
        raise error
    if error is None and not (client.status == "running" and future.status in ("finished", "lost", "pending")):
        raise SolveError(
            f"the connection to the scheduler {scheduler} was lost; what is done is kept, run the same command again "
            "to go on."
        )
    if error is None or isinstance(error, KilledWorker):
        return None
    return LostWork("failed", f"an error that clutchid did not expect, {type(error).__name__}: {error}.")


def _memory_of_machine() -> int:
    """Bytes of memory of this machine, or of the container that this process is in."""
    total = int(psutil.virtual_memory().total)
    for name in _CONTAINER:
        with suppress(OSError, ValueError):  # "max" is no number
            total = min(total, int(Path(name).read_text(encoding="utf-8")))
    return total


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress log lines of Dask on standard error: faults of workers are rows of the results."""
    roots = {"distributed", "tornado", "asyncio", "bokeh"}
    below = {
        name for name in logging.root.manager.loggerDict if name.split(".")[0] in roots
    }  # have levels of their own
    loggers = [logging.getLogger(name) for name in sorted(roots | below)]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)

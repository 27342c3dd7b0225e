"""A scheduler that was started elsewhere: whether it answers, and has workers with this clutchid."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from clutchid.errors import ParameterError
from clutchid.fleet.version import version_and_source

if TYPE_CHECKING:
    from distributed import Client


async def answered(address: str, seconds: float) -> None:
    """Ask the scheduler who it is; a `Client` waits much longer for one that takes the connection and is silent."""
    from distributed import rpc
    from distributed.security import Security

    async with rpc(address, connection_args=Security().get_connection_args("client")) as scheduler:
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
        here = client.sync(client._run_on_scheduler, _version, callback_timeout=seconds)
        versions = client.sync(client._run, _version, on_error="return", callback_timeout=seconds)
    except TimeoutError:
        raise ParameterError(
            f"--scheduler {address}: a worker does not answer within {seconds:g} s; end it, or start it again."
        ) from None
    except Exception as error:  # its Python has no clutchid
        here, versions = error, {}
    for who, found in {"the scheduler": here, **{f"worker {name}": one for name, one in versions.items()}}.items():
        if isinstance(found, BaseException):
            raise ParameterError(f"--scheduler {address}: {who} has no clutchid of this version ({found}).")
        if found != version_and_source():
            raise ParameterError(
                f"--scheduler {address}: {who} has another clutchid than this process, or other sources; "
                "install the same version everywhere."
            )


def _version() -> dict[str, str]:
    return version_and_source()

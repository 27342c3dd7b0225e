"""A scheduler that was started elsewhere: whether it answers, and has workers with this clutchid."""

from __future__ import annotations

import asyncio
import ssl
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from clutchid.errors import ParameterError
from clutchid.fleets.version import version_and_source
from clutchid.recordings.files import plain_file

if TYPE_CHECKING:
    from distributed import Client
    from distributed.security import Security


class Tls(NamedTuple):
    """PEM files by which scheduler, workers and this process know each other: authority, own certificate, its key."""

    authority: Path
    certificate: Path
    key: Path


def security_of(address: str, tls: Tls | None) -> Security:
    """How the connection to a scheduler is secured: by certificates, of Dask's own configuration where none are given.

    Raises
    ------
    DataError
        If a file of certificates cannot be read.
    ParameterError
        If the files are no certificate and key, or certificates and the scheme of the address do not fit.
    """
    from distributed.security import Security

    secured = address.startswith("tls://")
    if tls is None:
        configured = Security()
        if secured and not (configured.tls_ca_file and configured.tls_client_cert):
            raise ParameterError(
                f"--scheduler {address}: a connection by TLS needs certificates; give --tls-ca, --tls-cert and "
                "--tls-key, or name the files in Dask's configuration (distributed.comm.tls)."
            )
        return configured
    if not secured:
        raise ParameterError(
            f"--scheduler {address}: is not secured by TLS, so --tls-ca, --tls-cert and --tls-key have no effect; its "
            "address must be like tls://host:8786, or leave them out."
        )
    _check_certificates(tls)
    authority, certificate, key = map(str, tls)
    return Security(require_encryption=True, tls_ca_file=authority, tls_client_cert=certificate, tls_client_key=key)


def _check_certificates(tls: Tls) -> None:
    """Load the files once: what is wrong with them is otherwise a scheduler that does not answer."""
    for path in tls:
        plain_file(path, "certificate")
    context = ssl.create_default_context()
    try:
        context.load_verify_locations(tls.authority)
    except ssl.SSLError as error:
        raise ParameterError(f"--tls-ca {tls.authority}: is no certificate in PEM format ({error.reason}).") from error
    try:
        context.load_cert_chain(tls.certificate, tls.key, password="")
    except ssl.SSLError as error:
        raise ParameterError(
            f"--tls-cert {tls.certificate}, --tls-key {tls.key}: are no certificate and its key, without a password, "
            f"in PEM format ({error.reason})."
        ) from error


async def answered(address: str, security: Security, seconds: float) -> None:
    """Ask the scheduler who it is; a `Client` waits much longer for one that takes the connection and is silent."""
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

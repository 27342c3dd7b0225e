"""Options of a Dask scheduler, which hands work to workers on other machines."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.errors import ParameterError

if TYPE_CHECKING:
    from clutchid.fleets.cluster import Tls


@dataclass(frozen=True, slots=True)
class Scheduler:
    """Where a scheduler is, and by which certificates it knows this process.

    Parameters
    ----------
    scheduler
        Address of a Dask scheduler, which hands the work to workers on other machines, for example tcp://host:8786.
        They see files under the same paths and have the same clutchid; needs the extra fleet.
    tls_ca
        With a scheduler at tls://host:port: PEM file with the authority whose certificates it trusts; by default these
        three files are those of Dask's configuration.
    tls_cert
        PEM file with a certificate of that authority, by which the scheduler knows this process.
    tls_key
        PEM file with the key of that certificate.
    """

    scheduler: str = ""
    tls_ca: Path | None = None
    tls_cert: Path | None = None
    tls_key: Path | None = None

    def tls(self) -> Tls | None:
        """The files of certificates, all or none.

        Raises
        ------
        ParameterError
            If only some are named, or there is no scheduler.
        """
        from clutchid.fleets.cluster import Tls

        given = {"--tls-ca": self.tls_ca, "--tls-cert": self.tls_cert, "--tls-key": self.tls_key}
        absent = [name for name, path in given.items() if path is None]
        if len(absent) == len(given):
            return None
        if not self.scheduler:
            raise ParameterError("--tls-ca, --tls-cert, --tls-key: belong to --scheduler tls://host:port.")
        if self.tls_ca is None or self.tls_cert is None or self.tls_key is None:
            raise ParameterError(f"{' and '.join(absent)}: also needed; a connection by TLS takes three files.")
        return Tls(self.tls_ca, self.tls_cert, self.tls_key)


#: No scheduler: processes of this machine do the work.
NO_SCHEDULER = Scheduler()

"""Where the recordings and the tables of a fleet lie: a folder, or objects at an address such as ``s3://bucket/fleet``.

Objects are those of S3, Google Cloud Storage or Azure, by obstore (extra ``cloud``), with the credentials and endpoints
of the environment, or files of a web server, which can be read by name, and neither listed nor written.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, NamedTuple, Protocol
from urllib.parse import unquote

from clutchid.errors import ClutchidError, DataError, ExportError, ParameterError, missing
from clutchid.files import make_folder, write_bytes

if TYPE_CHECKING:
    from obstore import GetOptions, ObjectMeta
    from obstore.store import ObjectStore

#: An address, of which `Path` leaves one slash.
_ADDRESS = re.compile(r"(s3|gs|az|https?|file):[/\\]+(.*)")

#: Bytes of an object that are read at a time, and how often an object is asked for that ends in the middle.
_CHUNK, _ATTEMPTS = 4_000_000, 4

#: Objects that are deleted together, and that are asked for at the same time.
_DELETED, _TOGETHER = 1000, 16


#: Folder of the parts of the table of recordings.
PARTS_FOLDER = "recordings"


def run_of(name: str) -> str:
    """Folder of the run to which an object of that name belongs, with a slash at its end; empty if to none."""
    return name.partition(f"{PARTS_FOLDER}/date=")[0] if f"/{PARTS_FOLDER}/date=" in name else ""


class Storage(Protocol):
    """Files by their names, which are paths with `/`."""

    def names(self, under: str) -> Iterator[str]:
        """Names below a folder, which ends with `/`."""

    def read(self, name: str) -> bytes:
        """Content of a file."""

    def write(self, name: str, content: bytes, *, once: bool = False) -> None:
        """Write a file, which is whole or not there; `once` keeps an existing file."""

    def delete(self, names: Iterable[str]) -> None:
        """Delete files, also some that are not there any more."""


class Folder(NamedTuple):
    """A folder of this machine, or of a share."""

    path: Path

    def names(self, under: str) -> Iterator[str]:
        """Names below a folder, which ends with `/`."""
        for path in sorted((self.path / under).rglob("*")):
            if path.is_file():
                yield path.relative_to(self.path).as_posix()

    def read(self, name: str) -> bytes:
        """Content of a file."""
        return (self.path / name).read_bytes()

    def write(self, name: str, content: bytes, *, once: bool = False) -> None:
        """Write a file and its folders; on any error, an existing one is unchanged."""
        path = self.path / name
        if not (once and path.exists()):
            make_folder(path.parent)
            write_bytes(content, path)

    def delete(self, names: Iterable[str]) -> None:
        """Delete files, also some that are not there any more."""
        for name in names:
            (self.path / name).unlink(missing_ok=True)


class Objects(NamedTuple):
    """Objects below an address, such as ``s3://bucket/fleet``, or on a web server."""

    address: str

    @property
    def is_web(self) -> bool:
        """Whether they are files of a web server."""
        return self.address.startswith("http")

    @property
    def name(self) -> str:
        """Last part of the address."""
        name = PurePosixPath(self.address).name
        return unquote(name) if self.is_web else name

    @property
    def root(self) -> Path:
        """Path that stands for the address."""
        return Path("/", *self.address.split("/")[2:])

    def stamps(self, under: str = "") -> dict[str, str]:
        """Stamp of each object below a prefix, by its name."""
        import obstore

        with self._reached():
            pages = obstore.list(_store(self.address), prefix=under.rstrip("/") or None)
            return {entry["path"]: self._stamp(entry) for page in pages for entry in page}

    def stamp(self, name: str) -> str:
        """Stamp of an object."""
        import obstore

        with self._reached(name):
            return self._stamp(obstore.head(_store(self.address), name))

    def stamps_of(self, names: Sequence[str]) -> list[str]:
        """Stamps of objects by their names, without a listing; empty of what is not there or is refused."""

        def stamp(name: str) -> str:
            try:
                return self.stamp(name)
            except _UnsteadyError:
                raise
            except DataError:
                return ""

        with ThreadPoolExecutor(_TOGETHER) as pool:
            return [*pool.map(stamp, names)]

    def _stamp(self, entry: ObjectMeta) -> str:
        """Size and ETag of an object; on a web server with its name, since two files may have one ETag there.

        A web server without ETags has the time of the file; a list of Azure has ETags without the quotes that belong
        to them.
        """
        etag = entry["e_tag"] or ""
        if self.is_web:
            where = unquote(f"{self.address}/{entry['path']}")
            return f"{entry['size']} {etag or entry['last_modified'].isoformat()} {where}"
        return f"{entry['size']} {etag if etag.endswith(chr(34)) else f'{chr(34)}{etag}{chr(34)}'}"

    def names(self, under: str) -> Iterator[str]:
        """Names below a folder, which ends with `/`."""
        yield from sorted(self.stamps(under))

    def read(self, name: str) -> bytes:
        """Content of an object."""
        import obstore

        with self._reached(name):
            return bytes(obstore.get(_store(self.address), name).bytes())

    def write(self, name: str, content: bytes, *, once: bool = False) -> None:
        """Write an object; `once` keeps an existing object, also of another process at the same time."""
        import obstore
        from obstore.exceptions import AlreadyExistsError

        with self._reached(name, ExportError):
            try:
                obstore.put(_store(self.address), name, content, mode="create" if once else "overwrite")
            except AlreadyExistsError:
                if not once:
                    raise

    def delete(self, names: Iterable[str]) -> None:
        """Delete objects, also some that are not there any more."""
        import obstore

        every = list(names)
        for first in range(0, len(every), _DELETED):
            with self._reached(kind=ExportError):
                obstore.delete(_store(self.address), every[first : first + _DELETED])

    @contextmanager
    def staged(self, name: str, stamp: str) -> Iterator[Path]:
        """An object as a file of its name, which is deleted after; where it ends in the middle, the rest is asked for.

        An empty stamp is that of today.

        Raises
        ------
        DataError
            If it is not there any more, has changed since its stamp, or cannot be read to its end.
        """
        import obstore

        stamp = stamp or self.stamp(name)
        size = int(stamp.partition(" ")[0])
        with tempfile.TemporaryDirectory(prefix="clutchid-") as folder:
            path = Path(folder) / PurePosixPath(name).name
            with path.open("wb") as file:
                for attempt in range(1, _ATTEMPTS + 1):
                    if file.tell() >= size:
                        break
                    try:
                        with self._reached(name):
                            # not every web server sends a part of a file
                            rest: GetOptions = {"range": (file.tell(), size)} if file.tell() else {}
                            content = obstore.get(_store(self.address), name, options=rest)
                            if self._stamp(content.meta) != stamp:
                                raise DataError(f"{self.address}/{name}: {_STALE}")
                            for chunk in content.stream(_CHUNK):
                                file.write(chunk)
                    except _UnsteadyError:
                        if attempt == _ATTEMPTS:
                            raise
            yield path

    @contextmanager
    def _reached(self, name: str = "", kind: type[ClutchidError] = DataError) -> Iterator[None]:
        """Errors of the storage as one sentence."""
        from obstore.exceptions import BaseError, PermissionDeniedError, PreconditionError, UnauthenticatedError

        where = f"{self.address}/{name}".rstrip("/")
        try:
            yield
        except FileNotFoundError as error:
            raise (NoObjectError if kind is DataError else kind)(f"{where}: there is no such object.") from error
        except PreconditionError as error:
            raise kind(f"{where}: {_STALE}") from error
        except (PermissionDeniedError, UnauthenticatedError) as error:
            raise kind(f"{where}: access is refused ({_first(error)}); {_access(where)}") from error
        except (BaseError, OSError) as error:
            said = f"{where}: cannot be reached ({_first(error)}); {_access(where)}"
            raise (_UnsteadyError if kind is DataError else kind)(said) from error


#: What is said of an object that has another ETag, or none.
_STALE = "has changed or was deleted since it was listed; run the same command again."


def _access(address: str) -> str:
    """Where the credentials for an address come from."""
    web = "only web addresses that need no password are read"
    stores = "credentials and endpoint are those of the environment"
    return f"{web if address.startswith('http') else stores}, see docs/commands/fleet.md."


class NoObjectError(DataError):
    """An object that is not there."""


class _UnsteadyError(DataError):
    """A storage that may answer later."""


def _first(error: Exception) -> str:
    """Words of a storage: its code where it has one, else the end of the first line, after what was tried how often."""
    text = str(error)
    codes = re.findall(r"<Code>(\w+)</Code>", text)
    return codes[0] if codes else text.splitlines()[0].rpartition(" - ")[2][:160].strip(" :")


@lru_cache(maxsize=16)
def _store(address: str) -> ObjectStore:
    """The storage at an address, one a process."""
    try:
        from obstore.exceptions import BaseError
        from obstore.store import HTTPStore, from_url
    except ImportError as error:
        raise missing(f"{address}", "obstore", "cloud") from error
    try:
        if address.startswith("http"):
            return HTTPStore(address, client_options={"allow_http": address.startswith("http:")})
        return from_url(address)
    except (BaseError, ValueError) as error:
        raise DataError(f"{address}: cannot be used ({_first(error)}); {_access(address)}") from error


def objects_at(path: str | PathLike[str]) -> Objects | None:
    """The objects at an address; None for a path of this machine."""
    match = _ADDRESS.match(str(path))
    if match is None or match[1] == "file":
        return None
    objects = Objects(f"{match[1]}://{match[2].replace(chr(92), '/')}".rstrip("/"))
    if objects.is_web and re.search(r"[?#]|^[^/]*@", match[2]):
        raise DataError(
            f"{match[1]} address: has a query (?), a fragment (#) or a password (@); name one without them."
        )
    _store(objects.address)
    return objects


def target_at(path: str | PathLike[str]) -> Objects | None:
    """The objects at an address to write to; None for a path of this machine."""
    target = objects_at(path)
    if target and target.is_web:
        raise ParameterError(
            f"--out {target.address}: a web server can only be read; name a folder, or objects such as s3://bucket/wear."
        )
    return target


def path_of(path: str | PathLike[str]) -> Path:
    """A path of this machine, also from ``file:///path``."""
    match = _ADDRESS.match(str(path))
    return Path("/" + unquote(match[2])) if match and match[1] == "file" else Path(path)


def scratch_of(objects: Objects) -> Path:
    """Folder of this machine for the index and the pages of a run whose tables lie at an address."""
    from platformdirs import user_cache_path

    return (
        user_cache_path("clutchid", appauthor=False)
        / "fleets"
        / hashlib.sha256(objects.address.encode()).hexdigest()[:16]
    )


def upload(folder: Path, before: Mapping[Path, int], objects: Objects) -> None:
    """Write the files of a folder that were written since, but its index.

    Parameters
    ----------
    before
        Time of each file, as by `times_of`.
    """
    for path, time in times_of(folder).items():
        if before.get(path) != time and ".sqlite" not in path.name:
            objects.write(path.relative_to(folder).as_posix(), path.read_bytes())


def times_of(folder: Path) -> dict[Path, int]:
    """When each file of a folder was written."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}

"""Files: opening of files that a user names, and atomic writing, with clear messages."""

from __future__ import annotations

import difflib
import hashlib
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from clutchid.errors import ClutchidError, DataError, ExportError
from clutchid.systems import is_in_use, replace

if TYPE_CHECKING:
    import polars as pl

#: Bytes that are read at a time.
_CHUNK = 1 << 20


@contextmanager
def atomic_write(path: str | PathLike[str], folder: Path | None = None) -> Iterator[Path]:
    """Temporary file that replaces `path` when the block ends without an error.

    On any error the temporary file is removed and an existing file stays unchanged. The temporary name has the suffix
    of `path`, for libraries that choose a format by it. Errors that name another file are raised as they are.

    Parameters
    ----------
    path
        The file.
    folder
        Folder of the temporary file, on the same disk; by default it is beside `path`.

    Raises
    ------
    ExportError
        If the folder is missing or cannot be written, `path` is not a plain file, or writing fails, also in polars.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with atomic_write(Path(folder) / "fit.toml") as temporary:
    ...         _ = temporary.write_text("[model]")
    ...     (Path(folder) / "fit.toml").read_text()
    '[model]'
    """
    temporary: Path | None = None
    try:
        target = writable_target(path)
        temporary = (folder or target.parent) / f".clutchid-{secrets.token_hex(6)}{target.suffix}"
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        if target.exists():
            shutil.copymode(target, temporary)
        replace(temporary, target)
    except Exception as error:
        reason = _failure(error, temporary)
        if reason is None:
            raise
        raise ExportError(f"{path}: cannot be written ({reason}); no file was changed.") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _failure(error: Exception, temporary: Path | None) -> str | None:
    """Reason why a file could not be written; None for an error that has another cause, or the sentence already."""
    if isinstance(error, ClutchidError):
        return None
    if isinstance(error, OSError):
        if error.filename2 is not None and is_in_use(error):
            return "another program, or this one, has it open; close it there"
        own = error.filename is None or temporary is None or str(error.filename) == str(temporary)
        return reason_of(error) if own else None
    polars = sys.modules.get("polars")
    return str(error) if polars is not None and isinstance(error, polars.exceptions.PolarsError) else None


def write_text(text: str, path: str | PathLike[str]) -> None:
    """Write `text` in UTF-8 to `path`, atomically; bytes of file names that are not UTF-8 become question marks.

    Raises
    ------
    ExportError
        If it cannot be written; an existing file stays unchanged.
    """
    write_bytes(text.encode("utf-8", "replace"), path)


def write_bytes(content: bytes, path: str | PathLike[str]) -> None:
    """Write `content` to `path`, atomically.

    Raises
    ------
    ExportError
        If it cannot be written; an existing file stays unchanged.
    """
    with atomic_write(path) as temporary:
        temporary.write_bytes(content)


def write_frame(frame: pl.DataFrame, path: str | PathLike[str], metadata: dict[str, str] | None = None) -> None:
    """Write a table as Parquet, atomically, with `metadata` of the file.

    Raises
    ------
    ExportError
        If it cannot be written; an existing file stays unchanged.
    """
    with atomic_write(path) as temporary, temporary.open("wb") as file:  # polars takes no name that is no text
        frame.write_parquet(file, metadata=metadata)


def check_writable(path: str | PathLike[str]) -> None:
    """Check, before a long computation, that `path` can be written.

    Raises
    ------
    ExportError
        If the folder is missing or cannot be written, or `path` is not a plain file.
    """
    folder = writable_target(path).parent
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ExportError(f"{path}: the folder '{folder}' cannot be written ({reason_of(error)}).") from error


#: Start of an address, of which `Path` keeps one slash, and of a share of another machine.
_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:[/\\]|//")


def not_an_address(path: str | PathLike[str], option: str = "") -> None:
    r"""Refuse an address such as ``s3://bucket/run.csv`` or ``\\server\share``, unless the system has such a path.

    Raises
    ------
    DataError
        If it is one; the text says what to do. `option` names it in messages.

    Examples
    --------
    >>> not_an_address("s3://bucket/run.csv")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    clutchid.errors.DataError: s3:/bucket/run.csv: is a network address, ...
    """
    file = Path(path)
    share = str(file).startswith("\\\\")
    if (_ADDRESS.match(str(file)) or share) and not is_there(file):
        raise DataError(
            f"{option} {file}".strip()
            + (
                ": is a network address, and clutchid opens only files and folders of this machine: copy or mount "
                "the data, and give a local path."
            )
        )


def is_there(path: Path) -> bool:
    """Whether a file or folder exists; False where the name is invalid or the place cannot be read."""
    try:
        return path.exists()
    except OSError:
        return False


def make_folder(folder: Path, option: str = "") -> None:
    """Create a folder if it does not exist; `option` names it in messages.

    Raises
    ------
    ExportError
        If it cannot be created.
    """
    not_an_address(folder, option)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        named = f"{option} {folder}".strip()
        raise ExportError(f"{named}: the folder cannot be created ({reason_of(error)}); name another one.") from error


def opened_file(path: str | PathLike[str], what: str = "recording") -> BinaryIO:
    """The plain file at `path`, open for reading; `what` names it in messages.

    Raises
    ------
    DataError
        If it is missing (the text gives the nearest name in the folder), a folder, not a plain file, or not readable.
    """
    file = Path(path)
    try:
        mode = file.stat().st_mode
        if stat.S_ISDIR(mode):
            raise DataError(f"{file}: is a folder; name one {what} in it.")
        if not stat.S_ISREG(mode):
            raise DataError(f"{file}: is not a plain file; save the {what} to a file first.")
        return file.open("rb")
    except (FileNotFoundError, NotADirectoryError):
        if file.is_symlink():
            raise DataError(f"{file}: is a link to '{file.readlink()}', which does not exist.") from None
        not_an_address(file)
        raise DataError(f"{file}: there is no such file{_nearest(file)}") from None
    except PermissionError:
        raise DataError(f"{file}: there is no permission to read it; change its owner or mode.") from None
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({reason_of(error)}).") from error


@contextmanager
def reading(path: str | PathLike[str]) -> Iterator[None]:
    """Turn a disk error while a file is read into a `DataError` with its name; other errors pass."""
    try:
        yield
    except OSError as error:
        if isinstance(error, ClutchidError):
            raise
        raise DataError(f"{path}: cannot be read ({reason_of(error)}).") from error


def plain_file(path: str | PathLike[str], what: str = "recording") -> Path:
    """Check that `path` can be `opened_file`, for files that a library opens.

    Raises
    ------
    DataError
        As `opened_file`.
    """
    opened_file(path, what).close()
    return Path(path)


def small_file(path: str | PathLike[str], what: str, most: int) -> bytes:
    """The bytes of a plain file of at most `most`; `what` names it in messages.

    Raises
    ------
    DataError
        As `opened_file`, or if it is larger.
    """
    with opened_file(path, what) as stream, reading(path):
        content = stream.read(most + 1)
    if len(content) > most:
        raise DataError(f"{path}: is not a {what}: it has more than {most / 1e6:g} MB; name another file.")
    return content


def digest(path: Path) -> str:
    """SHA-256 of a file as hexadecimal digits.

    Raises
    ------
    DataError
        As `opened_file`, or if it cannot be read.
    """
    total = hashlib.sha256()
    with opened_file(path, "file") as file, reading(path):
        while chunk := file.read(_CHUNK):
            total.update(chunk)
    return total.hexdigest()


def writable_target(path: str | PathLike[str]) -> Path:
    """Target of `path` with links resolved, so that a link is kept and its file replaced."""
    try:
        target = Path(path).resolve()
        target.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, RuntimeError) as error:  # a loop of links, a name that is too long
        reason = reason_of(error) if isinstance(error, OSError) else "a loop of links"
        raise ExportError(f"{path}: cannot be written ({reason}); name another file.") from None
    if not target.parent.is_dir():
        not_an_address(path)
        raise ExportError(f"{path}: the folder '{Path(path).parent}' does not exist; create it first.")
    if target.is_dir():
        raise ExportError(f"{path}: is a folder; name a file in it.")
    if target.exists() and not target.is_file():
        raise ExportError(f"{path}: is not a plain file; name another one.")
    if target.exists() and not os.access(target, os.W_OK):
        raise ExportError(f"{path}: is write-protected; allow writing or name another file.")
    return target


def _nearest(file: Path) -> str:
    try:
        names = [entry.name for entry in file.parent.iterdir()]
    except OSError:
        return f"; the folder '{file.parent}' does not exist either."
    near = difflib.get_close_matches(file.name, names, n=1)
    return f"; did you mean '{near[0]}'?" if near else "; check its name."


def reason_of(error: OSError) -> str:
    """Reason of the operating system, or of the library that raised the error."""
    return error.strerror or str(error) or type(error).__name__

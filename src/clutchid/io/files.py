"""Atomic writing of files, and checks of files with clear messages."""

from __future__ import annotations

import difflib
import hashlib
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.errors import DataError, ExportError, ParameterError

if TYPE_CHECKING:
    import polars as pl

CHUNK = 1 << 20


@contextmanager
def atomic_write(path: str | PathLike[str]) -> Iterator[Path]:
    """Temporary file beside `path` that replaces it when the block ends without an error.

    On any error the temporary file is removed and an existing file stays unchanged. The temporary name has the suffix
    of `path`, for libraries that choose a format by it.

    Raises
    ------
    ExportError
        If the folder is missing or cannot be written, `path` is not a plain file, or writing fails.

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
        temporary = target.parent / f".clutchid-{secrets.token_hex(6)}{target.suffix}"
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        if target.exists():
            shutil.copymode(target, temporary)
        temporary.replace(target)
    except ExportError:
        raise
    except OSError as error:
        raise ExportError(f"{path}: cannot be written ({_reason(error)}); what was there is unchanged.") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


@contextmanager
def polars_errors(path: str | PathLike[str]) -> Iterator[None]:
    """What polars says where `path` cannot be written, as on a full disk, as the error that it is.

    Raises
    ------
    ExportError
        In place of an error of polars.
    """
    import polars as pl

    try:
        yield
    except pl.exceptions.PolarsError as error:
        raise ExportError(f"{path}: cannot be written ({error}); what was there is unchanged.") from error


def write_frame(frame: pl.DataFrame, path: Path) -> None:
    """Write a table as Parquet.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing one is then unchanged.
    """
    with polars_errors(path), atomic_write(path) as temporary:
        frame.write_parquet(temporary)


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
        raise ExportError(f"{path}: the folder '{folder}' cannot be written ({_reason(error)}).") from error


def is_there(path: Path) -> bool:
    """Whether there is a file or folder; at a name that none can have, or cannot be looked at, there is none."""
    try:
        return path.exists()
    except OSError:
        return False


def make_folder(folder: Path, option: str = "") -> None:
    """Create a folder, unless it is there; `option` names it in messages.

    Raises
    ------
    ExportError
        If it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        named = f"{option} {folder}".strip()
        raise ExportError(f"{named}: the folder cannot be created ({_reason(error)}); name another one.") from error


def plain_file(path: str | PathLike[str], what: str = "recording") -> Path:
    """Check that `path` is a readable plain file; `what` names it in messages.

    Raises
    ------
    DataError
        If it is missing (the text gives the nearest name in the folder), a folder, not a plain file, or not readable.
    """
    file = Path(path)
    try:
        if file.is_dir():
            raise DataError(f"{file}: is a folder; name one {what} in it.")
        if not file.exists():
            raise DataError(f"{file}: there is no such file{_nearest(file)}")
        if not file.is_file():
            raise DataError(f"{file}: is not a plain file; save the {what} to a file first.")
        file.open("rb").close()
    except PermissionError:
        raise DataError(f"{file}: there is no permission to read it; change its owner or mode.") from None
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({_reason(error)}).") from error
    return file


def small_file(path: str | PathLike[str], what: str, most: int) -> bytes:
    """The bytes of a plain file of at most `most`; `what` names it in messages.

    Raises
    ------
    DataError
        As `plain_file`.
    ParameterError
        If it is larger.
    """
    file = plain_file(path, what)
    try:
        with file.open("rb") as stream:
            content = stream.read(most + 1)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({_reason(error)}).") from error
    if len(content) > most:
        raise ParameterError(f"{path}: is no {what}: it has more than {most / 1e6:g} MB; name another file.")
    return content


def digest(path: Path) -> str:
    """SHA-256 of a file as hexadecimal digits.

    Raises
    ------
    DataError
        If the file cannot be read.
    """
    total = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while chunk := file.read(CHUNK):
                total.update(chunk)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({_reason(error)}).") from error
    return total.hexdigest()


def writable_target(path: str | PathLike[str]) -> Path:
    """Target of `path` with links resolved, so that a link is kept and its file replaced."""
    try:
        target = Path(path).resolve()
        target.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, RuntimeError) as error:  # a loop of links, a name that is too long
        reason = _reason(error) if isinstance(error, OSError) else "a loop of links"
        raise ExportError(f"{path}: cannot be written ({reason}); name another file.") from None
    if not target.parent.is_dir():
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


def _reason(error: OSError) -> str:
    return error.strerror or str(error) or type(error).__name__

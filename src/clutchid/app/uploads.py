"""Files that the page sends or names by a path: safe names, limits of size and disk, only below the open folder."""

from __future__ import annotations

import re
from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing
from pathlib import Path

from clutchid.app.folder import free_bytes
from clutchid.errors import DataError
from clutchid.files import reason_of
from clutchid.names import printable
from clutchid.systems import is_device
from clutchid.verbs.reading import by_suffix, split_name

#: Largest upload in bytes; a larger file is opened by its path.
LARGEST_UPLOAD = 4 << 30

#: Bytes that stay free on the disk: the columns of a recording take about as much as its file.
SPARE = 1 << 30

#: Longest name of a file in the folder of the server.
_LONGEST = 120

#: Suffixes of what comes with recordings, in the list of a folder.
_BESIDE = (".dbc", ".toml")

#: Most entries of a folder that are listed.
_MOST_ENTRIES = 2000


def safe_name(text: str) -> str:
    """A safe file name: the last part of a path, without characters or names that are special on any system.

    Examples
    --------
    >>> safe_name("../../etc/passwd"), safe_name("Messung 7 (Größe).mf4"), safe_name("..."), safe_name("a\\x00<b>.csv")
    ('passwd', 'Messung 7 (Größe).mf4', 'file', 'a__b_.csv')
    >>> safe_name("aux.csv")
    '_aux.csv'
    """
    last = re.split(r"[/\\]", text)[-1]
    name = re.sub(r"[^\w .()+=@-]", "_", last).strip(" .")
    if len(name) > _LONGEST:
        stem, dot, suffix = name.rpartition(".")
        name = f"{stem[: _LONGEST - len(suffix) - 1]}{dot}{suffix[:20]}"
    return f"_{name}" if is_device(name) else name or "file"


def download_name(result: str, file: str) -> str:
    """Name under which a file of a result is downloaded, and that commands have for it: that of the result.

    Examples
    --------
    >>> download_name("calibrate run.mf4 (5)", "fit.toml"), download_name("CAL.toml", "fit.toml")
    ('calibrate run.mf4 (5).toml', 'CAL.toml')
    """
    return safe_name(f"{result.removesuffix('.toml')}{Path(file).suffix}")


def upload_size(name: str, length: str | None, folder: Path) -> int:
    """The size of an upload in bytes, before it is sent.

    Raises
    ------
    DataError
        If its size is not given, or it is too large for an upload or for the disk.
    """
    shown = printable(name)
    if length is None or not length.isdigit():
        raise DataError(f"{shown}: its size is not known before it is sent; open it by its path.")
    size = int(length)
    if size > LARGEST_UPLOAD:
        raise DataError(
            f"{shown}: {size / 1e9:.3g} GB is more than the {LARGEST_UPLOAD / 1e9:.3g} GB that the page takes; open it "
            "by its path, which copies nothing."
        )
    free = free_bytes(folder)
    if 2 * size + SPARE > free:
        raise DataError(
            f"{shown}: needs {(2 * size + SPARE) / 1e9:.3g} GB on the disk of {folder}, and {free / 1e9:.3g} GB are "
            "free; make room, or name another folder with CLUTCHID_CACHE."
        )
    return size


async def receive_upload(chunks: AsyncGenerator[bytes, None], path: Path, size: int) -> None:
    """Write an upload to a new file, which is removed if the upload breaks off or has another size.

    Raises
    ------
    DataError
        If it is not as long as it said, or cannot be written.
    """
    received = 0
    try:
        with path.open("xb") as file:
            async with aclosing(chunks):  # it may end before they do
                async for chunk in chunks:
                    received += len(chunk)
                    if received > size:
                        break
                    file.write(chunk)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise DataError(f"{path.name}: could not be saved ({reason_of(error)}).") from error
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    if received != size:
        path.unlink(missing_ok=True)
        raise DataError(f"{path.name}: {received:,} of {size:,} bytes arrived; send it again.")


def allowed_path(text: str, below: Path, named: Iterable[Path]) -> Path:
    """A file that may be opened by its path: one below the folder, also by links, or one given on the command line.

    Raises
    ------
    DataError
        If it is another one, or there is no such file.
    """
    shown = printable(text)
    if "\x00" in text:
        raise DataError(f"{shown}: is not a path.")
    try:
        path = (below / text).resolve()
        allowed = path.is_relative_to(below) or path in {file.resolve() for file in named}
    except (OSError, RuntimeError) as error:
        raise DataError(f"{shown}: cannot be opened ({error}).") from error
    if not allowed:
        raise DataError(f"{shown}: does not lie below {below}; start `clutchid app --folder DIR` with another folder.")
    if not path.is_file():
        raise DataError(f"{shown}: there is no such file below {below}.")
    return path


def is_opened(name: str) -> bool:
    """Whether the page opens a file of this name: a recording, or a file that belongs to one."""
    return bool(split_name(name)[1]) or Path(name).suffix.lower() in _BESIDE


def folder_listing(text: str, below: Path) -> dict[str, object]:
    """Folders, and files that the page opens, in a folder below that of the page.

    `others` has the number of other files by suffix.

    Raises
    ------
    DataError
        If it is another folder, or cannot be read.
    """
    folder = (below / text).resolve()
    if not folder.is_relative_to(below) or not folder.is_dir():
        raise DataError(f"{printable(text)}: there is no such folder below {below}.")
    folders: list[dict[str, object]] = []
    files: list[dict[str, object]] = []
    others: list[Path] = []
    try:
        names = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
        entries = sorted(names, key=lambda entry: entry.name.casefold())[:_MOST_ENTRIES]
        for entry in entries:
            path = entry.relative_to(below).as_posix()
            if entry.is_dir():
                folders.append({"name": entry.name, "path": path})
            elif is_opened(entry.name):
                files.append({"name": entry.name, "path": path, "size": entry.stat().st_size})
            else:
                others.append(entry)
    except OSError as error:
        raise DataError(f"{folder}: cannot be listed ({reason_of(error)}).") from error
    inside = folder != below
    up = folder.parent.relative_to(below).as_posix() if inside else None
    hidden = [f"Not listed: {by_suffix(others)}."] if others else []
    if len(names) > _MOST_ENTRIES:
        hidden.append(f"Only the first {_MOST_ENTRIES:,} of {len(names):,} entries are shown.")
    return {"folder": str(folder), "up": up, "folders": folders, "files": files, "others": " ".join(hidden)}

"""The folder of a running server with uploads, columns and results; it is removed with the server.

A server that was killed leaves its folder behind; the next one removes it.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from pathlib import Path

from clutchid.errors import ExportError
from clutchid.files import reason_of

_LOCK, _KEPT = "lock.json", "kept"


def cache_folder() -> Path:
    """Parent of the folders of servers: in the cache of compiled models, or as the user has set it."""
    from platformdirs import user_cache_path

    folder = os.environ.get("CLUTCHID_CACHE")
    return (Path(folder) if folder else user_cache_path("clutchid", appauthor=False)) / "app"


def new_folder(base: Path) -> Path:
    """A new folder for this process that only the user can read; folders of dead servers are removed first.

    Raises
    ------
    ExportError
        If it cannot be made.
    """
    try:
        base.mkdir(parents=True, exist_ok=True)
        sweep(base)
        folder = Path(tempfile.mkdtemp(prefix="run-", dir=base))  # of mode 0700
        private(folder / _LOCK, json.dumps({"pid": os.getpid(), "born": _born(os.getpid())}))
    except OSError as error:
        raise ExportError(
            f"{base}: no folder for recordings and results can be made there ({reason_of(error)}); name another one "
            "with the environment variable CLUTCHID_CACHE."
        ) from error
    return folder


def project_folder(below: Path) -> Path:
    """The folder of a project in the folder whose recordings it is about, for this process alone.

    Raises
    ------
    ExportError
        If it cannot be made, or another server has it.
    """
    folder = below / ".clutchid-app"
    if _is_alive(folder):
        raise ExportError(f"{folder}: another clutchid app has this project open; end it, or name another folder.")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        private(folder / _LOCK, json.dumps({"pid": os.getpid(), "born": _born(os.getpid())}))
    except OSError as error:
        raise ExportError(f"{folder}: the project cannot be kept there ({reason_of(error)}).") from error
    return folder


def sweep(base: Path) -> None:
    """Remove the folders of servers that have ended, except those that are to be kept."""
    for folder in base.glob("run-*"):
        if not _is_alive(folder) and not (folder / _KEPT).exists():
            shutil.rmtree(folder, ignore_errors=True)


def _is_alive(folder: Path) -> bool:
    """Whether the server of a folder runs."""
    try:
        lock = json.loads((folder / _LOCK).read_text(encoding="utf-8"))
        return bool(_born(lock["pid"]) == lock["born"])
    except (OSError, ValueError, KeyError, TypeError):
        return False


def end_folder(folder: Path, *, keep: bool, project: bool = False) -> None:
    """Remove the folder at the end of its server, or leave it; of a project what is made again is removed."""
    if project:
        for name in ("columns", "processes"):
            shutil.rmtree(folder / name, ignore_errors=True)
        (folder / _LOCK).unlink(missing_ok=True)
    elif keep:
        (folder / _KEPT).touch()
    else:
        shutil.rmtree(folder, ignore_errors=True)


def _born(pid: int) -> float | None:
    """Start time of a process in s, as process numbers are reused; None if it has ended."""
    import psutil

    try:
        return float(psutil.Process(pid).create_time())
    except psutil.Error:
        return None


def private(path: Path, text: str) -> None:
    """Write a file that only the user can read."""
    with os.fdopen(os.open(path, os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
        file.write(text)


def opening_page(folder: Path, address: str) -> Path:
    """A page that redirects to the address, so that the token does not show in the list of processes."""
    page = folder / "open.html"
    private(page, f'<!doctype html><meta http-equiv="refresh" content="0;url={address}"><title>clutchid</title>\n')
    return page


def free_bytes(folder: Path) -> int:
    """Bytes that are free on the disk of a folder."""
    return shutil.disk_usage(folder).free

"""Generated modules on disk, so that a warm process neither derives, prints nor compiles."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

_LIBRARIES = ("numba", "sympy", "numpy")

#: First line of a module: this and the SHA-256 of all that follows, so that a damaged file is known.
_MARK = b"# made by clutchid, sha256 of the rest: "


def load_module(name: str, sources: Iterable[Path], build: Callable[[], str]) -> ModuleType:
    """The generated module `name`, built by `build` unless a cached one fits.

    The cache folder is keyed by the contents of `sources`, the versions of the libraries and the processor type; Numba
    keeps the machine code beside the module and checks the processor's features itself. The file appears under a
    temporary name and is renamed, so processes that build at the same time do not disturb each other. Its first line
    holds the hash of the rest: a truncated or damaged file is built again. Where the user's cache folder cannot be
    written, a temporary folder serves.

    Raises
    ------
    OSError
        If not even a temporary folder can be written.
    """
    key = _key(sources)
    path = _folder(key) / f"{name}.py"
    if not _whole(path):
        _write(path, build())
    spec = importlib.util.spec_from_file_location(f"clutchid_generated_{name}_{key}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # Numba's cache finds a kernel's globals by the module's name
    try:
        spec.loader.exec_module(module)
    except (EOFError, ValueError, TypeError, ImportError):  # how Python's own compiled file beside it shows damage
        Path(importlib.util.cache_from_source(str(path))).unlink(missing_ok=True)
        spec.loader.exec_module(module)
    return module


def _whole(path: Path) -> bool:
    """Whether the module is there as it was written."""
    try:
        mark, _, text = path.read_bytes().partition(b"\n")
    except OSError:
        return False
    return mark == _mark(text)


def _mark(text: bytes) -> bytes:
    return _MARK + hashlib.sha256(text).hexdigest().encode()


def _key(sources: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in sorted(sources):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    for library in _LIBRARIES:
        digest.update(f"{library} {version(library)}".encode())
    digest.update(f"{platform.python_version()} {platform.machine()}".encode())
    return digest.hexdigest()[:16]


def _folder(key: str) -> Path:
    from platformdirs import user_cache_path

    chosen = os.environ.get("CLUTCHID_CACHE")
    preferred = Path(chosen) if chosen else user_cache_path("clutchid", appauthor=False)
    fallback = Path(tempfile.gettempdir()) / f"clutchid-{_user()}"
    for base in (preferred, fallback):
        folder = base / key
        try:
            if base is fallback:
                base.mkdir(mode=0o700, parents=True, exist_ok=True)
                if not _own(base):  # others may write to the temporary folder, and what lies there is executed
                    continue
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix="clutchid-"))


def _user() -> str:
    """A name for the user's own temporary folder; a container may know only the number."""
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def _own(folder: Path) -> bool:
    """Whether `folder` is the user's and nobody else can write to it."""
    if not hasattr(os, "getuid"):
        return True
    status = folder.lstat()
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022


def _write(path: Path, text: str) -> None:
    content = text.encode("utf-8")
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "wb") as file:
        file.write(_mark(content) + b"\n" + content)
    Path(temporary).replace(path)

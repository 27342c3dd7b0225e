"""Generated modules on disk, so that a warm process neither derives, prints nor compiles.

Two keys lead to machine code. The sources of a text, without comments and docstrings, find the text; the text finds the
folder that it lies in with its machine code. So an edit that leaves the text as it is compiles nothing. The wheel holds
the texts of the standard models, found by their sources as they are and the version of SymPy that made them.
"""

from __future__ import annotations

import ast
import atexit
import hashlib
import importlib.util
import os
import platform
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

from clutchid.systems import is_private, replace, user

_LIBRARIES = ("numba", "llvmlite", "sympy", "numpy")

#: Texts that a wheel brings along; a tree of sources has none.
TEXTS = Path(__file__).with_name("texts")

#: First line of a module: this and the SHA-256 of all that follows, so that a damaged file is known.
_MARK = b"# made by clutchid, sha256 of the rest: "

#: Functions that `announce` calls.
_listeners: list[Callable[[str], None]] = []


def when_compiling(say: Callable[[str], None]) -> None:
    """Have `say` called with a sentence when this process compiles for the first time."""
    _listeners[:] = [say]


def announce() -> None:
    """Report, once a process, that the compiler takes some time."""
    for say in _listeners[:]:
        _listeners.remove(say)
        say("compiling the model, once per machine ...")


def load_module(name: str, sources: Iterable[Path], build: Callable[[], str]) -> ModuleType:
    """The generated module `name`, built by `build` unless a cached one fits.

    Keys hold the versions of the libraries and of what compiles a kernel, and the processor type; Numba keeps the
    machine code beside the module and checks the processor's features itself. A file appears under a temporary name and
    is renamed, so processes that build at the same time do not disturb each other. The first line of a module holds the
    hash of the rest: a truncated or damaged file is built again. The cache is a folder of the user's own, which nobody
    else can write to; if it is read-only, what it holds is used. Else a temporary folder serves, and where nothing can
    be written, the module goes without a file.

    Raises
    ------
    Exception
        As `build` and the module itself do.
    """
    paths = sorted(sources)
    for folder, writable in _folders():
        try:
            path = _cached(folder, name, paths, build) if writable else _found(folder, name, paths)[0]
            if path is not None:
                return _executed(name, path)
        except OSError as problem:  # a full disk
            warnings.warn(f"{folder} cannot keep compiled models: {problem}.", RuntimeWarning, stacklevel=2)
    text = _brought(name, paths)
    return _unwritten(name, build() if text is None else text.decode())


def keep_text(folder: Path, name: str, sources: Iterable[Path], text: str) -> Path:
    """A file in `folder` with the text of the module `name`, which `load_module` takes where it lies in `TEXTS`."""
    path = _kept(folder, name, sorted(sources))
    _write(path, _marked(text.encode()))
    return path


def _kept(folder: Path, name: str, sources: Sequence[Path]) -> Path:
    # by the files as they are: how Python shows their meaning changes with its version
    parts = [part for path in sources for part in (path.name.encode(), path.read_bytes())]
    return folder / f"{name}-{_digest([*parts, version('sympy').encode()])}.txt"


def _brought(name: str, sources: Sequence[Path]) -> bytes | None:
    """The text from the wheel, unless a source or SymPy has changed or the file is damaged."""
    if not TEXTS.is_dir():
        return None
    path = _kept(TEXTS, name, sources)
    return path.read_bytes().partition(b"\n")[2] if _whole(path) else None


def generator_files(*folders: Path) -> list[Path]:
    """Python files and templates of this package, on which every generated text depends, and of `folders`."""
    files = (path for folder in (Path(__file__).parent, *folders) for path in folder.rglob("*"))
    return [path for path in files if path.suffix in (".py", ".j2")]


def _found(folder: Path, name: str, sources: Sequence[Path]) -> tuple[Path | None, list[Path]]:
    """The module's file, found by the files as they are or else by what they mean, and the signs that were missing."""
    signs: list[Path] = []
    for key in _keys(sources):
        sign = folder / "texts" / f"{name}-{key}"
        path = folder / _read(sign) / f"{name}.py"
        if _whole(path):
            return path, signs
        signs.append(sign)
    return None, signs


def _cached(folder: Path, name: str, sources: Sequence[Path], build: Callable[[], str]) -> Path:
    """The module's file, built where it is not there."""
    path, signs = _found(folder, name, sources)
    if path is None:
        announce()
        text = _brought(name, sources) or build().encode()
        path = folder / _digest([text, *_versions()]) / f"{name}.py"
        if not _whole(path):
            _write(path, _marked(text))
    for sign in signs:
        _write(sign, path.parent.name.encode())
    return path


def _executed(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"clutchid_generated_{name}_{path.parent.name}", path)
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


def _unwritten(name: str, text: str) -> ModuleType:
    """The module without a file: its kernels are compiled in every process."""
    module = ModuleType(f"clutchid_generated_{name}")
    sys.modules[module.__name__] = module
    exec(compile(text, f"<{module.__name__}>", "exec"), module.__dict__)
    return module


def _whole(path: Path) -> bool:
    """Whether the module exists and matches its checksum."""
    try:
        mark, _, text = path.read_bytes().partition(b"\n")
    except OSError:
        return False
    return mark == _mark(text)


def _marked(text: bytes) -> bytes:
    return _mark(text) + b"\n" + text


def _mark(text: bytes) -> bytes:
    return _MARK + hashlib.sha256(text).hexdigest().encode()


def _read(sign: Path) -> str:
    """The folder that a sign points to, "nowhere" without a sign."""
    try:
        return sign.read_text("ascii").strip() or "nowhere"
    except (OSError, UnicodeDecodeError):
        return "nowhere"


def _keys(sources: Sequence[Path]) -> Iterator[str]:
    """The key of the sources as they are, which is quick, and that of what they mean to the compiler."""
    contents = [(path, path.read_bytes()) for path in sources]
    for key in (lambda _, content: content, meaning):
        parts = [part for path, content in contents for part in (path.name.encode(), key(path, content))]
        yield _digest([*parts, *_versions()])


@cache
def meaning(path: Path, content: bytes) -> bytes:
    """A Python file without comments and docstrings."""
    if path.suffix != ".py":
        return content
    tree = ast.parse(content)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            del node.body[0]
    return ast.dump(tree).encode()


#: Modules that say how the compiler treats a kernel, which its text does not show.
_COMPILING = tuple(Path(__file__).with_name(name) for name in ("kernels.py", "linked.py", "machine_code.py"))


@cache
def _versions() -> list[bytes]:
    libraries = [f"{library} {version(library)}" for library in _LIBRARIES]
    versions = [part.encode() for part in (*libraries, platform.python_version(), platform.machine())]
    return [*versions, *(path.read_bytes() for path in _COMPILING)]


def _digest(parts: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()[:16]


def _folders() -> Iterator[tuple[Path, bool]]:
    """Folders of the user's own, the chosen or usual one first, and whether files can be written to them."""
    from platformdirs import user_cache_path

    chosen = os.environ.get("CLUTCHID_CACHE")
    preferred = Path(chosen) if chosen else user_cache_path("clutchid", appauthor=False)
    for folder in (preferred, Path(tempfile.gettempdir()) / f"clutchid-{user()}"):
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            private = is_private(folder)
        except OSError:
            continue
        if private:
            yield folder, _writable(folder)
        else:  # what lies there is executed
            warnings.warn(
                f"{folder} is not used for compiled models, because others may write to it; chmod 700 it, or choose "
                f"another folder with CLUTCHID_CACHE.",
                RuntimeWarning,
                stacklevel=2,
            )
    try:
        yield _of_this_process(), True
    except OSError:
        return


def _writable(folder: Path) -> bool:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@cache
def _of_this_process() -> Path:
    """A temporary folder that is removed with this process."""
    folder = tempfile.mkdtemp(prefix="clutchid-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _write(path: Path, content: bytes) -> None:
    """Write a file at once; the time of one does not depend on who wrote it, because Numba's cache holds it."""
    path.parent.mkdir(exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.utime(temporary, (0, 0))
        replace(Path(temporary), path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise

"""Kernels that are written by hand: how they are compiled, and where their machine code is kept."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any, TypeVar, cast

from clutchid.codegen.cache import load_module, meaning

#: Liberties of the compiler with sums and products of a generated kernel, in LLVM's words. Without nnan and ninf: a run
#: that leaves the finite numbers must be seen.
FAST = "reassoc nsz arcp contract afn"

#: Doubles in a vector: of AVX2 and below, and of AVX-512.
LANES = (4, 8)

_Function = TypeVar("_Function", bound=Callable[..., object])


@cache
def vector_lanes() -> int:
    """Doubles that are computed side by side: those of a vector of AVX-512 or AVX2, by the processor compiled for."""
    from numba.core.registry import cpu_target

    _, name, features = cpu_target.target_context.codegen().magic_tuple()
    return LANES["+avx512f" in features or name == "x86-64-v4"]


def kernel(function: _Function) -> _Function:
    """Compile a function of numbers and arrays that is written by hand."""
    return _compiled(function, fastmath={"contract", "reassoc"})


def generated(function: _Function) -> _Function:
    """Compile a generated kernel: the loops around the functions of a system."""
    return _compiled(function, fastmath=set(FAST.split()))


def inlined(function: _Function) -> _Function:
    """Common part of several generated kernels; its statements are put into each of them."""
    import numba

    return cast(_Function, numba.njit(inline="always")(function))


def _compiled(function: _Function, **options: Any) -> _Function:
    import numba  # slow to import, which a process that runs no kernel need not wait for

    from clutchid.codegen.machine_code import Kernel, MachineCode

    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    usual = {"nopython": True, "boundscheck": None, "nogil": True, "error_model": "numpy"}
    made: Any = Kernel(function, targetoptions={**usual, **options})
    if Path(function.__code__.co_filename).is_file():
        made._cache = MachineCode(function)
    return cast(_Function, made)


#: One thread loads at a time: Python 3.11 cannot parse in two at once.
_loading = RLock()


@cache
def kernels_in(name: str) -> ModuleType:
    """The module `name` of this package, loaded from the cache folder, so that its machine code is kept there too.

    Kernels that it imports from other modules are compiled with it: their text stands in place of the import, so that
    no machine code calls an older version of them. Of other modules of this package from which a kernel takes a name,
    such as the number of a column or a record, the text has a hash: the compiler freezes their values, and Numba's own
    cache does not see that they change.

    Raises
    ------
    ModuleNotFoundError
        If there is no such module.
    OSError
        If no cache folder can be written, not even a temporary one.
    """
    with _loading:
        texts = _texts(name)
        return load_module(name.rsplit(".", 1)[-1], list(texts), lambda: _joined(texts))


#: First line of a module of kernels.
_FIRST = "from __future__ import annotations"


def _joined(texts: dict[Path, str | None]) -> str:
    return "\n\n".join((_FIRST, *(_hash(path) if text is None else text for path, text in texts.items())))


def _hash(path: Path) -> str:
    """A comment with the hash of what a module means."""
    return f"# {path.stem}: {hashlib.sha256(meaning(path, path.read_bytes())).hexdigest()}"


def _texts(name: str) -> dict[Path, str | None]:
    """The texts of the modules whose kernels a module imports, in the order of their use, and last its own.

    None for a module without kernels from which they take names.
    """
    path = _file(name)
    text, texts = path.read_text(encoding="utf-8"), dict[Path, str | None]()
    lines, tree = text.splitlines(), ast.parse(text)
    taken = set(_names_taken(tree))
    for node in tree.body:
        module = node.module if isinstance(node, ast.ImportFrom) else None
        own = module if module and module.startswith("clutchid.") else None
        kernels = own is not None and _has_kernels(_file(own))
        if own and kernels:
            texts |= _texts(own)
        elif own and isinstance(node, ast.ImportFrom):
            texts |= {_file(own, name.name): None for name in node.names if (name.asname or name.name) in taken}
        if kernels or module == "__future__":
            for number in range(node.lineno - 1, node.end_lineno or node.lineno):
                lines[number] = ""
    return {**texts, path: "\n".join(lines)}


def _names_taken(tree: ast.Module) -> Iterator[str]:
    """Names in a module's statements and in the bodies of its functions, without their annotations and decorators.

    The records that kernels take `by_address` stand in a statement: their fields have places in the machine code.
    """
    for node in tree.body:
        parts = node.body if isinstance(node, ast.FunctionDef) else [node] if isinstance(node, ast.Expr) else []
        yield from (name.id for part in parts for name in ast.walk(part) if isinstance(name, ast.Name))


def _has_kernels(path: Path) -> bool:
    return "\n@kernel\n" in path.read_text(encoding="utf-8")


def _file(name: str, taken: str = "") -> Path:
    """The file of a module, or of the one that is `taken` from a package."""
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"no module named {name}")
    path = Path(spec.origin)
    inner = path.with_name(f"{taken}.py")
    return inner if path.stem == "__init__" and inner.is_file() else path

"""Kernels that are written by hand: how they are compiled, and where their machine code is kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from clutchid.codegen.cache import load_module

#: What a compiler may do with sums and products of a generated kernel, in LLVM's words. Without nnan and ninf: a run
#: that leaves the finite numbers must be seen.
FAST = "reassoc nsz arcp contract afn"

_Function = TypeVar("_Function", bound=Callable[..., object])


def kernel(function: _Function) -> _Function:
    """Compile a function of numbers and arrays that is written by hand."""
    return _compiled(function, fastmath={"contract", "reassoc"})


def generated(function: _Function) -> _Function:
    """Compile a generated kernel: the loops around the functions of a system."""
    return _compiled(function, fastmath=set(FAST.split()))


def inlined(function: _Function) -> _Function:
    """What several generated kernels have in common; its statements are put into each of them."""
    import numba

    return cast(_Function, numba.njit(inline="always")(function))


def _compiled(function: _Function, **options: Any) -> _Function:
    import numba  # slow to import, which a process that runs no kernel need not wait for

    from clutchid.codegen.machine_code import MachineCode

    made: Any = numba.njit(nogil=True, error_model="numpy", **options)(function)
    if Path(function.__code__.co_filename).is_file():
        made._cache = MachineCode(function)
    return cast(_Function, made)


@cache
def kernels_in(name: str) -> ModuleType:
    """The module `name` of this package, loaded from the cache folder, so that its machine code is kept there too.

    Raises
    ------
    ModuleNotFoundError
        If there is no such module.
    OSError
        If no cache folder can be written, not even a temporary one.
    """
    found = find_spec(name)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(f"no module named {name}")
    source = Path(found.origin)
    return load_module(source.stem, [source], lambda: source.read_text(encoding="utf-8"))

"""Kernels that are written by hand: how they are compiled, and where their machine code is kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TypeVar, cast

from clutchid.codegen.cache import load_module

_Function = TypeVar("_Function", bound=Callable[..., object])


def kernel(function: _Function) -> _Function:
    """Compile a function of numbers and arrays, with the settings of the generated kernels."""
    import numba  # slow to import, which a process that runs no kernel need not wait for

    made = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})(function)
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

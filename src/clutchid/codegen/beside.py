"""Kernels that a second process compiles on a first start, while this one begins with others."""

from __future__ import annotations

import threading
from collections.abc import Callable

from clutchid.processes import Pool
from clutchid.systems import processors

#: Waiting in s that Ctrl-C can end, also on Windows.
_GLANCE = 0.1

_compilers: list[threading.Thread] = []


def compile_beside(compile_kernels: Callable[[None], None]) -> None:
    """Let another process call a function of a module that compiles kernels; with one processor, nothing happens.

    It compiles into the cache folder, from which this process loads them, see `wait_for_kernels`. If it fails, they are
    compiled where they are called.
    """
    if processors() > 1:
        _compilers.append(threading.Thread(target=Pool().do, args=(compile_kernels, None), daemon=True))
        _compilers[-1].start()


def wait_for_kernels() -> None:
    """Wait until no other process compiles for this one."""
    for compiler in _compilers[:]:
        while compiler.is_alive():
            compiler.join(_GLANCE)
        _compilers.remove(compiler)

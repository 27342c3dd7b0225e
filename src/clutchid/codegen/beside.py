"""Kernels that a second process compiles on a first start, while this one begins with others."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import TypeVar

from clutchid.processes import Pool
from clutchid.systems import processors

Item = TypeVar("Item")

#: Waiting in s that Ctrl-C can end, also on Windows.
_GLANCE = 0.1

_compilers: list[threading.Thread] = []

#: What threads that wait do first, such as compiling the kernels that this process calls after those.
_meanwhile: deque[Callable[[], object]] = deque()


def compile_beside(
    compile_kernels: Callable[[Item], object], item: Item, meanwhile: Iterable[Callable[[], object]] = ()
) -> None:
    """Let another process call a function of a module that compiles kernels, unless one does; not on one processor.

    It compiles into the cache folder, from which this process loads them, see `wait_for_kernels`. If it fails, they are
    compiled where they are called. `meanwhile` is done, piece by piece, while this process waits.
    """
    if processors() > 1 and not any(compiler.is_alive() for compiler in _compilers):
        compiler = threading.Thread(target=Pool().do, args=(compile_kernels, item), daemon=True)
        compiler.start()
        _meanwhile.clear()
        _meanwhile.extend(meanwhile)
        _compilers[:] = [compiler]


def wait_for_kernels() -> None:
    """Wait until no other process compiles for this one; several threads may wait.

    The thread of that process does not: where none can be started, it compiles itself.
    """
    for compiler in tuple(_compilers):
        while compiler is not threading.current_thread() and compiler.is_alive():
            try:
                work = _meanwhile.popleft()
            except IndexError:
                compiler.join(_GLANCE)
            else:
                work()

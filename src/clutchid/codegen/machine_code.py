"""Kernels, and their machine code on disk as Numba keeps it, with a checksum: damaged files are compiled again."""

# mypy: disallow-subclassing-any=False, disallow-untyped-calls=False

from __future__ import annotations

import hashlib
import pickle
import sys
import warnings
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, InTreeCacheLocator
from numba.core.registry import CPUDispatcher

from clutchid.codegen.cache import announce

_SIZE = hashlib.sha256().digest_size

#: Options of a function that is called neither from Python nor by its address.
_NO_ENTRIES = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class _Part(CPUDispatcher):
    """A function that kernels call: without entries from Python and C, and without a file of its own.

    A literal argument, such as False, is no type of its own, for which all that the function calls would be compiled
    once more.
    """

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compiled function for these types of arguments."""
        return super().get_call_template(tuple(map(types.unliteral, args)), kws)


class Kernel(CPUDispatcher):
    """A function that Numba compiles: for calls from Python, and as a part of the kernels that call it."""

    @cached_property
    def _part(self) -> _Part:
        return _Part(self.py_func, targetoptions={**self.targetoptions, **_NO_ENTRIES})

    @property
    def _numba_type_(self) -> Any:
        """Type by which other kernels see it."""
        return types.Dispatcher(self._part)


class _Beside(InTreeCacheLocator):
    """The folder beside the module, whatever NUMBA_CACHE_DIR is, as its content is executed; also a read-only one."""

    @classmethod
    def from_function(cls, function: Any, file: str) -> Any:
        return cls(function, file)


class _KeptBeside(CompileResultCacheImpl):
    def __init__(self, function: Any) -> None:
        self._locator_classes = [_Beside]
        super().__init__(function)


class MachineCode(FunctionCache):
    """The machine code of a kernel on disk; a full disk is reported once."""

    _impl_class = _KeptBeside

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _Sealed(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Machine code of a signature, or None: then Numba compiles it next."""
        if "clutchid.cli" in sys.modules:  # the process is a command, and nobody else compiles in it
            _skip_blas()
        code = super().load_overload(signature, context)
        if code is None:
            announce()
        return code

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Save compiled code."""
        try:
            super().save_overload(signature, compiled)
        except OSError as problem:
            warnings.warn(f"{self._cache_path} cannot keep machine code: {problem}.", RuntimeWarning, stacklevel=2)
            self.disable()


@cache
def _skip_blas() -> None:
    """Load what Numba knows of NumPy without SciPy's linear algebra, a tenth of the start of a command.

    It is imported for products of matrices, which no kernel has.
    """
    from numba.np import linalg

    def absent() -> None:
        raise ImportError

    ensure, linalg.ensure_blas = linalg.ensure_blas, absent
    try:
        import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = ensure


def is_kept(kernel: Any) -> bool:
    """Whether machine code of `kernel` lies on disk, or cannot."""
    return not isinstance(kernel._cache, MachineCode) or bool(kernel._cache._cache_file._load_index())


class _Sealed(IndexDataCacheFile):
    """The files of a kernel, each with the SHA-256 of its content in front."""

    def _load_index(self) -> Any:
        try:
            version, stamp, overloads = self._opened(self._index_path)
        except OSError:
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: Any) -> None:
        self._keep(self._index_path, (self._version, self._source_stamp, overloads))

    def _load_data(self, name: str) -> Any:
        return self._opened(self._data_path(name))

    def _save_data(self, name: str, data: Any) -> None:
        self._keep(self._data_path(name), data)

    def _opened(self, path: str) -> Any:
        content = Path(path).read_bytes()
        if hashlib.sha256(content[_SIZE:]).digest() != content[:_SIZE]:
            raise OSError(f"{path} is damaged.")
        try:
            return pickle.loads(content[_SIZE:])
        except (AttributeError, ImportError, pickle.UnpicklingError) as problem:  # types of another process or version
            raise OSError(f"{path} cannot be read: {problem}.") from problem

    def _keep(self, path: str, value: Any) -> None:
        content = self._dump(value)
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(content).digest() + content)

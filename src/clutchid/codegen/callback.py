"""Kernels as arguments of other kernels."""

# mypy: disallow-subclassing-any=False, disallow-untyped-calls=False

from __future__ import annotations

from typing import Any

from numba import types


class Callback(types.WrapperAddressProtocol):
    """A kernel for arguments of fixed types, to be passed to a kernel that calls it by its address.

    All callbacks with the same argument and result types are of one type, so a kernel that takes one is compiled once,
    and its machine code is kept on disk. Never pass a kernel without this: Numba would compile a copy in every process,
    and keep it under a type that other processes may be unable to read.
    """

    def __init__(self, function: Any, arguments: tuple[Any, ...]) -> None:
        function.compile(arguments)
        self._compiled = function.overloads[arguments]

    def signature(self) -> Any:
        """Types of the result and of the arguments."""
        return self._compiled.signature

    def __wrapper_address__(self) -> int:
        address: int = self._compiled.library.get_pointer_to_function(self._compiled.fndesc.llvm_cfunc_wrapper_name)
        return address

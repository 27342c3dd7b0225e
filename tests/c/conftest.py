"""A C compiler, and generated C behind ctypes."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from clutchid.codegen.c99 import CSource, c99_source
from clutchid.codegen.system import System
from fixtures.once import once
from fixtures.programs import path_of

STRICT = ("-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-std=c99", "-pedantic")


class Table(ctypes.Structure):
    """NAME_table_t."""

    _fields_ = (("n", ctypes.c_int), ("breakpoints", ctypes.c_void_p), ("coefficients", ctypes.c_void_p))


class Basis(ctypes.Structure):
    """NAME_basis_t."""

    _fields_ = (("n", ctypes.c_int), ("coefficients", ctypes.c_void_p), ("reach", ctypes.c_void_p))


@dataclass(frozen=True)
class Compiled:
    """A shared library of generated C."""

    code: CSource
    file: Path
    name: str
    real: type

    def library(self) -> ctypes.CDLL:
        return ctypes.CDLL(str(self.file))

    def array(self, values: ArrayLike) -> NDArray:
        return np.array(values, dtype=self.real, order="C")

    def table(self, breakpoints: NDArray, load: NDArray) -> Table:
        """The arrays must outlive the table."""
        return Table(breakpoints.size, breakpoints.ctypes.data, load.ctypes.data)

    def run(self, x0, u, p, dt, substeps=1, table: tuple[ArrayLike, ArrayLike] | None = None):
        """Status, states and the last state left in x."""
        x, u, p, dt = (self.array(values) for values in (x0, u, p, dt))
        steps = np.full(dt.size, substeps, np.intc)
        out = np.full((dt.size + 1, x.size), np.nan, self.real)
        arrays = [pointer(a) for a in (x, u, p, dt, steps)]
        held = [self.array(part) for part in table or ()]
        tables = [ctypes.byref(self.table(*held))] if table else []
        status = getattr(self.library(), f"{self.name}_run")(*arrays, ctypes.c_int(dt.size + 1), *tables, pointer(out))
        return status, out, x

    def step(self, x, S, u, p, h, substeps, table: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None):
        """x and S after an interval of h seconds, by NAME_step_columns; `table` are breakpoints, load and basis."""
        x, S, u, p = (self.array(values) for values in (x, np.transpose(S), u, p))
        carry = np.zeros_like(x)
        library, step = self.library(), ctypes.c_float if self.real is np.float32 else ctypes.c_double
        constants, held = ctypes.create_string_buffer(1 << 14), ctypes.create_string_buffer(1 << 14)
        arrays = [self.array(part) for part in table or ()]
        tables = []
        if table:
            functions, pieces = arrays[2].shape[:2]
            places = np.arange(functions)
            reach = np.column_stack([0 * places, 0 * places + pieces - 1, pieces * places]).astype(np.intc)
            basis = Basis(functions, arrays[2].ctypes.data, reach.ctypes.data)
            tables = [ctypes.byref(self.table(*arrays[:2])), ctypes.byref(basis), ctypes.create_string_buffer(64)]
        getattr(library, f"{self.name}_constants")(pointer(p), constants)
        getattr(library, f"{self.name}_hold")(pointer(u), pointer(p), constants, held)
        common = (
            ctypes.c_int(S.shape[0]),
            ctypes.c_int(S.shape[1]),
            pointer(p),
            constants,
            held,
            *tables,
            step(h / substeps),
        )
        for _ in range(substeps):
            getattr(library, f"{self.name}_step_columns")(pointer(x), pointer(carry), pointer(S), *common)
        return x, S.T


def pointer(array: NDArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


@pytest.fixture(scope="session")
def compiler() -> str:
    return path_of("cc")


@pytest.fixture(scope="session")
def compiled(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Compiles ``name.h`` and ``name.c`` strictly: compiled(code, name, flags), the file of the library."""

    def make(code: CSource, name: str, flags: tuple[str, ...] = ("-O1",)) -> Path:
        folder = tmp_path_factory.mktemp(name)
        (folder / f"{name}.h").write_text(code.header)
        (folder / f"{name}.c").write_text(code.source)
        compile_only = [compiler, *STRICT, *flags, "-fPIC", "-c", "-o", "c.o", f"{name}.c"]
        # Linked without the flags: -ffast-math would add code that changes the arithmetic of this whole process.
        link = [compiler, "-shared", "-o", "c.so", "c.o", "-lm"]
        for command in (compile_only, link):
            process = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            assert (process.returncode, process.stderr) == (0, "")
        return folder / "c.so"

    return make


@pytest.fixture(scope="session")
def build(compiled: Callable[..., Path]) -> Callable[..., Compiled]:
    """Compiles a system's C strictly; further flags may be given."""

    def make(
        system: System,
        real: str = "double",
        flags: tuple[str, ...] = ("-O1",),
        derivatives: tuple[str, ...] | None = None,
    ) -> Compiled:
        options = {"real": real, "derivatives": derivatives}
        code = once((system, options), lambda: c99_source(system, **options))
        file = compiled(code, system.name, flags)
        return Compiled(code, file, system.name, np.float64 if real == "double" else np.float32)

    return make

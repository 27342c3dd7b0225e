"""The compiled kernels of a model variant, from the cache or made from the equations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType

from clutchid.codegen.cache import load_module
from clutchid.errors import ParameterError
from clutchid.parameters import unknown_name

#: Model variants by name.
VARIANTS = ("isothermal",)

_HERE = Path(__file__).parent


@cache
def kernels(variant: str) -> ModuleType:
    """Kernels of `variant`: ``run``, ``run_table``, ``run_all``, ``linearise`` and ``paper_table``.

    A warm call neither imports SymPy nor compiles.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    if variant not in VARIANTS:
        raise ParameterError(unknown_name(variant, VARIANTS, "model"))
    code = [path for folder in (_HERE, _HERE.parent / "codegen") for path in folder.rglob("*") if path.is_file()]
    sources = [path for path in code if path.suffix in (".py", ".j2")]
    return load_module(variant, [*sources, _HERE.parent / "parameters.py"], _builder(variant))


def _builder(variant: str) -> Callable[[], str]:
    def build() -> str:
        import sympy as sp

        from clutchid.codegen.numba_source import function_source, numba_source
        from clutchid.model.isothermal import isothermal
        from clutchid.model.load import table_expressions

        knots = sp.symbols("t_1:5 phi2_slope", real=True)
        systems = {"isothermal": isothermal}
        return numba_source(systems[variant]()) + function_source("paper_table", knots, table_expressions(*knots))

    return build

"""The compiled plant of a structure, from the cache or printed from the equations, and the loop around it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from clutchid.codegen.cache import generator_files, load_module
from clutchid.codegen.kernels import kernels_in
from clutchid.truck.structure import Structure

_HERE = Path(__file__).parent


def loop() -> ModuleType:
    """The module with the kernel ``drive``, one for all plants."""
    return kernels_in("clutchid.truck.loop")


@dataclass(frozen=True, slots=True)
class CompiledPlant:
    """Kernels of a plant, to be passed to the loop, which takes those of every plant.

    ``begin(p, work)`` and ``move(x, u, p, h, substeps, breakpoints, load, work)``; `parameters` are the names of p in
    their order, `work` is the size of the array work.
    """

    parameters: tuple[str, ...]
    work: int
    begin: Any
    move: Any


@cache
def compiled_plant(structure: Structure, ledger: bool) -> CompiledPlant:
    """The plant of a structure; with `ledger`, with balances of mass and energy across its boundary.

    With a filled cache, neither SymPy is imported nor anything compiled.

    Raises
    ------
    OSError
        If neither the cache folder nor a temporary folder can be written.
    """
    from numba import types

    from clutchid.codegen.linked import Callback

    own = [*(_HERE / "equations").glob("*.py"), *(_HERE / f"{name}.py" for name in ("compiled", "structure"))]
    sources = [*own, _HERE / "templates" / "plant.py.j2", *generator_files()]
    words = ("truck", *structure.words, *(("ledger",) if ledger else ()))
    kernels = load_module("_".join(words), sources, lambda: plant_source(structure, ledger))
    vector, number = types.Array(types.float64, 1, "C"), types.float64
    curve = (types.Array(types.float64, n, "C", readonly=True) for n in (1, 2))
    return CompiledPlant(
        parameters=kernels.PARAMETERS,
        work=kernels.WORK,
        begin=Callback(kernels.begin, (vector, vector)),
        move=Callback(kernels.move, (vector, vector, vector, number, types.int64, *curve, vector)),
    )


def plant_source(structure: Structure, ledger: bool) -> str:
    """Source of the module with the plant's equations.

    Raises
    ------
    NotImplementedError
        If an equation uses a function that is not printed.
    """
    from clutchid.codegen.functions import plain_functions
    from clutchid.codegen.templates import template
    from clutchid.truck.equations.plant import plant

    system = plant(structure, ledger)
    work, functions = plain_functions(system)
    return template("plant.py.j2", "clutchid.truck").render(
        name=system.name, parameters=system.parameter_names(), functions=functions, work=work
    )

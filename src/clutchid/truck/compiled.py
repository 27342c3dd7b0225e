"""The compiled closed loop of a family, from the cache or generated from the equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

from clutchid.codegen.cache import generator_files, load_module

_HERE = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class Loop:
    """Parts of a family's loop: its equations, the functions of its discrete-time parts, and its template.

    `plant` is the module of `clutchid.truck` with the function ``plant``, imported only where nothing is cached. `laws`
    are functions by the module that has them, `constants` come with their module; `files` are all sources, relative to
    this folder.
    """

    name: str
    plant: str
    laws: tuple[tuple[str, tuple[str, ...]], ...]
    constants: tuple[tuple[str, str], ...]
    settings: tuple[str, ...]
    template: str
    files: tuple[str, ...]


@cache
def compiled(parts: Loop, ledger: bool) -> ModuleType:
    """Module with ``drive``; with `ledger`, for the plant with balances of mass and energy across its boundary.

    With a filled cache, neither SymPy is imported nor anything compiled.

    Raises
    ------
    OSError
        If neither the cache folder nor a temporary folder can be written.
    """
    sources = [*(_HERE / file for file in (*parts.files, *SHARED)), *generator_files()]
    name = f"{parts.name}_ledger" if ledger else parts.name
    return load_module(name, sources, lambda: loop_source(parts, ledger))


def loop_source(parts: Loop, ledger: bool) -> str:
    """Source of the module: the plant's equations inside the loop of valves, sensor and controller.

    The plant is inlined in the loop rather than called, so that its states stay in registers.
    """
    import inspect
    from importlib import import_module

    from clutchid.codegen.numba_source import block
    from clutchid.codegen.program import right_hand_side
    from clutchid.codegen.staging import staged
    from clutchid.codegen.templates import template
    from clutchid.truck import law

    system = import_module(f"clutchid.truck.{parts.plant}").plant(ledger)
    statements, _ = right_hand_side(system)
    split = staged(statements, system.parameters, system.inputs)
    modules = [(import_module(f"clutchid.truck.{module}"), names) for module, names in parts.laws]
    constants = {key: repr(getattr(law, key)) for key in CONSTANTS}
    constants |= {key: repr(getattr(import_module(f"clutchid.truck.{module}"), key)) for module, key in parts.constants}
    text: str = template(parts.template, "clutchid.truck").render(
        name=system.name,
        constants=constants,
        functions=[inspect.getsource(getattr(module, key)) for module, names in modules for key in names],
        parameters=system.parameter_names(),
        settings=parts.settings,
        states=[str(state) for state in system.states],
        program={part: block(getattr(split, part)) for part in ("constants", "held", "stage")},
    )
    return text


#: Constants of `clutchid.truck.law` that every loop uses, and the sources that all loops share.
CONSTANTS = ("TICK", "SAMPLE", "TICKS", "FILTER_Y", "FILTER_V", "SLOW", "ENGAGED", "VENTING")
SHARED = ("flow.py", "motion.py", "law.py", "compiled.py", "parameters.py", "templates/loop.py.j2")

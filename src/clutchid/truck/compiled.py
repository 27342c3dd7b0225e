"""The compiled closed loop, from the cache or generated from the equations."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import ModuleType

from clutchid.codegen.cache import load_module
from clutchid.truck.order import SETTINGS

#: Functions and constants of `clutchid.truck.law` that the loop uses.
_FUNCTIONS = ("magnet", "lift_rate", "snapped", "governor", "quantised", "lagged", "request", "duty")
_CONSTANTS = ("TICK", "SAMPLE", "TICKS", "FILTER_Y", "FILTER_V", "SLOW", "ENGAGED", "VENTING")

_HERE = Path(__file__).parent


@cache
def loop(ledger: bool = False) -> ModuleType:
    """Module with ``drive``; with `ledger`, for the plant with balances of mass and energy across its boundary.

    With a filled cache, neither SymPy is imported nor anything compiled.

    Raises
    ------
    OSError
        If neither the cache folder nor a temporary folder can be written.
    """
    equations = [
        _HERE / f"{name}.py" for name in ("air", "flow", "friction", "motion", "plant", "law", "compiled", "order")
    ]
    codegen = [path for path in (_HERE.parent / "codegen").rglob("*.py") if path.is_file()]
    sources = [*equations, *codegen, _HERE / "templates" / "loop.py.j2"]
    name = "truck_ledger" if ledger else "truck"
    return load_module(name, sources, lambda: loop_source(ledger))


def loop_source(ledger: bool) -> str:
    """Source of the module: the plant's equations inside the loop of valves, sensor and controller.

    The plant is inlined in the loop rather than called, so that its states stay in registers.
    """
    import inspect

    from clutchid.codegen.numba_source import block
    from clutchid.codegen.program import right_hand_side
    from clutchid.codegen.staging import staged
    from clutchid.codegen.templates import template
    from clutchid.truck import law
    from clutchid.truck.plant import plant

    system = plant(ledger)
    statements, _ = right_hand_side(system)
    parts = staged(statements, system.parameters, system.inputs)
    text: str = template("loop.py.j2", "clutchid.truck").render(
        name=system.name,
        constants={key: repr(getattr(law, key)) for key in _CONSTANTS},
        functions=[inspect.getsource(getattr(law, key)) for key in _FUNCTIONS],
        parameters=system.parameter_names(),
        settings=SETTINGS,
        states=[str(state) for state in system.states],
        program={part: block(getattr(parts, part)) for part in ("constants", "held", "stage")},
    )
    return text

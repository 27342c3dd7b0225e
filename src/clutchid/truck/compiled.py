"""The compiled closed loop of a structure, from the cache or generated from the equations."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import ModuleType

from clutchid.codegen.cache import generator_files, load_module
from clutchid.truck.structure import Structure

_HERE = Path(__file__).parent

#: Numbers of valves, governor, sensors and controller, beside the parameters of the equations.
SETTINGS = (
    "period", "timer", "bang_bang", "continuous", "working", "P_S", "dP_G", "r_up", "r_down", "valve", "t_1s", "t_2s",
    "t_3s", "t_4s", "t_1e", "t_2e", "t_3e", "t_4e", "second_order", "tau_x", "t_n", "zeta_x", "x_0s", "x_0e", "n_x",
    "tau_is", "t_xs", "tau_ie", "t_xe", "f_x", "dead_s", "dead_e", "zero", "q_y", "rest", "y_max", "e_lin", "tau_y",
    "tau_p", "L_p", "t_lead", "e_in", "e_out",
)  # fmt: skip


@cache
def compiled(structure: Structure, ledger: bool) -> ModuleType:
    """Module with ``drive``; with `ledger`, for the plant with balances of mass and energy across its boundary.

    ``PARAMETERS`` and ``SETTINGS`` of the module are the names of its numbers in their order. With a filled cache,
    neither SymPy is imported nor anything compiled.

    Raises
    ------
    OSError
        If neither the cache folder nor a temporary folder can be written.
    """
    own = [*(_HERE / "equations").glob("*.py"), *(_HERE / f"{name}.py" for name in ("compiled", "law", "structure"))]
    sources = [*own, _HERE / "templates" / "loop.py.j2", *generator_files()]
    words = ("truck", *structure.words, *(("ledger",) if ledger else ()))
    return load_module("_".join(words), sources, lambda: loop_source(structure, ledger))


def loop_source(structure: Structure, ledger: bool) -> str:
    """Source of the module: the plant's equations inside the loop of valves, sensor and controller.

    The plant is inlined in the loop rather than called, so that its states stay in registers.
    """
    import inspect

    from clutchid.codegen.numba_source import block
    from clutchid.codegen.program import right_hand_side
    from clutchid.codegen.staging import staged
    from clutchid.codegen.templates import template
    from clutchid.truck import law
    from clutchid.truck.equations.plant import plant

    system = plant(structure, ledger)
    statements, _ = right_hand_side(system)
    split = staged(statements, system.parameters, system.inputs)
    text: str = template("loop.py.j2", "clutchid.truck").render(
        name=system.name, constants={key: repr(value) for key, value in vars(law).items() if key.isupper()},
        functions=[inspect.getsource(law_) for _, law_ in inspect.getmembers(law, inspect.isfunction)],
        parameters=system.parameter_names(), settings=SETTINGS, states=[str(state) for state in system.states],
        program={part: block(getattr(split, part)) for part in ("constants", "held", "stage")},
        governed="r_G" in structure.inputs,
        pressure="(gamma - 1.0) * U_A / (V_0A + A_A * y)" if structure.gas == "energy" else "p_A",
        shown="(scaled(y, set_rest, set_y_max, set_e_lin) if set_e_lin != 0.0 else y)",
    )  # fmt: skip
    return text

"""C99 of a system for a control unit: double or float, static memory, no heap, no recursion."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from clutchid.codegen.c99_columns import ColumnCode
from clutchid.codegen.c99_lines import c_lines, unpacked
from clutchid.codegen.language import C_DOUBLE, C_FLOAT, Language
from clutchid.codegen.layout import DifferentiatedProgram, layout
from clutchid.codegen.names import C_WORDS, apart
from clutchid.codegen.parts import Parts, positions, read
from clutchid.codegen.program import Lookup, live
from clutchid.codegen.system import System
from clutchid.codegen.templates import template

_LANGUAGES = {"double": C_DOUBLE, "float": C_FLOAT}


@dataclass(frozen=True, slots=True)
class CSource:
    """A C module: the text of ``NAME.h`` and of ``NAME.c``, which includes it."""

    header: str
    source: str


def c99_source(
    system: System,
    *,
    real: str = "double",
    notes: Mapping[str, str] | None = None,
    derivatives: Sequence[str] | None = None,
) -> CSource:
    """C99 of `system`: ``NAME_constants``, ``NAME_hold``, ``NAME_rhs``, ``NAME_step`` and ``NAME_run``.

    The functions do what the Numba kernel ``run`` does without jumps: classical RK4 with held inputs.

    Parameters
    ----------
    real : 'double' or 'float'
        Type of every number.
    notes : Mapping[str, str], optional
        Comments on states, inputs and parameters by name.
    derivatives : names of parameters, optional
        Adds ``NAME_step_columns``, which does what the Numba kernel ``step`` does: it moves the states together with
        columns of derivatives to these parameters, to weights of the table, and to whatever the states started with.

    Raises
    ------
    ValueError
        If `real` is neither "double" nor "float", the system's name is no C identifier, or a parameter is not one of
        the system's.
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    if real not in _LANGUAGES:
        raise ValueError(f"real = {real!r}: known are {', '.join(_LANGUAGES)}.")
    if not re.fullmatch(r"[A-Za-z]\w*", system.name, re.ASCII):
        raise ValueError(f"{system.name!r} is no C identifier: letters, digits and underscores are allowed.")
    unknown = sorted(set(derivatives or ()) - set(system.parameter_names()))
    if unknown:
        raise ValueError(f"{system.name} has no parameter {', '.join(unknown)}, so no derivatives to it.")
    plan, language = layout(apart(system, C_WORDS)), _LANGUAGES[real]
    places = None if derivatives is None else [system.parameter_names().index(name) for name in derivatives]
    columns = None if places is None else ColumnCode.of(plan, places, language)
    parts = columns.parts if columns else Parts.of(plan.system, plan.plain, plan.rates)
    values = _values(system, plan, parts, language)
    values |= {"real": real, "notes": dict(notes or {}), "columns": columns, "free": list(derivatives or ())}
    return CSource(template("c99.h.j2").render(values), template("c99.c.j2").render(values))


def _values(system: System, plan: DifferentiatedProgram, parts: Parts, language: Language) -> dict[str, Any]:
    """Values of the templates; names of the interface come from `system`, those of the code from `plan`."""
    inside, program = plan.system, parts.program
    in_held, stage = read(program.held), live(program.stage, plan.rates)
    defined = {str(symbol) for symbol, _ in inside.definitions}
    code = {"constants": program.constants, "held": program.held, "stage": stage}
    return {
        "name": system.name,
        "states": [str(s) for s in system.states],
        "inputs": [str(s) for s in system.inputs],
        "parameters": system.parameter_names(),
        "table": system.table if any(isinstance(s, Lookup) for s in program.stage) else None,
        "constants": parts.constants,
        "held": parts.held,
        "held_inputs": positions(inside.inputs, parts.inputs),
        "rates": plan.rates,
        "print": language.print,
        "code": {part: "\n".join(c_lines(lines, language, defined=defined)) for part, lines in code.items()},
        "constants_from": {"p": positions(inside.parameters, read(program.constants))},
        "held_from": {
            "u": positions(inside.inputs, in_held),
            "p": positions(inside.parameters, in_held),
            "c": [t for t in parts.constants if t in in_held],
        },
        "stage_from": unpacked(inside, parts, read(stage) | set(plan.rates)),
    }

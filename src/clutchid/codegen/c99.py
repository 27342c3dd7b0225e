"""C99 of a system for a control unit: double or float, static memory, no heap, no recursion."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from clutchid.codegen.language import C_DOUBLE, C_FLOAT, Language
from clutchid.codegen.layout import layout
from clutchid.codegen.names import C_WORDS, apart
from clutchid.codegen.program import Assign, Branch, Lookup, Statement, live, reads, targets
from clutchid.codegen.staging import Staged
from clutchid.codegen.system import Expr, System
from clutchid.codegen.templates import template

_LANGUAGES = {"double": C_DOUBLE, "float": C_FLOAT}


@dataclass(frozen=True, slots=True)
class CSource:
    """A C module: the text of ``NAME.h`` and of ``NAME.c``, which includes it."""

    header: str
    source: str


def c99_source(system: System, *, real: str = "double", notes: Mapping[str, str] | None = None) -> CSource:
    """C99 of `system`: ``NAME_constants``, ``NAME_hold``, ``NAME_rhs``, ``NAME_step`` and ``NAME_run``.

    The functions do what the Numba kernel ``run`` does without jumps: classical RK4 with held inputs. `real` is the
    type of every number, "double" or "float"; `notes` are comments on states, inputs and parameters by name.

    Raises
    ------
    ValueError
        If `real` is neither "double" nor "float", or the system's name is no C identifier.
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    if real not in _LANGUAGES:
        raise ValueError(f"real = {real!r}: known are {', '.join(_LANGUAGES)}.")
    if not re.fullmatch(r"[A-Za-z]\w*", system.name, re.ASCII):
        raise ValueError(f"{system.name!r} is no C identifier: letters, digits and underscores are allowed.")
    inside = apart(system, C_WORDS)
    plan = layout(inside)
    values = _values(system, inside, _pruned(plan.plain, plan.rates), _LANGUAGES[real], plan.rates)
    values |= {"real": real, "notes": dict(notes or {})}
    return CSource(template("c99.h.j2").render(values), template("c99.c.j2").render(values))


def _pruned(program: Staged, rates: Iterable[Expr]) -> Staged:
    """`program` without statements that lifting has made superfluous."""
    stage = live(program.stage, rates)
    held = live(program.held, _read(stage))
    return Staged(live(program.constants, _read([*stage, *held])), held, stage)


def _values(
    system: System, inside: System, program: Staged, language: Language, rates: Sequence[Expr]
) -> dict[str, Any]:
    """What the templates fill in; names of the interface come from `system`, those of the code from `inside`."""
    in_stage, in_held = _read(program.stage), _read(program.held)
    constants = [t for t in _set(program.constants) if t in in_stage | in_held]
    held = [t for t in _set(program.held) if t in in_stage]
    defined = {str(symbol) for symbol, _ in inside.definitions}
    parameters, inputs = inside.parameters, inside.inputs
    return {
        "name": system.name,
        "states": [str(s) for s in system.states],
        "inputs": [str(s) for s in system.inputs],
        "parameters": system.parameter_names(),
        "table": system.table if any(isinstance(s, Lookup) for s in program.stage) else None,
        "constants": constants,
        "held": held,
        "held_inputs": _positions(inputs, in_stage),
        "rates": rates,
        "print": language.print,
        "code": {
            part: "\n".join(c_lines(getattr(program, part), language, defined=defined))
            for part in ("constants", "held", "stage")
        },
        "constants_from": {"p": _positions(parameters, _read(program.constants))},
        "held_from": {
            "u": _positions(inputs, in_held),
            "p": _positions(parameters, in_held),
            "c": [t for t in constants if t in in_held],
        },
        "stage_from": {
            "x": _positions(inside.states, in_stage),
            "p": _positions(parameters, in_stage),
            "c": [t for t in constants if t in in_stage],
            "held": [*(symbol for _, symbol in _positions(inputs, in_stage)), *held],
        },
    }


def c_lines(
    statements: Sequence[Statement],
    language: Language,
    indent: str = "    ",
    declared: Collection[Expr] = (),
    defined: Collection[str] = (),
) -> list[str]:
    """Statements as lines of C; variables are declared where they are set, unless they are in `declared`.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed.
    """
    real = "float" if language is C_FLOAT else "double"
    lines: list[str] = []
    for statement in statements:
        if isinstance(statement, Assign):
            kind = "" if statement.target in declared else f"const {real} "
            lines.append(f"{indent}{kind}{statement.target} = {language.print(statement.value)};")
        elif isinstance(statement, Lookup):
            lines.append(
                f"{indent}const {real} {statement.value} = lookup(table, &memory->segment, {statement.argument});"
            )
        else:
            lines += _branch(statement, language, indent, declared, defined)
    return lines


def _branch(
    branch: Branch, language: Language, indent: str, declared: Collection[Expr], defined: Collection[str]
) -> list[str]:
    real = "float" if language is C_FLOAT else "double"
    outputs = targets(branch)
    new = [target for target in outputs if target not in declared]
    named = [str(target) for target in new if str(target) in defined]
    lines = [f"{indent}/* {', '.join(named)}, case by case */"] if named else []
    lines += [f"{indent}{real} {target};" for target in new]
    known = {*declared, *outputs}
    for number, (condition, arm) in enumerate(branch.arms):
        final = number == len(branch.arms) - 1
        test = "" if final else f"if ({language.print(condition)}) "
        lines.append(f"{indent}{'} else ' if number else ''}{test}{{")
        lines += c_lines(arm, language, indent + "    ", known, defined)
    return [*lines, f"{indent}}}"]


def _read(statements: Sequence[Statement]) -> set[Expr]:
    return {symbol for statement in statements for symbol in reads(statement)}


def _set(statements: Sequence[Statement]) -> list[Expr]:
    return [target for statement in statements for target in targets(statement)]


def _positions(symbols: Sequence[Expr], needed: Collection[Expr]) -> list[tuple[int, Expr]]:
    """Those `symbols` that are `needed`, with their positions."""
    return [(position, symbol) for position, symbol in enumerate(symbols) if symbol in needed]

"""Statements as lines of C."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from clutchid.codegen.language import C_FLOAT, Language
from clutchid.codegen.parts import Parts, positions
from clutchid.codegen.program import Assign, Branch, Lookup, Statement, targets
from clutchid.codegen.system import Expr, System


def c_lines(
    statements: Sequence[Statement],
    language: Language,
    indent: str = "    ",
    declared: Collection[Expr] = (),
    defined: Collection[str] = (),
    slopes: bool = False,
) -> list[str]:
    """Statements as lines of C; variables are declared where they are set, unless they are in `declared`.

    `defined` are names that a comment points out where they are computed case by case; with `slopes` a table gives its
    slope too.

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
            lines.append(f"{indent}const {real} {statement.value} = lookup(table, memory, {statement.argument});")
            if slopes:
                lines.append(f"{indent}const {real} {statement.slope} = table_slope(table, memory);")
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


def unpacked(system: System, parts: Parts, needed: Collection[Expr]) -> dict[str, list[Any]]:
    """Arguments that a stage reads: states, parameters, constants, and held values."""
    return {
        "x": positions(system.states, needed),
        "p": positions(system.parameters, needed),
        "c": [t for t in parts.constants if t in needed],
        "held": [t for t in (*parts.inputs, *parts.held) if t in needed],
    }

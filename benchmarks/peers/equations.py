"""The expressions of the paper's model as text for a peer: Python, Octave, and whatever has a choice."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import sympy as sp
from plain import STATES, WEIGHTS

from clutchid.codegen.language import FUNCTIONS, PYTHON, Language
from clutchid.codegen.program import Assign, Branch, Lookup, Statement, right_hand_side, targets
from clutchid.model.isothermal import isothermal
from clutchid.parameters import Parameters

OCTAVE = Language("double", "{}", "&&", "||", "!", "true", "false", {name: name for name in FUNCTIONS})

#: For a peer that has a root and a choice of its own.
CHOSEN = replace(PYTHON, functions={"sqrt": "sqrt"})


class Equations(NamedTuple):
    """Statements that compute the rates of the states; free parameters are left as symbols."""

    statements: tuple[Statement, ...]
    rates: tuple[sp.Symbol, ...]


def equations(values: Mapping[str, float], free: Collection[str] = ()) -> Equations:
    """The model with numbers for all parameters that are not `free`, and without the branches that these decide."""
    statements, rates = right_hand_side(isothermal())
    fixed = {
        symbol: sp.Float(values[str(symbol)])
        for symbol in isothermal().parameters
        if str(symbol) in values and str(symbol) not in free
    }
    return Equations(tuple(_simplified(statements, fixed)), rates)


def _simplified(statements: Sequence[Statement], fixed: Mapping[sp.Symbol, Any]) -> list[Statement]:
    new: list[Statement] = []
    for statement in statements:
        if isinstance(statement, Assign):
            new.append(Assign(statement.target, sp.sympify(statement.value).xreplace(fixed)))
        elif isinstance(statement, Lookup):
            new.append(statement)
        else:
            new += _simplified_branch(statement, fixed)
    return new


def _simplified_branch(branch: Branch, fixed: Mapping[sp.Symbol, Any]) -> list[Statement]:
    arms: list[tuple[Any, tuple[Statement, ...]]] = []
    for condition, arm in branch.arms:
        decided = sp.sympify(condition).xreplace(fixed)
        if decided is not sp.false:
            arms.append((decided, tuple(_simplified(arm, fixed))))
        if decided is sp.true:
            break
    return list(arms[0][1]) if arms[0][0] is sp.true else [Branch(tuple(arms))]


def lines(statements: Sequence[Statement], python: bool, indent: str = "    ") -> list[str]:
    """The statements as lines of Python, or of Octave."""
    language, colon, end = (PYTHON, ":", "") if python else (OCTAVE, "", ";")
    text: list[str] = []
    for statement in statements:
        if isinstance(statement, Assign):
            text.append(f"{indent}{statement.target} = {language.print(statement.value)}{end}")
        elif isinstance(statement, Lookup):
            text.append(f"{indent}{statement.value} = lookup({statement.argument}, table){end}")
        else:
            for number, (condition, arm) in enumerate(statement.arms):
                otherwise = number == len(statement.arms) - 1
                word = "else" if otherwise else ("elif " if python else "elseif ") if number else "if "
                text.append(f"{indent}{word}{'' if otherwise else language.print(condition)}{colon}")
                text += lines(arm, python, indent + "    ")
            text += [] if python else [f"{indent}end"]
    return text


def python_text(values: Mapping[str, float]) -> str:
    """``rates(y, v, p_A, p_B, z, u_vs, u_ve, table)`` in scalar Python, for `plain.scalar_rates`."""
    model = equations(values)
    arguments, result = ", ".join((*STATES, "u_vs", "u_ve", "table")), ", ".join(map(str, model.rates))
    return "\n".join([f"def rates({arguments}):", *lines(model.statements, True), f"    return ({result},)"])


def octave_rates(values: Mapping[str, float]) -> str:
    """The same as a function file of Octave; the table is a structure with fields `b` and `c`."""
    model = equations(values)
    unpacked = [f"    {state} = x({number});" for number, state in enumerate(STATES, 1)]
    result = "; ".join(map(str, model.rates))
    table = [
        "function f = lookup(y, table)",
        "    k = sum(y >= table.b); d = y - table.b(max(k, 1)); c = table.c(k + 1, :);",
        "    f = ((c(4)*d + c(3))*d + c(2))*d + c(1);",
        "end",
    ]
    head, body = "function dx = rates(x, u_vs, u_ve, table)", lines(model.statements, False)
    return "\n".join([head, *unpacked, *body, f"    dx = [{result}];", "end", *table])


def chosen_text(values: Mapping[str, float], free: Sequence[str] = ()) -> str:
    """The rates for a peer that computes all arms and chooses, for `plain.Model`; free load weights are in `load`."""
    model = equations(values, free)
    others = [f"{name}" for name in free if name not in WEIGHTS]
    arguments = ", ".join(("where", "sqrt", "load", *STATES, "u_vs", "u_ve", *others))
    text, names = _chosen(model.statements, {}, "")
    result = ", ".join(str(names[rate]) for rate in model.rates)
    return "\n".join([f"def rates({arguments}):", *text, f"    return {result}"]) + "\n"


def _chosen(
    statements: Sequence[Statement], names_so_far: Mapping[Any, sp.Symbol], mark: str
) -> tuple[list[str], dict[Any, sp.Symbol]]:
    """Lines, and names after them; what an arm assigns has a name of its own, which ends with the arm's `mark`."""
    text, names = list[str](), dict(names_so_far)

    def assign(target: Any, value: str) -> None:
        names[target] = sp.Symbol(f"{target}{mark}")
        text.append(f"    {names[target]} = {value}")

    def printed(value: Any) -> str:
        return CHOSEN.print(sp.sympify(value).xreplace(names))

    for statement in statements:
        if isinstance(statement, Assign):
            assign(statement.target, printed(statement.value))
        elif isinstance(statement, Lookup):
            assign(statement.value, f"load({printed(statement.argument)})")
        else:
            arms = []
            for number, (condition, arm) in enumerate(statement.arms):
                inner, branch = _chosen(arm, names, f"{mark}__{number}")
                text += inner
                arms.append((printed(condition), branch))
            for target in targets(statement):
                value = str(arms[-1][1][target])
                for condition, branch in arms[-2::-1]:
                    value = f"where({condition}, {branch[target]}, {value})"
                assign(target, value)
    return text, names


def parameter_values(array: Any) -> dict[str, float]:
    """Parameters by name from the array of the kernels."""
    return dict(zip(Parameters.names(), map(float, array), strict=True))

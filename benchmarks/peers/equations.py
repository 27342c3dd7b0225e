"""The expressions of the paper's model as text or values for a peer: Python, Octave, and whatever has `where`."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Collection, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import sympy as sp

from clutchid.codegen.language import FUNCTIONS, PYTHON, Language
from clutchid.codegen.program import Assign, Branch, Lookup, Statement, right_hand_side, targets
from clutchid.model.isothermal import isothermal
from clutchid.parameters import Parameters

STATES = ("y", "v", "p_A", "p_B", "z")
OCTAVE = Language("double", "{}", "&&", "||", "!", "true", "false", {name: name for name in FUNCTIONS})

#: Below 0 only in an arm that is not taken; a peer that computes all arms needs a root, and its derivative, there too.
SMALLEST = 1e-12


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


def python_rates(values: Mapping[str, float]) -> Callable[..., tuple[float, ...]]:
    """``rates(y, v, p_A, p_B, z, u_vs, u_ve, table)`` in scalar Python."""
    model = equations(values)
    arguments = ", ".join((*STATES, "u_vs", "u_ve", "table"))
    result = ", ".join(map(str, model.rates))
    source = "\n".join([f"def rates({arguments}):", *lines(model.statements, True), f"    return ({result},)"])
    # a solver tries steps that end below vacuum, before it rejects them
    guarded = SimpleNamespace(sqrt=lambda x: math.sqrt(x) if x > 0.0 else 0.0)
    names: dict[str, Any] = {"math": guarded, "lookup": lookup}
    exec(compile(source, "the model in Python", "exec"), names)
    function: Callable[..., tuple[float, ...]] = names["rates"]
    return function


def lookup(y: float, table: tuple[list[float], list[list[float]]]) -> float:
    """A piecewise cubic at y: breakpoints and coefficients as lists, which scalar Python reads fastest."""
    segment = bisect_right(table[0], y)
    d, c = y - table[0][max(segment - 1, 0)], table[1][segment]
    return ((c[3] * d + c[2]) * d + c[1]) * d + c[0]


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


class Operations(NamedTuple):
    """What a peer that records expressions has for a root, the larger of two, and a choice."""

    sqrt: Callable[[Any], Any]
    larger: Callable[[Any, Any], Any]
    where: Callable[[Any, Any, Any], Any]


class Compiled(NamedTuple):
    """The rates as a function of named values, for a peer that computes all arms and chooses."""

    model: Equations
    operations: Operations

    def __call__(self, known: dict[str, Any], table: Callable[[Any], Any]) -> list[Any]:
        """The rates; `known` has states, inputs and free parameters by name, `table` is the load over the position."""
        all_known = dict(known)
        self._compute(self.model.statements, all_known, table)
        return [all_known[str(rate)] for rate in self.model.rates]

    def _compute(self, statements: Sequence[Statement], known: dict[str, Any], table: Callable[[Any], Any]) -> None:
        for statement in statements:
            if isinstance(statement, Assign):
                known[str(statement.target)] = self._value(statement.value, known)
            elif isinstance(statement, Lookup):
                known[str(statement.value)] = table(known[str(statement.argument)])
            else:
                arms = []
                for condition, arm in statement.arms:
                    inner = dict(known)
                    self._compute(arm, inner, table)
                    arms.append((condition, inner))
                for target in map(str, targets(statement)):
                    value = arms[-1][1][target]
                    for condition, inner in arms[-2::-1]:
                        value = self.operations.where(self._value(condition, known), inner[target], value)
                    known[target] = value

    def _value(self, value: Any, known: Mapping[str, Any]) -> Any:
        symbols = sorted(sp.sympify(value).free_symbols, key=str)
        root = {"sqrt": lambda x: self.operations.sqrt(self.operations.larger(x, SMALLEST))}
        return sp.lambdify(symbols, value, modules=[root])(*(known[str(symbol)] for symbol in symbols))


def load_expression(
    y: Any, weights: Sequence[Any], breakpoints: Sequence[float], basis: Any, where: Callable[[Any, Any, Any], Any]
) -> Any:
    """The load of `weights` over y, a choice of cubics; `basis` has shape (weights, segments, 4)."""
    segments, powers = range(basis.shape[1]), range(4)
    combined = [
        [sum(w * float(b[s, k]) for w, b in zip(weights, basis, strict=True)) for k in powers] for s in segments
    ]
    value = None
    for s, c in enumerate(combined):
        d = y - float(breakpoints[max(s - 1, 0)])
        piece = ((c[3] * d + c[2]) * d + c[1]) * d + c[0]
        value = piece if value is None else where(y >= float(breakpoints[s - 1]), piece, value)
    return value


def parameter_values(array: Any) -> dict[str, float]:
    """Parameters by name from the array of the kernels."""
    return dict(zip(Parameters.names(), map(float, array), strict=True))

"""Names that generated code uses for itself, and systems whose symbols keep out of their way."""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Iterable
from dataclasses import replace

import sympy as sp

from clutchid.codegen.language import FUNCTIONS
from clutchid.codegen.system import Expr, System, TabulatedFunction

_PYTHON = "math x u p"
_C = """
    x u p c held table memory dx n h half sixth stage reach weight sum at i k a offset argument segment
    lookup rhs step constants hold run out dt substeps table_slope
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    isfinite fabs fabsf INFINITY NAN
"""

#: What the generated Python calls its arguments, locals and modules.
PYTHON_WORDS = frozenset(_PYTHON.split()) | frozenset(keyword.kwlist)

#: What the generated C calls its arguments, locals and functions, and the words of C99 and its mathematics.
C_WORDS = frozenset(_C.split()) | frozenset(name + suffix for name in FUNCTIONS for suffix in ("", "f"))

_GENERATED = re.compile(r"(const|held)_\d+|_.*|.*__.*")


def apart(system: System, words: Collection[str]) -> System:
    """`system` with those symbols renamed that generated code would confuse with `words` or its own variables.

    A parameter ``k`` becomes ``k_``; symbols without a conflict keep their names, so the code stays readable.
    """
    symbols = [
        *(*system.states, *system.inputs, *system.parameters, *system.measured),
        *(symbol for symbol, _ in system.definitions),
        *([system.table.value] if system.table else []),
    ]
    taken = {str(symbol) for symbol in symbols}
    renamed: dict[Expr, Expr] = {}
    for number, symbol in enumerate(symbols):
        name = re.sub("__+", "_", str(symbol)).lstrip("_") or "a"
        made = _derived if number < len(system.states) else _nothing
        while name in words or _GENERATED.fullmatch(name) or made(name) & taken or name in taken - {str(symbol)}:
            name = _longer(name)
        taken |= {name} | made(name)
        if name != str(symbol):
            renamed[symbol] = sp.Symbol(name, **symbol.assumptions0)
    return _renamed(system, renamed) if renamed else system


def _longer(name: str) -> str:
    """Another name: one underscore at the end, then letters, because two in a row mark derivatives."""
    return name + ("_" if not name.endswith("_") else "a")


def _derived(state: str) -> set[str]:
    """Variables that the generated code makes of a state."""
    return {f"d_{state}", f"new_{state}"}


def _nothing(_: str) -> set[str]:
    return set()


def _renamed(system: System, renamed: dict[Expr, Expr]) -> System:
    def new(value: Expr) -> Expr:
        return sp.sympify(value).xreplace(renamed)

    def each(values: Iterable[Expr]) -> tuple[Expr, ...]:
        return tuple(new(value) for value in values)

    return replace(
        system,
        states=each(system.states),
        inputs=each(system.inputs),
        parameters=each(system.parameters),
        definitions=tuple((new(symbol), new(value)) for symbol, value in system.definitions),
        derivatives=each(system.derivatives),
        table=TabulatedFunction(new(system.table.value), new(system.table.argument)) if system.table else None,
        measured=each(system.measured),
        jumps=tuple(replace(jump, states=each(jump.states)) for jump in system.jumps),
    )

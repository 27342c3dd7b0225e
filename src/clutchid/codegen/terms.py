"""The terms of a system one after the other, as plain Python: to find the one that goes wrong first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import sympy as sp

from clutchid.codegen.language import PYTHON_WORDS, apart
from clutchid.codegen.numba_source import block
from clutchid.codegen.program import lower
from clutchid.codegen.system import Expr, System

#: What this text calls its own.
_WORDS = PYTHON_WORDS | {"terms", "TERMS"}


def terms_source(system: System) -> str:
    """Source of a generator ``terms(x, u, p, table value)`` and of the names of what it yields, ``TERMS``.

    It yields the definitions of `system` in their order, then the derivatives of its states. It is no kernel: a term
    that cannot be computed raises at its turn, as Python's arithmetic does. Each row of ``TERMS`` has the name of a
    term, d_NAME for a derivative, the parameters that stand in it, and the states and terms that do.

    Raises
    ------
    ValueError
        If a piecewise expression does not cover every case.
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    defined = dict(system.definitions)
    others = [*system.states, *_table(system), *defined]
    # a derivative that is a definition itself has what stands in that one
    rows = [(symbol, value) for symbol, value in system.definitions]
    rows += [(rate, defined.get(value, value)) for rate, value in _rates(system)]
    listed = [f'    ("{name}", {_used(value, system.parameters)}, {_used(value, others)}),' for name, value in rows]
    inside = apart(system, _WORDS)
    everything = (*inside.states, *inside.inputs, *inside.parameters, *dict(inside.definitions), *_table(inside))
    taken = {str(symbol) for symbol in everything} | _WORDS
    lines = [*_unpacked(inside.states, "x"), *_unpacked(inside.inputs, "u"), *_unpacked(inside.parameters, "p")]
    for symbol, value in (*inside.definitions, *_rates(inside)):
        lines += [block(lower(symbol, value, taken), "    "), f"    yield {symbol}"]
    head = f"def terms({', '.join(['x', 'u', 'p', *map(str, _table(inside))])}):"
    return "\n".join(["", "", "TERMS = (", *listed, ")", "", "", head, *lines, ""])


def _table(system: System) -> list[Expr]:
    return [system.table.value] if system.table else []


def _rates(system: System) -> list[tuple[Expr, Expr]]:
    rates = zip(system.states, system.derivatives, strict=True)
    return [(sp.Symbol(f"d_{state}", real=True), value) for state, value in rates]


def _used(value: Expr, symbols: Iterable[Expr]) -> tuple[str, ...]:
    """Names of those `symbols` that stand in `value`."""
    used: set[Expr] = getattr(value, "free_symbols", set())
    return tuple(str(symbol) for symbol in symbols if symbol in used)


def _unpacked(symbols: Sequence[Expr], array: str) -> list[str]:
    return [f"    ({', '.join(map(str, symbols))},) = {array}"] if symbols else []

"""Exact derivatives of a program by forward accumulation, branch by branch."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import sympy as sp

from clutchid.codegen.program import Assign, Branch, Lookup, Statement, targets
from clutchid.codegen.system import Expr

Derivatives: TypeAlias = dict[Expr, dict[Expr, Expr]]


def differentiate(statements: Sequence[Statement], seeds: Iterable[Expr]) -> tuple[list[Statement], Derivatives]:
    """The statements with their exact derivatives to `seeds`, by forward accumulation.

    Returns the extended statements and, for each symbol, its non-zero derivatives by seed.
    """
    active: Derivatives = {seed: {seed: sp.Integer(1)} for seed in seeds}
    extended = [new for statement in statements for new in _with_derivatives(statement, active)]
    return extended, active


def _with_derivatives(statement: Statement, active: Derivatives) -> list[Statement]:
    if isinstance(statement, Assign):
        return [statement, *_chain(statement.target, statement.value, active)]
    if isinstance(statement, Lookup):
        own = active.get(statement.value, {})
        out = _chain(statement.value, statement.slope * statement.argument, active, {statement.slope})
        active.setdefault(statement.value, {}).update(own)
        return [statement, *out]
    arms, states = [], []
    for condition, arm in statement.arms:
        inner = dict(active)
        arms.append((condition, [new for part in arm for new in _with_derivatives(part, inner)]))
        states.append(inner)
    for target in targets(statement):
        seeds = dict.fromkeys(seed for state in states for seed in state.get(target, {}))
        active[target] = {}
        for seed in seeds:
            symbol = sp.Symbol(f"{target}__{seed}", real=True)
            active[target][seed] = symbol
            for (_, body), state in zip(arms, states, strict=True):
                value = state.get(target, {}).get(seed, sp.Integer(0))
                if value != symbol:
                    body.append(Assign(symbol, value))
    return [Branch(tuple((condition, tuple(body)) for condition, body in arms))]


def _chain(target: Expr, value: Expr, active: Derivatives, passive: set[Expr] = frozenset()) -> list[Statement]:  # type: ignore[assignment]
    """Derivatives of ``target = value`` by the chain rule, entered into `active`."""
    out: list[Statement] = []
    total: dict[Expr, Expr] = {}
    for argument in sorted(value.free_symbols - passive, key=str):
        inner = active.get(argument)
        if not inner:
            continue
        partial = sp.diff(value, argument)
        if len(inner) > 1 and partial.args:
            symbol = sp.Symbol(f"{target}__by__{argument}", real=True)
            out.append(Assign(symbol, partial))
            partial = symbol
        for seed, factor in inner.items():
            total[seed] = total.get(seed, 0) + partial * factor
    active[target] = {}
    for seed, derivative in total.items():
        if derivative == 0:
            continue
        if derivative.is_Atom:
            active[target][seed] = derivative
            continue
        symbol = sp.Symbol(f"{target}__{seed}", real=True)
        out.append(Assign(symbol, derivative))
        active[target][seed] = symbol
    return out

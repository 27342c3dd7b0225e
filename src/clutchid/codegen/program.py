"""From expressions to a structured program: assignments, table lookups and branches.

A piecewise expression becomes a branch, so an arm that is not taken is never computed: a square root outside its
domain cannot poison value or derivative, and a closed valve costs nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TypeAlias

import sympy as sp

from clutchid.codegen.system import Expr, System, TabulatedFunction


@dataclass(frozen=True, slots=True)
class Assign:
    """``target = value``."""

    target: Expr
    value: Expr


@dataclass(frozen=True, slots=True)
class Lookup:
    """``value, slope = table(argument)``."""

    value: Expr
    slope: Expr
    argument: Expr


@dataclass(frozen=True, slots=True)
class Branch:
    """The first arm whose condition holds; the last condition is always true."""

    arms: tuple[tuple[Expr, tuple[Statement, ...]], ...]


Statement: TypeAlias = Assign | Lookup | Branch


def lower(target: Expr, value: Expr, taken: Collection[str] = ()) -> list[Statement]:
    """Statements that compute `value` into `target`; piecewise parts become branches.

    Auxiliary variables are numbered, target_1 and so on, leaving out the names `taken`.

    Raises
    ------
    ValueError
        If a piecewise expression does not cover every case.
    """
    numbered = (f"{target}_{number}" for number in itertools.count(1))
    names = (sp.Symbol(name, real=True) for name in numbered if name not in taken)
    return _merge_equal_branches(_lower(target, sp.sympify(value), names))


def _lower(target: Expr, value: Expr, names: Iterator[Expr]) -> list[Statement]:
    if isinstance(value, sp.Piecewise):
        before: list[Statement] = []
        arms = []
        for arm, printed in value.args:
            prepared, condition = _extract(printed, names)
            before += prepared
            arms.append((condition, tuple(_merge_equal_branches(_lower(target, arm, names)))))
        if arms[-1][0] is not sp.true:
            raise ValueError(f"{target}: a piecewise expression must end with a branch for every other case.")
        return [*before, Branch(tuple(arms))]
    prepared, value = _extract(value, names)
    return [*prepared, Assign(target, value)]


_BRANCHING = (sp.Piecewise, sp.Abs, sp.Max, sp.Min)


def _extract(value: Expr, names: Iterator[Expr]) -> tuple[list[Statement], Expr]:
    """`value` with its outermost branching parts replaced by symbols that the statements compute."""
    statements: list[Statement] = []
    replaced: dict[Expr, Expr] = {}

    def visit(node: Expr) -> Expr:
        if not node.args or not node.has(*_BRANCHING):
            return node
        if node not in replaced:
            replaced[node] = visit_new(node)
        return replaced[node]

    def visit_new(node: Expr) -> Expr:
        if isinstance(node, sp.Piecewise):
            symbol = next(names)
            statements.extend(_lower(symbol, node, names))
            return symbol
        arguments = [visit(argument) for argument in node.args]
        if isinstance(node, sp.Abs):
            return either(arguments[0] < 0, -arguments[0], arguments[0])
        if isinstance(node, (sp.Max, sp.Min)):
            return reduce(lambda a, b: either(a > b if isinstance(node, sp.Max) else a < b, a, b), arguments)
        return node.func(*arguments)

    def either(condition: Expr, first: Expr, second: Expr) -> Expr:
        if condition in (sp.true, sp.false):
            return first if condition is sp.true else second
        symbol = next(names)
        statements.append(Branch(((condition, (Assign(symbol, first),)), (sp.true, (Assign(symbol, second),)))))
        return symbol

    return statements, visit(value)


def _merge_equal_branches(statements: Sequence[Statement]) -> list[Statement]:
    """Neighbouring branches on the same conditions as one."""
    merged: list[Statement] = []
    for statement in statements:
        last = merged[-1] if merged else None
        if isinstance(statement, Branch) and isinstance(last, Branch):
            conditions = [condition for condition, _ in statement.arms]
            used = {symbol for condition in conditions for symbol in condition.free_symbols}
            if conditions == [condition for condition, _ in last.arms] and not used & set(targets(last)):
                arms = zip(last.arms, statement.arms, strict=True)
                merged[-1] = Branch(tuple((c, tuple(_merge_equal_branches([*a, *b]))) for (c, a), (_, b) in arms))
                continue
        merged.append(statement)
    return merged


def targets(statement: Statement) -> list[Expr]:
    """Symbols that `statement` leaves defined; of a branch, those that every arm sets."""
    if isinstance(statement, Assign):
        return [statement.target]
    if isinstance(statement, Lookup):
        return [statement.value, statement.slope]
    per_arm = [[t for inner in arm for t in targets(inner)] for _, arm in statement.arms]
    return [t for t in dict.fromkeys(per_arm[0]) if all(t in others for others in per_arm[1:])]


def reads(statement: Statement) -> set[Expr]:
    """Symbols that `statement` needs from outside."""
    if isinstance(statement, Assign):
        return set(statement.value.free_symbols)
    if isinstance(statement, Lookup):
        return {statement.argument}
    needed: set[Expr] = set()
    for condition, arm in statement.arms:
        needed |= condition.free_symbols
        assigned: set[Expr] = set()
        for inner in arm:
            needed |= reads(inner) - assigned
            assigned |= set(targets(inner))
    return needed


def live(statements: Sequence[Statement], needed: Iterable[Expr]) -> list[Statement]:
    """The statements that the symbols `needed` depend on."""
    wanted = set(needed)
    results: list[Statement] = []
    for statement in reversed(statements):
        if not wanted & set(targets(statement)):
            continue
        needs = _live_arms(statement, wanted) if isinstance(statement, Branch) else statement
        wanted |= reads(needs)
        results.append(needs)
    return results[::-1]


def _live_arms(branch: Branch, wanted: set[Expr]) -> Branch:
    outputs = wanted & set(targets(branch))
    return Branch(tuple((condition, tuple(live(arm, outputs))) for condition, arm in branch.arms))


def right_hand_side(system: System) -> tuple[list[Statement], tuple[Expr, ...]]:
    """Statements for the definitions and derivatives of `system`, and the symbols of the derivatives.

    Raises
    ------
    ValueError
        If a piecewise expression does not cover every case.
    """
    rates = tuple(sp.Symbol(f"d_{state}", real=True) for state in system.states)
    defined = [symbol for symbol, _ in system.definitions]
    taken = {str(symbol) for symbol in (*system.states, *system.inputs, *system.parameters, *rates, *defined)}
    statements: list[Statement] = []
    pending = system.table
    for symbol, value in system.definitions:
        if pending is not None and pending.value in value.free_symbols:
            statements.append(_lookup(pending))
            pending = None
        statements += lower(symbol, value, taken)
    if pending is not None:
        statements.append(_lookup(pending))
    for rate, value in zip(rates, system.derivatives, strict=True):
        statements += lower(rate, value, taken)
    return _merge_equal_branches(statements), rates


def _lookup(table: TabulatedFunction) -> Lookup:
    return Lookup(table.value, sp.Symbol(f"{table.value}_slope", real=True), table.argument)

"""From expressions to a structured program: assignments and branches, exactly differentiated and staged.

A piecewise expression becomes a branch, so an arm that is not taken is never computed: a square root outside its
domain cannot poison value or derivative, and a closed valve costs nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import sympy as sp

from clutchid.codegen.system import Expr, System, Table


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


# ---------------------------------------------------------------------------------------------------------- lowering


def lower(target: Expr, value: Expr) -> list[Statement]:
    """Statements that compute `value` into `target`; piecewise parts become branches."""
    names = (sp.Symbol(f"{target}_{number}", real=True) for number in range(1, 10**6))
    return _merge_equal_branches(_lower(target, _as_piecewise(sp.sympify(value)), names))


def _lower(target: Expr, value: Expr, names: Iterator[Expr]) -> list[Statement]:
    if isinstance(value, sp.Piecewise):
        before: list[Statement] = []
        arms = []
        for arm, condition in value.args:
            prepared, condition = _extract(condition, names)
            before += prepared
            arms.append((condition, tuple(_merge_equal_branches(_lower(target, arm, names)))))
        if arms[-1][0] is not sp.true:
            raise ValueError(f"{target}: a piecewise expression must end with a branch for every other case.")
        return [*before, Branch(tuple(arms))]
    prepared, value = _extract(value, names)
    return [*prepared, Assign(target, value)]


def _extract(value: Expr, names: Iterator[Expr]) -> tuple[list[Statement], Expr]:
    """`value` with its outermost piecewise parts replaced by symbols that the statements compute."""
    statements: list[Statement] = []
    replaced: dict[Expr, Expr] = {}

    def visit(node: Expr) -> Expr:
        if isinstance(node, sp.Piecewise):
            if node not in replaced:
                replaced[node] = next(names)
                statements.extend(_lower(replaced[node], node, names))
            return replaced[node]
        if not node.args or not node.has(sp.Piecewise):
            return node
        return node.func(*(visit(argument) for argument in node.args))

    return statements, visit(value)


def _as_piecewise(value: Expr) -> Expr:
    value = value.replace(sp.Abs, lambda x: sp.Piecewise((-x, x < 0), (x, True)))
    return value.replace(lambda e: isinstance(e, (sp.Min, sp.Max)), lambda e: e.rewrite(sp.Piecewise))


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
        known: set[Expr] = set()
        for inner in arm:
            needed |= reads(inner) - known
            known |= set(targets(inner))
    return needed


def live(statements: Sequence[Statement], needed: Iterable[Expr]) -> list[Statement]:
    """The statements that the symbols `needed` depend on."""
    wanted = set(needed)
    kept: list[Statement] = []
    for statement in reversed(statements):
        if not wanted & set(targets(statement)):
            continue
        if isinstance(statement, Branch):
            outputs = wanted & set(targets(statement))
            statement = Branch(tuple((c, tuple(live(arm, outputs))) for c, arm in statement.arms))
        wanted |= reads(statement)
        kept.append(statement)
    return kept[::-1]


# --------------------------------------------------------------------------------------------------- differentiation

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


# ----------------------------------------------------------------------------------------------------------- staging


@dataclass(slots=True)
class Staged:
    """A program in three parts: computed once a run, once a sample (inputs are held), and at every stage."""

    constants: list[Statement] = field(default_factory=list)
    held: list[Statement] = field(default_factory=list)
    stage: list[Statement] = field(default_factory=list)


def staged(statements: Sequence[Statement], parameters: Iterable[Expr], inputs: Iterable[Expr]) -> Staged:
    """Split by how often a statement's result can change, subexpressions too."""
    level: dict[Expr, int] = dict.fromkeys(parameters, 0) | dict.fromkeys(inputs, 1)
    out = Staged()
    lists = (out.constants, out.held)
    cache: tuple[dict[Expr, Expr], dict[Expr, Expr]] = ({}, {})
    assigned = Counter(_assigned(statements))

    def level_of(symbols: Iterable[Expr]) -> int:
        return max((level.get(symbol, 2) for symbol in symbols), default=0)

    def lift(value: Expr, current: int) -> Expr:
        """`value` with its parts that change less often than `current` replaced by symbols computed there."""
        if not value.args or isinstance(value, sp.logic.boolalg.BooleanAtom):
            return value
        own = level_of(value.free_symbols)
        if own < current and not (value.is_number or isinstance(value, sp.logic.boolalg.Boolean)):
            return store(value, own) if _costs(value) else value
        if isinstance(value, (sp.Mul, sp.Add)):
            slow = [a for a in value.args if level_of(a.free_symbols) < current and not a.is_number]
            if len(slow) > 1 or (slow and _costs(slow[0])):
                fast = [a for a in value.args if a not in slow]
                return value.func(lift(value.func(*slow), current), *(lift(a, current) for a in fast))
        return value.func(*(lift(a, current) for a in value.args))

    def store(value: Expr, own: int) -> Expr:
        if value not in cache[own]:
            inner = lift(value, own)
            symbol = sp.Symbol(f"{('const', 'held')[own]}_{len(cache[own])}", real=True)
            lists[own].append(Assign(symbol, inner))
            level[symbol] = own
            cache[own][value] = symbol
        return cache[own][value]

    def place(statement: Statement, movable: bool) -> list[Statement]:
        own = max(level_of(reads(statement)), 2 if isinstance(statement, Lookup) else 0)
        if own < 2 and movable and all(assigned[t] == count for t, count in Counter(_assigned([statement])).items()):
            lists[own].append(_rewritten(statement, lambda value: lift(value, own)))
            level.update(dict.fromkeys(targets(statement), own))
            return []
        if isinstance(statement, Assign):
            return [Assign(statement.target, lift(statement.value, 2))]
        if isinstance(statement, Lookup):
            return [statement]
        outputs = set(targets(statement))
        arms = []
        for condition, arm in statement.arms:
            body = [new for part in arm for new in place(part, not outputs & set(targets(part)))]
            arms.append((lift(condition, 2), tuple(body)))
        return [Branch(tuple(arms))]

    for statement in statements:
        out.stage += place(statement, True)
    return out


def _assigned(statements: Iterable[Statement]) -> Iterator[Expr]:
    """Targets of all statements, those inside branches too."""
    for statement in statements:
        if isinstance(statement, Branch):
            for _, arm in statement.arms:
                yield from _assigned(arm)
        else:
            yield from targets(statement)


def _costs(value: Expr) -> bool:
    """Whether computing `value` once and keeping it is worth a variable."""
    return bool(value.args) and not (isinstance(value, sp.Mul) and len(value.args) == 2 and value.args[0] == -1)


def _rewritten(statement: Statement, change: Callable[[Expr], Expr]) -> Statement:
    if isinstance(statement, Assign):
        return Assign(statement.target, change(statement.value))
    if isinstance(statement, Branch):
        return Branch(tuple((c, tuple(_rewritten(inner, change) for inner in arm)) for c, arm in statement.arms))
    return statement


# ---------------------------------------------------------------------------------------------------------- assembly


def right_hand_side(system: System) -> tuple[list[Statement], tuple[Expr, ...]]:
    """Statements for the definitions and derivatives of `system`, and the symbols of the derivatives."""
    statements: list[Statement] = []
    pending = system.table
    for symbol, value in system.definitions:
        if pending is not None and pending.value in value.free_symbols:
            statements.append(_lookup(pending))
            pending = None
        statements += lower(symbol, value)
    if pending is not None:
        statements.append(_lookup(pending))
    rates = tuple(sp.Symbol(f"d_{state}", real=True) for state in system.states)
    for rate, value in zip(rates, system.derivatives, strict=True):
        statements += lower(rate, value)
    return _merge_equal_branches(statements), rates


def _lookup(table: Table) -> Lookup:
    return Lookup(table.value, sp.Symbol(f"{table.value}_slope", real=True), table.argument)

"""A program split by how often its results change: once a run, once a sample, at every stage of a step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import sympy as sp

from clutchid.codegen.program import Assign, Branch, Lookup, Statement, live, reads, targets
from clutchid.codegen.system import Expr, System


@dataclass(slots=True)
class Staged:
    """A program in three parts: computed once a run, once a sample (inputs are held), and at every stage."""

    constants: list[Statement] = field(default_factory=list)
    held: list[Statement] = field(default_factory=list)
    stage: list[Statement] = field(default_factory=list)


def staged(statements: Sequence[Statement], parameters: Iterable[Expr], inputs: Iterable[Expr]) -> Staged:
    """Split by how often a statement's result can change, subexpressions too."""
    level = dict.fromkeys(parameters, 0) | dict.fromkeys(inputs, 1)
    stager = _Stager(level, Counter(_assigned(statements)))
    for statement in statements:
        stager.out.stage += stager.place(statement, True)
    return stager.out


@dataclass(slots=True)
class _Stager:
    """State while statements are placed: how often each symbol changes (0, 1, 2), and stored variables."""

    level: dict[Expr, int]
    assigned: Counter[Expr]
    out: Staged = field(default_factory=Staged)
    stored: tuple[dict[Expr, Expr], dict[Expr, Expr]] = field(default_factory=lambda: ({}, {}))

    def level_of(self, symbols: Iterable[Expr]) -> int:
        return max((self.level.get(symbol, 2) for symbol in symbols), default=0)

    def lift(self, value: Expr, current: int) -> Expr:
        """`value` with its parts that change less often than `current` replaced by symbols computed there."""
        if not value.args or isinstance(value, sp.logic.boolalg.BooleanAtom):
            return value
        own = self.level_of(value.free_symbols)
        if own < current and not (value.is_number or isinstance(value, sp.logic.boolalg.Boolean)):
            return self.store(value, own) if _costs(value) else value
        if isinstance(value, (sp.Mul, sp.Add)):
            slow = [a for a in value.args if self.level_of(a.free_symbols) < current and not a.is_number]
            if len(slow) > 1 or (slow and _costs(slow[0])):
                fast = [a for a in value.args if a not in slow]
                return value.func(self.lift(value.func(*slow), current), *(self.lift(a, current) for a in fast))
        return value.func(*(self.lift(a, current) for a in value.args))

    def store(self, value: Expr, own: int) -> Expr:
        """The symbol that holds `value`, computed once a run (`own` 0) or once a sample (1)."""
        if value not in self.stored[own]:
            inner = self.lift(value, own)
            symbol = sp.Symbol(f"{('const', 'held')[own]}_{len(self.stored[own])}", real=True)
            self._part(own).append(Assign(symbol, inner))
            self.level[symbol] = own
            self.stored[own][value] = symbol
        return self.stored[own][value]

    def place(self, statement: Statement, movable: bool) -> list[Statement]:
        """Rest of `statement` at every stage; the other part is put where it is computed less often."""
        own = max(self.level_of(reads(statement)), 2 if isinstance(statement, Lookup) else 0)
        here = Counter(_assigned([statement]))
        if own < 2 and movable and all(self.assigned[target] == count for target, count in here.items()):
            self._part(own).append(_rewritten(statement, lambda value: self.lift(value, own)))
            self.level.update(dict.fromkeys(targets(statement), own))
            return []
        if isinstance(statement, Assign):
            return [Assign(statement.target, self.lift(statement.value, 2))]
        if isinstance(statement, Lookup):
            return [statement]
        outputs = set(targets(statement))
        arms = []
        for condition, arm in statement.arms:
            body = [new for part in arm for new in self.place(part, not outputs & set(targets(part)))]
            arms.append((self.lift(condition, 2), tuple(body)))
        return [Branch(tuple(arms))]

    def _part(self, own: int) -> list[Statement]:
        return self.out.constants if own == 0 else self.out.held


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


@dataclass(frozen=True, slots=True)
class ProgramParts:
    """The statements that some results need, and the symbols that go from one part to the next.

    `constants` and `held` are computed once a run and once a sample and read later; `inputs` are those inputs that
    every stage reads as they are.
    """

    program: Staged
    constants: tuple[Expr, ...]
    held: tuple[Expr, ...]
    inputs: tuple[Expr, ...]
    in_stage: frozenset[Expr]

    @classmethod
    def of(cls, system: System, program: Staged, results: Iterable[Expr]) -> ProgramParts:
        """Part of `program` that the stage's `results` need, without statements that lifting has made superfluous."""
        wanted = {symbol for value in results for symbol in sp.sympify(value).free_symbols}
        stage = live(program.stage, wanted)
        in_stage = read(stage) | wanted
        held = live(program.held, in_stage)
        later = read(held) | in_stage
        constants = live(program.constants, later)
        return cls(
            program=Staged(constants, held, stage),
            constants=tuple(t for t in assigned(constants) if t in later),
            held=tuple(t for t in assigned(held) if t in in_stage),
            inputs=tuple(symbol for symbol in system.inputs if symbol in in_stage),
            in_stage=frozenset(in_stage),
        )


def read(statements: Sequence[Statement]) -> set[Expr]:
    """Symbols that `statements` need, their own results too."""
    return {symbol for statement in statements for symbol in reads(statement)}


def assigned(statements: Sequence[Statement]) -> list[Expr]:
    """Symbols that `statements` leave defined, in their order."""
    return [target for statement in statements for target in targets(statement)]


def positions(symbols: Sequence[Expr], needed: Collection[Expr]) -> list[tuple[int, Expr]]:
    """Those `symbols` that are `needed`, with their positions."""
    return [(position, symbol) for position, symbol in enumerate(symbols) if symbol in needed]

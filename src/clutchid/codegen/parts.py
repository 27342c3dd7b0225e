"""A staged program as three functions: which results each hands to the next."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import sympy as sp

from clutchid.codegen.program import Statement, live, reads, targets
from clutchid.codegen.staging import Staged
from clutchid.codegen.system import Expr, System


@dataclass(frozen=True, slots=True)
class Parts:
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
    def of(cls, system: System, program: Staged, results: Iterable[Expr]) -> Parts:
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

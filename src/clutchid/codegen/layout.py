"""Input of every printer: the program of a `System`, differentiated and staged, and its non-zero derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import sympy as sp

from clutchid.codegen.differentiation import Derivatives, differentiate
from clutchid.codegen.program import Assign, Branch, Statement, live, lower, right_hand_side
from clutchid.codegen.staging import Staged, staged
from clutchid.codegen.system import Expr, System


@dataclass(frozen=True, slots=True)
class Entry:
    """One structurally non-zero derivative: of row `row` to column `column`, computed as `value`."""

    row: int
    column: int
    value: Expr


#: The number of a jump, in the program of all jumps; 0 changes nothing.
JUMP = sp.Dummy("jump", real=True)


@dataclass(frozen=True, slots=True)
class JumpProgram:
    """All jumps of a system, of which `JUMP` is taken: new states, their derivatives to states and parameter slots."""

    statements: tuple[Statement, ...]
    states: tuple[Expr, ...]
    jacobian: tuple[Entry, ...]
    slots: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class DifferentiatedProgram:
    """The differentiated program of a system; `slots` are the non-zero (state, parameter) pairs of all derivatives."""

    system: System
    plain: Staged
    with_jacobian: Staged
    with_parameters: Staged
    rates: tuple[Expr, ...]
    jacobian: tuple[Entry, ...]
    table_entries: tuple[Entry, ...]
    slots: tuple[tuple[int, int], ...]
    slot_values: tuple[Expr, ...]
    jump: JumpProgram


def layout(system: System) -> DifferentiatedProgram:
    """Differentiate and stage `system` once, for all printers.

    Raises
    ------
    ValueError
        If a piecewise expression does not cover every case.
    """
    statements, rates = right_hand_side(system)
    seeds = [*system.states, *system.parameters, *([system.table.value] if system.table else [])]
    extended, by = differentiate(statements, seeds)
    jacobian = _entries(by, rates, system.states)
    table_entries = _entries(by, rates, [system.table.value]) if system.table else ()
    jumped, outputs, jump_by = _jumps(system)
    slots = {(e.row, e.column) for e in _entries(by, rates, system.parameters)}
    slots |= {(e.row, e.column) for e in _entries(jump_by, outputs, system.parameters)}
    ordered = tuple(sorted(slots))
    slot_values = _slot_values(system, by, rates, ordered)

    def stage(needed: Iterable[Expr]) -> Staged:
        symbols = [symbol for value in needed for symbol in sp.sympify(value).free_symbols]
        return staged(live(extended, symbols), system.parameters, system.inputs)

    state_values = [*rates, *(e.value for e in jacobian), *(e.value for e in table_entries)]
    return DifferentiatedProgram(
        system=system,
        plain=stage(rates),
        with_jacobian=stage(state_values),
        with_parameters=stage([*state_values, *slot_values]),
        rates=rates,
        jacobian=jacobian,
        table_entries=table_entries,
        slots=ordered,
        slot_values=slot_values,
        jump=JumpProgram(
            tuple(jumped),
            outputs,
            _entries(jump_by, outputs, system.states),
            _slot_values(system, jump_by, outputs, ordered),
        ),
    )


def _entries(by: Derivatives, rows: Sequence[Expr], columns: Sequence[Expr]) -> tuple[Entry, ...]:
    return tuple(
        Entry(i, j, by[row][column])
        for i, row in enumerate(rows)
        for j, column in enumerate(columns)
        if column in by.get(row, {})
    )


def _slot_values(
    system: System, by: Derivatives, rows: Sequence[Expr], slots: Iterable[tuple[int, int]]
) -> tuple[Expr, ...]:
    return tuple(by.get(rows[i], {}).get(system.parameters[j], sp.Integer(0)) for i, j in slots)


def _jumps(system: System) -> tuple[list[Statement], tuple[Expr, ...], Derivatives]:
    """The program of all jumps, the symbols of the new states, and their derivatives."""
    outputs = tuple(sp.Symbol(f"new_{state}", real=True) for state in system.states)
    taken = {str(symbol) for symbol in (*system.states, *system.parameters, *system.measured, *outputs)}
    arms: list[tuple[Expr, tuple[Statement, ...]]] = []
    for number, jump in enumerate(system.jumps, start=1):
        pairs = zip(outputs, jump.states, strict=True)
        arms.append((sp.Eq(JUMP, number), tuple(new for pair in pairs for new in lower(*pair, taken))))
    arms.append((sp.true, tuple(Assign(*pair) for pair in zip(outputs, system.states, strict=True))))
    extended, by = differentiate([Branch(tuple(arms))], [*system.states, *system.parameters])
    return extended, outputs, by

"""Columns of sensitivities through a Runge-Kutta step, `WIDTH` at once, as LLVM's text, and the work array.

A block of columns lies in one array: groups of rows, one a state, of `WIDTH` numbers each. They are the sensitivities
S and, for each of the four stages, the derivatives of the rates to the column's own parameter: the sources.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

import sympy as sp

from clutchid.codegen.kernels import FAST
from clutchid.codegen.layout import DifferentiatedProgram, Entry
from clutchid.codegen.llvm import Function, Interface, constant, finished
from clutchid.codegen.staging import Parts

#: Columns that are computed at once.
WIDTH = 4

_VECTOR = f"<{WIDTH} x double>"


def block_size(states: int) -> int:
    """Numbers of a block of columns."""
    return 5 * states * WIDTH


@dataclass(frozen=True, slots=True)
class Rows:
    """The rate of a column, row by row: k = J s + source.

    `entries` are the non-zero ones of the Jacobian J; those that are no numbers are read at work[jacobian + position],
    and `stride` numbers further on for every stage. The rows `sourced` have a source.
    """

    states: int
    entries: Sequence[Entry]
    sourced: Collection[int]
    jacobian: int
    stride: int


def move_columns(rows: Rows) -> Function:
    """The function ``columns_step(work, work_at, h)``: a step of h seconds for the block at work[work_at]."""
    writer = _Writer(rows)
    half, whole = writer.spread(writer.scaled("%h", 0.5)), writer.spread("%h")
    S = [writer.row(0, i) for i in range(rows.states)]
    z, rates = S, []
    for stage, reach in enumerate((half, half, whole, whole)):
        rates.append([writer.rate(stage, i, z) for i in range(rows.states)])
        z = [writer.add(s, writer.times(reach, k)) for s, k in zip(S, rates[stage], strict=True)]
    sixth = writer.spread(writer.scaled("%h", 1.0 / 6.0))
    for i, (s, *k) in enumerate(zip(S, *rates, strict=True)):
        total = writer.add(writer.add(k[0], writer.times(_number(2.0), writer.add(k[1], k[2]))), k[3])
        writer.keep(i, writer.add(s, writer.times(sixth, total)))
    interface = Interface(("work",), moving=("work",), numbers=(("h", sp.Dummy()),))
    return finished("columns_step", interface, writer.lines)


def map_columns(rows: Rows) -> Function:
    """The function ``columns_jump(work, work_at)``: J S + source, with the first stage's, in place of S."""
    writer = _Writer(rows)
    S = [writer.row(0, i) for i in range(rows.states)]
    for i in range(rows.states):
        writer.keep(i, writer.rate(0, i, S))
    return finished("columns_jump", Interface(("work",), moving=("work",)), writer.lines)


@dataclass(slots=True)
class _Writer:
    """Instructions on vectors of `WIDTH` numbers."""

    rows: Rows
    lines: list[str] = field(default_factory=lambda: ["  %block = getelementptr double, ptr %work, i64 %work_at"])
    numbers: count[int] = field(default_factory=count)

    def rate(self, stage: int, row: int, z: Sequence[str]) -> str:
        """One row of J z + source."""
        terms = []
        for position, entry in enumerate(self.rows.entries):
            if entry.row == row:
                factor = _number(entry.value) if entry.value.is_number else self.entry(stage, position)
                terms.append(z[entry.column] if entry.value == 1 else self.times(factor, z[entry.column]))
        if row in self.rows.sourced:
            terms.append(self.row(stage + 1, row))
        total, *others = terms or [_number(0.0)]
        for other in others:
            total = self.add(total, other)
        return total

    def new(self, instruction: str) -> str:
        name = f"%.{next(self.numbers)}"
        self.lines.append(f"  {name} = {instruction}")
        return name

    def times(self, a: str, b: str) -> str:
        return self.new(f"fmul {FAST} {_VECTOR} {a}, {b}")

    def add(self, a: str, b: str) -> str:
        return self.new(f"fadd {FAST} {_VECTOR} {a}, {b}")

    def scaled(self, number: str, factor: float) -> str:
        return self.new(f"fmul {FAST} double {number}, {constant(factor)}")

    def entry(self, stage: int, position: int) -> str:
        """An entry of the Jacobian in all lanes."""
        index = self.rows.jacobian + stage * self.rows.stride + position
        at = self.new(f"getelementptr double, ptr %work, i64 {index}")
        return self.spread(self.new(f"load double, ptr {at}"))

    def spread(self, number: str) -> str:
        """A number in all lanes."""
        one = self.new(f"insertelement {_VECTOR} poison, double {number}, i64 0")
        return self.new(f"shufflevector {_VECTOR} {one}, {_VECTOR} poison, <{WIDTH} x i32> zeroinitializer")

    def row(self, group: int, row: int) -> str:
        return self.new(f"load {_VECTOR}, ptr {self.address(group, row)}, align 8")

    def keep(self, row: int, value: str) -> None:
        self.lines.append(f"  store {_VECTOR} {value}, ptr {self.address(0, row)}, align 8")

    def address(self, group: int, row: int) -> str:
        return self.new(f"getelementptr double, ptr %block, i64 {(group * self.rows.states + row) * WIDTH}")


def _number(value: object) -> str:
    return f"<{', '.join([f'double {constant(value)}'] * WIDTH)}>"


@dataclass(frozen=True, slots=True)
class Work:
    """Places in the work array.

    First the segment in which the table was read last, then `constants` and `held`; then four `stages` of `stride`
    numbers, in each of which lie the rates (or new states after a jump), segment and offset of the table, Jacobian,
    derivatives to the table's value, and parameter slots. After the `head` of all these come the blocks of columns,
    each of `block` numbers, see `lanes`; the first source of a block begins at its number `source`.
    """

    constants: int
    held: int
    stages: int
    stride: int
    rates: int
    segment: int
    offset: int
    jacobian: int
    table: int
    slots: int
    head: int
    block: int
    source: int

    @classmethod
    def of(cls, plan: DifferentiatedProgram, programs: Sequence[Parts]) -> Work:
        """Room for the results of all `programs`, which use the array in turn."""
        n = len(plan.system.states)
        before, stages = _placed(
            {
                "segment": 1,
                "constants": max(len(program.constants) for program in programs),
                "held": max(len(program.inputs) + len(program.held) for program in programs),
            }
        )
        inside, stride = _placed(
            {
                "rates": n,
                "segment": 1,
                "offset": 1,
                "jacobian": max(len(plan.jacobian), len(plan.jump.jacobian)),
                "table": len(plan.table_entries),
                "slots": len(plan.slots),
            }
        )
        return cls(
            constants=before["constants"],
            held=before["held"],
            stages=stages,
            stride=stride,
            **inside,
            head=stages + 4 * stride,
            block=block_size(n),
            source=n * WIDTH,
        )


def _placed(sizes: Mapping[str, int]) -> tuple[dict[str, int], int]:
    """One after the other, and the end."""
    places, end = {}, 0
    for name, size in sizes.items():
        places[name] = end
        end += size
    return places, end

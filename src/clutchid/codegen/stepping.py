"""One step of the classical Runge-Kutta scheme as LLVM's text: of the states, and of the columns of sensitivities.

Columns are moved `WIDTH` at once. A block of them lies in one array: groups of rows, one a state, of `WIDTH` numbers
each. They are the sensitivities S and, for each of the four stages, the derivatives of the rates to the column's own
parameter: the sources.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

import sympy as sp

from clutchid.codegen.differentiation import Entry
from clutchid.codegen.kernels import FAST
from clutchid.codegen.llvm import ArrayElement, Function, Interface, Writer, constant, finished, real
from clutchid.codegen.program import Lookup, Statement
from clutchid.codegen.staging import ProgramParts
from clutchid.codegen.system import Expr, System

#: Columns that are computed at once.
WIDTH = 4

_VECTOR = real(WIDTH)

#: Numbers a lane of a piece of the table.
TABLE_PIECE = 7


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
        first = self.new(f"insertelement {_VECTOR} poison, double {number}, i64 0")
        return self.new(f"shufflevector {_VECTOR} {first}, {_VECTOR} poison, <{WIDTH} x i32> zeroinitializer")

    def row(self, group: int, row: int) -> str:
        return self.new(f"load {_VECTOR}, ptr {self.address(group, row)}, align 8")

    def keep(self, row: int, value: str) -> None:
        self.lines.append(f"  store {_VECTOR} {value}, ptr {self.address(0, row)}, align 8")

    def address(self, group: int, row: int) -> str:
        return self.new(f"getelementptr double, ptr %block, i64 {(group * self.rows.states + row) * WIDTH}")


def _number(value: object) -> str:
    return constant(value, WIDTH)


@dataclass(frozen=True, slots=True)
class Work:
    """Places in the work array.

    First the segment in which the table was read last, then `constants` and `held`; then four `stages` of `stride`
    numbers, in each of which lie the rates (or new states after a jump), segment and offset of the table, Jacobian,
    derivatives to the table's value, and parameter slots. After the `head` of all these come the blocks of columns,
    each of `block` numbers; the first source of a block begins at its number `source`.
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
    def of(
        cls, n: int, programs: Sequence[ProgramParts], *, jacobian: int = 0, table: int = 0, slots: int = 0
    ) -> Work:  # fmt: skip
        """Room for the results of all `programs` of n states, which use the array in turn.

        So many entries of the Jacobian, derivatives to the table's value, and parameter slots have places.
        """
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
                "jacobian": jacobian,
                "table": table,
                "slots": slots,
            }
        )
        return cls(
            constants=before["constants"],
            held=before["held"],
            stages=stages,
            stride=stride,
            **inside,
            head=stages + 4 * stride,
            block=5 * n * WIDTH,
            source=n * WIDTH,
        )


def _placed(sizes: Mapping[str, int]) -> tuple[dict[str, int], int]:
    """Places of consecutive ranges, and the end of the last."""
    places, end = {}, 0
    for name, size in sizes.items():
        places[name] = end
        end += size
    return places, end


#: Type of a look-up's result: value and slope, segment, and the distance from its left breakpoint.
_FOUND = "{double, double, i64, double}"

#: The table's function at an argument; the search starts in segment `last`.
_LOOK_UP = f"""
define linkonce_odr {_FOUND} @clutchid_look_up(double %argument, i64 %last, ptr %breakpoints, i64 %count, ptr %load)
    alwaysinline nounwind {{
entry:
  br label %down
down:
  %high = phi i64 [ %last, %entry ], [ %lower, %under ]
  %some = icmp sgt i64 %high, 0
  br i1 %some, label %test, label %up
test:
  %lower = sub i64 %high, 1
  %0 = getelementptr double, ptr %breakpoints, i64 %lower
  %1 = load double, ptr %0
  %2 = fcmp olt double %argument, %1
  br i1 %2, label %under, label %up
under:
  br label %down
up:
  %low = phi i64 [ %high, %down ], [ %high, %test ], [ %higher, %over ]
  %more = icmp slt i64 %low, %count
  br i1 %more, label %next, label %found
next:
  %3 = getelementptr double, ptr %breakpoints, i64 %low
  %4 = load double, ptr %3
  %5 = fcmp oge double %argument, %4
  br i1 %5, label %over, label %found
over:
  %higher = add i64 %low, 1
  br label %up
found:
  %left = sub i64 %low, 1
  %6 = icmp sgt i64 %left, 0
  %7 = select i1 %6, i64 %left, i64 0
  %8 = getelementptr double, ptr %breakpoints, i64 %7
  %9 = load double, ptr %8
  %offset = fsub {FAST} double %argument, %9
  %row = getelementptr [4 x double], ptr %load, i64 %low
  %10 = load double, ptr %row
  %11 = getelementptr double, ptr %row, i64 1
  %12 = load double, ptr %11
  %13 = getelementptr double, ptr %row, i64 2
  %14 = load double, ptr %13
  %15 = getelementptr double, ptr %row, i64 3
  %16 = load double, ptr %15
  %17 = fmul {FAST} double %offset, %16
  %18 = fadd {FAST} double %14, %17
  %19 = fmul {FAST} double %offset, %18
  %20 = fadd {FAST} double %12, %19
  %21 = fmul {FAST} double %offset, %20
  %value = fadd {FAST} double %10, %21
  %22 = fmul {FAST} double %17, {constant(3.0)}
  %23 = fmul {FAST} double %14, {constant(2.0)}
  %24 = fadd {FAST} double %22, %23
  %25 = fmul {FAST} double %24, %offset
  %slope = fadd {FAST} double %12, %25
  %26 = insertvalue {_FOUND} poison, double %value, 0
  %27 = insertvalue {_FOUND} %26, double %slope, 1
  %28 = insertvalue {_FOUND} %27, i64 %low, 2
  %29 = insertvalue {_FOUND} %28, double %offset, 3
  ret {_FOUND} %29
}}
"""


def step_function(
    name: str,
    system: System,
    rates: Sequence[Expr],
    work: Work,
    statements: Sequence[Statement],
    places: tuple[Mapping[Expr, ArrayElement], Sequence[tuple[ArrayElement, Expr]]],
    inline: bool,
    early: bool = False,
    lanes: int = 1,
) -> Function:
    """The function ``NAME(x, x_at, p, work, h)`` that moves the states x by h seconds.

    A system with a table has three arguments more: ``breakpoints, count, load``. With `early` there is a last one, the
    number of stages: 4 of a step. With several lanes h is an array, and the breakpoints end with infinity. `rates` are
    the symbols of its derivatives. `places` are where the symbols of `statements` are read, and what each stage writes
    to its part ``stage`` of the work array.

    Raises
    ------
    NotImplementedError
        If an expression uses a function or a relation that is not printed.
    """
    loads, stores = places
    writer = Writer(places=dict(loads), lanes=lanes)
    step = _Step(writer, system.states, rates, work, keep=bool(stores), early=early)
    step.begin()
    step.writer.run(statements)
    for place, value in stores:
        step.writer.store(place, step.writer.number(sp.sympify(value)))
    step.end()
    table = (("breakpoints", "ptr noalias"), ("count", "i64"), ("load", "ptr noalias")) if system.table else ()
    others = (*table, *([("evaluations", "i64")] if early else []))
    if lanes == 1:
        interface = Interface(("x", "p", "work"), ("x",), (("h", sp.Dummy()),), others, inline)
    else:
        interface = Interface(("x", "p", "work", "h"), ("x",), (), others, inline)
    return finished(name, interface, step.writer.lines, _LOOK_UP if system.table and lanes == 1 else "")


@dataclass(slots=True)
class _Step:
    """The loop over the stages; with `keep` each leaves where it read the table."""

    writer: Writer
    states: Sequence[Expr]
    rates: Sequence[Expr]
    work: Work
    keep: bool
    early: bool
    start: list[str] = field(default_factory=list)
    opened: int = 0
    looked_up: bool = False
    h: str = "%h"

    def begin(self) -> None:
        """Read the states, and enter the loop."""
        writer, states = self.writer, self.states
        writer.bases |= {"p": "%p", "work": "%work", "stage": "%stage", "h": "%h"}
        writer.bases["x"] = writer.new("getelementptr double, ptr %x, i64 %x_at")
        self.start = [writer.load(ArrayElement("x", i)) for i, _ in enumerate(states)]
        if writer.lanes == 1:
            writer.lines.append("  %last = load double, ptr %work")
            writer.lines.append("  %segment = fptosi double %last to i64")
        else:
            self.h = writer.load(ArrayElement("h", 0))
        writer.lines += ["  br label %stages", "stages:"]
        self.opened, writer.block = len(writer.lines), "stages"
        writer.values |= {state: f"%at.{i}" for i, state in enumerate(states)}
        writer.lookup = self.look_up if writer.lanes == 1 else self.look_up_by_lane

    def look_up(self, lookup: Lookup) -> None:
        """The table at an argument."""
        writer, self.looked_up = self.writer, True
        passed = f"double {writer.number(lookup.argument)}, i64 %seg, ptr %breakpoints, i64 %count, ptr %load"
        writer.lines.append(f"  %found = call {_FOUND} @clutchid_look_up({passed})")
        writer.values[lookup.value] = writer.new(f"extractvalue {_FOUND} %found, 0")
        writer.values[lookup.slope] = writer.new(f"extractvalue {_FOUND} %found, 1")
        writer.lines.append(f"  %reached = extractvalue {_FOUND} %found, 2")
        if self.keep:
            writer.store(ArrayElement("stage", self.work.segment), writer.new("sitofp i64 %reached to double"))
            writer.store(ArrayElement("stage", self.work.offset), writer.new(f"extractvalue {_FOUND} %found, 3"))

    def look_up_by_lane(self, lookup: Lookup) -> None:
        """The table at an argument in each lane, whose piece stays in the work array until a lane leaves its own.

        A piece: its left and right end, the breakpoint that its polynomial is about, and four coefficients.
        """
        writer, lanes, real = self.writer, self.writer.lanes, self.writer.real
        places = [ArrayElement("work", self.work.head + i) for i in range(TABLE_PIECE)]
        last, argument = [writer.load(place) for place in places], writer.number(lookup.argument)
        below, above = (writer.compared(way, argument, end) for way, end in zip(("olt", "oge"), last, strict=False))

        def search() -> list[str]:
            def row(array: str, columns: int, at: str) -> list[str]:
                address = f"getelementptr [{columns * lanes} x double], ptr %{array}, i64 {at}"
                first = writer.new(address)
                places = (writer.new(f"getelementptr {real}, ptr {first}, i64 {c}") for c in range(columns))
                return [writer.new(f"load {real}, ptr {place}, align 8") for place in places]

            start, (end,) = writer.constant(-sys.float_info.max), row("breakpoints", 1, "0")
            before, piece = writer.block, [start, end, end, *row("load", 4, "0")]
            writer.lines += ["  br label %pieces", "pieces:"]
            opened, writer.block = len(writer.lines), "pieces"
            (left,), (right,) = row("breakpoints", 1, "%piece"), row("breakpoints", 1, "%piece.next")
            inside = writer.compared("oge", argument, left)
            now = [left, right, left, *row("load", 4, "%piece.next")]
            pieces = [
                writer.new(f"select {writer.truth} {inside}, {real} {new}, {real} %was.{i}")
                for i, new in enumerate(now)
            ]
            writer.lines[opened:opened] = [
                f"  %piece = phi i64 [ 0, %{before} ], [ %piece.next, %pieces ]",
                *(
                    f"  %was.{i} = phi {real} [ {first}, %{before} ], [ {new}, %pieces ]"
                    for i, (first, new) in enumerate(zip(piece, pieces, strict=True))
                ),
                "  %piece.next = add i64 %piece, 1",
            ]
            writer.lines += [
                "  %piece.more = icmp slt i64 %piece.next, %count",
                "  br i1 %piece.more, label %pieces, label %found",
                "found:",
            ]
            writer.block = "found"
            for place, value in zip(places, pieces, strict=True):
                writer.store(place, value)
            return pieces

        left = writer.new(f"or {writer.truth} {below}, {above}")
        _, _, start, *c = writer.where(writer.any(left), last, search)
        offset, zero = writer.chain("fsub", [argument, start]), writer.constant(0.0)
        value, slope = c[3], zero
        for coefficient in c[2::-1]:
            slope = writer.chain("fadd", [value, writer.chain("fmul", [offset, slope])])
            value = writer.chain("fadd", [coefficient, writer.chain("fmul", [offset, value])])
        writer.values |= {lookup.value: value, lookup.slope: slope}

    def end(self) -> None:
        """Close the loop, and write the states."""
        writer, real = self.writer, self.writer.real
        writer.lines[self.opened : self.opened] = self._entered(writer.block)
        rates = [writer.number(rate) for rate in self.rates]
        writer.lines += [
            f"  %half = fmul {FAST} {real} {self.h}, {writer.constant(0.5)}",
            "  %early = icmp slt i64 %number, 2",
            f"  %reach = select i1 %early, {real} %half, {real} {self.h}",
            "  %next = add i64 %number, 1",
            "  %inner = and i64 %next, 2",
            "  %twice = icmp ne i64 %inner, 0",
            f"  %weight = select i1 %twice, {real} {writer.constant(2.0)}, {real} {writer.constant(1.0)}",
        ]
        for i, (x, rate) in enumerate(zip(self.start, rates, strict=True)):
            writer.lines += [
                f"  %part.{i} = fmul {FAST} {real} %weight, {rate}",
                f"  %total.{i} = fadd {FAST} {real} %sum.{i}, %part.{i}",
                f"  %way.{i} = fmul {FAST} {real} %reach, {rate}",
                f"  %moved.{i} = fadd {FAST} {real} {x}, %way.{i}",
            ]
        last = "%evaluations" if self.early else "4"
        writer.lines += [
            f"  %again = icmp slt i64 %next, {last}",
            "  br i1 %again, label %stages, label %done",
            "done:",
        ]
        writer.lines.append(f"  %sixth = fmul {FAST} {real} {self.h}, {writer.constant(1.0 / 6.0)}")
        if self.looked_up:
            writer.lines += ["  %left = sitofp i64 %reached to double", "  store double %left, ptr %work"]
        for i, x in enumerate(self.start):
            writer.lines.append(f"  %all.{i} = fmul {FAST} {real} %sixth, %total.{i}")
            writer.lines.append(f"  %end.{i} = fadd {FAST} {real} {x}, %all.{i}")
            writer.store(ArrayElement("x", i), f"%end.{i}")

    def _entered(self, last: str) -> list[str]:
        """Head of every stage: its number, the states there, the sum of the rates so far, the segment."""
        lines = [f"  %number = phi i64 [ 0, %entry ], [ %next, %{last} ]"]
        if self.looked_up:
            lines.append(f"  %seg = phi i64 [ %segment, %entry ], [ %reached, %{last} ]")
        for i, x in enumerate(self.start):
            zero = self.writer.constant(0.0)
            lines.append(f"  %at.{i} = phi {self.writer.real} [ {x}, %entry ], [ %moved.{i}, %{last} ]")
            lines.append(f"  %sum.{i} = phi {self.writer.real} [ {zero}, %entry ], [ %total.{i}, %{last} ]")
        return [
            *lines,
            f"  %stage.at = mul i64 %number, {self.work.stride}",
            f"  %stage.in = add i64 %stage.at, {self.work.stages}",
            "  %stage = getelementptr double, ptr %work, i64 %stage.in",
        ]

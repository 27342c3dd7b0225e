"""One step of the classical Runge-Kutta scheme as LLVM's text, with what its stages leave for the sensitivities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from clutchid.codegen.kernels import FAST
from clutchid.codegen.lanes import Work
from clutchid.codegen.layout import DifferentiatedProgram
from clutchid.codegen.llvm import ArrayElement, Function, Interface, Writer, constant, finished
from clutchid.codegen.program import Lookup, Statement
from clutchid.codegen.system import Expr

#: What a table gives: value and slope, segment, and the distance from its left breakpoint.
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
    plan: DifferentiatedProgram,
    work: Work,
    statements: Sequence[Statement],
    places: tuple[Mapping[Expr, ArrayElement], Sequence[tuple[ArrayElement, Expr]]],
    inline: bool,
) -> Function:
    """The function ``NAME(x, x_at, p, work, h)`` that moves the states x by h seconds.

    A system with a table has three arguments more: ``breakpoints, count, load``. `places` are where the symbols of
    `statements` are read, and what each stage writes to its part ``stage`` of the work array.

    Raises
    ------
    NotImplementedError
        If an expression uses a function or a relation that is not printed.
    """
    loads, stores = places
    step = _Step(Writer(places=dict(loads)), plan, work, keep=bool(stores))
    step.begin()
    step.writer.run(statements)
    for place, value in stores:
        step.writer.store(place, step.writer.number(sp.sympify(value)))
    step.end()
    table = (("breakpoints", "ptr noalias"), ("count", "i64"), ("load", "ptr noalias")) if plan.system.table else ()
    interface = Interface(("x", "p", "work"), ("x",), (("h", sp.Dummy()),), table, inline)
    return finished(name, interface, step.writer.lines, _LOOK_UP if plan.system.table else "")


@dataclass(slots=True)
class _Step:
    """The loop over the stages; with `keep` each leaves where it read the table."""

    writer: Writer
    plan: DifferentiatedProgram
    work: Work
    keep: bool
    start: list[str] = field(default_factory=list)
    opened: int = 0
    found: bool = False

    def begin(self) -> None:
        """Read the states, and enter the loop."""
        writer, states = self.writer, self.plan.system.states
        writer.bases |= {"p": "%p", "work": "%work", "stage": "%stage"}
        writer.bases["x"] = writer.new("getelementptr double, ptr %x, i64 %x_at")
        self.start = [writer.load(ArrayElement("x", i)) for i, _ in enumerate(states)]
        writer.lines.append("  %last = load double, ptr %work")
        writer.lines += ["  %segment = fptosi double %last to i64", "  br label %stages", "stages:"]
        self.opened, writer.block = len(writer.lines), "stages"
        writer.values |= {state: f"%at.{i}" for i, state in enumerate(states)}
        writer.lookup = self.look_up

    def look_up(self, lookup: Lookup) -> None:
        """The table at an argument."""
        writer, self.found = self.writer, True
        passed = f"double {writer.number(lookup.argument)}, i64 %seg, ptr %breakpoints, i64 %count, ptr %load"
        writer.lines.append(f"  %found = call {_FOUND} @clutchid_look_up({passed})")
        writer.values[lookup.value] = writer.new(f"extractvalue {_FOUND} %found, 0")
        writer.values[lookup.slope] = writer.new(f"extractvalue {_FOUND} %found, 1")
        writer.lines.append(f"  %reached = extractvalue {_FOUND} %found, 2")
        if self.keep:
            writer.store(ArrayElement("stage", self.work.segment), writer.new("sitofp i64 %reached to double"))
            writer.store(ArrayElement("stage", self.work.offset), writer.new(f"extractvalue {_FOUND} %found, 3"))

    def end(self) -> None:
        """Close the loop, and write the states."""
        writer = self.writer
        writer.lines[self.opened : self.opened] = self._entered(writer.block)
        rates = [writer.values[rate] for rate in self.plan.rates]
        writer.lines += [
            f"  %half = fmul {FAST} double %h, {constant(0.5)}",
            "  %early = icmp slt i64 %number, 2",
            "  %reach = select i1 %early, double %half, double %h",
            "  %next = add i64 %number, 1",
            "  %inner = and i64 %next, 2",
            "  %twice = icmp ne i64 %inner, 0",
            f"  %weight = select i1 %twice, double {constant(2.0)}, double {constant(1.0)}",
        ]
        for i, (x, rate) in enumerate(zip(self.start, rates, strict=True)):
            writer.lines += [
                f"  %part.{i} = fmul {FAST} double %weight, {rate}",
                f"  %total.{i} = fadd {FAST} double %sum.{i}, %part.{i}",
                f"  %way.{i} = fmul {FAST} double %reach, {rate}",
                f"  %moved.{i} = fadd {FAST} double {x}, %way.{i}",
            ]
        writer.lines += ["  %again = icmp slt i64 %next, 4", "  br i1 %again, label %stages, label %done", "done:"]
        writer.lines.append(f"  %sixth = fmul {FAST} double %h, {constant(1.0 / 6.0)}")
        if self.found:
            writer.lines += ["  %left = sitofp i64 %reached to double", "  store double %left, ptr %work"]
        for i, x in enumerate(self.start):
            writer.lines.append(f"  %all.{i} = fmul {FAST} double %sixth, %total.{i}")
            writer.lines.append(f"  %end.{i} = fadd {FAST} double {x}, %all.{i}")
            writer.store(ArrayElement("x", i), f"%end.{i}")

    def _entered(self, last: str) -> list[str]:
        """Head of every stage: its number, the states there, the sum of the rates so far, the segment."""
        lines = [f"  %number = phi i64 [ 0, %entry ], [ %next, %{last} ]"]
        if self.found:
            lines.append(f"  %seg = phi i64 [ %segment, %entry ], [ %reached, %{last} ]")
        for i, x in enumerate(self.start):
            lines.append(f"  %at.{i} = phi double [ {x}, %entry ], [ %moved.{i}, %{last} ]")
            lines.append(f"  %sum.{i} = phi double [ {constant(0.0)}, %entry ], [ %total.{i}, %{last} ]")
        return [
            *lines,
            f"  %stage.at = mul i64 %number, {self.work.stride}",
            f"  %stage.in = add i64 %stage.at, {self.work.stages}",
            "  %stage = getelementptr double, ptr %work, i64 %stage.in",
        ]

"""The functions of a system in LLVM's text: what a kernel computes once a run, once a sample and in a step."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from clutchid.codegen.differentiation import JUMP, DifferentiatedProgram, Entry
from clutchid.codegen.llvm import ArrayElement, Function, Interface, function
from clutchid.codegen.program import live
from clutchid.codegen.staging import Parts, positions, read
from clutchid.codegen.stepping import Rows, Work, map_columns, move_columns, step_function
from clutchid.codegen.system import Expr, symbols_in


def functions(plan: DifferentiatedProgram) -> tuple[Work, dict[str, Function]]:
    """All functions of a system by the names that its kernels call them, and the work array that they share.

    ``constants_NAME(p, work)``, ``hold_NAME(u, u_at, p, work)`` and ``step_NAME(x, x_at, p, work, h)``, which ends with
    the table's ``breakpoints, count, load``, compute the states, where NAME is "plain", with the Jacobian for
    "jacobian", with the derivatives to parameters too for "all"; ``jump_NAME(x, measured, measured_at, p, work,
    number)`` what a jump does. `move_columns` and `map_columns` move the sensitivities.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed.
    """
    jacobian = [*plan.rates, *_values(plan.jacobian), *_values(plan.table_entries)]
    programs = {
        "plain": (plan.plain, list(plan.rates)),
        "jacobian": (plan.with_jacobian, jacobian),
        "all": (plan.with_parameters, [*jacobian, *plan.slot_values]),
    }
    parts = {name: Parts.of(plan.system, program, results) for name, (program, results) in programs.items()}
    work = Work.of(plan, list(parts.values()))
    out: dict[str, Function] = {}
    for name, part in parts.items():
        out |= _Program(plan, work, name, part).functions()
    return work, out | _columns(plan, work) | (_jumps(plan, work) if plan.system.jumps else {})


@dataclass(frozen=True, slots=True)
class _Program:
    """One staged program: its parts, and how the results of one reach the next."""

    plan: DifferentiatedProgram
    work: Work
    name: str
    parts: Parts

    def functions(self) -> dict[str, Function]:
        made = {"constants": self.constants, "hold": self.hold, "step": self.step}
        return {f"{part}_{self.name}": make(f"{part}_{self.name}") for part, make in made.items()}

    def constants(self, name: str) -> Function:
        statements = self.parts.program.constants
        loads = _from("p", self.plan.system.parameters, read(statements))
        return function(
            name,
            Interface(("p", "work"), inline=self.name == "plain"),
            statements,
            loads,
            _stored(self.stored_constants()),
        )

    def hold(self, name: str) -> Function:
        statements = self.parts.program.held
        needed = read(statements)
        loads = _from("u", self.plan.system.inputs, {*needed, *self.parts.inputs})
        loads |= _from("p", self.plan.system.parameters, needed) | _only(self.stored_constants(), needed)
        interface = Interface(("u", "p", "work"), moving=("u",), inline=self.name == "plain")
        return function(name, interface, statements, loads, _stored(self.stored_held()))

    def step(self, name: str) -> Function:
        system, plan, needed = self.plan.system, self.plan, self.parts.in_stage
        loads = _from("p", system.parameters, needed)
        loads |= _only(self.stored_constants(), needed) | _only(self.stored_held(), needed)
        stores = _stores(self.work.rates, plan.rates) if self.name == "jacobian" else []
        if self.name != "plain":
            stores += _stores(self.work.jacobian, _values(plan.jacobian))
            stores += _stores(self.work.table, _values(plan.table_entries))
        if self.name == "all":
            stores += _stores(self.work.slots, plan.slot_values)
        return step_function(
            name, plan, self.work, self.parts.program.stage, (loads, stores), inline=self.name == "plain"
        )

    def stored_constants(self) -> dict[Expr, ArrayElement]:
        return _placed(self.work.constants, self.parts.constants)

    def stored_held(self) -> dict[Expr, ArrayElement]:
        return _placed(self.work.held, (*self.parts.inputs, *self.parts.held))


def _jumps(plan: DifferentiatedProgram, work: Work) -> dict[str, Function]:
    """New states into the places of the first stage's rates; their derivatives into those of its derivatives."""
    states = _stores(work.rates, plan.jump.states)
    after = [*_stores(work.jacobian, _values(plan.jump.jacobian)), *_stores(work.slots, plan.jump.slots)]
    return {
        "jump_plain": _jump(plan, work, "jump_plain", states),
        "jump_all": _jump(plan, work, "jump_all", [*states, *after]),
    }


def _jump(plan: DifferentiatedProgram, work: Work, name: str, stores: Sequence[tuple[ArrayElement, Expr]]) -> Function:
    results = symbols_in(value for _, value in stores)
    statements = live(plan.jump.statements, results)
    needed = read(statements) | results
    system = plan.system
    loads = _from("x", system.states, needed) | _from("p", system.parameters, needed)
    loads |= _from("measured", system.measured, needed)
    interface = Interface(
        ("x", "measured", "p", "work"),
        moving=("measured",),
        numbers=(("number", JUMP),),
        inline=name == "jump_plain",
    )
    first = [(ArrayElement("work", work.stages + place.index), value) for place, value in stores]
    return function(name, interface, statements, loads, first)


def _columns(plan: DifferentiatedProgram, work: Work) -> dict[str, Function]:
    """Propagation of the sensitivities through a step and through a jump."""
    n, jacobian = len(plan.system.states), work.stages + work.jacobian
    sourced = {row for row, _ in plan.slots} | {entry.row for entry in plan.table_entries}
    jumped = Rows(n, plan.jump.jacobian, sourced, jacobian, work.stride)
    moved = {"columns_step": move_columns(Rows(n, plan.jacobian, sourced, jacobian, work.stride))}
    return moved | ({"columns_jump": map_columns(jumped)} if plan.system.jumps else {})


def _values(entries: Iterable[Entry]) -> list[Expr]:
    return [entry.value for entry in entries]


def _from(array: str, symbols: Sequence[Expr], needed: Collection[Expr]) -> dict[Expr, ArrayElement]:
    """Places of those `symbols` that are needed, whose numbers stand in `array` one after the other."""
    return {symbol: ArrayElement(array, position) for position, symbol in positions(symbols, needed)}


def _placed(first: int, symbols: Iterable[Expr]) -> dict[Expr, ArrayElement]:
    return {symbol: ArrayElement("work", first + position) for position, symbol in enumerate(symbols)}


def _only(places: Mapping[Expr, ArrayElement], needed: Collection[Expr]) -> dict[Expr, ArrayElement]:
    return {symbol: place for symbol, place in places.items() if symbol in needed}


def _stored(places: Mapping[Expr, ArrayElement]) -> list[tuple[ArrayElement, Expr]]:
    return [(place, symbol) for symbol, place in places.items()]


def _stores(first: int, values: Iterable[Expr]) -> list[tuple[ArrayElement, Expr]]:
    """Values one after the other from `first` on, among the results of a stage."""
    return [(ArrayElement("stage", first + position), value) for position, value in enumerate(values)]

"""The functions of a system in LLVM's text: what a kernel computes once a run, once a sample and in a step."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from clutchid.codegen.differentiation import JUMP, DifferentiatedProgram, Entry, jump_program
from clutchid.codegen.llvm import ArrayElement, Function, Interface, function
from clutchid.codegen.program import Statement, live, right_hand_side
from clutchid.codegen.staging import ProgramParts, Staged, staged
from clutchid.codegen.stepping import Rows, Work, map_columns, move_columns, step_function
from clutchid.codegen.system import Expr, System, symbols_in


def functions(plan: DifferentiatedProgram) -> tuple[Work, dict[str, Function]]:
    """All functions of a system by the names that its kernels call them, and the work array that they share.

    ``constants_NAME(p, work)``, ``hold_NAME(u, u_at, p, work)`` and ``step_NAME(x, x_at, p, work, h)``, which ends with
    the table's ``breakpoints, count, load``, compute the states, where NAME is "plain", with the Jacobian for
    "jacobian", whose step is given the number of its stages last, with the derivatives to parameters too for "all", or
    to the frequent ones for "frequent".
    ``jump_NAME(x, measured, measured_at, p, work, number)`` is what a jump does. `move_columns` and `map_columns` move
    the sensitivities.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed.
    """
    jacobian = [*plan.rates, *_values(plan.jacobian), *_values(plan.table_entries)]
    programs: dict[str, tuple[Staged, Sequence[int]]] = {
        "plain": (plan.plain, ()),
        "jacobian": (plan.with_jacobian, ()),
        "frequent": (plan.with_frequent, plan.frequent),
        "all": (plan.with_parameters, range(len(plan.slots))),
    }
    if not plan.frequent:
        del programs["frequent"]
    parts = {
        name: ProgramParts.of(
            plan.system,
            program,
            plan.rates if name == "plain" else [*jacobian, *(plan.slot_values[at] for at in slots)],
        )
        for name, (program, slots) in programs.items()
    }
    work = Work.of(
        len(plan.system.states), list(parts.values()), jacobian=max(len(plan.jacobian), len(plan.jump.jacobian)),
        table=len(plan.table_entries), slots=len(plan.slots),
    )  # fmt: skip
    out: dict[str, Function] = {}
    for name, part in parts.items():
        results = _results(plan, work, name, programs[name][1])
        out |= _program(plan.system, plan.rates, work, name, part, results)
    return work, out | _columns(plan, work) | (_jumps(plan, work) if plan.system.jumps else {})


def plain_functions(system: System, lanes: int = 1) -> tuple[Work, dict[str, Function]]:
    """The functions of `functions` for states alone, without any derivative, in so many lanes.

    Raises
    ------
    ValueError
        If a piecewise expression does not cover every case.
    NotImplementedError
        If an expression uses a function that is not printed.
    """
    statements, rates = right_hand_side(system)
    parts = ProgramParts.of(system, staged(statements, system.parameters, system.inputs), rates)
    work = Work.of(len(system.states), [parts])
    out = _program(system, rates, work, "plain", parts, [], lanes)
    if system.jumps:
        jump, outputs = jump_program(system)
        states = _stores("work", outputs, work.stages + work.rates)
        out["jump_plain"] = _jump(system, "jump_plain", [jump], states, lanes)
    return work, out


def _results(
    plan: DifferentiatedProgram, work: Work, name: str, slots: Sequence[int]
) -> list[tuple[ArrayElement, Expr]]:
    """Results that the stages of a program write: derivatives to parameters at the places `slots` of all."""
    if name == "plain":
        return []
    return [
        *(_stores("stage", plan.rates, work.rates) if name == "jacobian" else []),
        *_stores("stage", _values(plan.jacobian), work.jacobian),
        *_stores("stage", _values(plan.table_entries), work.table),
        *((ArrayElement("stage", work.slots + at), plan.slot_values[at]) for at in slots),
    ]


def _program(
    system: System, rates: Sequence[Expr], work: Work, name: str, parts: ProgramParts,
    results: Sequence[tuple[ArrayElement, Expr]], lanes: int = 1,
) -> dict[str, Function]:  # fmt: skip
    """Functions of one staged program; the results of each are read by the next from the work array."""
    inline, program = name == "plain", parts.program
    constants = _stores("work", parts.constants, work.constants)
    held = _stores("work", (*parts.inputs, *parts.held), work.held)
    of_run = _loads(_stores("p", system.parameters))
    of_sample = of_run | _loads(constants)
    of_stage = of_sample | _loads(held)
    of_inputs = of_sample | _loads(_stores("u", system.inputs))
    once, hold = Interface(("p", "work"), inline=inline), Interface(("u", "p", "work"), ("u",), inline=inline)
    return {
        f"constants_{name}": function(f"constants_{name}", once, program.constants, of_run, constants, lanes),
        f"hold_{name}": function(f"hold_{name}", hold, program.held, of_inputs, held, lanes),
        f"step_{name}": step_function(
            f"step_{name}", system, rates, work, program.stage, (of_stage, results), inline, name == "jacobian", lanes
        ),
    }


def _jumps(plan: DifferentiatedProgram, work: Work) -> dict[str, Function]:
    """New states into the places of the first stage's rates; their derivatives into those of its derivatives."""
    states = _stores("work", plan.jump.states, work.stages + work.rates)
    after = _stores("work", _values(plan.jump.jacobian), work.stages + work.jacobian)
    after += _stores("work", plan.jump.slots, work.stages + work.slots)
    return {
        "jump_plain": _jump(plan.system, "jump_plain", plan.jump.statements, states),
        "jump_all": _jump(plan.system, "jump_all", plan.jump.statements, [*states, *after]),
    }


def _jump(
    system: System, name: str, statements: Sequence[Statement], stores: Sequence[tuple[ArrayElement, Expr]],
    lanes: int = 1,
) -> Function:  # fmt: skip
    number = (("number", JUMP),)
    interface = Interface(("x", "measured", "p", "work"), ("measured",), number, inline=name == "jump_plain")
    statements = live(statements, symbols_in(value for _, value in stores))
    read = {"x": system.states, "p": system.parameters, "measured": system.measured}
    loads = _loads([place for array, symbols in read.items() for place in _stores(array, symbols)])
    return function(name, interface, statements, loads, stores, lanes)


def _columns(plan: DifferentiatedProgram, work: Work) -> dict[str, Function]:
    """Propagation of the sensitivities through a step and through a jump."""
    n, jacobian = len(plan.system.states), work.stages + work.jacobian
    sourced = {row for row, _ in plan.slots} | {entry.row for entry in plan.table_entries}
    jumped = Rows(n, plan.jump.jacobian, sourced, jacobian, work.stride)
    moved = {"columns_step": move_columns(Rows(n, plan.jacobian, sourced, jacobian, work.stride))}
    return moved | ({"columns_jump": map_columns(jumped)} if plan.system.jumps else {})


def _values(entries: Iterable[Entry]) -> list[Expr]:
    return [entry.value for entry in entries]


def _stores(array: str, values: Iterable[Expr], first: int = 0) -> list[tuple[ArrayElement, Expr]]:
    """Values one after the other in `array`, from its element `first` on."""
    return [(ArrayElement(array, first + position), value) for position, value in enumerate(values)]


def _loads(stores: Iterable[tuple[ArrayElement, Expr]]) -> dict[Expr, ArrayElement]:
    """Places that symbols are read from: those that they stand in."""
    return {symbol: place for place, symbol in stores}

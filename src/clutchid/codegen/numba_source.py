"""Numba kernels of a system: a run, a run with exact sensitivities, and the linearisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from clutchid.codegen.language import PYTHON
from clutchid.codegen.layout import Entry, JumpProgram, Layout, layout
from clutchid.codegen.names import PYTHON_WORDS, apart
from clutchid.codegen.program import Assign, Lookup, Statement, lower
from clutchid.codegen.staging import Staged
from clutchid.codegen.system import Expr, System
from clutchid.codegen.templates import template

_LOOKUP = """\
while seg > 0 and {argument} < breakpoints[seg - 1]:
    seg -= 1
while seg < breakpoints.size and {argument} >= breakpoints[seg]:
    seg += 1
offset = {argument} - breakpoints[max(seg - 1, 0)]
{value} = load[seg, 0] + offset * (load[seg, 1] + offset * (load[seg, 2] + offset * load[seg, 3]))
{slope} = load[seg, 1] + offset * (2.0 * load[seg, 2] + offset * 3.0 * load[seg, 3])"""


#: Sensitivity columns that are computed at once.
WIDTH = 4


@dataclass(frozen=True, slots=True)
class _Kernel:
    """One function of the generated module; `slots` are printed parameter derivatives, empty where none are wanted."""

    name: str
    program: dict[str, str]
    sensitivities: bool
    slots: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Term:
    """A non-zero entry of a Jacobian row, as text."""

    of: str
    text: str
    number: int | None = None

    def factor(self, stage: int) -> str:
        """The entry at an RK4 stage: a stored value, or the literal where it is constant."""
        return self.text if self.number is None else f"j{stage}_{self.number}"


@dataclass(frozen=True, slots=True)
class _Row:
    """One row of the sensitivity equation: Jacobian row times sensitivities, plus the parameter derivative."""

    name: str
    entries: tuple[_Term, ...]
    has_source: bool
    states: int

    def text(self, stage: int, number: int) -> str:
        """The row at an RK4 stage."""
        prefix = f"z{stage}_" if stage else "s_"
        terms = [f"{term.factor(stage)} * {prefix}{term.of}" for term in self.entries]
        source = f"work[c + {((stage + 1) * self.states + number) * WIDTH}]"
        return " + ".join([*terms, *([source] if self.has_source else [])]) or "0.0"


def numba_source(system: System) -> str:
    """Source of a Python module with the kernels ``run``, ``run_table``, ``run_all`` and ``linearise``.

    All integrate with classical RK4 from sample to sample, `substeps` steps an interval, with held inputs, and apply
    the system's jumps after a sample is stored. Exact sensitivities go through the same steps as the states, so they
    are the derivatives of the computed solution, not of the differential equation. ``run_table`` carries them for
    initial states and table weights, ``run_all`` for parameters too.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    system = apart(system, PYTHON_WORDS)
    plan = layout(system)
    slots = tuple(PYTHON.print(value) for value in plan.slot_values)
    kernels = [
        _Kernel("run", _staged(plan.plain), False, ()),
        _Kernel("run_table", _staged(plan.with_jacobian), True, ()),
        _Kernel("run_all", _staged(plan.with_parameters), True, slots),
    ]
    text: str = template("kernels.py.j2").render(
        name=system.name,
        states=[str(s) for s in system.states],
        inputs=[str(s) for s in system.inputs],
        parameters=system.parameter_names(),
        measured=[str(s) for s in system.measured],
        table=system.table is not None,
        jacobian=_texts(plan.jacobian),
        table_entries=_texts(plan.table_entries),
        rows=_rows(plan),
        jumps=[_jump(system, jump.name, program) for jump, program in zip(system.jumps, plan.jumps, strict=True)],
        with_jacobian=_staged(plan.with_jacobian),
        kernels=kernels,
        slot_pairs=plan.slots,
        width=WIDTH,
        size=5 * len(system.states) * WIDTH,
    )
    return text


def function_source(name: str, arguments: Sequence[Expr], values: Any) -> str:
    """Source of a plain Python function of numbers; `values` is an expression or nested lists of them.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed.
    """
    return f"\n\ndef {name}({', '.join(str(a) for a in arguments)}):\n    return {_nested(values)}\n"


def elementwise_source(name: str, columns: Sequence[Expr], numbers: Sequence[Expr], value: Expr) -> str:
    """Source of a compiled function ``name(columns..., numbers...)`` that computes `value` for every row of columns.

    It stands in the module of `numba_source`, whose compiler settings it shares.

    Raises
    ------
    ValueError
        If a piecewise expression does not cover every case.
    NotImplementedError
        If an expression uses a function that is not printed.
    """
    first, *_ = names = [str(column) for column in columns]
    result = sp.Symbol("result", real=True)
    lines = [
        "",
        "",
        "@_jit",
        f"def {name}({', '.join([*(f'all_{column}' for column in names), *map(str, numbers)])}):",
        f"    out = np.empty(all_{first}.size)",
        "    for k in range(out.size):",
        *(f"        {column} = all_{column}[k]" for column in names),
        block(lower(result, value, {*names, *map(str, numbers)}), "        "),
        f"        out[k] = {result}",
        "    return out",
    ]
    return "\n".join(lines) + "\n"


def _nested(values: Any) -> str:
    if isinstance(values, (list, tuple)):
        return f"({''.join(_nested(v) + ', ' for v in values)})"
    return PYTHON.print(values)


def block(statements: Sequence[Statement], indent: str = "") -> str:
    """Statements as Python text."""
    lines: list[str] = []
    for statement in statements:
        if isinstance(statement, Assign):
            lines.append(f"{indent}{statement.target} = {PYTHON.print(statement.value)}")
        elif isinstance(statement, Lookup):
            text = _LOOKUP.format(value=statement.value, slope=statement.slope, argument=statement.argument)
            lines += [indent + line for line in text.splitlines()]
        else:
            for number, (condition, arm) in enumerate(statement.arms):
                final = number == len(statement.arms) - 1
                word = "else" if final else f"{'elif' if number else 'if'} {PYTHON.print(condition)}"
                lines.append(f"{indent}{word}:")
                lines.append(block(arm, indent + "    ") or f"{indent}    pass")
    return "\n".join(lines)


def _staged(program: Staged) -> dict[str, str]:
    return {part: block(getattr(program, part)) for part in ("constants", "held", "stage")}


def _texts(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    return [
        {
            "row": e.row,
            "column": e.column,
            "text": PYTHON.print(e.value),
            "constant": e.value.is_number,
            "number": number,
        }
        for number, e in enumerate(entries)
    ]


def _rows(plan: Layout) -> list[_Row]:
    sourced = {row for row, _ in plan.slots} | {entry.row for entry in plan.table_entries}
    states = [str(state) for state in plan.system.states]
    terms: list[list[_Term]] = [[] for _ in states]
    for number, e in enumerate(plan.jacobian):
        constant = e.value.is_number
        terms[e.row].append(_Term(states[e.column], PYTHON.print(e.value), None if constant else number))
    return [_Row(name, tuple(terms[i]), i in sourced, len(states)) for i, name in enumerate(states)]


def _jump(system: System, name: str, jump: JumpProgram) -> dict[str, Any]:
    states = [str(state) for state in system.states]
    terms: list[list[_Term]] = [[] for _ in states]
    for e in jump.jacobian:
        terms[e.row].append(_Term(states[e.column], PYTHON.print(e.value)))
    return {
        "name": name,
        "statements": block(jump.statements),
        "rows": [" + ".join(f"{term.text} * s_{term.of}" for term in row) or "0.0" for row in terms],
        "slots": [(number, PYTHON.print(value)) for number, value in enumerate(jump.slots) if value != 0],
    }

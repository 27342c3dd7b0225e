"""C99 of a system for a control unit, with its derivatives: double or float, static memory, no heap, no recursion."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp

from clutchid.codegen.differentiation import DifferentiatedProgram, Entry, differentiated
from clutchid.codegen.language import C_LANGUAGES, C_WORDS, Language, apart
from clutchid.codegen.program import Assign, Branch, Lookup, Statement, live, reads, targets
from clutchid.codegen.staging import ProgramParts, assigned, positions, read
from clutchid.codegen.system import Expr, System
from clutchid.codegen.templates import template


def c_lines(
    statements: Sequence[Statement],
    language: Language,
    indent: str = "    ",
    declared: Collection[Expr] = (),
    defined: Collection[str] = (),
    slopes: bool = False,
) -> list[str]:
    """Statements as lines of C; variables are declared where they are set, unless they are in `declared`.

    `defined` are names that a comment points out where they are computed case by case; with `slopes` a table gives its
    slope too.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed.
    """
    real = language.real
    lines: list[str] = []
    for statement in statements:
        if isinstance(statement, Assign):
            kind = "" if statement.target in declared else f"const {real} "
            lines.append(f"{indent}{kind}{statement.target} = {language.print(statement.value)};")
        elif isinstance(statement, Lookup):
            lines.append(f"{indent}const {real} {statement.value} = lookup(table, memory, {statement.argument});")
            if slopes:
                lines.append(f"{indent}const {real} {statement.slope} = table_slope(table, memory);")
        else:
            lines += _branch(statement, language, indent, declared, defined)
    return lines


def _branch(
    branch: Branch, language: Language, indent: str, declared: Collection[Expr], defined: Collection[str]
) -> list[str]:
    outputs = targets(branch)
    new = [target for target in outputs if target not in declared]
    named = [str(target) for target in new if str(target) in defined]
    lines = [f"{indent}/* {', '.join(named)}, case by case */"] if named else []
    lines += [f"{indent}{language.real} {target};" for target in new]
    in_scope = {*declared, *outputs}
    for number, (condition, arm) in enumerate(branch.arms):
        final = number == len(branch.arms) - 1
        test = "" if final else f"if ({language.print(condition)}) "
        lines.append(f"{indent}{'} else ' if number else ''}{test}{{")
        lines += c_lines(arm, language, indent + "    ", in_scope, defined)
    return [*lines, f"{indent}}}"]


def unpacked(system: System, parts: ProgramParts, needed: Collection[Expr]) -> dict[str, list[Any]]:
    """Arguments that a stage reads: states, parameters, constants, and held values."""
    return {
        "x": positions(system.states, needed),
        "p": positions(system.parameters, needed),
        "c": [t for t in parts.constants if t in needed],
        "held": [t for t in (*parts.inputs, *parts.held) if t in needed],
    }


@dataclass(frozen=True, slots=True)
class ColumnCode:
    """The text around ``NAME_step_columns``.

    `code` are the statements that the rates need, `more` the others, which nothing needs without columns. `jacobian`,
    `table` and `slots` are the results of a stage, as text. A slot is the derivative of the rate of a row
    to the parameter of a column: (row, column, text). `rows` are the rates of a column, J z, a row each.
    """

    parts: ProgramParts
    code: str
    more: str
    unpacked: dict[str, list[Any]]
    jacobian: tuple[str, ...]
    table: tuple[tuple[int, str], ...]
    slots: tuple[tuple[int, int, str], ...]
    rows: tuple[str, ...]

    @property
    def owned(self) -> list[tuple[int, list[tuple[int, int]]]]:
        """Columns of parameters with their slots: (column, [(row, slot), ...])."""
        places = [(column, row, slot) for slot, (row, column, _) in enumerate(self.slots)]
        columns = sorted({column for column, _, _ in places})
        return [(column, [(row, slot) for other, row, slot in places if other == column]) for column in columns]

    @classmethod
    def of(cls, plan: DifferentiatedProgram, places: Sequence[int], language: Language) -> ColumnCode:
        """For the parameters at these places.

        Raises
        ------
        NotImplementedError
            If an expression uses a function that is not printed.
        """
        pairs = zip(plan.slots, plan.slot_values, strict=True)
        chosen = [(row, places.index(q), value) for (row, q), value in pairs if q in places and value != 0]
        entries = [entry for entry in plan.jacobian if not entry.value.is_number]
        derivatives = [entry.value for entry in (*entries, *plan.table_entries)] + [value for _, _, value in chosen]
        program = plan.with_parameters if chosen else plan.with_jacobian
        parts = ProgramParts.of(plan.system, program, [*plan.rates, *derivatives])
        stage = parts.program.stage
        slopes = any(isinstance(part, Lookup) and part.slope in read(stage) for part in stage)
        wanted, needed = set(plan.rates), list[Statement]()
        for statement in reversed(stage):
            if wanted & set(targets(statement)):
                wanted |= reads(statement)
                needed.insert(0, statement)
        more = [statement for statement in stage if statement not in needed]
        return cls(
            parts=parts,
            code="\n".join(c_lines(needed, language, slopes=slopes)),
            more="\n".join(c_lines(more, language, "        ")),
            unpacked=unpacked(plan.system, parts, parts.in_stage),
            jacobian=tuple(language.print(entry.value) for entry in entries),
            table=tuple((entry.row, language.print(entry.value)) for entry in plan.table_entries),
            slots=tuple((row, column, language.print(value)) for row, column, value in chosen),
            rows=tuple(_row(plan, row, entries, language) for row, _ in enumerate(plan.rates)),
        )


def _row(plan: DifferentiatedProgram, row: int, entries: Sequence[Entry], language: Language) -> str:
    """The rate of a column: J z."""
    terms = []
    for entry in plan.jacobian:
        if entry.row == row:
            number = language.print(entry.value) if entry.value.is_number else f"jacobian[{entries.index(entry)}]"
            terms.append(f"z[{entry.column}]" if entry.value == 1 else f"({number} * z[{entry.column}])")
    return " + ".join(terms)


@dataclass(frozen=True, slots=True)
class CSource:
    """A C module: the text of ``NAME.h`` and of ``NAME.c``, which includes it."""

    header: str
    source: str


def comment(text: str) -> str:
    """A text on one line that may stand in a comment of C.

    Examples
    --------
    >>> comment("5 */ 7 /* 9")
    '5 * / 7 / * 9'
    """
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").split())


def c99_source(
    system: System,
    *,
    real: str = "double",
    notes: Mapping[str, str] | None = None,
    derivatives: Sequence[str] | None = None,
    idle: Mapping[str, Sequence[int]] | None = None,
) -> CSource:
    """C99 of `system`: ``NAME_constants``, ``NAME_hold``, ``NAME_rhs``, ``NAME_step`` and ``NAME_run``.

    The functions do what the Numba kernel ``run`` does without jumps: classical RK4 with held inputs.

    Parameters
    ----------
    real : 'double' or 'float'
        Type of every number.
    notes : Mapping[str, str], optional
        Comments on states, inputs and parameters by name.
    derivatives : names of parameters, optional
        Adds ``NAME_step_columns``, which does what the Numba kernel ``step`` does: it moves the states together with
        columns of derivatives to these parameters, to weights of the table, and to whatever the states started with.

    idle : places of inputs by a quantity of ``NAME_held_t``, optional
        Where none of these inputs is above 0, the quantity and its derivatives are 0, and nothing is computed for it.

    Raises
    ------
    ValueError
        If `real` is neither "double" nor "float", the system's name is not a C identifier, or a parameter is not one of
        the system's.
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    if real not in C_LANGUAGES:
        raise ValueError(f"real = {real!r}: known are {', '.join(C_LANGUAGES)}.")
    if not re.fullmatch(r"[A-Za-z]\w*", system.name, re.ASCII):
        raise ValueError(f"{system.name!r} is not a C identifier: letters, digits and underscores are allowed.")
    unknown = sorted(set(derivatives or ()) - set(system.parameter_names()))
    if unknown:
        raise ValueError(f"{system.name} has no parameter {', '.join(unknown)}, so no derivatives to it.")
    plan, language = differentiated(apart(system, C_WORDS)), C_LANGUAGES[real]
    places = None if derivatives is None else [system.parameter_names().index(name) for name in derivatives]
    columns = None if places is None else ColumnCode.of(plan, places, language)
    parts = columns.parts if columns else ProgramParts.of(plan.system, plan.plain, plan.rates)
    for name, inputs in (idle or {}).items():
        parts = _idle(parts, name, [plan.system.inputs[place] for place in inputs])
    values = _values(system, plan, parts, language)
    values |= {
        "real": real,
        "notes": {name: comment(text) for name, text in (notes or {}).items()},
        "columns": columns,
        "free": list(derivatives or ()),
    }
    return CSource(template("c99.h.j2").render(values), template("c99.c.j2").render(values))


def _idle(parts: ProgramParts, name: str, inputs: Sequence[Expr]) -> ProgramParts:
    """Parts whose held quantity, if there is one, is 0 with its derivatives where no input is above 0."""
    program = parts.program
    family = {t for t in assigned(program.held) if str(t) == name or str(t).startswith(f"{name}__")}
    if not family & set(parts.held):
        return parts
    part = live(program.held, family)
    others = [statement for statement in program.held if not set(targets(statement)) & set(assigned(part))]
    needed = read(others) | set(parts.held)
    shared = live(part, needed - family)
    own = tuple(statement for statement in part if not set(targets(statement)) & set(assigned(shared)))
    zeros = tuple(Assign(t, sp.Float(0.0)) for t in assigned(own) if t in family & needed)
    branch = Branch(((sp.And(*(value <= 0 for value in inputs)), zeros), (sp.true, own)))
    return replace(parts, program=replace(program, held=[*shared, branch, *others]))


def _values(system: System, plan: DifferentiatedProgram, parts: ProgramParts, language: Language) -> dict[str, Any]:
    """Values of the templates; names of the interface come from `system`, those of the code from `plan`."""
    inside, program = plan.system, parts.program
    in_held, stage = read(program.held), live(program.stage, plan.rates)
    defined = {str(symbol) for symbol, _ in inside.definitions}
    code = {"constants": program.constants, "held": program.held, "stage": stage}
    return {
        "name": system.name,
        "states": [str(s) for s in system.states],
        "inputs": [str(s) for s in system.inputs],
        "parameters": system.parameter_names(),
        "table": system.table if any(isinstance(s, Lookup) for s in program.stage) else None,
        "constants": parts.constants,
        "held": parts.held,
        "held_inputs": positions(inside.inputs, parts.inputs),
        "rates": plan.rates,
        "print": language.print,
        "absolute": "fabsf" if language.real == "float" else "fabs",
        "code": {part: "\n".join(c_lines(lines, language, defined=defined)) for part, lines in code.items()},
        "constants_from": {"p": positions(inside.parameters, read(program.constants))},
        "held_from": {
            "u": positions(inside.inputs, in_held),
            "p": positions(inside.parameters, in_held),
            "c": [t for t in parts.constants if t in in_held],
        },
        "stage_from": unpacked(inside, parts, read(stage) | set(plan.rates)),
    }

"""Numba kernels of a system: a run, a run with its sensitivities, and the linearisation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy as sp

from clutchid.codegen.differentiation import differentiated
from clutchid.codegen.functions import functions, plain_functions
from clutchid.codegen.language import PYTHON, PYTHON_WORDS, apart
from clutchid.codegen.llvm import ArrayElement, Interface, function
from clutchid.codegen.program import Assign, Lookup, Statement, lower
from clutchid.codegen.stepping import TABLE_PIECE, WIDTH
from clutchid.codegen.system import Expr, System, symbols_in
from clutchid.codegen.templates import template

_LOOKUP = """\
while seg > 0 and {argument} < breakpoints[seg - 1]:
    seg -= 1
while seg < breakpoints.size and {argument} >= breakpoints[seg]:
    seg += 1
offset = {argument} - breakpoints[max(seg - 1, 0)]
{value} = load[seg, 0] + offset * (load[seg, 1] + offset * (load[seg, 2] + offset * load[seg, 3]))
{slope} = load[seg, 1] + offset * (2.0 * load[seg, 2] + offset * 3.0 * load[seg, 3])"""


def numba_source(system: System) -> str:
    """Source of a Python module with the kernels ``run``, ``run_all`` and ``linearise``.

    All integrate with classical RK4 from sample to sample, `substeps` steps an interval, with held inputs, and apply
    the system's jumps after a sample is stored. Exact sensitivities go through the same steps as the states, so they
    are the derivatives of the computed solution, not of the differential equation: to initial states, table weights
    and, where slots are filled, parameters.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    plan = differentiated(apart(system, ()))
    work, printed = functions(plan)
    return template("kernels.py.j2").render(
        name=system.name,
        n=len(system.states),
        inputs=[str(s) for s in system.inputs],
        jumps=[jump.name for jump in system.jumps],
        table=system.table is not None,
        look_up=", breakpoints, breakpoints.size, load" if system.table else "",
        tables="breakpoints, load, " if system.table else "",
        free=("basis, table_basis, table_column, " if system.table else "") + "fill_slot, fill_row, fill_column, ",
        table_rows=[entry.row for entry in plan.table_entries],
        jacobian=plan.jacobian,
        functions=printed,
        slots=plan.slots,
        frequent=plan.frequent,
        work=work,
        width=WIDTH,
    )


def lanes_source(system: System, lanes: int) -> str:
    """Source of a Python module with the kernel ``run_lanes``: `lanes` runs of `numba_source` side by side.

    Raises
    ------
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    inside = apart(system, ())
    work, printed = plain_functions(inside, lanes)
    return template("lanes.py.j2").render(
        name=system.name, n=len(system.states), lanes=lanes, jumps=bool(system.jumps), functions=printed, work=work,
        piece=TABLE_PIECE if system.table else 0,
    )  # fmt: skip


def module_head(name: str) -> str:
    """Head of a module without a system, only functions of `function_source` and `elementwise_source`."""
    return template("head.py.j2").render(name=name)


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
    arguments = [f"a{number}" for number, _ in enumerate((*columns, *numbers))]
    result = sp.Dummy("result", real=True)
    row_function = function(
        name,
        Interface(("out",), moving=("out",), numbers=tuple(zip(arguments, (*columns, *numbers), strict=True))),
        lower(result, value),
        {},
        [(ArrayElement("out", 0), result)],
    )
    rows = [f"{argument}[k]" for argument in arguments[: len(columns)]]
    return template("elementwise.py.j2").render(
        name=name, arguments=arguments, row_function=row_function, passed=[*rows, *arguments[len(columns) :]]
    )


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


#: Names that the text of `terms_source` needs for itself.
_WORDS = PYTHON_WORDS | {"terms", "TERMS"}


def terms_source(system: System) -> str:
    """Source of a generator ``terms(x, u, p, table value)`` and of the names of what it yields, ``TERMS``.

    It yields the definitions of `system` in their order, then the derivatives of its states. It is no kernel: a term
    that cannot be computed raises at its turn, as Python's arithmetic does. Each row of ``TERMS`` has the name of a
    term, d_NAME for a derivative, the parameters that stand in it, and the states and terms that do.

    Raises
    ------
    ValueError
        If a piecewise expression does not cover every case.
    NotImplementedError
        If an expression uses a function that is not printed, see `clutchid.codegen.language`.
    """
    defined = dict(system.definitions)
    others = [*system.states, *system.tabulated, *defined]
    # a derivative that is a definition itself has what stands in that one
    rows = [*system.definitions, *((rate, defined.get(value, value)) for rate, value in _rates(system))]
    listed = [f'    ("{name}", {_used(value, system.parameters)}, {_used(value, others)}),' for name, value in rows]
    inside = apart(system, _WORDS)
    taken = {str(symbol) for symbol in inside.symbols} | _WORDS
    lines = [*_unpacked(inside.states, "x"), *_unpacked(inside.inputs, "u"), *_unpacked(inside.parameters, "p")]
    for symbol, value in (*inside.definitions, *_rates(inside)):
        lines += [block(lower(symbol, value, taken), "    "), f"    yield {symbol}"]
    head = f"def terms({', '.join(['x', 'u', 'p', *map(str, inside.tabulated)])}):"
    return "\n".join(["", "", "TERMS = (", *listed, ")", "", "", head, *lines, ""])


def _rates(system: System) -> list[tuple[Expr, Expr]]:
    rates = zip(system.states, system.derivatives, strict=True)
    return [(sp.Symbol(f"d_{state}", real=True), value) for state, value in rates]


def _used(value: Expr, symbols: Iterable[Expr]) -> tuple[str, ...]:
    """Names of those `symbols` that stand in `value`."""
    used = symbols_in([value])
    return tuple(str(symbol) for symbol in symbols if symbol in used)


def _unpacked(symbols: Sequence[Expr], array: str) -> list[str]:
    return [f"    ({', '.join(map(str, symbols))},) = {array}"] if symbols else []

"""Columns of derivatives in a step in C: the entries of the Jacobian, and the sources of columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from clutchid.codegen.c99_lines import c_lines, unpacked
from clutchid.codegen.language import Language
from clutchid.codegen.layout import DifferentiatedProgram, Entry
from clutchid.codegen.parts import Parts, read
from clutchid.codegen.program import Lookup


@dataclass(frozen=True, slots=True)
class ColumnCode:
    """The text around ``NAME_step_columns``.

    `jacobian`, `table` and `slots` are the results of a stage, as text. A slot is the derivative of the rate
    `slot_rows` to the parameter of the column `slot_columns`. `rows` are the rates of a column, J z + source, a row
    each.
    """

    parts: Parts
    code: str
    unpacked: dict[str, list[Any]]
    jacobian: tuple[str, ...]
    table: tuple[tuple[int, str], ...]
    slots: tuple[str, ...]
    slot_rows: tuple[int, ...]
    slot_columns: tuple[int, ...]
    rows: tuple[str, ...]

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
        parts = Parts.of(plan.system, program, [*plan.rates, *derivatives])
        stage = parts.program.stage
        slopes = any(isinstance(part, Lookup) and part.slope in read(stage) for part in stage)
        return cls(
            parts=parts,
            code="\n".join(c_lines(stage, language, slopes=slopes)),
            unpacked=unpacked(plan.system, parts, parts.in_stage),
            jacobian=tuple(language.print(entry.value) for entry in entries),
            table=tuple((entry.row, language.print(entry.value)) for entry in plan.table_entries),
            slots=tuple(language.print(value) for _, _, value in chosen),
            slot_rows=tuple(row for row, _, _ in chosen),
            slot_columns=tuple(column for _, column, _ in chosen),
            rows=tuple(_row(plan, row, entries, language) for row, _ in enumerate(plan.rates)),
        )


def _row(plan: DifferentiatedProgram, row: int, entries: Sequence[Entry], language: Language) -> str:
    """The rate of a column: J z + source."""
    terms = []
    for entry in plan.jacobian:
        if entry.row == row:
            number = language.print(entry.value) if entry.value.is_number else f"jacobian[{entries.index(entry)}]"
            terms.append(f"z[{entry.column}]" if entry.value == 1 else f"({number} * z[{entry.column}])")
    return " + ".join([*terms, f"source[{row}]"])

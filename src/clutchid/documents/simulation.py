"""A simulation against its recording as a document: its errors and warnings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from clutchid.documents.document import Document, Notice, Row
from clutchid.documents.fit_json import errors_json
from clutchid.documents.fit_rows import errors_text

if TYPE_CHECKING:
    from clutchid.estimation import Errors


class Simulated(Protocol):
    """Name of a recording, errors of its simulation, None without a measured position, message and warnings."""

    @property
    def recording(self) -> str:
        """Name of the recording."""

    @property
    def errors(self) -> Errors | None:
        """Errors against what was measured."""

    @property
    def message(self) -> str:
        """Sentence of the simulation."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of both."""


def simulated_document(simulated: Simulated, command: str = "") -> Document:
    """Document of a simulation."""
    name, errors, warnings = simulated.recording, simulated.errors, simulated.warnings
    data: dict[str, Any] = {
        "status": "warning" if warnings else "ok", "message": simulated.message, "warnings": list(warnings),
    }  # fmt: skip
    rows: tuple[Row, ...] = ()
    if errors is not None:
        data |= {"errors": errors_json(errors), "logs": {name: errors_json(errors)}}
        rows = (Row(None, f"simulated {name}: {errors_text(errors)}", fixed=True),)
    return Document(
        f"Simulation of {name}", rows=rows, notices=tuple(map(Notice, warnings)), data=lambda: data, command=command,
    )  # fmt: skip

"""A simulation against its recording as a document: its errors and warnings."""

from __future__ import annotations

from typing import Any

from clutchid.documents.document import Document, Notice, Row
from clutchid.documents.fit_json import errors_json
from clutchid.documents.fit_rows import errors_text
from clutchid.documents.results import SimulatedRecording


def simulated_document(simulated: SimulatedRecording, command: str = "") -> Document:
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

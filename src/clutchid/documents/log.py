"""A log or a simulation as a document: its columns over time, or its errors against its recording."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clutchid.documents.document import Document, LabelRow, Notice, Picture
from clutchid.documents.figures import draw_over_time, fill_over_time, label, legend, new_figure
from clutchid.documents.fit_json import errors_json
from clutchid.documents.fit_rows import errors_text
from clutchid.documents.results import SimulatedRecording
from clutchid.documents.style import BAR, MM, STYLE, Line
from clutchid.log import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from clutchid.simulation.simulation import Simulation

#: Panels of a log: label, and display unit in SI and line of its columns; a panel without a column is left out.
_PANELS: tuple[tuple[str, dict[str, tuple[float, Line]]], ...] = (
    ("position [mm]", {"position": (MM, Line(STYLE.blue))}),
    (
        "pressure,\nabsolute [bar]",
        {
            "pressure_a": (BAR, Line(STYLE.blue, "chamber A")),
            "pressure_b": (BAR, Line(STYLE.orange, "chamber B")),
            "pressure_supply": (BAR, Line(STYLE.green, "supply")),
        },
    ),
    (
        "duty cycle [1]",
        {
            "duty_supply": (1.0, Line(STYLE.green, "supply", 0.9)),
            "duty_exhaust": (-1.0, Line(STYLE.purple, "exhaust (negative)", 0.9)),
        },
    ),
    ("force [N]", {"force": (1.0, Line(STYLE.blue))}),
)


def log_figure(log: Log) -> Figure:
    """Position, pressures, duty cycles and force over time, those that `log` has."""
    panels = [(y, lines) for y, lines in _PANELS if any(name in log for name in lines)]
    figure, axes = new_figure([1.7] * max(1, len(panels)))
    for axis, (y, lines) in zip(axes, panels, strict=False):
        if "pressure_a" in lines and {"pressure_a low", "pressure_a high"} <= set(log.columns):
            low, high = log["pressure_a low"] / BAR, log["pressure_a high"] / BAR
            fill_over_time(axis, log.time, low, high, Line(STYLE.blue, "95 % band", opacity=0.3))
        for name, (unit, line) in lines.items():
            if name in log:
                draw_over_time(axis, log.time, log[name] / unit, line)
        label(axis, y=y)
        legend(axis, 4)
    label(axes[-1], "time [s]")
    if len(log) > 1:
        axes[-1].set_xlim(float(log.time[0]), float(log.time[-1]))
    return figure


def log_document(log: Log, command: str = "") -> Document:
    """Document of a log."""
    return _document(log, repr(log), command)


def simulation_document(simulation: Simulation, command: str = "") -> Document:
    """Document of a simulation."""
    return _document(simulation.log, repr(simulation), command)


def _document(log: Log, text: str, command: str) -> Document:
    def picture() -> Picture:
        return Picture(log_figure(log), "", f"Columns of {log.name} over time")

    return Document(log.name, rows=(LabelRow(None, text, fixed=True),), figure=picture, command=command)


def simulated_document(simulated: SimulatedRecording, command: str = "") -> Document:
    """Document of a simulation against its recording: its errors and warnings."""
    name, errors, warnings = simulated.recording, simulated.errors, simulated.warnings
    data: dict[str, Any] = {
        "status": "warning" if warnings else "ok", "message": simulated.message, "warnings": list(warnings),
    }  # fmt: skip
    rows: tuple[LabelRow, ...] = ()
    if errors is not None:
        data |= {"errors": errors_json(errors), "logs": {name: errors_json(errors)}}
        rows = (LabelRow(None, f"simulated {name}: {errors_text(errors)}", fixed=True),)
    return Document(
        f"Simulation of {name}", rows=rows, notices=tuple(map(Notice, warnings)), data=lambda: data, command=command,
    )  # fmt: skip

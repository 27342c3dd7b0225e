"""Loads of saved calibrations and estimates side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.documents.document import Chapter, Document, LabelRow, Picture
from clutchid.documents.figures import draw, fill, label, legend, mark_span, new_figure
from clutchid.documents.fit_json import curve_json
from clutchid.documents.fit_rows import POSITIONS, with_interval
from clutchid.documents.results import SavedLoad, SavedLoads
from clutchid.documents.style import MM, STYLE, Line
from clutchid.documents.tables import Cell, Column, ReportTable
from clutchid.estimation.assess.comparison import ENGAGING, half_load_band

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CAPTION = "Loads over the position with their pointwise 95 % bands, dashed beyond the recorded positions."
_COLOURS = (STYLE.blue, STYLE.orange, STYLE.green, STYLE.red, STYLE.purple, STYLE.ink)


def saved_loads_document(saved: SavedLoads, command: str = "") -> Document:
    """Document of several saved loads."""
    width = max(len(file.name) for file in saved.loads)
    lines = [["", *(f"{mm} mm" for mm in POSITIONS)], *([file.name, *_at_positions(file)] for file in saved.loads)]
    text = "\n".join(line[0].ljust(width) + "".join(cell.rjust(15) for cell in line[1:]) for line in lines)
    row = LabelRow(None, f"Load [N] with its 95 % interval:\n{text}", fixed=True, cells=tuple(map(tuple, lines)))
    return Document(
        "Loads side by side", rows=(row,), figure=lambda: Picture(saved_loads_figure(saved), _CAPTION, "Loads"),
        sections=lambda: [Chapter("Loads", (saved_loads_table(saved),))], data=lambda: saved_loads_json(saved),
        command=command, sources={file.name: file.sha256 for file in saved.loads},
    )  # fmt: skip


def _at_positions(file: SavedLoad) -> list[str]:
    """The load where the clutch engages, a dash beyond the recorded range."""
    y, force, low, high = file.load.table().T
    values = ([float(np.interp(mm * MM, y, side)) for side in (force, low, high)] for mm in POSITIONS)
    cells = [with_interval(middle, (top - bottom) / 2) for middle, bottom, top in values]
    return ["-" if mm * MM > file.reach else cell for mm, cell in zip(POSITIONS, cells, strict=True)]


def saved_loads_figure(saved: SavedLoads) -> Figure:
    """The loads with their bands."""
    figure, (axis,) = new_figure([3.7])
    mark_span(axis, ENGAGING[0] / MM, ENGAGING[1] / MM, "engagement, 5 to 8 mm")
    for number, file in enumerate(saved.loads):
        x, curve, colour = file.load.position / MM, file.load, _COLOURS[number % len(_COLOURS)]
        within = ~(curve.position > file.reach)
        fill(axis, x[within], curve.low[within], curve.high[within], Line(colour, opacity=0.2, layer=1))
        draw(axis, x[within], curve.force[within], Line(colour, file.name, 2.0))
        draw(axis, x[~within], curve.force[~within], Line(colour, "", 1.4, (0, (4, 3))))
    label(axis, "position [mm]", "load [N]")
    legend(axis, 2)
    return figure


def saved_loads_table(saved: SavedLoads) -> ReportTable:
    """Trust, greatest load and half-load position of each."""
    columns = (
        Column("file", "file"), Column("created", "saved", date=True), Column("trust", "trust"),
        Column("peak [N]", "greatest\nload [N]", 1.0, 0), Column("half_load [m]", "half load\nat [mm]", MM, 2),
        Column("half_load_low [m]", "from", MM, 2), Column("half_load_high [m]", "to", MM, 2),
        Column("reach [m]", "recorded\nup to [mm]", MM, 1),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for file in saved.loads:
        furthest = float(np.nanmin([file.reach, file.load.position[-1]]))
        peak = float(file.load.force[file.load.peak(furthest)])
        rows.append((file.name, file.created[:10], file.trust, peak, *half_load_band(file.load, furthest), file.reach))
    return ReportTable("Saved loads", columns, tuple(rows), note="Intervals at 95 %.")


def saved_loads_json(saved: SavedLoads) -> dict[str, Any]:
    """The JSON object of ``clutchid compare``."""
    facts = ("name", "created", "sha256", "trust")
    loads = [
        {**{fact: getattr(file, fact) for fact in facts}, "load_curve": curve_json(file.load), "reach_m": file.reach}
        for file in saved.loads
    ]
    return {"status": "ok", "message": "", "loads": loads}

"""Parts of a page on new against worn: the load of a fit and that of its calibration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.changes import since_calibration
from clutchid.documents.document import Block, Bullets, Chapter, Picture, Text
from clutchid.documents.figures import draw, fill, label, legend, mark_span, new_figure
from clutchid.documents.fit_rows import interval_words
from clutchid.documents.style import MM, STYLE, Line
from clutchid.documents.tables import POSITION_STEP, Cell, Column, ReportTable
from clutchid.estimation import Fit, LoadCurve
from clutchid.estimation.assess.comparison import ENGAGING, Comparison, comparison

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CAPTION = (
    "Load at the calibration and now, each with its pointwise 95 % band, and the difference of the two loads. Dots "
    "mark half of the peak. The band of the difference treats both loads as independent."
)


def comparison_sections(fit: Fit) -> list[Chapter]:
    """Both loads, and changes since the calibration; none without one."""
    if fit.baseline is None:
        return []
    compared = comparison(fit)
    blocks: list[Block] = [Bullets(tuple(since_calibration(fit) or ["Apart from the load, no change was found."]))]
    if compared is not None:
        alt = "Load of the calibration and present load over the position, and their difference, with 95 % bands"
        blocks += [Text(_halves(compared)), Picture(comparison_figure(compared), _CAPTION, alt), change_table(compared)]
    elif fit.status != "failed":
        blocks.append(
            Text("The file of the calibration has no load, or no load was fitted, so there is nothing to compare.")
        )
    return [Chapter("New against worn", tuple(blocks))]


def _halves(compared: Comparison) -> str:
    """The half-load position now and at the calibration, by how much the answer says that it moved."""
    if not np.isfinite(compared.shift.position):
        return "One of the loads does not reach half of its peak, so its position cannot be compared."
    now, before = (
        f"{at.position / MM:.2f} mm{interval_words(at, behind=' mm at 95 %')}"
        for at in (compared.half_now, compared.half_before)
    )
    return f"The load reaches half of its peak at {now}; at the calibration it did at {before}."


def comparison_figure(compared: Comparison) -> Figure:
    """Both loads with their bands, and below their difference with its band, up to the reach of the recordings."""
    inside = compared.present.position <= compared.reach
    change, present, calibrated = compared.difference, compared.present, compared.calibrated
    difference = LoadCurve(present.position, change.force, change.low, change.high)
    shown = [LoadCurve(*load.table()[inside].T) for load in (calibrated, present, difference)]
    words = ("at the calibration", "now", "now minus calibration")
    figure = two_loads_figure(shown, words, compared.reach)
    for load, half, colour in (
        (calibrated, compared.half_before, STYLE.orange), (present, compared.half_now, STYLE.blue),
    ):  # fmt: skip
        if np.isfinite(half.position):
            force = float(np.interp(half.position, load.position, load.force))
            figure.axes[0].plot([half.position / MM], [force], "o", color=colour, markersize=5, zorder=4)
    return figure


def two_loads_figure(curves: Sequence[LoadCurve], words: Sequence[str], reach: float) -> Figure:
    """Two loads with their bands up to a position in m, and below them their difference; `words` name the three."""
    figure, (loads, difference) = new_figure([3.3, 1.9])
    lines = Line(STYLE.orange, words[0], 2.0), Line(STYLE.blue, words[1], 2.0), Line(STYLE.red, words[2], 1.6)
    for axis in (loads, difference):
        mark_span(axis, ENGAGING[0] / MM, ENGAGING[1] / MM)
    for axis, load, line in zip((loads, loads, difference), curves, lines, strict=True):
        fill(axis, load.position / MM, load.low, load.high, Line(line.colour, opacity=0.2, layer=1))
        draw(axis, load.position / MM, load.force, line)
    difference.axhline(0.0, color=STYLE.ink, linewidth=0.7)
    label(loads, y="load [N]")
    label(difference, "position [mm]", "change [N]")
    loads.set_xlim(0.0, max(reach / MM, 1.0))
    for axis in (loads, difference):
        legend(axis, 4)
    return figure


def change_table(compared: Comparison) -> ReportTable:
    """Both loads and their difference in N and % at every millimetre within the reach."""
    columns = (
        Column("position [m]", "position [mm]", MM, 0), Column("calibrated [N]", "calibrated [N]", 1.0, 0),
        Column("present [N]", "now [N]", 1.0, 0), Column("change [N]", "[N]", 1.0, 0, group="change"),
        Column("low [N]", "from [N]", 1.0, 0, group="change"), Column("high [N]", "to [N]", 1.0, 0, group="change"),
        Column("share [1]", "[%]", 0.01, 1, group="change"),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for position in np.arange(POSITION_STEP, compared.reach + 1e-9, POSITION_STEP):
        curves = compared.calibrated, compared.present
        both = (float(np.interp(position, curve.position, curve.force)) for curve in curves)
        rows.append((float(position), *both, *compared.at(float(position))))
    return ReportTable("Load at the calibration and now", columns, tuple(rows), note="Intervals at 95 %.")

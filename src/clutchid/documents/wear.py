"""Wear of a clutch as a document: trend with bands, alarms, forecast, loads from new to now, recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.document import Chapter, Document, Notice, Picture
from clutchid.documents.figures import draw, fill, label, legend, mark_span, new_figure
from clutchid.documents.results import WornClutch
from clutchid.documents.style import MM, STYLE, Line
from clutchid.documents.tables import Cell, Column, Link, ReportTable
from clutchid.documents.wear_rows import recordings_words, rows_of, wear_json
from clutchid.estimation import LoadCurve
from clutchid.estimation.assess.comparison import ENGAGING
from clutchid.log import FloatArray
from clutchid.names import capital
from clutchid.wear import FALSE_ALARMS, Wear

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Loads that are drawn, at most.
LOADS = 12

#: Names, units and factors of the quantities.
_SHOWN = {
    "wear": ("wear of the facing [mm]", MM),
    "shift": ("shift of the\nhalf-load position [mm]", MM),
    "load": ("change of the load\nover 5 to 8 mm [%]", 0.01),
}


def trend_figure(wear: Wear) -> Figure:
    """Every quantity over the axis: measurements, trend with band given all recordings, alarms, and the limit."""
    names = [name for name in _SHOWN if name in wear.now]
    figure, axes = new_figure([2.0] * len(names))
    s, unit = _scaled(wear.s, wear.axis)
    jumps = [k for k, outcome in enumerate(wear.outcomes) if outcome == "jump"]
    apart = np.insert(s, jumps, s[jumps])  # another clutch is another line
    for axis, name in zip(axes, names, strict=True):
        words, factor = _SHOWN[name]
        value, low, high = (np.insert(side, jumps, np.nan) / factor for side in wear.now[name])
        fill(axis, apart, low, high, Line(STYLE.blue, "95 % band", opacity=0.2))
        draw(axis, apart, value, Line(STYLE.blue, "trend, given all recordings", 1.6))
        if name != "wear":
            _measured(axis, s, wear, name, factor)
        _alarms(axis, s, wear, words=axis is axes[0])
        limited = name == ("wear" if "wear" in wear.now else "shift")
        if limited and wear.limit is not None:
            draw(axis, s[[0, -1]], np.full(2, wear.limit / factor), Line(STYLE.orange, "limit", 1.2, (0, (5, 3))))
        label(axis, y=words)
        legend(axis, 5)
    label(axes[-1], unit)
    return figure


def _alarms(axis: Axes, s: FloatArray, wear: Wear, *, words: bool) -> None:
    """A line for each alarm, with its kind if `words`."""
    places = {job.recording: float(at) for job, at in zip(wear.dated, s, strict=True)}
    for alarm in wear.alarms:
        at = places[alarm.before]
        axis.axvline(at, color=STYLE.red, linewidth=1.2, dashes=(4, 2))
        if words:
            axis.text(
                at, 0.97, f"{alarm.kind} ", color=STYLE.red, rotation=90, ha="right", va="top",
                fontsize=STYLE.font_size - 0.5,
                transform=axis.get_xaxis_transform(),
            )  # fmt: skip


def _scaled(s: FloatArray, unit: str) -> tuple[FloatArray, str]:
    """The axis in thousands where it is long."""
    return (s / 1e3, f"thousand {unit}") if s[-1] - s[0] >= 2e4 else (s, unit)


def _measured(axis: Axes, s: FloatArray, wear: Wear, name: str, factor: float) -> None:
    """The measurements that count, and those that were left out."""
    measured = [reading.measurement for reading in wear.readings]
    values = np.array([getattr(measurement, name) if measurement else np.nan for measurement in measured])
    used = np.array(wear.counted)
    for chosen, mark, colour, words in (
        (used, "o", STYLE.ink, "readings"), (~used, "x", STYLE.red, "left out"),
    ):  # fmt: skip
        if np.isfinite(values[chosen]).any():
            axis.plot(s[chosen], values[chosen] / factor, mark, color=colour, markersize=4, label=words, zorder=1.5)


def life_figure(curves: Sequence[tuple[str, LoadCurve]]) -> Figure:
    """Loads of recordings evenly over the life, from dark (first) to light (last); the band is that of the last."""
    from matplotlib.colors import LinearSegmentedColormap

    figure, (axis,) = new_figure([3.2])
    chosen = [curves[k] for k in np.unique(np.linspace(0, len(curves) - 1, LOADS).round().astype(int))]
    colours = LinearSegmentedColormap.from_list("life", STYLE.ordered)
    mark_span(axis, ENGAGING[0] / MM, ENGAGING[1] / MM)
    last = chosen[-1][1]
    fill(axis, last.position / MM, last.low, last.high, Line(STYLE.measured, "95 % band, last", opacity=0.25))
    for k, (name, curve) in enumerate(chosen):
        ends = name if k in (0, len(chosen) - 1) else ""
        share = k / max(len(chosen) - 1, 1)
        colour = "#{:02x}{:02x}{:02x}".format(*(round(255 * part) for part in colours(share)[:3]))
        draw(axis, curve.position / MM, curve.force, Line(colour, ends, 1.4))
    top = max(float(np.nanmax(curve.force)) for _, curve in chosen)
    axis.set_ylim(-0.05 * top, 1.15 * top)
    axis.set_xlim(0.0, float(last.position[-1]) / MM)
    label(axis, "position [mm]", "load [N]")
    legend(axis, 3)
    return figure


_BY_TYPE = (
    " What is left follows from the recordings of this vehicle alone; the tables of the fleet also use those of the "
    "other vehicles of its type, so that their numbers differ."
)
_TREND = (
    "Estimates from single recordings, and the trend with its 95 % band. The estimates may all lie on one side of "
    "the trend: errors that all recordings of a vehicle share, and errors due to air temperature, are removed from "
    "the trend as far as they can be estimated, and its band covers the rest."
)
_ALARMS = " Red and dashed: alarms."
_TEST = f"The test for changes gives one false alarm in about {1 / FALSE_ALARMS:,.0f} recordings."
_LOADS = (
    "Load over the position of the piston for recordings spread evenly over the life, from dark (first) to light "
    "(last). Shaded: 5 to 8 mm, where the clutch engages."
)


def wear_document(clutch: WornClutch, command: str = "") -> Document:
    """Document of the wear of a clutch."""
    wear = clutch.wear
    counted = any(wear.counted)
    return Document(
        f"Wear of the clutch of {wear.vehicle}" if wear.vehicle else "Wear of a clutch",
        f"Recordings: {recordings_words(wear)}",
        tuple(rows_of(wear)),
        notices=tuple(_notices(wear)),
        figure=(lambda: _trend(clutch)) if counted else None,
        sections=lambda: _sections(clutch),
        data=lambda: wear_json(wear, clutch.left_out),
        command=command,
        home=Link("Back to the fleet", clutch.home) if clutch.home else None,
    )


def _sections(clutch: WornClutch) -> list[Chapter]:
    sections = [Chapter("Recordings", (recordings_table(clutch.wear),))]
    if curves := clutch.wear.curves:
        sections.insert(0, Chapter("Load from new to now", (Picture(life_figure(curves), _LOADS, "Loads"),)))
    return sections


def _notices(wear: Wear) -> Iterator[Notice]:
    yield from (Notice(capital(warning)) for warning in wear.warnings)
    if not any(wear.counted):
        yield Notice("No recording determines the wear.", "none")
        return
    if not wear.alarms:
        yield Notice("No sudden change of the load was found, and no leak.", "good")


def _trend(clutch: WornClutch) -> Picture:
    wear = clutch.wear
    by_type = _BY_TYPE if wear.left and clutch.home else ""
    caption = f"{_TREND}{_ALARMS if wear.alarms else ''} {_TEST}{by_type}"
    return Picture(trend_figure(wear), caption, "Trend of the wear with its band")


def recordings_table(wear: Wear) -> ReportTable:
    """A row a recording, with why it does not count, or a message where it is not only that the fit converged."""
    columns = (
        Column("recording", "recording"), Column("begin", "begin", date=True),
        Column("strokes [1]", "strokes", decimals=0), Column("shift [m]", "shift\n[mm]", MM, 3),
        Column("load [1]", "load\n[%]", 0.01, 1), Column("trust", "trust"),
        Column("outcome", "in the trend"), Column("message", "reason or message"),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for job, reading, outcome, reason in wear.rows:
        begin = f"{job.begin:%Y-%m-%d}" if job.begin else None
        shift, load = (reading.measurement.shift, reading.measurement.load) if reading.measurement else (None, None)
        message = reason or ("" if reading.status == "ok" else reading.message)
        rows.append((job.recording, begin, job.strokes, shift, load, reading.trust, outcome, message))
    note = "Files without an estimate have no place in this order and come last." if wear.apart else ""
    return ReportTable("Recordings in the order of the life", columns, tuple(rows), note=note)

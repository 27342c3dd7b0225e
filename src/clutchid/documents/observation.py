"""Page of an observed recording: load before and after, by stroke, samples, parameters, health."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.documents.comparison import two_loads_figure
from clutchid.documents.diagnosis import limit_blocks
from clutchid.documents.document import Block, Chapter, Details, Document, Notice, Picture, Text, page_rows, sources_of
from clutchid.documents.figures import (
    draw,
    draw_duties,
    draw_over_time,
    fill,
    fill_over_time,
    label,
    legend,
    new_figure,
)
from clutchid.documents.fit_json import curve_json
from clutchid.documents.innovations import innovation_blocks
from clutchid.documents.observation_rows import observe_json, rows_of
from clutchid.documents.results import Observation
from clutchid.documents.style import BAR, MM, STYLE, Line
from clutchid.documents.tables import Cell, Column, ReportTable
from clutchid.estimation import Estimate, LoadCurve
from clutchid.estimation.assess.innovations import innovation_statistics
from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.log import FloatArray
from clutchid.numerics.interval import QUANTILE
from clutchid.observer import Loads, ObservedRecording, curve, curve_positions, estimates_of, loads, start
from clutchid.observer.flags import FLAGS, LIVE_FLAGS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Positions in m at which the load is drawn by stroke.
_FOLLOWED = (3e-3, 6e-3, 12e-3)

#: Units of differences of pressures in Pa and of positions in m.
_KPA, _MICRO = 1e3, 1e-6

#: Percentage of the innovations that the figure has room for.
_SHOWN = 99.0


def loads_figure(both: Loads) -> Figure:
    """The load before and after a recording with their bands, and below the change with the band of the load after."""
    before, after = both.before, both.after
    change = LoadCurve(after.position, *(side - before.force for side in (after.force, after.low, after.high)))
    words = ("before the recording", "after the recording", "after minus before, with the band after")
    figure = two_loads_figure((before, after, change), words, float(after.position[-1]))
    _limit(figure.axes[0], np.concatenate([before.force, after.force, [0.0]]), 0.15)
    _limit(figure.axes[1], np.append(change.force, 0.0), 1.0)
    return figure


def _limit(axis: Axes, values: FloatArray, part: float) -> None:
    """Limits for some values with a part of their range on both sides, however wide a band is."""
    low, high = float(values.min()), float(values.max())
    room = part * max(high - low, 1e-3)
    lowest, highest = axis.get_ylim()
    axis.set_ylim(max(lowest, low - room), min(highest, high + room))


def strokes_figure(run: ObservedRecording) -> Figure:
    """The load at three positions over the number of the stroke, with its band; first that before the recording."""
    from matplotlib.ticker import MaxNLocator

    grid = curve_positions(run.observer)
    curves: list[LoadCurve] = [curve(run.observer, run.before, grid), *(row.curve for row in run.strokes)]
    number = np.array([run.before.strokes, *(row.number for row in run.strokes)], dtype=np.float64)
    places = [int(np.argmin(np.abs(grid - position))) for position in _FOLLOWED if position <= grid[-1]]
    figure, axes = new_figure([1.25] * len(places))
    for axis, at in zip(axes, places, strict=True):
        force, low, high = (np.array([getattr(load, side)[at] for load in curves]) for side in ("force", "low", "high"))
        fill(axis, number, low, high, Line(STYLE.blue, "95 % band", opacity=0.2))
        draw(axis, number, force, Line(STYLE.blue, "load", 1.6))
        axis.plot(number, force, "o", color=STYLE.blue, markersize=2.8)
        _limit(axis, np.concatenate([force, low[1:], high[1:]]), 0.2)
        label(axis, y=f"at {grid[at] / MM:.0f} mm [N]")
    axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
    label(axes[-1], "stroke")
    legend(axes[0], 4)
    return figure


def samples_figure(run: ObservedRecording) -> Figure:
    """Position, pressure in chamber A with its band, innovations with their bounds, and duty cycles, over time.

    Where the pressure was measured, its difference to the estimate follows.
    """
    log, states = run.log, run.observer.actuator.states
    with_pressure = "pressure_a" in log
    figure, axes = new_figure([1.6, 1.9, *([1.15] if with_pressure else []), 1.15, 1.05])
    position, pressure, innovation, duty = axes[0], axes[1], axes[-2], axes[-1]
    y, p = (run.samples.states[:, states.index(name)] for name in ("y", "p_A"))
    t, h = log.time, QUANTILE * run.deviation("p_A")
    draw_over_time(position, t, log["position"] / MM, Line(STYLE.measured, "measured", 2.2))
    draw_over_time(position, t, y / MM, Line(STYLE.blue, "estimated"))
    if with_pressure:
        draw_over_time(pressure, t, log["pressure_a"] / BAR, Line(STYLE.measured, "measured, not used", 2.2))
        fill_over_time(axes[2], t, -h / _KPA, h / _KPA, Line(STYLE.blue, "95 % band", opacity=0.35, layer=3))
        draw_over_time(
            axes[2], t, (log["pressure_a"] - p) / _KPA, Line(STYLE.measured, ("measured minus estimated"), 0.8)
        )
        label(axes[2], y="difference\n[kPa]")
    fill_over_time(pressure, t, (p - h) / BAR, (p + h) / BAR, Line(STYLE.blue, "95 % band", opacity=0.3))
    draw_over_time(pressure, t, p / BAR, Line(STYLE.blue, "estimated from the position"))
    _innovations(innovation, run)
    draw_duties(duty, log)
    label(position, y="position [mm]")
    label(pressure, y="pressure A,\nabsolute [bar]")
    label(innovation, y="innovation\n[µm]")
    for axis in axes:
        legend(axis, 4)
    return figure


def _innovations(axis: Axes, run: ObservedRecording) -> None:
    """Innovations with their 95 % bounds."""
    innovations, variance = run.samples.innovations.T
    corrected = np.isfinite(innovations)
    innovation, bound = innovations[corrected] / _MICRO, QUANTILE * np.sqrt(variance[corrected]) / _MICRO
    t = run.log.time[corrected]
    fill_over_time(axis, t, -bound, bound, Line(STYLE.measured, "95 % bounds", opacity=0.3))
    draw_over_time(axis, t, innovation, Line(STYLE.red, "position, measured minus predicted", 0.8))
    if corrected.any():
        most = 1.5 * float(np.nanpercentile(np.fmax(bound, np.abs(innovation)), _SHOWN))
        axis.set_ylim(-most, most)


_AFTER = "after the recording"
_MEANINGS = {**FLAGS, **LIVE_FLAGS}
_LOADS = (
    "Load before and after the recording over the position of the piston, each with its pointwise 95 % band, and "
    "the change. The band before the recording allows for wear since the calibration. Shaded: 5 to 8 mm, where the "
    "clutch engages."
)
_STROKES = (
    "Load at three positions after each stroke, with its 95 % band; the first point is the load before the recording."
)
_SAMPLES = (
    "Position and pressure estimated at each sample from the samples up to it, the innovations (measured minus "
    "predicted) with their 95 % bounds, and the duty cycles."
)
_LOADS_ALT = "Load before and after the recording over the position, and its change, with 95 % bands"


def observe_document(observation: Observation, command: str = "") -> Document:
    """Document of an observed recording."""
    run, origin = observation
    name = origin.name or "a calibration that is not from a file"
    observer = run.observer
    log = run.log
    return Document(
        f"Load and pressure of {log.name}, on line",
        f"Model {observer.actuator.model}; method {observer.method}; started from {name}.",
        tuple(rows_of(run)),
        notices=(*map(Notice, log.warnings), _flags(run)),
        figure=lambda: Picture(loads_figure(loads(run)), _LOADS, _LOADS_ALT),
        sections=lambda: observe_sections(run),
        data=lambda: observe_json(run, origin),
        command=command,
        sources=sources_of([log]),
    )


def observation_data(observation: Observation) -> dict[str, Any]:
    """Data of an observed recording for the local page: loads by stroke, rows, and the next step."""
    run = observation.run
    time, grid = run.log.time, curve_positions(run.observer)
    loads = [(float(time[0]), 0, curve(run.observer, run.before, grid))]
    loads += [(row.time, row.number, row.curve) for row in run.strokes]
    rows = page_rows(observe_document(observation))
    wrong = any(row["mood"] == "none" for row in rows)
    kind, why = (
        ("correct", ("correct the problems that the reasons name"))
        if wrong
        else ("export", "export the observer for a control unit")
    )
    return {
        "span": [float(time[0]), float(time[-1])],
        "reach_m": float(np.nanmax(run.log["position"])),
        "calibrated": curve_json(curve(run.observer, start(run.observer), grid)),
        "loads": [{"time": at, "stroke": number, "curve": curve_json(load)} for at, number, load in loads],
        "faults": [*_flags(run).items],
        "summary": rows,
        "next": {"kind": kind, "why": why, "command": ""},
        "warnings": [*run.log.warnings],
    }


def _flags(run: ObservedRecording) -> Notice:
    raised = [f"{_MEANINGS[name]}: {seconds:.3g} s" for name, seconds in run.health.items() if seconds > 0.0]
    return Notice("Flags", items=tuple(raised)) if raised else Notice("No fault was found.", "good")


def observe_sections(run: ObservedRecording) -> list[Chapter]:
    """Load by stroke, samples, innovations, parameters and flags."""
    innovations = innovation_blocks(run.log.name, innovation_statistics(run))
    limits = limit_blocks(observed_verdict(indicators(run)))
    samples = Picture(samples_figure(run), f"{run.log.name}. {_SAMPLES}", "Samples over time", dense=True)
    return [
        Chapter("Load by stroke", _by_stroke(run)),
        Chapter("Samples", (samples,)),
        *([Chapter("Innovations", innovations)] if innovations else []),
        Chapter("Parameters", _parameters(run)),
        *([Chapter("Limits of the result", limits)] if limits else []),
    ]


def _by_stroke(run: ObservedRecording) -> tuple[Block, ...]:
    if not run.strokes:
        return (Text("No stroke ended in the recording."),)
    return (Picture(strokes_figure(run), _STROKES, "Load at three positions by stroke"),)


def _parameters(run: ObservedRecording) -> tuple[Block, ...]:
    """Parameters and load weights that adapt, before and after; none if the load stays as calibrated."""
    names, weights = run.observer.adapting, run.observer.actuator.load.names
    if not names:
        return (Text("The observer does not adapt: load and parameters keep their calibrated values."),)
    parameters = [name for name in names if name not in weights]
    others = (adapted_table(run, "Parameters that adapt", parameters),) if parameters else ()
    table = adapted_table(run, "Load weights", [name for name in names if name in weights])
    return (*others, Details("Load weights", (table,)))


def adapted_table(run: ObservedRecording, title: str, names: Sequence[str]) -> ReportTable:
    """Some parameters, with their meaning, or load weights, before and after the recording."""
    actuator = run.observer.actuator
    before, after = (estimates_of(run.observer, state) for state in (run.before, run.after))
    meant = not set(names) & set(actuator.load.names)
    columns = (
        Column("name", "parameter"), Column("unit", "unit"), Column("before", "before", significant=4),
        Column("after", "value", significant=4, group=_AFTER),
        Column("std", "standard\ndeviation", significant=2, group=_AFTER),
        Column("low", "95 %\nfrom", significant=4, group=_AFTER), Column("high", "to", significant=4, group=_AFTER),
        *([Column("meaning", "meaning")] if meant else []),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (
            name, actuator.unit(name), _rounded(before[name]),
            after[name].value, after[name].std, after[name].low, after[name].high,
            *([actuator.row(name).meaning] if meant else []),
        )
        for name in names
    ]  # fmt: skip
    return ReportTable(title, columns, tuple(rows))


def _rounded(estimate: Estimate) -> float:
    """A value, 0 where it differs from that by rounding only."""
    return estimate.value if abs(estimate.value) > 1e-6 * estimate.std else 0.0

"""A fleet as a document: distribution of wear, worst and odd vehicles, failures by reason, and all vehicles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clutchid.documents.document import Block, Chapter, Document, LabelRow, Markup, Notice, Picture, Sortable, Text
from clutchid.documents.figures import label, legend, new_figure
from clutchid.documents.fleet_tables import (
    MARKS,
    ODD_AT_LEAST,
    ODD_SCORE,
    OddVehicle,
    Spans,
    VehicleRow,
    all_table,
    has_reading,
    left_shown,
    odd_tables,
    odd_vehicles,
    quantiles,
    quantity_of,
    reasons_table,
    spans_of,
    types_table,
    worst_table,
)
from clutchid.documents.results import FleetWear
from clutchid.documents.style import MM, STYLE
from clutchid.log import FloatArray
from clutchid.names import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Types that have a colour of their own; more of them could not be distinguished.
_TYPES = 6

#: Bars of a histogram, at most.
_BARS = 40

_COLOURS = (STYLE.blue, STYLE.orange, STYLE.green, STYLE.purple, STYLE.red, STYLE.measured)


class Panel(NamedTuple):
    """A histogram: words of its axis, a value a vehicle, (n,), NaN where unknown."""

    words: str
    values: FloatArray


def panels_of(vehicles: Sequence[VehicleRow], spans: Spans) -> list[Panel]:
    """Wear where it is known, shift where a vehicle has only that, and what is left, where there is a limit."""
    wear = np.array([vehicle.wear.value for vehicle in vehicles]) / MM
    shift = np.array([vehicle.shift.value for vehicle in vehicles]) / MM
    left = np.array([left_shown(vehicle, spans).value for vehicle in vehicles])
    panels = [
        Panel("wear of the facing [mm]", wear),
        Panel("shift of the half-load position [mm]", np.where(np.isfinite(wear), np.nan, shift)),
        Panel(f"left, median [{spans.left_words}]", left),
    ]
    return [panel for panel in panels if np.isfinite(panel.values).any()]


def distribution_figure(vehicles: Sequence[VehicleRow], spans: Spans) -> Figure:
    """A histogram a quantity, stacked by type where there are few; at least one value must be known."""
    panels = panels_of(vehicles, spans)
    figure, axes = new_figure([2.5] * len(panels), share_x=False)
    types = np.array([vehicle.type for vehicle in vehicles])
    names = [name for name, _ in Counter(types.tolist()).most_common()]
    groups = [(f"type {printable(name)[:24]}" if name else "no type", types == name) for name in names]
    if len(names) > _TYPES:
        groups = [("", np.ones(types.size, dtype=bool))]
    for axis, panel in zip(axes, panels, strict=True):
        _histogram(axis, panel, groups)
        label(axis, y="vehicles")
    if len(groups) > 1:
        legend(axes[0], _TYPES)
    return figure


def _histogram(axis: Axes, panel: Panel, groups: Sequence[tuple[str, np.ndarray]]) -> None:
    """Bars over the range of nearly all values; how many lie outside stands below them."""
    from matplotlib.ticker import MaxNLocator

    finite = panel.values[np.isfinite(panel.values)]
    low, high = _range(finite)
    edges = np.linspace(low, high, int(np.clip(2 * np.sqrt(finite.size), 5, _BARS)) + 1)
    bottom = np.zeros(edges.size - 1)
    for (words, group), colour in zip(groups, _COLOURS, strict=False):
        number = np.histogram(panel.values[group & np.isfinite(panel.values)], edges)[0]
        axis.bar(
            edges[:-1], number, np.diff(edges), bottom, align="edge", color=colour, edgecolor="white", linewidth=0.4,
            label=words,
        )  # fmt: skip
        bottom = bottom + number
    axis.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    margin = 0.5 * (edges[1] - edges[0])
    axis.set_xlim(low - margin, high + margin)
    axis.set_ylim(0.0, max(1.0, 1.12 * bottom.max()))
    axis.set_xlabel(panel.words + _outside(panel.values, low, high), fontsize=STYLE.font_size, color=STYLE.ink)


def _range(values: FloatArray) -> tuple[float, float]:
    """From the smallest to the greatest, but at most half their 98 % span beyond it."""
    first, last = np.quantile(values, (0.01, 0.99))
    margin = 0.5 * (last - first)
    low, high = float(max(values.min(), first - margin)), float(min(values.max(), last + margin))
    around = 0.05 * max(abs(low), abs(high)) or 0.5
    return (low, high) if high - low > 1e-6 * around else (low - around, high + around)


def _outside(values: FloatArray, low: float, high: float) -> str:
    """Number of vehicles that are not drawn, in words."""
    below, above = int(np.sum(values < low)), int(np.sum((values > high) & np.isfinite(values)))
    endless, unknown = int(np.sum(np.isposinf(values))), int(np.sum(np.isnan(values)))
    counts = {"below": below, "above": above, "with no end in sight": endless, "unknown": unknown}
    shown = ", ".join(f"{number:,} {words}" for words, number in counts.items() if number)
    return f"; not drawn: {shown}" if shown else ""


#: Vehicles below which the range of all is said in place of that of nine in ten.
_FEW = 20


def fleet_document(fleet: FleetWear, command: str = "") -> Document:
    """Document of a fleet, whose page leads to those of its vehicles."""
    vehicles, spans = fleet.vehicles, spans_of(fleet.vehicles)
    measured = [vehicle for vehicle in vehicles if has_reading(vehicle)]
    counted = f"{len(measured):,} of {_number(len(vehicles), 'vehicle')} have readings of the clutch"
    rows = [LabelRow("wear", f"{counted}. {_spread(measured)}")] if measured else []
    return Document(
        "Wear of a fleet", _subtitle(vehicles), tuple(rows),
        notices=() if measured else (Notice("No recording determines the wear of a vehicle.", "none"),),
        figure=(lambda: _distribution(vehicles, measured, spans)) if measured else None,
        sections=lambda: _sections(fleet, spans),
        command=command,
    )  # fmt: skip


def _sections(fleet: FleetWear, spans: Spans) -> list[Chapter]:
    vehicles, odd = fleet.vehicles, odd_vehicles(fleet.vehicles, spans)
    failures = reasons_table(fleet.reasons) if fleet.reasons else Notice("Every recording counts.", "good")
    sections = []
    if any(map(has_reading, vehicles)):
        limited = any(not np.isnan(vehicle.left.value) for vehicle in vehicles)
        sections.append(Chapter("By type", (types_table(vehicles, spans),)))
        heading = "Soonest at their limit" if limited else "Most worn"
        sections.append(Chapter(heading, (worst_table(vehicles, spans),)))
    sections.append(Chapter("Odd vehicles", _odd(odd)))
    sections.append(Chapter("Recordings that do not count", (failures,)))
    if vehicles:
        sections.append(Chapter("All vehicles", (Sortable(all_table(vehicles, odd, spans)),)))
    return sections


def _subtitle(vehicles: Sequence[VehicleRow]) -> str:
    statuses: Counter[str] = Counter()
    for vehicle in vehicles:
        statuses.update(vehicle.statuses)
    recordings = sum(vehicle.recordings for vehicle in vehicles)
    by_status = ", ".join(
        f"{number:,} {status.replace('_', ' ')}" for status, number in statuses.most_common() if number
    )
    words = f"{_number(len(vehicles), 'vehicle')}, {_number(recordings, 'recording')}"
    return f"{words}: {by_status}" if by_status else words


def _distribution(vehicles: Sequence[VehicleRow], measured: Sequence[VehicleRow], spans: Spans) -> Picture:
    what = "their wear" if quantity_of(measured) == "wear" else "the shift of their half-load position"
    more = " and by what is left until their limit" if any(np.isfinite(row.left.value) for row in vehicles) else ""
    caption = f"Vehicles by {what} now{more}. In all figures and tables, changes are since the calibration of the type."
    return Picture(distribution_figure(vehicles, spans), caption, "Histograms of wear and of what is left")


def _spread(vehicles: Sequence[VehicleRow]) -> str:
    """The median and the range of nine vehicles in ten; of all where there are few, and of two that only."""
    name = quantity_of(vehicles)
    few = len(vehicles) < _FEW
    shares = (0.0, 0.5, 1.0) if few else (0.05, 0.5, 0.95)
    low, median, high = (
        f"{value / MM:.3f}".replace("-", "−")
        for value in quantiles([getattr(vehicle, name).value for vehicle in vehicles], shares)
        if value is not None
    )
    if len(vehicles) < 3:
        return f"Their {name} is {low} and {high} mm." if len(vehicles) == 2 else f"Its {name} is {median} mm."
    return f"The median {name} is {median} mm; {'all' if few else 'nine of ten'} are between {low} and {high} mm."


def _odd(odd: Sequence[OddVehicle]) -> tuple[Block, ...]:
    if not odd:
        return (Notice("No vehicle stands out.", "good"),)
    counts = Counter(vehicle.mark for vehicle in odd)
    links = ", ".join(
        f'<a href="#filter={mark.replace(" ", "+")}">{mark}</a> ({counts[mark]:,})' for mark in MARKS if counts[mark]
    )
    rule = (
        f"A rate is fast or slow where its robust z score among at least {ODD_AT_LEAST} vehicles of the type, from "
        f"their median and median absolute deviation, is beyond {ODD_SCORE}."
    )
    return Text(Markup(f"All of them, in the table of all vehicles: {links}. {rule}")), *odd_tables(odd)


def _number(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"

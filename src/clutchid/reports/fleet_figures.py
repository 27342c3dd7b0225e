"""Figure of a fleet: how wear, or shift, and what is left are distributed over its vehicles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clutchid.log import FloatArray
from clutchid.names import printable
from clutchid.reports.figures import label, legend, new_figure
from clutchid.reports.fleet_values import Spans, VehicleRow, left_shown
from clutchid.reports.style import MM, STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Types that have a colour of their own; more of them could not be distinguished.
TYPES = 6

#: Bars of a histogram, at most.
BARS = 40

_COLOURS = (STYLE.blue, STYLE.orange, STYLE.green, STYLE.purple, STYLE.red, STYLE.measured)


class Panel(NamedTuple):
    """A histogram: words of its axis, a value a vehicle, (n,), NaN where unknown."""

    words: str
    values: FloatArray


def panels_of(vehicles: Sequence[VehicleRow], spans: Spans) -> list[Panel]:
    """Wear where it is known, shift where a vehicle has only that, and what is left, where there is a limit."""
    wear = np.array([one.wear for one in vehicles]) / MM
    shift = np.array([one.shift for one in vehicles]) / MM
    left = np.array([left_shown(one, spans)[1] for one in vehicles])
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
    types = np.array([one.type for one in vehicles])
    names = [name for name, _ in Counter(types.tolist()).most_common()]
    groups = [types == name for name in names] if len(names) <= TYPES else [np.ones(types.size, dtype=bool)]
    for axis, panel in zip(axes, panels, strict=True):
        _histogram(axis, panel, groups)
        label(axis, y="vehicles")
    if 1 < len(names) <= TYPES:
        _name_types(axes[0], names)
    return figure


def _histogram(axis: Axes, panel: Panel, groups: Sequence[np.ndarray]) -> None:
    """Bars over the range of nearly all values; how many lie outside stands below them."""
    from matplotlib.ticker import MaxNLocator

    finite = panel.values[np.isfinite(panel.values)]
    low, high = _range(finite)
    edges = np.linspace(low, high, int(np.clip(2 * np.sqrt(finite.size), 5, BARS)) + 1)
    bottom = np.zeros(edges.size - 1)
    for group, colour in zip(groups, _COLOURS, strict=False):
        number = np.histogram(panel.values[group & np.isfinite(panel.values)], edges)[0]
        axis.bar(
            edges[:-1], number, np.diff(edges), bottom, align="edge", color=colour, edgecolor="white", linewidth=0.4
        )
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
    """How many vehicles are not drawn, in words."""
    below, above = int(np.sum(values < low)), int(np.sum((values > high) & np.isfinite(values)))
    endless, unknown = int(np.sum(np.isposinf(values))), int(np.sum(np.isnan(values)))
    counts = {"below": below, "above": above, "with no end in sight": endless, "unknown": unknown}
    shown = ", ".join(f"{number:,} {words}" for words, number in counts.items() if number)
    return f"; not drawn: {shown}" if shown else ""


def _name_types(axis: Axes, names: Sequence[str]) -> None:
    from matplotlib.patches import Patch

    marks = [Patch(color=colour) for colour, _ in zip(_COLOURS, names, strict=False)]
    words = [f"type {printable(name)[:24]}" if name else "no type" for name in names]
    legend(axis, TYPES, (marks, words))

"""Figures by matplotlib's object interface, without pyplot, backends or global settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING, Literal

import numpy as np

from clutchid.documents.style import STYLE, Line
from clutchid.log import HOLE, FloatArray, Log, sample_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

#: Style of all lines of matplotlib's SVG; in a style sheet within an HTML page it would apply to the whole page.
_JOINTS = "stroke-linejoin: round; stroke-linecap: butt"

#: Curves with more samples than twice this are decimated before they are drawn.
BINS = 1500

#: Greatest share of the width of a figure that a legend has, beside the labels of the axis.
_LEGEND_SHARE = 0.85


def new_figure(heights: Sequence[float], columns: int = 1, *, share_x: bool = True) -> tuple[Figure, list[Axes]]:
    """An empty figure with a panel per entry of `heights` (inches) and column, row by row.

    By default, panels in a column share x, and panels in a row share y.
    """
    from matplotlib.figure import Figure

    rows: Literal["row", "none"] = "row" if columns > 1 else "none"
    figure = Figure(figsize=(STYLE.width, sum(heights)), dpi=STYLE.dpi, facecolor="white", layout="constrained")
    grid = figure.subplots(
        len(heights), columns, sharex="col" if share_x else False, sharey=rows, squeeze=False,
        gridspec_kw={"height_ratios": list(heights)},
    )  # fmt: skip
    axes = [axis for row in grid for axis in row]
    for axis in axes:
        axis.set_axisbelow(True)
        axis.grid(visible=True, color=STYLE.grid, linewidth=0.7)
        axis.spines[["top", "right"]].set_visible(False)
        axis.spines[["left", "bottom"]].set_color(STYLE.measured)
        axis.tick_params(labelsize=STYLE.font_size, color=STYLE.measured, labelcolor=STYLE.ink)
    figure.align_ylabels()
    return figure, axes


def label(axis: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Axis labels with units, as in ``position [mm]``, and a left-aligned title above the panel."""
    if x:
        axis.set_xlabel(x, fontsize=STYLE.font_size, color=STYLE.ink)
    if y:
        axis.set_ylabel(y, fontsize=STYLE.font_size, color=STYLE.ink)
    if title:
        axis.set_title(title, fontsize=STYLE.font_size + 0.5, color=STYLE.ink, loc="left", fontweight="bold")


def legend(axis: Axes, columns: int = 4) -> None:
    """Legend of what is labelled in a panel, above it, where it covers no curve, in as many columns as fit."""
    _in_columns(axis, columns, partial(axis.legend, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.1))


def shared_legend(axis: Axes, columns: int = 4) -> None:
    """Legend above the figure of a panel, for several with the same curves, or with titles of their own."""
    _in_columns(axis, columns, partial(_figure_of(axis).legend, loc="outside upper left"))


def _figure_of(axis: Axes) -> Figure:
    figure = axis.get_figure(root=True)
    assert figure is not None
    return figure


def _in_columns(axis: Axes, columns: int, place: Callable[..., Legend]) -> None:
    """A legend in as many of the columns as fit the width of the panels; none without a label."""
    entries = axis.get_legend_handles_labels()
    figure = _figure_of(axis)
    most = _LEGEND_SHARE * figure.get_figwidth() * figure.dpi
    for number in range(min(columns, len(entries[0])), 0, -1):
        box = place(
            *entries, ncols=number, fontsize=STYLE.font_size - 0.5, frameon=False, handlelength=1.6, columnspacing=1.3
        )
        for text in box.get_texts():
            text.set_parse_math(False)  # a name of a recording may have a $
        if number == 1 or box.get_window_extent().width <= most:
            return
        box.remove()


def draw(axis: Axes, x: FloatArray, y: FloatArray, line: Line) -> None:
    """Draw a curve, decimated so that all extremes stay visible; NaN leaves a gap."""
    x, y = thinned(x, y)
    axis.plot(
        x, y, color=line.colour, linewidth=line.width, linestyle=line.dash, alpha=line.opacity,
        label=line.label or "_nolegend_", solid_joinstyle="round", zorder=line.layer,
    )  # fmt: skip


def draw_over_time(axis: Axes, time: FloatArray, y: FloatArray, line: Line) -> None:
    """Draw a curve over time; a hole in time leaves a gap."""
    t, (values,) = with_gaps(time, [y])
    draw(axis, t, values, line)


def fill_over_time(axis: Axes, time: FloatArray, low: FloatArray, high: FloatArray, line: Line) -> None:
    """Draw a band over time; a hole in time leaves a gap."""
    t, (below, above) = with_gaps(time, [low, high])
    fill(axis, t, below, above, line)


def with_gaps(time: FloatArray, columns: Sequence[FloatArray]) -> tuple[FloatArray, list[FloatArray]]:
    """Curves with NaN in the holes in time, enough of them that a decimated curve has a gap as well.

    Examples
    --------
    >>> with_gaps(np.array([0.0, 1.0, 2.0, 9.0]), [np.ones(4)])[1]
    [array([ 1.,  1.,  1., nan, nan, nan,  1.])]
    """
    holes = np.flatnonzero(np.diff(time) > HOLE * sample_interval(time, np.inf))
    count = 2 * -(-time.size // BINS) + 1
    at = np.repeat(holes + 1, count)
    between = (time[holes, None] + np.diff(time)[holes, None] * np.linspace(0.0, 1.0, count + 2)[1:-1]).ravel()
    return np.insert(time, at, between), [np.insert(column, at, np.nan) for column in columns]


def fill(axis: Axes, x: FloatArray, low: FloatArray, high: FloatArray, line: Line) -> None:
    """Draw a band between two curves, decimated so that its extremes stay visible; NaN leaves a gap."""
    x, low, high = thinned_band(x, low, high)
    axis.fill_between(
        x, low, high, where=(np.isfinite(low) & np.isfinite(high)).tolist(), color=line.colour, alpha=line.opacity,
        linewidth=0, label=line.label or "_nolegend_", zorder=line.layer,
    )  # fmt: skip


def draw_duties(axis: Axes, log: Log) -> None:
    """Draw the duty cycles of both valves over time, in the lowest panel of a figure."""
    draw_over_time(axis, log.time, log["duty_supply"], Line(STYLE.green, "supply", 0.9))
    draw_over_time(axis, log.time, -log["duty_exhaust"], Line(STYLE.purple, "exhaust (negative)", 0.9))
    label(axis, "time [s]", "duty cycle [1]")
    axis.set_xlim(float(log.time[0]), float(log.time[-1]))


def thinned_band(
    x: FloatArray, low: FloatArray, high: FloatArray, bins: int = BINS
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Decimate a band: minimum and maximum of every bin, at its first x."""
    if x.size <= 2 * bins:
        return x, low, high
    starts = np.arange(0, x.size, -(-x.size // bins))
    return x[starts], np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)


def thinned(x: FloatArray, y: FloatArray, bins: int = BINS) -> tuple[FloatArray, FloatArray]:
    """Decimate a curve: minimum and maximum of every bin, in their original order.

    Examples
    --------
    A spike of one sample in a million is kept:

    >>> y = np.zeros(1_000_000)
    >>> y[123_456] = 1.0
    >>> x, y = thinned(np.arange(1e6), y)
    >>> x.size, y.max()
    (3000, np.float64(1.0))
    """
    if y.size <= 2 * bins:
        return x, y
    width = -(-y.size // bins)
    padded = np.full((-(-y.size // width), width), np.nan)
    padded.ravel()[: y.size] = y
    unknown = np.isnan(padded)
    lowest = np.where(unknown, np.inf, padded).argmin(axis=1)
    highest = np.where(unknown, -np.inf, padded).argmax(axis=1)
    pairs = np.sort(np.column_stack([lowest, highest]), axis=1) + width * np.arange(len(padded))[:, None]
    at = pairs.ravel()
    return x[at], y[at]


def mark_span(axis: Axes, low: float, high: float, text: str = "") -> None:
    """Shade a range of x behind the curves, in the units of the axis."""
    axis.axvspan(low, high, color=STYLE.span, zorder=0, linewidth=0, label=text or "_nolegend_")


def svg(figure: Figure) -> str:
    """The figure as an SVG element for an HTML page, its text as outlines; reproducible byte by byte."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = BytesIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with rc_context({"svg.hashsalt": "clutchid", "svg.fonttype": "path"}):
        # Figure.savefig draws once more, for the layout
        FigureCanvasSVG(figure).print_svg(buffer, metadata=nothing)  # type: ignore[no-untyped-call]
    text = buffer.getvalue().decode("utf-8")
    element = text[text.index("<svg") :].replace(f'<style type="text/css">*{{{_JOINTS}}}</style>', "")
    return element.replace("<svg", f'<svg style="{_JOINTS}; max-width: 100%; height: auto"', 1)


def png(figure: Figure) -> bytes:
    """The figure as a PNG file; reproducible byte by byte."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    buffer = BytesIO()
    FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None})  # type: ignore[no-untyped-call]
    return buffer.getvalue()

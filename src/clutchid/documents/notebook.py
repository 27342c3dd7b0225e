"""Figures and HTML of logs, simulations and fits, as notebooks show them."""

from __future__ import annotations

from functools import partial
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.figures import draw_over_time, fill_over_time, label, legend, new_figure, svg
from clutchid.documents.style import BAR, MM, STYLE, Line
from clutchid.log import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from clutchid.estimation.result import Fit
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
    figure.align_ylabels()
    return figure


def figure_of(shown: Log | Simulation | Fit) -> Figure:
    """The columns of a log or a simulation over time, or the load of a fit with its band."""
    if isinstance(shown, Log):
        return _displayed(log_figure(shown))
    from clutchid.simulation.simulation import Simulation  # loaded, as `shown` is of it or of what needs it

    if isinstance(shown, Simulation):
        return _displayed(log_figure(shown.log))
    from clutchid.documents.fit_figures import load_figure

    return _displayed(load_figure(shown.raised()))


def _displayed(figure: Figure) -> Figure:
    """The figure, which a notebook shows as SVG although pyplot does not know it."""
    figure._repr_svg_ = partial(svg, figure)  # type: ignore[attr-defined]
    return figure


def html_of(shown: Log | Simulation | Fit) -> str:
    """Summary, and figure; a failed fit has no load."""
    if isinstance(shown, Log):
        return _html(repr(shown), figure_of(shown))
    from clutchid.simulation.simulation import Simulation

    if isinstance(shown, Simulation):
        return _html(repr(shown), figure_of(shown))
    drawn = shown.status != "failed" and np.isfinite(shown.load_curve.force).any()
    return _html(printed_fit(shown), figure_of(shown) if drawn else None)


def printed_fit(fit: Fit) -> str:
    """Text of `repr`, with the verdict behind its first line."""
    from clutchid.estimation.assess.verdict import verdict

    first, *rest = repr(fit).splitlines()
    judged = verdict(fit)
    sentences = [*judged.reasons, *([judged.experience] if judged.experience else [])]
    trust = [f"  trust: {judged.trust}", *(f"    {sentence}" for sentence in sentences)]
    return "\n".join([first, *trust, *rest])


def _html(text: str, figure: Figure | None) -> str:
    picture = "" if figure is None else svg(figure)
    return f'<div style="max-width: {STYLE.width:g}in"><pre>{escape(text)}</pre>{picture}</div>'

"""Identifiability of the parameters of a fit: ranking, near dependencies, and profiles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.documents.document import Block, Bullets, Details, Picture
from clutchid.documents.figures import label, new_figure
from clutchid.documents.style import STYLE
from clutchid.documents.tables import Column, ReportTable
from clutchid.estimation import Fit
from clutchid.estimation.result import ProfileCurve
from clutchid.inference.uncertainty.identifiability import NearDependency, in_words
from clutchid.numerics.interval import QUANTILE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def identifiability_json(fit: Fit) -> dict[str, Any]:
    """Ranking, near dependencies and profiles of a fit as JSON."""
    ranked = fit.identifiability
    return {
        "identifiability": ranked and {
            "ranking": [row._asdict() for row in ranked.ranking],
            "dependencies": [group._asdict() for group in ranked.dependencies],
        },
        "profiles": {name: {**c._asdict(), "values": c.values.tolist(), "distances": c.distances.tolist()}
                     for name, c in fit.profiles.items()},
    }  # fmt: skip


def identifiability_blocks(fit: Fit) -> list[Block]:
    """Near dependencies as sentences, the ranking as a table, and a figure of each profile."""
    ranked = fit.identifiability
    if ranked is None:
        return []
    sentences = tuple(_sentence(fit, group) for group in ranked.dependencies)
    bullets = [Bullets(sentences)] if sentences else []
    profiles = (
        Picture(
            profile_figure(name, curve, fit.parameters[name].unit), f"{name}: profile likelihood, {curve.shape}.", name
        )
        for name, curve in fit.profiles.items()
    )
    return [*bullets, Details("Ranking by what the data determine", (ranking_table(fit),)), *profiles]


def _sentence(fit: Fit, group: NearDependency) -> str:
    """A near dependency; the weights of a load are one word."""
    weights = set(fit.actuator.load.names)
    load = ["the load"] if weights & set(group.names) else []
    names = [*load, *(name for name in group.names if name not in weights)]
    if len(names) < 2:
        names = list(group.names)
    return f"The data determine {in_words(names)} only together (condition index {group.condition:.0f})."


def ranking_table(fit: Fit) -> ReportTable:
    """The parameters in the order in which the data determine them."""
    assert fit.identifiability is not None, "a failed fit has no ranking"
    columns = (
        Column("name", "parameter"), Column("unit", "unit"),
        Column("alone", "all others\nknown", significant=3, group="standard deviation by the data"),
        Column("ranked", "with those\nbefore it", significant=3, group="standard deviation by the data"),
        Column("std", "stated", significant=3), Column("collinearity [1]", "collinearity\nindex", 1.0, 1),
    )  # fmt: skip
    rows = tuple(
        (row.name, fit.parameters[row.name].unit, row.alone, row.ranked, fit.parameters[row.name].std, row.collinearity)
        for row in fit.identifiability.ranking
        if row.name in fit.parameters
    )
    note = (
        "For independent residuals and without priors; the stated standard deviation has correlated residuals and "
        "priors. The index says by what factor others can make up for a change: above 10 to 15 they are hardly "
        "identifiable together."
    )
    return ReportTable("Ranking", columns, rows, note=note)


def starts_figure(fit: Fit) -> Figure:
    """Final cost of every start of a search, the lowest first; hollow where the search went on from another."""
    figure, (axis,) = new_figure([1.9])
    starts = sorted((start for start in fit.starts if start.cost < np.inf), key=lambda start: start.cost)
    for place, start in enumerate(starts):
        filled = STYLE.blue if start.status != "not searched" else "none"
        axis.plot(place, start.cost, "o", color=STYLE.blue, markerfacecolor=filled)
    axis.set_yscale("log")
    axis.set_xticks(range(len(starts)), [start.name for start in starts])
    label(axis, y="cost [1]")
    return figure


def profile_figure(name: str, curve: ProfileCurve, unit: str) -> Figure:
    """Growth of the cost, in standard deviations, over the values at which a parameter was fixed."""
    figure, (axis,) = new_figure([2.2])
    axis.plot(curve.values, curve.distances, color=STYLE.blue, marker="o", markersize=3)
    axis.axhline(QUANTILE, color=STYLE.ink, linewidth=0.8, linestyle=":")
    for end in (curve.low, curve.high):
        axis.axvline(end, color=STYLE.ink, linewidth=0.8, linestyle=":")
    label(axis, f"{name} [{unit}]", "distance [std]")
    return figure

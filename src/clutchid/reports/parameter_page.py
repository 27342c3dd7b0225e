"""Parameters of a fit for a page: estimates with intervals, load weights, and fixed parameters."""

from __future__ import annotations

from collections.abc import Iterable

from clutchid.estimation import Fit
from clutchid.estimation.assess.evidence import reach
from clutchid.reports.html import Block, Details, Text, escape
from clutchid.reports.load_tables import load_table
from clutchid.reports.tables import Cell, Column, Table, scientific


def parameter_blocks(fit: Fit) -> tuple[Block, ...]:
    """The estimates; weights of a load on B-splines, which mean little individually, are collapsed."""
    weights = [name for name in fit.parameters if name.partition("@")[0] in fit.actuator.load.names]
    others = [name for name in fit.parameters if name not in weights]
    blocks: list[Block] = [parameter_table(fit, others)] if others else []
    if fit.actuator.load.basis == "paper":
        blocks = [parameter_table(fit, [*others, *weights])] if fit.parameters else []
    elif weights:
        if fit.status != "failed" and fit.recordings:
            blocks.append(load_table(fit.load_curve, reach(fit)))
        knots = ", ".join(f"{knot * 1e3:g}" for knot in fit.actuator.load.knots)
        table = parameter_table(fit, weights, "Weights of the B-splines")
        note = Text(f"Knots at {knots} mm. A weight is approximately the load near its knot.")
        blocks.append(Details(f"{len(weights)} load weights", (table, note)))
    return (*blocks, Details("Fixed parameters", (Text(_fixed(fit)),)))


def parameter_table(fit: Fit, names: Iterable[str] | None = None, title: str = "Estimated parameters") -> Table:
    """The estimates with unit, standard error, 95 % interval and meaning."""
    columns = (
        Column("name", "parameter"), Column("unit", "unit"), Column("value", "value", significant=5),
        Column("std", "standard error", significant=3), Column("low", "from", significant=5, group="95 % interval"),
        Column("high", "to", significant=5, group="95 % interval"), Column("meaning", "meaning"),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for name in fit.parameters if names is None else names:
        e = fit.parameters[name]
        rows.append((name, e.unit, e.value, e.std, e.low, e.high, meaning(fit, name)))
    return Table(title, columns, tuple(rows))


def meaning(fit: Fit, name: str) -> str:
    """What a parameter, NAME or NAME@STEM, is."""
    base, _, stem = name.partition("@")
    meaning = fit.actuator.row(base).meaning if base in fit.actuator.parameter_names else "weight of the load"
    return f"{meaning}, in {stem}" if stem else meaning


def _fixed(fit: Fit) -> str:
    free = {name.partition("@")[0] for name in fit.parameters}
    fixed = [
        f"{name} = {scientific(fit.actuator.value(name), 0)}{fit.actuator.unit_behind(name)}"
        for name in fit.actuator.names
        if name not in free
    ]
    return "Fixed: " + escape("; ".join(fixed)) + "."

"""Parts of a page on the trust in a fit: verdict, residuals with their figures, missing excitation."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.document import Block, Bullets, Details, Picture, Text
from clutchid.documents.figures import label, new_figure
from clutchid.documents.style import MM, STYLE
from clutchid.documents.tables import Cell, Column, ReportTable
from clutchid.estimation import Fit
from clutchid.estimation.assess.diagnostics import Diagnosis, remarks
from clutchid.estimation.assess.evidence import HORIZON, Evidence
from clutchid.estimation.assess.verdict import Verdict
from clutchid.log import INPUTS, FloatArray
from clutchid.names import capital

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from clutchid.numerics.whiteness import Colour

#: Name, display unit in SI, and its symbol, for the residual of a column.
_SHOWN = {"position": ("position", MM, "mm"), "pressure_a": ("pressure A", 1e3, "kPa")}


def colour_figure(diagnosis: Diagnosis) -> Figure:
    """Autocorrelation of the residuals and their correlation with both valves, three panels a measured column."""
    columns = list(diagnosis.columns.items())
    figure, axes = new_figure([1.6] * 3 * len(columns), share_x=False)
    for row, (name, column) in enumerate(columns):
        draw_colour(axes[3 * row : 3 * row + 3], column.fast, _SHOWN[name][0])
    label(axes[-1], "lag [ms]")
    return figure


def draw_colour(axes: Sequence[Axes], colour: Colour, name: str) -> None:
    """Three panels: autocorrelation of a residual of this name, and correlation with the supply and exhaust valve."""
    own, *others = axes
    _stems(own, colour.lag[1:], colour.autocorrelation[1:], colour.bound[1:])
    label(own, y="correlation [1]", title=f"{name}: autocorrelation")
    for axis, key in zip(others, INPUTS, strict=True):
        crossed = colour.inputs.get(key)
        if crossed is not None:
            _stems(axis, crossed.lag, crossed.correlation, crossed.bound)
        else:
            axis.text(0.5, 0.5, "constant", ha="center", va="center", transform=axis.transAxes)
        label(axis, y="correlation [1]", title=f"{name}: with the {key.removeprefix('duty_')} valve")


def _stems(axis: Axes, lag: FloatArray, values: FloatArray, bound: FloatArray) -> None:
    """Correlations over the lag with their 99 % bounds; NaN is not drawn."""
    ms = lag * 1e3
    axis.fill_between(ms, -bound, bound, color=STYLE.measured, alpha=0.3, linewidth=0)
    axis.vlines(ms, 0.0, values, color=STYLE.blue, linewidth=1.3)
    axis.axhline(0.0, color=STYLE.ink, linewidth=0.7)
    largest = float(np.nanmax(np.abs(np.concatenate([values, bound])), initial=0.0))
    axis.set_ylim(-1.15 * max(largest, 0.1), 1.15 * max(largest, 0.1))


def limit_blocks(judged: Verdict, names: Collection[str] = ()) -> tuple[Block, ...]:
    """Notes and limits of a verdict; `names` of recordings are not capitalised."""
    folded = (("Not counted against the result", judged.notes), ("Limits of the verdict", judged.unseen))
    return tuple(
        Details(heading, tuple(Text(capital_unless_named(sentence, names)) for sentence in sentences))
        for heading, sentences in folded
        if sentences
    )


def information_blocks(fit: Fit, basis: Evidence) -> list[Block]:
    """Identifiability, missing excitation, and where the manoeuvres that add it are listed."""
    sentences = [*fit.notes, *basis.missing]
    blocks: list[Block] = [Bullets(tuple(map(capital_unless_named, sentences)))] if sentences else []
    if not basis.missing:
        return [*blocks, Text("The excitation is sufficient: reach, directions and vented rests.")]
    return [*blocks, Text('What to drive: docs/excitation.md, "What is missing".')]


def diagnosis_table(basis: Evidence) -> ReportTable:
    """Fit in %, errors and number of independent samples of every recording."""
    columns = (
        Column("recording", "recording"), Column("column", "of"), Column("fit_percent [1]", "fit [%]", 1.0, 1),
        Column("predicted_percent [1]", f"fit over\n{HORIZON:g} s [%]", 1.0, 1),
        Column("rms", "rms"), Column("mean", "mean"), Column("samples [1]", "samples", 1.0, 0),
        Column("effective_samples [1]", "independent\nsamples", 1.0, 0),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for name, diagnosis in basis.diagnoses.items():
        for key, column in diagnosis.columns.items():
            shown, unit, symbol = _SHOWN[key]
            over = basis.predictions[name] if key == "position" else None
            rms, mean = (
                Column("", "", unit, 4 if symbol == "mm" else 3).shown(value) + f" {symbol}"
                for value in (column.rms, column.mean)
            )
            numbers = (column.samples, column.effective_samples)
            rows.append((name, shown, column.fit_percent, over, rms, mean, *numbers))
    note = (
        "The fit is 100 % for an exact simulation and 0 % for a simulation that is no better than the mean. Over 1 "
        "s: the simulation starts again from the measured position every second."
    )
    return ReportTable("Residuals, measured minus simulated", columns, tuple(rows), note=note)


def residual_blocks(fit: Fit, diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Figures of the residuals of one recording, and remarks on them."""
    pressure = "pressure_a" in diagnosis.columns
    follows = " The simulated position follows the measured one." if fit.follows else ""
    who = diagnosis.name
    colour = Picture(
        colour_figure(diagnosis),
        f"{who}: autocorrelation of the residual of position{' and of pressure' if pressure else ''}, and correlation "
        "of the whitened residual with the duty cycles. At a positive lag the residual follows the valve. White noise "
        f"is within the grey bounds at 99 of 100 lags; larger values are due to model errors.{follows}",
        "Autocorrelation of the residuals and correlation with both valves, with 99 % bounds",
        dense=True,
    )
    sentences = [sentence.removeprefix(f"{diagnosis.name}: ") for sentence in remarks(diagnosis)]
    bullets: tuple[Block, ...] = (Bullets(tuple(map(capital_unless_named, sentences))),) if sentences else ()
    return (colour, *bullets)


def capital_unless_named(sentence: str, names: Collection[str] = ()) -> str:
    """A sentence with a capital, unless it begins with a name of a column or recording."""
    named = "_" in sentence.split(" ", maxsplit=1)[0] or any(sentence.startswith(f"{name}: ") for name in names)
    return sentence if named else capital(sentence)


def worst_first(basis: Evidence, names: Sequence[str]) -> list[str]:
    """Recordings by their fit over a second, the poorest first; those without one last."""
    return sorted(names, key=lambda name: basis.predictions.get(name, 100.0))

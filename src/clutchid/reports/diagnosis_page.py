"""Parts of a page on the trust in a fit: verdict, residuals, and missing excitation."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Literal

from clutchid.errors import ClutchidError
from clutchid.estimation import Fit
from clutchid.estimation.assess.diagnostics import Diagnosis, remarks
from clutchid.estimation.assess.evidence import HORIZON, Evidence, information
from clutchid.estimation.assess.verdict import Verdict
from clutchid.reports.diagnosis_figures import SHOWN, colour_figure, region_figure
from clutchid.reports.figures import png
from clutchid.reports.html import Block, Bullets, Details, Notice, Picture, Text, escape
from clutchid.reports.tables import Cell, Column, Table

_BOX: Mapping[str, Literal["ok", "warning", "failed"]] = {"good": "ok", "with care": "warning", "none": "failed"}


def verdict_blocks(judged: Verdict, names: Collection[str] = ()) -> list[Block]:
    """The verdict with its reasons, notes and limits; `names` of recordings are not capitalised."""
    items = tuple(_capital(reason, names) for reason in judged.reasons)
    blocks: list[Block] = [Notice(f"Trust: {judged.trust} – {judged.meaning}", _BOX[judged.trust], items)]
    folded = (("Not counted against the result", judged.notes), ("Limits of the verdict", judged.unseen))
    for heading, sentences in folded:
        if sentences:
            blocks.append(Details(heading, tuple(Text(escape(_capital(one, names))) for one in sentences)))
    return blocks


def information_blocks(fit: Fit, found: Evidence) -> list[Block]:
    """What the data determine, missing excitation, and the recommended recording."""
    sentences = [*fit.notes, *found.missing]
    blocks: list[Block] = [Bullets(tuple(escape(_capital(sentence)) for sentence in sentences))] if sentences else []
    if not found.missing:
        return [*blocks, Text("The excitation is sufficient: reach, directions and vented rests.")]
    proposal = _proposal(fit)
    return [*blocks, Text(f"Recommended recording: {escape(proposal)}")] if proposal else blocks


def _proposal(fit: Fit) -> str:
    """The most informative manoeuvre for the load; empty if none can be simulated."""
    from clutchid.estimation.assess.manoeuvre_choice import best_manoeuvre

    weights = [name for name in fit.parameters if name in fit.actuator.load.names]
    known = information(fit)
    if not weights or known is None:
        return ""
    try:
        return best_manoeuvre(fit.actuator, weights, known).message
    except ClutchidError:
        return ""


def diagnosis_table(found: Evidence) -> Table:
    """Fit in %, errors and number of independent samples of every recording."""
    columns = (
        Column("recording", "recording"), Column("column", "of"), Column("fit_percent [1]", "fit [%]", 1.0, 1),
        Column("predicted_percent [1]", f"fit over\n{HORIZON:g} s [%]", 1.0, 1),
        Column("rms", "rms"), Column("mean", "mean"), Column("samples [1]", "samples", 1.0, 0),
        Column("effective_samples [1]", "independent\nsamples", 1.0, 0),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for name, diagnosis in found.diagnoses.items():
        for key, column in diagnosis.columns.items():
            shown, unit, symbol = SHOWN[key]
            over = found.predictions[name] if key == "position" else None
            rms, mean = (
                Column("", "", unit, 4 if symbol == "mm" else 3).shown(value) + f" {symbol}"
                for value in (column.rms, column.mean)
            )
            numbers = (column.samples, column.effective_samples)
            rows.append((name, shown, column.fit_percent, over, rms, mean, *numbers))
    note = (
        "The fit is 100 % for an exact simulation and 0 % for one that is as good as the mean. Over 1 s: simulated for "
        "a second at a time from the measured position."
    )
    return Table("Residuals, measured less simulated", columns, tuple(rows), note=note)


def residual_blocks(fit: Fit, diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Figures of the residuals of one recording, and remarks on them."""
    pressure = "pressure_a" in diagnosis.columns
    follows = " The simulated position follows the measured one." if fit.follows else ""
    who = escape(diagnosis.name)
    colour = Picture(
        png(colour_figure(diagnosis)),
        f"{who}: autocorrelation of the residual of position{' and of pressure' if pressure else ''}, and correlation "
        "of the whitened residual with the duty cycles. At a positive lag the residual follows the valve. White noise "
        f"is within the grey bounds at 99 of 100 lags; larger values are due to model errors.{follows}",
        "Autocorrelation of the residuals and correlation with both valves, with 99 % bounds",
    )
    regions = Picture(
        png(region_figure(diagnosis)),
        f"{who}: rms error by position and direction of motion; the dotted line is that of the whole recording.",
        "Rms error by stroke region, opening, closing and in hold",
    )
    sentences = [sentence.removeprefix(f"{diagnosis.name}: ") for sentence in remarks(diagnosis)]
    bullets: tuple[Block, ...] = (Bullets(tuple(escape(_capital(s)) for s in sentences)),) if sentences else ()
    return (colour, regions, *bullets)


def _capital(sentence: str, names: Collection[str] = ()) -> str:
    named = "_" in sentence.split(" ", maxsplit=1)[0] or any(sentence.startswith(f"{name}: ") for name in names)
    if named:
        return sentence
    return sentence[:1].upper() + sentence[1:]


def worst_first(found: Evidence, names: Sequence[str]) -> list[str]:
    """Recordings by their fit over a second, the poorest first; those without one last."""
    return sorted(names, key=lambda name: found.predictions.get(name, 100.0))

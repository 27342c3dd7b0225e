"""A fit as a document: answer, load, sections of tables and figures, and data."""

from __future__ import annotations

from typing import Any

import numpy as np

from clutchid.documents.document import Document, Notice, Picture, page_rows, sources_of
from clutchid.documents.fit_figures import load_figure
from clutchid.documents.fit_json import fit_json
from clutchid.documents.fit_rows import other_warnings, rows_of
from clutchid.documents.fit_sections import fit_sections
from clutchid.documents.style import MM
from clutchid.estimation import Fit
from clutchid.estimation.assess.evidence import as_recorded, reach
from clutchid.estimation.assess.verdict import states_of_wear, verdict
from clutchid.log import FloatArray


def fit_document(fit: Fit, command: str = "") -> Document:
    """Document of a fit of any status and method, with the command that repeats it."""
    return Document(
        f"Clutch load from {', '.join(fit.recordings) or 'no recording'}", _subtitle(fit), tuple(rows_of(fit)),
        notices=tuple(map(Notice, other_warnings(fit))),
        sections=lambda: fit_sections(fit),
        figure=(lambda: load_picture(fit)) if has_load(fit) else None,
        data=lambda: fit_json(fit),
        command=command, sources=_sources(fit),
    )  # fmt: skip


def application_data(fit: Fit, document: Document) -> dict[str, Any]:
    """Data of a fit with its document for the local page: its JSON, the rows for pages, and the next step.

    Changes that only reflect recordings of different states of wear are left out: a row says so.
    """
    data = document.data()
    return {
        **data,
        "changes": [] if states_of_wear(fit) else data["changes"],
        "summary": page_rows(document),
        "reach_m": reach(fit),
        "is_calibration": fit.calibration is not None and fit.baseline is None,
        "next": None if document.next is None else document.next._asdict(),
    }  # fmt: skip


def compared_columns(fit: Fit) -> dict[str, dict[str, FloatArray]]:
    """Columns of each recording, fitted or verified, as they are compared: simulated through the sensors."""
    columns: dict[str, dict[str, FloatArray]] = {}
    for name, recording in {**fit.recordings, **fit.verification}.items():
        measured, simulated = recording.measured.columns, as_recorded(fit, name, recording.simulated).columns
        own = columns[name] = {}
        for column in ("position", "pressure_a"):
            both = {column: measured.get(column), f"simulated {column}": simulated.get(column)}
            own |= {key: values for key, values in both.items() if values is not None}
            own |= {key: simulated[key] for key in (f"{column} low", f"{column} high") if key in simulated}
            if column in measured and column in simulated:
                own[f"residual {column}"] = measured[column] - simulated[column]
    return columns


def printed_fit(fit: Fit) -> str:
    """Text of `repr`, with the verdict behind its first line."""
    first, *rest = repr(fit).splitlines()
    judged = verdict(fit)
    sentences = [*judged.reasons, *([judged.experience] if judged.experience else [])]
    return "\n".join([first, f"  trust: {judged.trust}", *(f"    {sentence}" for sentence in sentences), *rest])


def load_picture(fit: Fit) -> Picture:
    """The load over the position."""
    caption = _CAPTION["shooting" if fit.follows else "simulation"]
    return Picture(load_figure(fit), caption, "Load over position with its 95 % interval and half of its peak")


_CAPTION = {
    "simulation": (
        "Load over the position of the piston, with a pointwise 95 % interval for a correct model: it includes noise "
        "and autocorrelated residuals, but no model errors. The curve is dashed beyond the recorded positions."
    ),
    "shooting": (
        "Load over the position of the piston, with a pointwise 95 % interval: it includes noise, autocorrelated "
        "residuals, the uncertainty of the calibration and the drift of the actuator between two recordings. Beyond "
        "the recorded positions the curve is dashed, and the interval may exceed the figure."
    ),
}


def has_load(fit: Fit) -> bool:
    """Whether there is a load to draw."""
    return fit.status != "failed" and bool(np.isfinite(fit.load_curve.force).any())


def _subtitle(fit: Fit) -> str:
    load = fit.actuator.load
    knots = ", ".join(f"{knot / MM:g}" for knot in load.knots)
    basis = f"load on the paper's three splines, knots {knots} mm, slope {load.phi2_slope:g} of φ₂ at t₃"
    if load.basis != "paper":
        ends = f"{load.knots[0] / MM:g} to {load.knots[-1] / MM:g}"
        basis = f"load on cubic B-splines, {len(load.knots)} knots from {ends} mm"
    how = {"simulation": "simulation error", "shooting": "multiple shooting"}.get(fit.method, "prediction error")
    return f"Model {fit.actuator.model}; {basis}; fitted by {how}."


def _sources(fit: Fit) -> dict[str, str]:
    """SHA-256 of the files of a fit."""
    sources = sources_of(r.measured for r in (*fit.recordings.values(), *fit.verification.values()))
    origin = fit.baseline.origin if fit.baseline else None
    return sources | ({origin.name: origin.sha256} if origin and origin.sha256 else {})

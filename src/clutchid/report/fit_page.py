"""The page of a fit: what was found, how sure it is, and how well it explains the recordings."""

from __future__ import annotations

from os import PathLike

import numpy as np

from clutchid.estimate import Fit
from clutchid.estimate.result import Errors, Recording
from clutchid.report.figures import png
from clutchid.report.files import write_text
from clutchid.report.fit_figures import ENGAGING, load_figure, reach, recording_figure
from clutchid.report.html import Block, Notice, Page, Picture, Section, Text, escape, render
from clutchid.report.provenance import provenance
from clutchid.report.style import BAR, KN, MM
from clutchid.report.tables import Cell, Column, Table, scientific

_STATUS = {
    "ok": "The fit settled, without a warning.",
    "warning": "There is something to know before the result is used.",
    "failed": "The fit failed; there is no load to show.",
}


def fit_page(fit: Fit, command: str, path: str | PathLike[str]) -> None:
    """Write the page of `fit` as one self-contained HTML file.

    Parameters
    ----------
    fit : Fit
        Of any status; a failed one gives a page that says so.
    command : str
        The command line that repeats the fit, shown on the page.
    path
        The file; an older one is replaced in one step.

    Raises
    ------
    ExportError
        If the file cannot be written; an older file stays as it was.
    """
    write_text(render(page_of(fit, command)), path)


def page_of(fit: Fit, command: str) -> Page:
    """The page of `fit` before it is rendered."""
    logs = [r.measured for r in (*fit.recordings.values(), *fit.verification.values())]
    names = ", ".join(fit.recordings) or "no recording"
    sections = [Section("Result", _result(fit)), Section("Parameters", (parameter_table(fit), *_parameter_notes(fit)))]
    if fit.recordings:
        sections.append(Section("Errors", _errors(fit)))
    sections += [_section(name, r, "fitted") for name, r in fit.recordings.items()]
    sections += [_section(name, r, "verified, not fitted") for name, r in fit.verification.items()]
    return Page(f"Clutch load from {names}", _subtitle(fit), tuple(sections), provenance(logs, command))


def _subtitle(fit: Fit) -> str:
    load = fit.actuator.load
    knots = ", ".join(f"{knot / MM:g}" for knot in load.knots)
    basis = f"load on the paper's three splines, knots {knots} mm, slope {load.phi2_slope:g} of φ₂ at t₃"
    return f"Model {fit.actuator.model}; {basis}."


def _result(fit: Fit) -> tuple[Block, ...]:
    kind = fit.status
    lead = f"{_STATUS[kind]} {fit.message[:1].upper()}{fit.message[1:]}."
    blocks: list[Block] = [Notice(lead, kind), *(Notice(warning) for warning in fit.warnings)]
    if kind != "failed":
        alt = "Load over position with its 95 % band"
        blocks += [Text(_sentence(fit)), Picture(png(load_figure(fit)), _LOAD_CAPTION, alt)]
    return tuple(blocks)


_LOAD_CAPTION = (
    "Load over the position of the piston. The band holds the load with 95 % probability at each position, if the "
    "model is right: it counts noise and coloured residuals, not what the model leaves out. Where nothing was "
    "recorded the curve is dashed."
)


def _sentence(fit: Fit) -> str:
    """The load in one paragraph: peak, and what it is where the clutch engages."""
    curve, furthest = fit.load_curve, reach(fit)
    inside = curve.position <= furthest
    at = int(np.argmax(np.where(inside, curve.force, -np.inf)))
    low, high = (float(np.interp(y, curve.position, curve.force)) for y in ENGAGING)
    text = (
        f"Within the {furthest / MM:.1f} mm that were driven the load is greatest at {curve.position[at] / MM:.1f} "
        f"mm, {curve.force[at] / KN:.2f} kN. Where the clutch engages it goes from {low / KN:.2f} kN at "
        f"{ENGAGING[0] / MM:.0f} mm to {high / KN:.2f} kN at {ENGAGING[1] / MM:.0f} mm"
    )
    there = (curve.position >= ENGAGING[0]) & (curve.position <= ENGAGING[1])
    half = (curve.high - curve.low)[there] / 2
    if not np.isfinite(half).all():
        return f"{text}; the recordings give no interval there."
    return f"{text}, ± {half.max():.0f} N at 95 %."


def parameter_table(fit: Fit) -> Table:
    """The estimates with unit, standard error and 95 % interval."""
    columns = (
        Column("name", "parameter"), Column("unit", "unit"), Column("value", "value", significant=5),
        Column("std", "standard error", significant=3), Column("low", "from", significant=5, group="95 % interval"),
        Column("high", "to", significant=5, group="95 % interval"),
    )  # fmt: skip
    rows = tuple((name, e.unit, e.value, e.std, e.low, e.high) for name, e in fit.parameters.items())
    return Table("Estimated parameters", columns, rows)


def _parameter_notes(fit: Fit) -> tuple[Block, ...]:
    fixed = []
    for name in fit.actuator.names:
        if name not in fit.parameters:
            unit = fit.actuator.unit(name)
            value = scientific(fit.actuator.value(name), 0)
            fixed.append(f"{name} = {value}" + ("" if unit == "1" else f" {unit}"))
    return (Text("Held fixed: " + escape("; ".join(fixed)) + "."),)


def error_table(fit: Fit) -> Table:
    """Rms errors and sums of squares per recording, fitted and verified."""
    columns = (
        Column("recording", "recording"), Column("use", "use"),
        Column("position_rms [m]", "rms [mm]", MM, 3, group="position"),
        Column("position_sse [m2]", "Σe² [m²]", significant=4, group="position"),
        Column("pressure_a_rms [Pa]", "rms [bar]", BAR, 3, group="pressure A"),
        Column("pressure_a_sse [Pa2]", "Σe² [Pa²]", significant=4, group="pressure A"),
    )  # fmt: skip
    rows = [(name, "fitted", *_cells(r.errors)) for name, r in fit.recordings.items()]
    if len(rows) > 1:
        rows.append(("all fitted", "", *_cells(fit.errors)))
    rule = len(rows)
    rows += [(name, "verified", *_cells(r.errors)) for name, r in fit.verification.items()]
    note = "Errors against the measured samples; Σe² is the sum of squares, as in Table 2 of the paper."
    return Table("Simulation against measurement", columns, tuple(rows), (rule,), note)


def _cells(errors: Errors) -> tuple[Cell, ...]:
    return errors.position_rms, errors.position_sse, errors.pressure_a_rms, errors.pressure_a_sse


def _errors(fit: Fit) -> tuple[Block, ...]:
    scales = []
    if "position" in fit.scales:
        scales.append(f"{fit.scales['position'] / MM:.3g} mm for position")
    if "pressure_a" in fit.scales:
        scales.append(f"{fit.scales['pressure_a'] / BAR:.3g} bar for pressure")
    return error_table(fit), Text(f"Residuals were divided by {' and '.join(scales) or 'nothing'}.")


def _section(name: str, recording: Recording, use: str) -> Section:
    e = recording.errors
    rms = e.pressure_a_rms
    pressure = "pressure not measured" if rms is None else f"{rms / BAR:.3f} bar rms in pressure"
    caption = f"{escape(name)}, {use}: {e.position_rms / MM:.3f} mm rms in position, {pressure}."
    starts = "; ".join(f"{y / MM:.2f} mm, {p / BAR:.3f} bar" for y, p in recording.starts[:6])
    more = " …" if len(recording.starts) > 6 else ""
    alt = f"Measured and simulated motion and pressure of {name}"
    picture = Picture(png(recording_figure(recording)), caption, alt)
    start = Text(f"Simulated from position and pressure at the start: {starts}{more}.")
    return Section(f"{name} ({use})", (picture, start))

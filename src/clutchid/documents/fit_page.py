"""Page of a fit: verdict, load, parameters with intervals, and comparison with the recordings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from html import escape
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from clutchid.documents.comparison_page import comparison_sections
from clutchid.documents.diagnosis_page import (
    diagnosis_table,
    information_blocks,
    residual_blocks,
    verdict_blocks,
    worst_first,
)
from clutchid.documents.figures import png, svg
from clutchid.documents.fit_figures import load_figure, recording_figure, reliable
from clutchid.documents.html import Block, Details, Notice, Page, PageSection, Picture, Text, provenance, render
from clutchid.documents.innovations import innovation_blocks
from clutchid.documents.style import BAR, MM
from clutchid.documents.summary import interval_words, other_warnings
from clutchid.documents.tables import Cell, Column, ReportTable, load_table, scientific
from clutchid.estimation import Fit
from clutchid.estimation.assess.comparison import ENGAGING, half_load_band
from clutchid.estimation.assess.evidence import Evidence, as_recorded, evidence, reach
from clutchid.estimation.assess.innovations import calibration_innovations
from clutchid.estimation.assess.verdict import noise_only, verdict
from clutchid.estimation.result import Errors, Recording
from clutchid.files import write_text


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


def parameter_table(fit: Fit, names: Iterable[str] | None = None, title: str = "Estimated parameters") -> ReportTable:
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
    return ReportTable(title, columns, tuple(rows))


def meaning(fit: Fit, name: str) -> str:
    """Meaning of a parameter, NAME or NAME@STEM."""
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


#: Greatest number of fitted, and of verified, recordings with figures; the others are in the tables.
MAX_DRAWN = 3

#: A recording longer than the first length in s has an additional figure of a part of the second length in s.
LONG_RECORDING, DETAIL_LENGTH = 120.0, 30.0

_STATUS = {
    "ok": "The search {}, without warnings.",
    "warning": "The search {}.",
    "failed": "The fit failed, and there is no load to show: {}.",
}


def fit_page(fit: Fit, command: str, path: str | PathLike[str]) -> None:
    """Write the page of `fit` as one self-contained HTML file.

    Parameters
    ----------
    fit : Fit
        Of any status and method; a failed one gives a page with the reason.
    command : str
        The command line that repeats the fit, shown on the page.
    path
        The file; an existing one is replaced atomically.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.
    """
    write_text(render(page_of(fit, command)), path)


def page_of(fit: Fit, command: str) -> Page:
    """The page of `fit` before it is rendered."""
    logs = [r.measured for r in (*fit.recordings.values(), *fit.verification.values())]
    names = ", ".join(fit.recordings) or "no recording"
    found = evidence(fit)
    sections = [PageSection("Result", _result(fit)), *comparison_sections(fit)]
    if found.diagnoses:
        sections.append(PageSection("What the data determine", tuple(information_blocks(fit, found))))
    sections.append(PageSection("Parameters", parameter_blocks(fit)))
    if fit.recordings:
        sections.append(PageSection("Errors", _errors(fit, found)))
        sections += _drawn(fit, found, fit.recordings, "fitted")
    sections += _drawn(fit, found, fit.verification, "verified, not fitted")
    sections += [
        PageSection(f"Innovations of {name}", innovation_blocks(name, of_one))
        for name, of_one in list(calibration_innovations(fit).items())[:MAX_DRAWN]
    ]
    return Page(f"Clutch load from {names}", _subtitle(fit), tuple(sections), provenance(logs, command))


def _subtitle(fit: Fit) -> str:
    load = fit.actuator.load
    knots = ", ".join(f"{knot / MM:g}" for knot in load.knots)
    basis = f"load on the paper's three splines, knots {knots} mm, slope {load.phi2_slope:g} of φ₂ at t₃"
    if load.basis != "paper":
        ends = f"{load.knots[0] / MM:g} to {load.knots[-1] / MM:g}"
        basis = f"load on cubic B-splines, {len(load.knots)} knots from {ends} mm"
    how = {"simulation": "simulation error", "shooting": "multiple shooting"}.get(fit.method, "prediction error")
    return f"Model {fit.actuator.model}; {basis}; fitted by {how}."


def _result(fit: Fit) -> tuple[Block, ...]:
    blocks = verdict_blocks(verdict(fit), fit.recordings)
    lead = _STATUS[fit.status].format(fit.message.rstrip("."))
    blocks += [Notice(lead, fit.status), *(Notice(warning) for warning in other_warnings(fit))]
    if fit.status != "failed":
        alt = "Load over position with its 95 % interval and half of its peak"
        blocks += [
            Text(_sentence(fit)),
            Picture(svg(load_figure(fit)), _LOAD_CAPTION["shooting" if fit.follows else "simulation"], alt),
        ]
    return tuple(blocks)


_LOAD_CAPTION = {
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


def _sentence(fit: Fit) -> str:
    """The load in one paragraph: peak, half-load position, and values where the clutch engages."""
    curve, furthest = fit.load_curve, reach(fit)
    at = curve.peak(furthest)
    low, high = (float(np.interp(y, curve.position, curve.force)) for y in ENGAGING)
    text = (
        f"Within the recorded {furthest / MM:.1f} mm the load is greatest at {curve.position[at] / MM:.1f} mm, "
        f"{curve.force[at]:.0f} N.{_half_sentence(fit)}"
    )
    if not furthest >= ENGAGING[1]:
        return f"{text} The {ENGAGING[1] / MM:.0f} mm to where the clutch engages were not reached."
    text += (
        f" Where the clutch engages it goes from {low:.0f} N at {ENGAGING[0] / MM:.0f} mm to {high:.0f} N "
        f"at {ENGAGING[1] / MM:.0f} mm"
    )
    engaging = (curve.position >= ENGAGING[0]) & (curve.position <= ENGAGING[1])
    half = (curve.high - curve.low)[engaging] / 2
    if not np.isfinite(half).all():
        return f"{text}; the interval there is infinite."
    return f"{text}, ± {half.max():.0f} N at 95 %{', noise only' if noise_only(fit) else ''}."


def _half_sentence(fit: Fit) -> str:
    at = half_load_band(fit.load_curve, reach(fit))
    if not np.isfinite(at.position):
        return ""
    return f" It passes half of that at {at.position / MM:.2f} mm{interval_words(at, behind=' mm at 95 %')}."


def error_table(fit: Fit) -> ReportTable:
    """Rms errors and sums of squares of each recording, fitted and verified."""
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
    if fit.follows:
        which = "those within windows of 0.1 s" if fit.method == "shooting" else "one-sample prediction errors"
        how = "multiple shooting" if fit.method == "shooting" else "prediction error"
        note += f" For {how} they are {which}; a verified recording is simulated as a whole."
    return ReportTable("Simulation against measurement", columns, tuple(rows), (rule,), note)


def _cells(errors: Errors) -> tuple[Cell, ...]:
    return errors.position_rms, errors.position_sse, errors.pressure_a_rms, errors.pressure_a_sse


def _errors(fit: Fit, found: Evidence) -> tuple[Block, ...]:
    scales = []
    if "position" in fit.scales:
        scales.append(f"{fit.scales['position'] / MM:.3g} mm for position")
    if "pressure_a" in fit.scales:
        scales.append(f"{fit.scales['pressure_a'] / BAR:.3g} bar for pressure")
    divided = Text(f"Residuals were divided by {' and '.join(scales) or 'nothing'}.")
    return (error_table(fit), *([diagnosis_table(found)] if found.diagnoses else []), divided)


def _drawn(fit: Fit, found: Evidence, recordings: Mapping[str, Recording], use: str) -> list[PageSection]:
    """A section for each recording; of many, only those with the poorest fit."""
    names = list(recordings)
    if len(names) > MAX_DRAWN:
        kept = worst_first(found, names)[:MAX_DRAWN]
        names = [name for name in names if name in kept]
    sections = [_section(fit, name, recordings[name], use, found) for name in names]
    if len(names) < len(recordings):
        rest = f"{len(recordings) - len(names)} more ({use})"
        words = f"The {len(names)} recordings with the poorest fit are drawn; the others are in the table of errors."
        sections.append(PageSection(rest, (Text(words),)))
    return sections


def _section(fit: Fit, name: str, recording: Recording, use: str, found: Evidence) -> PageSection:
    e = recording.errors
    rms = e.pressure_a_rms
    fitted = use == "fitted"
    pressure = "pressure not measured" if rms is None else f"{rms / BAR:.3f} bar rms in pressure"
    caption = f"{escape(name)}, {use}: {e.position_rms / MM:.3f} mm rms in position, {pressure}."
    position_only = fitted and "pressure_a" not in fit.scales
    if not fitted:
        caption += " Not fitted: position and pressure are simulated from the duty cycles."
    if position_only:
        caption += (
            " The pressure is estimated from the position alone; it is unreliable where the background is grey: before "
            "the first or after the last vented rest, or beyond the reach of the fitted recordings."
        )
    as_measured = replace(recording, simulated=as_recorded(fit, name, recording.simulated))
    span = reliable(recording.measured, fit.actuator.parameters, reach(fit)) if position_only else None
    alt = f"Measured and simulated motion and pressure of {name}"
    in_mm, in_bar = Column("", "", MM, 2).shown, Column("", "", BAR, 3).shown
    starts = "; ".join(f"{in_mm(y)} mm, {in_bar(p)} bar" for y, p in recording.starts[:6])
    more = " …" if len(recording.starts) > 6 else ""
    start = Text(f"Simulated from position and pressure at the start: {starts}{more}.")
    residuals = residual_blocks(fit, found.diagnoses[name]) if fitted and name in found.diagnoses else ()
    pictures = [Picture(png(recording_figure(as_measured, span)), caption, alt), *_detail(as_measured, span, alt)]
    return PageSection(f"{name} ({use})", (*pictures, start, *residuals))


def _detail(recording: Recording, span: NDArray[np.bool_] | None, alt: str) -> list[Picture]:
    """For a long recording, the part with the largest error of the position."""
    time = recording.measured.time
    if time[-1] - time[0] <= LONG_RECORDING:
        return []
    starts = np.searchsorted(time, np.arange(time[0], time[-1], DETAIL_LENGTH))
    squares = np.nan_to_num((recording.measured["position"] - recording.simulated["position"]) ** 2)
    worst = int(np.argmax(np.add.reduceat(squares, starts)))
    a, b = int(starts[worst]), int([*starts, time.size][worst + 1])
    if b - a < 2:
        return []
    part = replace(recording, measured=recording.measured.slice(a, b), simulated=recording.simulated.slice(a, b))
    figure = recording_figure(part, None if span is None else span[a:b])
    return [Picture(png(figure), f"The {DETAIL_LENGTH:.0f} s with the largest error of the position.", alt)]

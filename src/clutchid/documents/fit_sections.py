"""Sections of a fit: parameters with intervals, errors, and comparison with the recordings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from clutchid.documents.comparison import comparison_sections
from clutchid.documents.diagnosis import diagnosis_table, information_blocks, limit_blocks, residual_blocks, worst_first
from clutchid.documents.document import Block, Chapter, Details, Picture, Text
from clutchid.documents.fit_figures import recording_figure, reliable
from clutchid.documents.identifiability import identifiability_blocks, starts_figure
from clutchid.documents.style import BAR, MM
from clutchid.documents.tables import Cell, Column, ReportTable, load_table, scientific
from clutchid.estimation import Errors, Fit, Recording
from clutchid.estimation.assess.evidence import Evidence, as_recorded, evidence, reach
from clutchid.estimation.assess.verdict import verdict
from clutchid.log import BoolArray
from clutchid.numerics.interval import QUANTILE


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
    assumed = {f"{assumption.name}@{stem}": assumption for assumption in fit.assumed for stem in assumption.recordings}
    names = list(fit.parameters if names is None else names)
    for name in names:
        e, words = fit.parameters[name], parameter_meaning(fit, name)
        if name in assumed:
            value, half = assumed[name].value, assumed[name].half_width
            rows.append((name, e.unit, value, half / QUANTILE, value - half, value + half, f"{words}: assumed"))
        else:
            rows.append((name, e.unit, e.value, e.std, e.low, e.high, words))
    return ReportTable(title, columns, tuple(rows), note=_ASSUMED if assumed.keys() & {*names} else "")


_ASSUMED = (
    "Conditions that were not recorded keep their calibrated values, within an assumed range. The band of the load "
    "includes this range, and these data do not narrow it."
)


def parameter_meaning(fit: Fit, name: str) -> str:
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
    return f"Fixed: {'; '.join(fixed)}."


#: Greatest number of fitted, and of verified, recordings with figures; the others are in the tables.
MAX_DRAWN = 3

#: A recording longer than the first length in s has an additional figure of a part of the second length in s.
_LONG_RECORDING, _DETAIL_LENGTH = 120.0, 30.0


def fit_sections(fit: Fit) -> list[Chapter]:
    """Tables and figures of a fit, below its answer."""
    basis = evidence(fit)
    sections = comparison_sections(fit)
    if basis.diagnoses:
        blocks = (*information_blocks(fit, basis), *identifiability_blocks(fit))
        sections.append(Chapter("Parameters that the data determine", blocks))
    sections.append(Chapter("Parameters", parameter_blocks(fit)))
    if fit.recordings:
        sections.append(Chapter("Errors", _errors(fit, basis)))
        sections += _drawn(fit, basis, fit.recordings, "fitted")
    sections += _drawn(fit, basis, fit.verification, "verified, not fitted")
    limits = limit_blocks(verdict(fit), fit.recordings)
    return [*sections, Chapter("Limits of the result", limits)] if limits else sections


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


def _errors(fit: Fit, basis: Evidence) -> tuple[Block, ...]:
    scales = []
    if "position" in fit.scales:
        scales.append(f"{fit.scales['position'] / MM:.3g} mm for position")
    if "pressure_a" in fit.scales:
        scales.append(f"{fit.scales['pressure_a'] / BAR:.3g} bar for pressure")
    divided = Text(f"Residuals were divided by {' and '.join(scales) or 'nothing'}.")
    words = "Cost of every start of the search; hollow where it was only compared, and the search went on from another."
    starts = [Picture(starts_figure(fit), words, "Cost of every start")] if len(fit.starts) > 1 else []
    return (error_table(fit), *([diagnosis_table(basis)] if basis.diagnoses else []), divided, *starts)


def _drawn(fit: Fit, basis: Evidence, recordings: Mapping[str, Recording], use: str) -> list[Chapter]:
    """A section for each recording; of many, only those with the poorest fit."""
    names = list(recordings)
    if len(names) > MAX_DRAWN:
        worst = worst_first(basis, names)[:MAX_DRAWN]
        names = [name for name in names if name in worst]
    sections = [_section(fit, name, recordings[name], use, basis) for name in names]
    if len(names) < len(recordings):
        rest = f"{len(recordings) - len(names)} more ({use})"
        words = f"The {len(names)} recordings with the poorest fit are drawn; the others are in the table of errors."
        sections.append(Chapter(rest, (Text(words),)))
    return sections


def _section(fit: Fit, name: str, recording: Recording, use: str, basis: Evidence) -> Chapter:
    e = recording.errors
    rms = e.pressure_a_rms
    fitted = use == "fitted"
    pressure = "pressure not measured" if rms is None else f"{rms / BAR:.3f} bar rms in pressure"
    caption = f"{name}, {use}: {e.position_rms / MM:.3f} mm rms in position, {pressure}."
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
    residuals = residual_blocks(fit, basis.diagnoses[name]) if fitted and name in basis.diagnoses else ()
    pictures = [
        Picture(recording_figure(as_measured, span), caption, alt, dense=True),
        *_detail(as_measured, span, alt),
    ]
    return Chapter(f"{name} ({use})", (*pictures, start, *residuals))


def _detail(recording: Recording, span: BoolArray | None, alt: str) -> list[Picture]:
    """For a long recording, the part with the largest error of the position."""
    time = recording.measured.time
    if time[-1] - time[0] <= _LONG_RECORDING:
        return []
    starts = np.searchsorted(time, np.arange(time[0], time[-1], _DETAIL_LENGTH))
    squares = np.nan_to_num((recording.measured["position"] - recording.simulated["position"]) ** 2)
    worst = int(np.argmax(np.add.reduceat(squares, starts)))
    a, b = int(starts[worst]), int([*starts, time.size][worst + 1])
    if b - a < 2:
        return []
    part = replace(recording, measured=recording.measured.slice(a, b), simulated=recording.simulated.slice(a, b))
    figure = recording_figure(part, None if span is None else span[a:b])
    return [Picture(figure, f"The {_DETAIL_LENGTH:.0f} s with the largest error of the position.", alt, dense=True)]

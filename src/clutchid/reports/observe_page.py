"""Page of a recording that was observed: load before and after, by stroke, samples over time, parameters, health."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.observer.by_stroke import Known, known
from clutchid.observer.health import FLAGS, LIVE_FLAGS
from clutchid.observer.recording import ObservedRecording
from clutchid.recordings.files import write_text
from clutchid.reports.diagnosis_page import verdict_blocks
from clutchid.reports.figures import png, svg
from clutchid.reports.html import Block, Details, Notice, Page, Picture, Section, Text, escape, render
from clutchid.reports.observe_figures import loads_figure, samples_figure, strokes_figure
from clutchid.reports.observe_text import load_sentence, loads
from clutchid.reports.provenance import provenance
from clutchid.reports.tables import Cell, Column, Table

_AFTER = "after the recording"
_MEANINGS = {**FLAGS, **LIVE_FLAGS}
_LOADS = (
    "Load before and after the recording over the position of the piston, each with its pointwise 95 % band, and the "
    "change. The band before is that of a clutch that may have worn since. Shaded: 5 to 8 mm, where the clutch engages."
)
_STROKES = (
    "Load at three positions after each stroke, with its 95 % band; the first point is that before the recording."
)
_SAMPLES = (
    "Position and pressure as estimated at each sample from what came before it, the innovations (measured less "
    "predicted) with their 95 % bounds, and the duty cycles."
)
_SUPPLY = (
    "No supply pressure was recorded, so that of the calibration is assumed: 5 % less is taken for a load that is 6 % "
    "larger."
)


def observe_page(run: ObservedRecording, origin: Origin, command: str, path: str | PathLike[str]) -> None:
    """Write the page of an observed recording as one self-contained HTML file.

    Parameters
    ----------
    origin : Origin
        The calibration that the observer started from.
    command : str
        The command line that repeats the run, shown on the page.
    path
        The file; an existing one is replaced atomically.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.
    """
    write_text(render(page_of(run, origin, command)), path)


def page_of(run: ObservedRecording, origin: Origin, command: str) -> Page:
    """The page before it is rendered."""
    name = escape(run.log.name)
    sections = [
        Section("Load before and after", _result(run)),
        Section("Load by stroke", _by_stroke(run)),
        Section("Samples", (Picture(png(samples_figure(run)), f"{name}. {_SAMPLES}", "Samples over time"),)),
        Section("Parameters", _parameters(run)),
        Section("Flags", (health_table(run),)),
    ]
    subtitle = (
        f"Model {run.observer.actuator.model}; method {run.observer.method}; started from "
        f"{origin.name or 'a calibration that is not from a file'}."
    )
    title = f"Load and pressure of {run.log.name}, on line"
    return Page(title, subtitle, tuple(sections), provenance([run.log], command))


def _result(run: ObservedRecording) -> tuple[Block, ...]:
    notices = verdict_blocks(observed_verdict(indicators(run)))
    notices += [Notice(warning) for warning in run.log.warnings]
    raised = [f"{_MEANINGS[name]}: {seconds:.3g} s" for name, seconds in run.health.items() if seconds > 0.0]
    if raised:
        notices.append(Notice("Flags", "warning", tuple(raised)))
    else:
        notices.append(Notice("No fault was found.", "ok"))
    sentence = load_sentence(run)
    words = [f"{sentence[:1].upper()}{sentence[1:]}."]
    if run.observer.compares:
        words.append(f"Innovations (NIS in motion) are {run.after.mismatch:.2f} times those of the calibration.")
    if run.assumes_supply:
        words.append(_SUPPLY)
    alt = "Load before and after the recording over the position, and its change, with 95 % bands"
    figure = Picture(svg(loads_figure(loads(run))), _LOADS, alt)
    return (*notices, Text(escape(" ".join(words))), figure)


def _by_stroke(run: ObservedRecording) -> tuple[Block, ...]:
    if not run.strokes:
        return (Text("No stroke ended in the recording."),)
    return (Picture(svg(strokes_figure(run)), _STROKES, "Load at three positions by stroke"),)


def _parameters(run: ObservedRecording) -> tuple[Block, ...]:
    """Parameters and load weights that adapt, before and after; none if the load stays as calibrated."""
    names, weights = run.observer.adapting, run.observer.actuator.load.names
    if not names:
        return (Text("Nothing adapts: load and parameters stay as calibrated."),)
    parameters = [name for name in names if name not in weights]
    others = (parameter_table(run, "Parameters that adapt", parameters),) if parameters else ()
    table = parameter_table(run, "Load weights", [name for name in names if name in weights])
    return (*others, Details("Load weights", (table,)))


def parameter_table(run: ObservedRecording, title: str, names: Sequence[str]) -> Table:
    """Some parameters, with their meaning, or load weights, before and after the recording."""
    actuator = run.observer.actuator
    before, after = (known(run.observer, state) for state in (run.before, run.after))
    meant = not set(names) & set(actuator.load.names)
    columns = (
        Column("name", "parameter"), Column("unit", "unit"), Column("before", "before", significant=4),
        Column("after", "value", significant=4, group=_AFTER),
        Column("std", "standard\ndeviation", significant=2, group=_AFTER),
        Column("low", "95 %\nfrom", significant=4, group=_AFTER), Column("high", "to", significant=4, group=_AFTER),
        *([Column("meaning", "meaning")] if meant else []),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (
            name, actuator.unit(name), _rounded(before[name]), *after[name],
            *([actuator.row(name).meaning] if meant else []),
        )
        for name in names
    ]  # fmt: skip
    return Table(title, columns, tuple(rows))


def _rounded(one: Known) -> float:
    """A value, 0 where it differs from that by rounding only."""
    return one.value if abs(one.value) > 1e-6 * one.std else 0.0


def health_table(run: ObservedRecording) -> Table:
    """Seconds of each flag."""
    columns = (
        Column("flag", "flag"), Column("meaning", "meaning"), Column("seconds [s]", "seconds", 1.0, 3),
    )  # fmt: skip
    rows = tuple((name, _MEANINGS[name], seconds) for name, seconds in run.health.items())
    return Table("Seconds of each flag", columns, rows)

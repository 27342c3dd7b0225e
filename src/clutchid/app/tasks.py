"""What a job does, in its own process: open a recording, apply a map, fit, check a calibration, export."""

from __future__ import annotations

import json
import shutil
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.app import records
from clutchid.app.plots import CLOCK, clock_column
from clutchid.codegen.cache import when_compiling
from clutchid.documents.fit import application_data, compared_columns
from clutchid.documents.fit_json import curve_json, fit_json
from clutchid.documents.look_json import look_json, map_json
from clutchid.errors import ClutchidError, DataError, ParameterError
from clutchid.estimation.parameter_file import read_parameters
from clutchid.estimation.result import calibrated_curve
from clutchid.exports.fit_file import function_name, write_matlab
from clutchid.log import FloatArray, Log
from clutchid.measurements.checks import AMBIENT, in_si
from clutchid.measurements.columns import Heading
from clutchid.measurements.map.channel_map import read_map
from clutchid.measurements.opening import open_source
from clutchid.measurements.source import BLOCK, Source
from clutchid.measurements.stored import store, stored, write_column
from clutchid.numerics.progress import Step
from clutchid.verbs import saving
from clutchid.verbs.looking import checked, contents_of
from clutchid.verbs.observing import observed
from clutchid.verbs.options import pressure
from clutchid.verbs.progress import CALIBRATION, ESTIMATE, Progressed, shared
from clutchid.verbs.reading import Reading, RecordingFile
from clutchid.verbs.start import calibration_file

if TYPE_CHECKING:
    from clutchid.app.worker import Events
    from clutchid.estimation import Fit
    from clutchid.measurements.map.channel_map import ChannelMap

#: Most strokes and rests of a recording that are listed.
MOST_SECTIONS = 2000


def look(task: records.Look, events: Events) -> dict[str, Any]:
    """The contents of a recording, the checks, and how its channels are plotted.

    Raises
    ------
    DataError, ParameterError, MissingExtra
        As `clutchid.read`, or if its channel map cannot be understood.
    """
    events.progress("reading", None, "reading")

    def shown(done: int, size: int) -> None:
        events.progress("reading", 0.9 * done / max(size, 1), f"reading, {done:,} samples")

    if task.copied:
        source = stored(task.folder)
    else:
        opened = open_source(task.file.path)
        shutil.rmtree(task.folder, ignore_errors=True)
        source = store(opened, task.folder, BLOCK, shown)
    when_compiling(lambda _: events.progress("compiling", 0.9, "compiling the model, once per machine"))
    given = None if task.file.map is None else read_map(task.file.map)
    ambient = pressure(task.ambient or None)
    _write_clocks(source, given, task.folder)
    about = {
        "ambient": AMBIENT if ambient is None else ambient,
        "plots": [[heading.index for heading in grid.headings] for grid in source.rasters],  # columns, as look has them
        "strokes": [],
        "checking": False,
        **({} if given is None else {"map": map_json(given)}),
    }
    contents = contents_of(source, ambient, given)
    events.part({**look_json(contents, None, ""), **about, "checking": True})
    events.progress("checks", 0.9, "checks")
    try:
        found = checked(source, contents, ambient, given)
    except DataError as error:  # the map does not fit: the file is shown nevertheless
        return {**look_json(contents, None, ""), **about, "status": "bad_input", "message": str(error)}
    return {**look_json(contents, found.inspection, found.unchecked), **about, "strokes": _strokes(found.log)}


def cut(task: records.Cut, events: Events) -> dict[str, Any]:
    """Write the chosen strokes of stored columns as a recording, and open it.

    Raises
    ------
    DataError
        If none of the chosen strokes is there any more.
    """
    from clutchid.measurements import source_pieces, write
    from clutchid.strokes import cut as sections_of
    from clutchid.strokes import joined

    events.progress("cutting", None, "cutting")
    source = stored(task.source)
    given = None if task.map is None else read_map(task.map)
    chosen = {round(float(begin), 6) for begin in task.begins}
    pieces = source_pieces(source, given, pressure(task.look.ambient or None))
    sections = [section for section in sections_of(pieces) if round(section.start, 6) in chosen]
    if not sections:
        raise DataError(f"{source.path.name}: no stroke is chosen.")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write(joined(sections), task.look.file.path)
    return look(task.look, events)


def _write_clocks(source: Source, given: ChannelMap | None, folder: Path) -> None:
    """The time of every grid in s, as a column: that of the map, of the file, or the number of the sample."""
    from clutchid.measurements.map.picking import own_clock

    for index, raster in enumerate(source.rasters):
        clock = own_clock(raster)[0]
        entry = None if given is None else given.channels.get("time")
        if entry is not None:
            named = next((h for h in raster.headings if h.text == entry.channel), None)
            if named is not None:
                clock = Heading(named.index, named.text, "time", entry.unit or named.unit)
        rate = 1.0 if given is None or given.rate is None else given.rate
        parts = []
        done = 0
        for table in source.tables(index, [] if clock is None else [clock.index], BLOCK):
            if clock is None or clock.index not in table.numbers:
                parts.append((done + np.arange(table.size)) / rate)
            else:
                parts.append(in_si(clock, table.numbers[clock.index], AMBIENT))
            done += table.size
        write_column(folder, index, CLOCK, clock_column(np.concatenate(parts) if parts else np.empty(0)))


def _strokes(log: Log | None) -> list[dict[str, Any]]:
    """The sections of a recording with their label, start and end in s."""
    from clutchid.strokes import cut

    if log is None or not {"position", "duty_supply", "duty_exhaust"} <= {*log.columns}:
        return []
    sections = islice(cut(log), MOST_SECTIONS)
    return [{"kind": one.kind, "label": one.label, "begin": one.start, "end": one.end} for one in sections]


def _files(files: Sequence[records.File]) -> tuple[RecordingFile, ...]:
    """Recordings, each with the channel map of its own."""
    return tuple(RecordingFile(file.path, file.map) for file in files)


def fit(task: records.FitRecordings, events: Events) -> dict[str, Any]:
    """Calibrate, or estimate a load, as the command of the same verb, and write its files into the folder of the task.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`.
    """
    asked = task.asked
    usual = CALIBRATION if asked.verb == "calibrate" else ESTIMATE

    def show(done: Progressed) -> None:
        events.progress(done.step.stage, done.share, done.words)

    progress = shared(usual, show)
    when_compiling(lambda _: progress(Step("compiling")))
    found = asked.run_on(_files(task.recordings), _files(task.verify), task.start, progress).raised()
    progress(Step("writing"))
    shown = _shown(found, task)
    events.part({**shown, "writing": True})
    return {**shown, **_written(found, task)}


def _written(found: Fit, task: records.FitRecordings) -> dict[str, Any]:
    """Write the files of a fit; their names, and why others could not be written."""
    folder, files, failures = task.folder, ["result.json"], []
    for name in ("fit.toml", "report.html", "fit.m", "fit.mat"):
        try:
            if name.endswith(".html"):
                saving.report(found, task.asked.command, folder / name)
            elif name.endswith(".m"):
                write_matlab(found, folder / name, function_name(*task.name.split()))
            else:
                saving.save(found, folder / name)
            files.append(name)
        except ClutchidError as error:
            failures.append(f"{name}: {error}")
    (folder / "result.json").write_text(json.dumps(records.finite(fit_json(found))), encoding="utf-8")
    return {"files": files, "failures": failures}


def _shown(found: Fit, task: records.FitRecordings) -> dict[str, Any]:
    """What the page shows of a fit."""
    kept = Path(records.download_name(task.name, "fit.toml"))
    command = replace(task.asked, save=(kept,), report=kept.with_suffix(".html")).command
    return {
        **application_data(found, command),
        "recordings": _residuals(found, task.folder / "columns"),
        "files": [],
        "failures": [],
        "writing": False,
    }


def _residuals(found: Fit, folder: Path) -> list[dict[str, Any]]:
    """Columns of the fitted and verified recordings, and their names by number."""
    folder.mkdir(parents=True, exist_ok=True)
    shown = []
    columns = compared_columns(found)
    for grid, (name, one) in enumerate({**found.recordings, **found.verification}.items()):
        _write_columns(folder, grid, one.measured.time, columns[name].values())
        span = [float(one.measured.time[0]), float(one.measured.time[-1])]
        shown.append({"name": name, "columns": [*columns[name]], "span": span, "verified": name in found.verification})
    return shown


def _write_columns(folder: Path, grid: int, time: FloatArray, columns: Iterable[FloatArray]) -> None:
    """The columns of a plot over one time."""
    for number, values in ((CLOCK, clock_column(time)), *enumerate(columns)):
        write_column(folder, grid, number, values)


def check_calibration(task: records.ReadCalibration, events: Events) -> dict[str, Any]:
    """What a parameter file holds, if it is a calibration.

    Raises
    ------
    DataError, ParameterError
        If it cannot be understood, or is no calibration.
    """
    events.progress("reading", None, "reading")
    try:
        content = read_parameters(task.path)
    except ParameterError as error:
        raise ParameterError(_no_calibration(task) or str(error).replace(str(task.path), task.name)) from None
    known = content.calibration
    if known is None:
        raise ParameterError(
            f"{task.name}: is a parameter file without a calibration; a calibration is written by "
            "`clutchid calibrate --save CAL.toml`."
        )
    curve = calibrated_curve(content.actuator, known)
    return {
        "status": "ok", "load_curve": None if curve is None else curve_json(curve), "is_calibration": True,
        "trust": content.origin.trust or "",
        "created": content.origin.created, "files": ["fit.toml"], "recordings": [], "reasons": [], "parameters": {},
    }  # fmt: skip


def _no_calibration(task: records.ReadCalibration) -> str:
    """Advice for a channel map that was taken for a calibration; empty for other files."""
    try:
        read_map(task.path)
    except (DataError, ParameterError):
        return ""
    return f"{task.name}: is a channel map; give it to a recording with “Use a map” in its table of channels."


def export(task: records.Export, events: Events) -> dict[str, Any]:
    """Export the observer of a calibration, and pack it as a ZIP file.

    Raises
    ------
    DataError, ParameterError, ExportError
        As `clutchid.export`.
    """
    from clutchid.exports.exporting import targets_of
    from clutchid.verbs.exporting import export as exported

    events.progress("export", None, "writing the C and comparing it with Python")
    when_compiling(lambda _: events.progress("compiling", None, "compiling the model, once per machine"))
    made = task.folder / "export"
    shutil.rmtree(made, ignore_errors=True)
    done = exported(task.start, made, to=targets_of(task.to), method=task.method)
    archive = shutil.make_archive(str(made), "zip", made)
    parity = done.parity
    words = f"{len(done.files)} files"
    if parity is not None:
        holds = "holds" if done.holds else "does not hold"
        words += f"; parity {holds} on {parity.recording}: load {100 * parity.load:.2g} % of its peak"
    return {"file": Path(archive).name, "words": words, "notes": list(done.notes)}


def observe(task: records.Observe, events: Events) -> dict[str, Any]:
    """Follow a recording with the observer of a calibration, and write its columns and its loads by stroke.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.observe`.
    """
    from clutchid.documents import document_of
    from clutchid.documents.document import page_rows
    from clutchid.documents.results import Observation
    from clutchid.observer.by_stroke import curve, positions
    from clutchid.observer.observer import start

    events.progress("reading", 0.0, "reading")
    when_compiling(lambda _: events.progress("compiling", 0.1, "compiling the model, once per machine"))
    content = calibration_file(task.start)
    events.progress("observing", 0.3, "following the samples")
    run = observed(Reading(_files([task.recording]), force=task.force), content, task.method)
    log = run.log
    events.progress("writing", 0.9, "writing")
    folder = task.folder / "columns"
    folder.mkdir(parents=True, exist_ok=True)
    estimates = run.estimates()
    names = [name for name in OBSERVED if name in estimates.columns]
    _write_columns(folder, 0, log.time, (np.asarray(estimates.columns[name], dtype=np.float64) for name in names))
    grid = positions(run.observer)
    loads = [(float(log.time[0]), 0, curve(run.observer, run.before, grid))]
    loads += [(row.time, row.number, row.curve) for row in run.strokes]
    rows = page_rows(document_of(Observation(run, content.origin)))
    return {
        "columns": names,
        "span": [float(log.time[0]), float(log.time[-1])],
        "calibrated": curve_json(curve(run.observer, start(run.observer), grid)),
        "loads": [{"time": time, "stroke": number, "curve": curve_json(one)} for time, number, one in loads],
        "health": dict(run.health),
        "summary": rows,
        "next": {"kind": "correct", "why": "correct what the reasons say", "command": ""}
        if any(row["mood"] == "none" for row in rows)
        else {"kind": "export", "why": "export the observer for a control unit", "command": ""},
        "warnings": [*log.warnings],
    }


def open_table(task: records.ReadTable, events: Events) -> dict[str, Any]:
    """The table of a fleet, or the trend and the loads of a vehicle, from the files of their commands.

    Raises
    ------
    DataError
        As `clutchid.app.tables.opened`.
    """
    from clutchid.app import tables  # half a second of imports, which other jobs need not wait for

    events.progress("reading", None, "reading")
    return tables.opened(task.path, task.below, task.vehicle)


#: Columns of an observed recording that are plotted.
OBSERVED = (
    "position", "pressure_a", "pressure_a low", "pressure_a high", "pressure_a_measured [Pa]", "innovation",
    "innovation std", "used [1]", "nis_ratio [1]",
)  # fmt: skip


#: What does each task.
TASKS: Mapping[type[records.Task], Callable[[Any, Events], dict[str, Any]]] = {
    records.Look: look,
    records.Cut: cut,
    records.FitRecordings: fit,
    records.ReadCalibration: check_calibration,
    records.Export: export,
    records.Observe: observe,
    records.ReadTable: open_table,
}

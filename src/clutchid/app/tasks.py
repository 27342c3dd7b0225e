"""Tasks of jobs, each in a process of its own: open a recording, apply a map, fit, check a calibration, export."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.app import records
from clutchid.app.uploads import download_name
from clutchid.documents import Observation, write_page
from clutchid.documents.fit import application_data, compared_columns
from clutchid.documents.fit_json import curve_json, fit_json
from clutchid.documents.json_text import json_text
from clutchid.documents.look import look_json, map_json
from clutchid.documents.observation import observation_data
from clutchid.documents.results import Looked
from clutchid.errors import ClutchidError, DataError, ParameterError
from clutchid.numerics.progress import Step
from clutchid.verbs import saving
from clutchid.verbs.looking import is_map
from clutchid.verbs.next_step import document_with_next_step
from clutchid.verbs.observing import ObserveRequest, observed
from clutchid.verbs.options import pressure_option
from clutchid.verbs.progress import CALIBRATION, ESTIMATE, Progressed, shared, when_compiling
from clutchid.verbs.reading import Reading
from clutchid.verbs.start import calibration_file, saved_load
from clutchid.verbs.stored import copied, sections, stored_recording, write_columns

if TYPE_CHECKING:
    from clutchid import Fit
    from clutchid.app.worker import Events

#: Most strokes and rests of a recording that are listed.
_MOST_SECTIONS = 2000


def look(task: records.Look, events: Events) -> dict[str, Any]:
    """The contents of a recording, the checks, and how its channels are plotted.

    Raises
    ------
    DataError, ParameterError, MissingExtra
        As `clutchid.read`, or if its channel map cannot be understood.
    """
    events.progress("reading", None, "reading")

    def shown(count: int, size: int) -> None:
        events.progress("reading", 0.9 * count / max(size, 1), f"reading, {count:,} samples")

    if not task.copied:
        copied(task.file.path, task.folder, shown)
    when_compiling(lambda _: events.progress("compiling", 0.9, "compiling the model, once per machine"))
    recording = stored_recording(task.folder, task.file.map, pressure_option(task.ambient or None))
    about = {
        "ambient": recording.shown_ambient,
        "plots": recording.grids,
        "strokes": [],
        "checking": False,
        **({} if recording.channels is None else {"map": map_json(recording.channels)}),
    }
    contents = recording.contents()
    events.part({**look_json(Looked(contents)), **about, "checking": True})
    events.progress("checks", 0.9, "checks")
    try:
        checks = recording.checked(contents)
    except DataError as error:  # the map does not fit: the file is shown nevertheless
        return {**look_json(Looked(contents)), **about, "status": "bad_input", "message": str(error)}
    strokes = [
        {"kind": section.kind, "begin": section.start, "end": section.end}
        for section in sections(checks.log, _MOST_SECTIONS)
    ]
    return {**look_json(checks), **about, "strokes": strokes}


def cut(task: records.Cut, events: Events) -> dict[str, Any]:
    """Write a span of stored columns as a recording, and open it."""
    events.progress("cutting", None, "cutting")
    recording = stored_recording(task.source, task.map, pressure_option(task.look.ambient or None))
    recording.cut(task.span, task.look.file.path)
    return look(task.look, events)


def fit(task: records.FitRecordings, events: Events) -> dict[str, Any]:
    """Calibrate, or estimate a load, as the command of the same verb, and write its files into the folder of the task.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`.
    """
    asked = task.asked
    usual = CALIBRATION if asked.verb == "calibrate" else ESTIMATE

    def show(state: Progressed) -> None:
        events.progress(state.step.stage, state.share, state.words)

    progress = shared(usual, show)
    when_compiling(lambda _: progress(Step("compiling")))
    paths, others = ([file.path for file in files] for files in (task.recordings, task.verify))
    maps = {file.path: file.map for file in (*task.recordings, *task.verify)}
    reading = replace(asked.files.reading(paths, others, force=asked.force), maps=maps)
    result = asked.run_on(reading, task.start, progress).raised()
    progress(Step("writing"))
    shown = _shown(result, task)
    events.part({**shown, "writing": True})
    return {**shown, **_written(result, task)}


def _written(result: Fit, task: records.FitRecordings) -> dict[str, Any]:
    """Write the files of a fit; their names, and why others could not be written."""
    folder, files, failures = task.folder, ["result.json"], []
    for name in ("fit.toml", "report.html", "fit.mat"):
        try:
            if name.endswith(".html"):
                write_page(document_with_next_step(result, task.asked), folder / name)
            else:
                saving.save_fit(result, folder / name)
            files.append(name)
        except ClutchidError as error:
            failures.append(f"{download_name(task.name, name)}: {error}")
    (folder / "result.json").write_text(json_text(fit_json(result)), encoding="utf-8")
    return {"files": files, "failures": failures}


def _shown(result: Fit, task: records.FitRecordings) -> dict[str, Any]:
    """Content of the page of a fit."""
    file = Path(download_name(task.name, "fit.toml"))
    asked = replace(task.asked, save=(file,), report=file.with_suffix(".html"))
    return {
        **application_data(result, document_with_next_step(result, asked)),
        "recordings": _residuals(result, task.folder / "columns"),
        "files": [],
        "failures": [],
        "writing": False,
    }


def _residuals(result: Fit, folder: Path) -> list[dict[str, Any]]:
    """Columns of the fitted and verified recordings, and their names by number."""
    shown = []
    columns = compared_columns(result)
    for grid, (name, recording) in enumerate({**result.recordings, **result.verification}.items()):
        write_columns(folder, grid, recording.measured.time, columns[name].values())
        span = [float(recording.measured.time[0]), float(recording.measured.time[-1])]
        shown.append({"name": name, "columns": [*columns[name]], "span": span, "verified": name in result.verification})
    return shown


def check_calibration(task: records.ReadCalibration, events: Events) -> dict[str, Any]:
    """Content of a parameter file that is a calibration.

    Raises
    ------
    DataError, ParameterError
        If it cannot be understood, or is no calibration.
    """
    events.progress("reading", None, "reading")
    try:
        saved = saved_load(task.path)
    except ParameterError as error:
        if is_map(task.path):
            advice = "give it to a recording with “Use a map” in its table of channels"
            raise ParameterError(f"{task.name}: is a channel map; {advice}.") from None
        raise ParameterError(str(error).replace(str(task.path), task.name)) from None
    return {
        "status": "ok", "load_curve": curve_json(saved.load), "reach_m": saved.reach, "trust": saved.trust or "",
        "is_calibration": saved.is_calibration, "created": saved.created, "files": ["fit.toml"], "recordings": [],
        "reasons": [], "parameters": {},
    }  # fmt: skip


def export(task: records.Export, events: Events) -> dict[str, Any]:
    """Export the observer of a calibration, and pack it as a ZIP file.

    Raises
    ------
    DataError, ParameterError, ExportError
        As `clutchid.export`.
    """
    from clutchid.verbs.exporting import export as exported

    events.progress("export", None, "writing the C code and comparing it with Python")
    when_compiling(lambda _: events.progress("compiling", None, "compiling the model, once per machine"))
    made = task.folder / "export"
    shutil.rmtree(made, ignore_errors=True)
    bundle = exported(task.start, made, to=task.to, method=task.method)
    archive = shutil.make_archive(str(made), "zip", made)
    return {"file": Path(archive).name, "words": bundle.message, "notes": list(bundle.notes)}


def observe(task: records.Observe, events: Events) -> dict[str, Any]:
    """Follow a recording with the observer of a calibration, and write its columns and its loads by stroke.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.observe`.
    """
    events.progress("reading", 0.0, "reading")
    when_compiling(lambda _: events.progress("compiling", 0.1, "compiling the model, once per machine"))
    content = calibration_file(task.start)
    events.progress("observing", 0.3, "following the samples")
    file = task.recording
    run = observed(Reading((file.path,), channels=file.map, force=task.force), content, ObserveRequest(task.method))
    events.progress("writing", 0.9, "writing")
    estimates = run.estimates()
    names = [name for name in _OBSERVED if name in estimates.columns]
    values = (np.asarray(estimates.columns[name], dtype=np.float64) for name in names)
    write_columns(task.folder / "columns", 0, run.log.time, values)
    return {"columns": names, **observation_data(Observation(run, content.origin))}


#: Columns of an observed recording that are plotted.
_OBSERVED = (
    "position", "pressure_a", "pressure_a low", "pressure_a high", "pressure_a_measured [Pa]", "innovation",
    "innovation std", "used [1]", "nis_ratio [1]",
)  # fmt: skip


#: Functions of the tasks by their type.
TASKS: Mapping[type[records.Task], Callable[[Any, Events], dict[str, Any]]] = {
    records.Look: look,
    records.Cut: cut,
    records.FitRecordings: fit,
    records.ReadCalibration: check_calibration,
    records.Export: export,
    records.Observe: observe,
}

"""`Session`: recordings, jobs and results of a running server, and the actions on them."""

from __future__ import annotations

import itertools
import os
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from uuid import uuid4

import tomli_w

from clutchid.app import records
from clutchid.app.board import Board, BoardItem
from clutchid.app.commands import VERBS, fit_command, repeated, repeated_observation
from clutchid.app.jobs import Job, Jobs, Lane
from clutchid.app.project import kept, read_project, write_project
from clutchid.app.uploads import download_name, safe_name
from clutchid.errors import DataError, ParameterError
from clutchid.names import printable
from clutchid.systems import replace
from clutchid.verbs.choosing import checked_search, choices
from clutchid.verbs.options import pressure_option


class Session:
    """State of a server.

    Parameters
    ----------
    folder
        Its own, for uploads, columns and results.
    below, given
        The folder whose files may be opened by path, and further files.
    trace
        Called with the traceback of an error in a job that nobody expected.
    project
        Whether recordings, maps and results come back with the next server of this folder.
    """

    def __init__(
        self, folder: Path, below: Path, named: Sequence[Path] = (), trace: Callable[[str], None] = lambda _: None,
        *, project: bool = False,
    ) -> None:  # fmt: skip
        self.name = uuid4().hex
        self.folder, self.below, self.named = folder, below.resolve(), tuple(named)
        self.board = Board()
        items = read_project(folder) if project else []
        for item in items:
            self.board.put(item)
        if project:
            self.board.changed = self._keep
        self.jobs = Jobs(folder / "processes", self._job_changed, self._job_done, trace)
        self._numbers = itertools.count(1 + max((int(_number(item.id)) for item in items), default=0))

    def _keep(self, before: BoardItem | None, after: BoardItem | None) -> None:
        if kept(before) != kept(after):
            write_project(self.folder, self.board.kept_items())

    def resume(self) -> None:
        """Begin to read the recordings of a project again, and the files that were named."""
        for recording in self.board.all(records.Recording):
            self._look(recording, copied=False)
        there = {item.path for item in self.board.all(records.Recording)}
        for path in self.named:
            if path not in there:
                self.open_any(path)

    # recordings

    def open_any(self, path: Path) -> str:
        """Begin to read a file as a calibration or as a recording, by its suffix; the id."""
        is_toml = path.suffix.lower() == ".toml"
        return self.open_calibration(path, path.name, move=False) if is_toml else self.open(path)

    def _look(self, recording: records.Recording, *, copied: bool) -> None:
        self.board.update(recording.id, status="reading", message="")
        file = records.File(recording.path, recording.map)
        task = records.Look(file, self._columns(recording.id), recording.ambient, copied=copied)
        self.jobs.submit(f"{'check' if copied else 'open'} {recording.name}", "files", task, recording.id)

    def upload_path(self, name: str) -> tuple[str, Path]:
        """An id and a new file for an upload with this name, in a folder of its own."""
        id_ = self._id("recording")
        path = self.folder / "uploads" / id_ / safe_name(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        return id_, path

    def open(self, path: Path, id_: str | None = None, *, uploaded: bool = False) -> str:
        """Begin to read a file as a recording; the id of the recording."""
        id_ = id_ or self._id("recording")
        recording = records.Recording(id_, printable(path.name), path, uploaded, size=path.stat().st_size)
        return self._begin(
            f"open {recording.name}", "files", recording, records.Look(records.File(path), self._columns(id_))
        )

    def set_map(self, id_: str, channels: Mapping[str, Any], rate: float | None, ambient: str) -> None:
        """Give a recording a channel map, and look at it again.

        Raises
        ------
        DataError, ParameterError
            If there is no such recording, or the map is none; the text lists all problems.
        """
        from clutchid.verbs.looking import read_map

        self._recording(id_)
        pressure_option(ambient or None)
        file = self.folder / "maps" / id_ / "map.toml"
        file.parent.mkdir(parents=True, exist_ok=True)
        tried = file.with_name("tried.toml")
        try:
            tried.write_text(tomli_w.dumps(_stated({"rate": rate, **channels})), encoding="utf-8")
            read_map(tried)
        except (ParameterError, DataError) as error:
            raise ParameterError(str(error).replace(str(tried), "map")) from None
        except TypeError:  # what JSON has and TOML has not
            raise ParameterError("map: entries of a channel map are texts and numbers.") from None
        replace(tried, file)
        self.jobs.cancel_about(id_)
        self.board.update(id_, map=file, ambient=ambient)
        self._look(self._recording(id_), copied=True)

    def cut(self, id_: str, span: tuple[float, float]) -> str:
        """Begin to write a span in s of a recording as a new recording; its id.

        Raises
        ------
        DataError
            If there is no such recording.
        """
        whole = self._recording(id_)
        new, path = self.upload_path(f"{Path(safe_name(whole.name)).stem}-cut.parquet")
        look = records.Look(records.File(path), self._columns(new), whole.ambient)
        task = records.Cut(self._columns(id_), whole.map, span, look)
        recording = records.Recording(new, path.name, path, uploaded=True)
        return self._begin(f"cut {whole.name}", "files", recording, task)

    def forget(self, id_: str) -> None:
        """Remove a recording or a result with its files."""
        self.jobs.cancel_about(id_)
        self.board.remove(id_)
        for name in ("uploads", "columns", "maps", "results"):
            shutil.rmtree(self.folder / name / id_, ignore_errors=True)

    # results

    def fit(self, verb: str, recordings: Sequence[str], verify: Sequence[str], start: str | None, options: Any) -> str:
        """Begin a fit; the id of its result.

        Raises
        ------
        DataError, ParameterError
            If a recording, the calibration or an option is not as the verb needs it.
        """
        if verb not in VERBS:
            raise ParameterError(f"{verb}: is not known; {' or '.join(VERBS)}.")
        if not recordings:
            raise ParameterError(f"no recording given to {verb}; choose one above.")
        if verb == "estimate" and start is None:
            raise ParameterError(
                "no --start: a load is estimated from position alone with a calibration. Calibrate a recording with "
                "pressure first, or open a calibration that was saved."
            )
        files, others = self._files(recordings), self._files(verify)
        calibration = None if start is None else self.calibration_file(start)
        asked = fit_command(verb, options, files, others, None if start is None else self._start_name(start))
        checked_search(verb, asked.search, calibration)
        command, python = repeated(asked, [*files, *others])
        id_, folder = self._result_folder("result")
        # the result names its calibration as the command does
        first = shutil.copyfile(calibration, folder / asked.start.name) if calibration and asked.start else None
        name = self._name(verb, id_, recordings)
        chosen = files[0].map if asked.files.map else None  # which outlives its recording
        own = shutil.copyfile(chosen, folder / "map.toml") if chosen else None
        task = records.FitRecordings(asked, name, files, folder, others, first)
        result = records.Result(
            id_, verb, name, recordings=tuple(recordings), verify=tuple(verify), start=start,
            options=asked.search, made=time.time(), command=command, python=python, map=own,
        )  # fmt: skip
        return self._begin(name, "fits", result, task)

    def choices(self, verb: str, free: str, start: str | None, options: Any) -> dict[str, Any]:
        """Parameters that a fit may free, and the sentence that refuses its options, empty where none does.

        Raises
        ------
        DataError, ParameterError
            If the calibration is not there, or cannot be read.
        """
        calibration, message = None if start is None else self.calibration_file(start), ""
        try:
            checked_search(verb, fit_command(verb, options, ()).search, calibration)
        except ParameterError as error:
            message = str(error)
        return {"choices": [choice._asdict() for choice in choices(verb, free, calibration)], "message": message}

    def open_calibration(self, path: Path, name: str, *, move: bool) -> str:
        """Begin to read a calibration from a file; the id of its result."""
        id_, folder = self._result_folder("result")
        file = folder / "fit.toml"
        if move:
            replace(path, file)
        else:
            shutil.copyfile(path, file)
        shown = printable(name)
        if shown in {result.name for result in self.board.all(records.Result)}:
            shown = f"{shown.removesuffix('.toml')} ({_number(id_)}).toml"
        result = records.Result(id_, "file", shown, made=time.time())
        return self._begin(f"open {shown}", "files", result, records.ReadCalibration(file, name))

    def observe(self, recording: str, start: str, method: str, *, force: bool) -> str:
        """Begin to follow a recording with the observer of a calibration; the id of the observation.

        Raises
        ------
        DataError
            If the recording or the calibration is not there.
        """
        (file,), first = self._files([recording]), self.calibration_file(start)
        id_, folder = self._result_folder("observation")
        command, python = repeated_observation(file, self._start_name(start), method, force=force)
        task = records.Observe(file, first, method, folder, force)
        name = self._name("observe", id_, [recording])
        run = records.Observation(id_, name, method, recording, start, command=command, python=python)
        return self._begin(name, "fits", run, task)

    def export(self, id_: str, to: str, method: str) -> None:
        """Begin to export the observer of a calibration.

        Raises
        ------
        DataError
            If it is none.
        """
        start = self.calibration_file(id_)
        result = self.board.get(records.Result, id_)
        task = records.Export(start, to, method, start.parent)
        self.jobs.submit(f"export {result.name if result else ''}", "fits", task, id_)

    # files

    def calibration_file(self, id_: str) -> Path:
        """The parameter file of a result.

        Raises
        ------
        DataError
            If there is none.
        """
        path = self.folder / "results" / id_ / "fit.toml"
        if self.board.get(records.Result, id_) is None or not path.is_file():
            raise DataError("this calibration has been removed; choose another one.")
        return path

    def file_of(self, id_: str, name: str) -> tuple[Path, records.Result]:
        """A file of a result by its name, and the result.

        Raises
        ------
        DataError
            If there is none.
        """
        result = self.board.get(records.Result, id_)
        path = self.folder / "results" / id_ / name
        if result is not None and path.is_file():
            files = (result.found or {}).get("files", ())
            if name in files or any(name == export["file"] for export in result.exports):
                return path, result
        raise DataError(f"{printable(name)}: there is no such file of this result.")

    def columns_of(self, kind: type[records.Recording | records.Result | records.Observation], id_: str) -> Path:
        """The stored columns of a recording or of a result.

        Raises
        ------
        DataError
            If there is none.
        """
        if self.board.get(kind, id_) is None:
            raise DataError(f"this {kind.__name__.lower()} has been removed.")
        return self._columns(id_) if kind is records.Recording else self.folder / "results" / id_ / "columns"

    # jobs

    def _begin(self, title: str, lane: Lane, item: records.PageItem, task: records.Task) -> str:
        """Put a record on the board and submit the job that will complete it; its id."""
        self.board.put(item)
        self.jobs.submit(title, lane, task, item.id)
        return item.id

    def _job_changed(self, job: Job) -> None:
        self.board.put(job)
        if isinstance(job.task, records.Export):
            return
        if job.status in ("failed", "cancelled"):
            self.board.update(job.about, status=job.status, message=job.message, bad_input=job.bad_input)
        elif job.status == "running" and (item := self.board.item(job.about)) and item.status == "waiting":
            self.board.update(job.about, status="running")

    def _job_done(self, job: Job, content: dict[str, Any]) -> None:
        task = job.task
        if isinstance(task, records.Export):
            result = self.board.get(records.Result, job.about)
            if result is not None:
                self.board.update(job.about, exports=(*result.exports, content))
        elif isinstance(task, records.Look | records.Cut):
            path = (task.look if isinstance(task, records.Cut) else task).file.path
            size = path.stat().st_size if path.exists() else 0
            self.board.update(job.about, status="ready", look=content, size=size, message="")
        else:
            self.board.update(job.about, status="done", found=content, message="")

    # records

    def _id(self, kind: str) -> str:
        return f"{kind}-{next(self._numbers)}"

    def _columns(self, id_: str) -> Path:
        return self.folder / "columns" / id_

    def _result_folder(self, kind: str) -> tuple[str, Path]:
        """An id and a new folder for the files of a result."""
        id_ = self._id(kind)
        folder = self.folder / "results" / id_
        folder.mkdir(parents=True)
        return id_, folder

    def _recording(self, id_: str) -> records.Recording:
        recording = self.board.get(records.Recording, id_)
        if recording is None:
            raise DataError("this recording has been removed; open it again.")
        return recording

    def _files(self, ids: Sequence[str]) -> tuple[records.File, ...]:
        """Recordings as jobs read them, each with the name that a command has for it."""
        recordings = [self._recording(id_) for id_ in ids]
        for recording in recordings:
            if recording.look is None:
                raise DataError(f"{recording.name}: is not read yet.")
        names = (recording.name if recording.uploaded else _relative(recording.path) for recording in recordings)
        files = ((recording.path, recording.map) for recording in recordings)
        return tuple(records.File(*file, name) for file, name in zip(files, names, strict=True))

    def _name(self, verb: str, id_: str, recordings: Sequence[str]) -> str:
        """Name of a result on the page, in its files and in commands: what was done with which recordings."""
        first, *others = (self._recording(recording).name for recording in recordings)
        return f"{verb} {first}{f' and {len(others)} more' if others else ''} ({_number(id_)})"

    def _start_name(self, id_: str) -> str:
        result = self.board.get(records.Result, id_)
        return download_name(result.name if result else "CAL.toml", "fit.toml")


def _number(id_: str) -> str:
    return id_.partition("-")[2]


def _stated(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of a channel map without null, which TOML lacks."""
    stated = {name: value for name, value in entries.items() if value is not None}
    return {name: _stated(value) if isinstance(value, dict) else value for name, value in stated.items()}


def _relative(path: Path) -> str:
    """A path, relative if it lies in the current folder."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else os.fspath(path)

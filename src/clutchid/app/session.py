"""`Session`: recordings, jobs and results of a running server, and what may be done with them."""

from __future__ import annotations

import itertools
import os
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from clutchid.app.board import Board
from clutchid.app.jobs import Job, Jobs
from clutchid.app.uploads import safe_name
from clutchid.errors import DataError, ParameterError
from clutchid.names import printable
from clutchid.systems import command_line, replace
from clutchid.verbs.options import bounds, pressure, priors

#: What a fit on the page asks for, by verb: the defaults of the commands of the same name.
VERBS: Mapping[str, Mapping[str, str]] = {
    "calibrate": {"measure": "position,pressure_a", "free": "auto"},
    "estimate": {"measure": "position", "free": "load"},
}

#: Methods of a fit; an empty text leaves the choice to it.
METHODS = ("", "simulation", "shooting", "prediction-error")

#: Content of the files of a result, by suffix.
MEDIA = {
    ".toml": "application/toml",
    ".json": "application/json",
    ".m": "text/plain; charset=utf-8",
    ".mat": "application/octet-stream",
    ".zip": "application/zip",
    ".html": "text/html; charset=utf-8",
}


class Session:
    """All that one server has.

    Parameters
    ----------
    folder
        Its own, for uploads, columns and results.
    below, given
        The folder whose files may be opened by path, and further files.
    trace
        Called with the traceback of an error in a job that nobody expected.
    """

    def __init__(
        self,
        folder: Path,
        below: Path,
        given: Sequence[Path] = (),
        trace: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.folder, self.below, self.given = folder, below.resolve(), tuple(given)
        self.board = Board()
        self.jobs = Jobs(folder / "processes", self._job_changed, self._job_done, trace)
        self._numbers = itertools.count(1)

    # recordings

    def upload_path(self, name: str, kind: str = "recording", beside: str = "") -> tuple[str, Path]:
        """An id and a new file for an upload with this name, in a folder of its own or in that of another upload."""
        id_ = beside or self._id(kind)
        path = self.folder / "uploads" / id_ / safe_name(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        return id_, path

    def open(self, path: Path, id_: str | None = None, *, uploaded: bool = False, dbc: Sequence[str] = ()) -> str:
        """Begin to read a file as a recording; the id of the recording."""
        id_ = id_ or self._id("recording")
        self.board.put("recording", id_, {
            "id": id_, "name": printable(path.name), "path": str(path), "uploaded": uploaded, "status": "reading",
            "size": path.stat().st_size, "message": "", "look": None, "map": None, "dbc": [*dbc], "ambient": "",
        })  # fmt: skip
        folder = str(self.folder / "columns" / id_)
        task = {"do": "open", "path": str(path), "folder": folder, "dbc": [*dbc]}
        self.jobs.submit(f"open {printable(path.name)}", "files", task, id_)
        return id_

    def set_map(self, id_: str, channels: Mapping[str, Any], rate: float | None, ambient: str) -> None:
        """Give a recording a channel map, and look at it again.

        Raises
        ------
        DataError, ParameterError
            If there is no such recording, or the map is none; the text lists all problems.
        """
        from clutchid.measurements.map.channel_map import read_map

        known = self._recording(id_)
        pressure(ambient or None)
        kept = self.folder / "maps" / id_ / "map.toml"
        kept.parent.mkdir(parents=True, exist_ok=True)
        tried = kept.with_name("tried.toml")
        entries = {
            name: {key: value for key, value in entry.items() if value is not None}
            if isinstance(entry, dict)
            else entry
            for name, entry in channels.items()
        }
        content = {**({"rate": rate} if rate is not None else {}), **entries}
        try:
            tried.write_text(tomli_w.dumps(content), encoding="utf-8")
            read_map(tried)
        except (ParameterError, DataError) as error:
            raise ParameterError(str(error).replace(str(tried), "map")) from None
        except TypeError:  # what JSON has and TOML has not
            raise ParameterError("map: entries of a channel map are texts and numbers.") from None
        replace(tried, kept)
        self.jobs.cancel_about(id_)
        self.board.update("recording", id_, map=str(kept), ambient=ambient, status="reading", message="")
        task = {
            "do": "look", "path": known["path"], "folder": str(self.folder / "columns" / id_), "map": str(kept),
            "ambient": ambient or None,
        }  # fmt: skip
        self.jobs.submit(f"check {known['name']}", "files", task, id_)

    def cut(self, id_: str, begins: Sequence[float]) -> str:
        """Begin to write the strokes of a recording that begin at these times in s as a new recording; its id.

        Raises
        ------
        DataError
            If there is no such recording.
        """
        known = self._recording(id_)
        new = self._id("recording")
        path = self.folder / "uploads" / new / f"{Path(safe_name(known['name'])).stem}-cut.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        self.board.put("recording", new, {
            "id": new, "name": path.name, "path": str(path), "uploaded": True, "status": "reading", "size": 0,
            "message": "", "look": None, "map": None, "dbc": [], "ambient": "",
        })  # fmt: skip
        task = {
            "do": "cut", "source": str(self.folder / "columns" / id_), "map": known["map"], "path": str(path),
            "folder": str(self.folder / "columns" / new), "begins": [*begins], "ambient": known["ambient"] or None,
        }  # fmt: skip
        self.jobs.submit(f"cut {known['name']}", "files", task, new)
        return new

    def forget(self, kind: str, id_: str) -> None:
        """Remove a recording or a result, with all that was kept of it."""
        self.jobs.cancel_about(id_)
        self.board.put(kind, id_, None)
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
        used = {**VERBS[verb], "zero": "subtract", **checked_options(options)}
        several = [self._item(one) for one in recordings]
        others = [self._item(one) for one in verify]
        id_ = self._id("result")
        folder = self.folder / "results" / id_
        folder.mkdir(parents=True)
        first = None if start is None else self.calibration_file(start)
        begun = None if start is None else self._start_name(start)
        arguments = _arguments(verb, several, others, begun, used)
        task = {
            "do": "fit", "verb": verb, "recordings": several, "verify": others, "folder": str(folder),
            "start": None if first is None else str(first), "options": used, "arguments": arguments[1:],
        }  # fmt: skip
        names = ", ".join(item["name"] for item in several)
        self.board.put("result", id_, {
            "id": id_, "verb": verb, "name": f"{verb} {names}", "status": "waiting", "recordings": [*recordings],
            "verify": [*verify], "start": start, "options": used, "made": time.time(), "found": None, "message": "",
            "bad_input": False, "command": command_line(arguments), "exports": [],
            "python": _python(verb, several, others, begun, used),
        })  # fmt: skip
        self.jobs.submit(f"{verb} {names}", "fits", task, id_)
        return id_

    def open_calibration(self, path: Path, name: str, *, move: bool) -> str:
        """Begin to read a calibration from a file; the id of the result that it becomes."""
        id_ = self._id("result")
        kept = self.folder / "results" / id_ / "fit.toml"
        kept.parent.mkdir(parents=True)
        if move:
            replace(path, kept)
        else:
            shutil.copyfile(path, kept)
        self.board.put("result", id_, {
            "id": id_, "verb": "file", "name": printable(name), "status": "waiting", "recordings": [], "verify": [],
            "start": None, "options": {}, "made": time.time(), "found": None, "message": "", "bad_input": False,
            "command": "", "python": "", "exports": [],
        })  # fmt: skip
        self.jobs.submit(
            f"open {printable(name)}", "files", {"do": "calibration", "path": str(kept), "name": name}, id_
        )
        return id_

    def observe(self, recording: str, start: str, method: str, *, force: bool) -> str:
        """Begin to follow a recording with the observer of a calibration; the id of what it becomes.

        Raises
        ------
        DataError
            If the recording or the calibration is not there.
        """
        item, first = self._item(recording), self.calibration_file(start)
        id_ = self._id("observation")
        folder = self.folder / "results" / id_
        folder.mkdir(parents=True)
        words = ["clutchid", "observe", item["name"], "--start", self._start_name(start), "--method", method]
        words += ["--out", "est.parquet", *(["--map", "map.toml"] if item["map"] else [])]
        words += ["--force"] if force else []
        task = {
            "do": "observe", "recording": item, "start": str(first), "method": method, "folder": str(folder),
            "force": force,
        }  # fmt: skip
        name = f"observe {item['name']}"
        self.board.put("observation", id_, {
            "id": id_, "name": name, "method": method, "status": "waiting", "recording": recording, "start": start,
            "found": None, "message": "", "bad_input": False, "command": command_line(words),
        })  # fmt: skip
        self.jobs.submit(name, "fits", task, id_)
        return id_

    # results of track and fleet

    def open_table(self, path: Path, id_: str | None = None, vehicle: str | None = None) -> str:
        """Begin to read a result of a track or a fleet, or a vehicle of a fleet; the id of what it becomes.

        With an id that is there already it is read again, as when a file beside it has been sent. The other files of
        the run are those beside it, if they lie below the folder that is open to the page.
        """
        uploads = self.folder / "uploads"
        below = path.parent.resolve() if path.is_relative_to(uploads) else self.below
        id_ = id_ or self._id("table")
        name = printable(path.name) if vehicle is None else printable(vehicle)
        self.jobs.cancel_about(id_)
        self.board.put("table", id_, {
            "id": id_, "name": name, "path": str(path), "folder": printable(path.parent.name), "vehicle": vehicle,
            "status": "waiting", "found": None, "message": "", "bad_input": False,
        })  # fmt: skip
        task = {"do": "table", "path": str(path), "below": str(below), "vehicle": vehicle}
        self.jobs.submit(f"open {name}", "files", task, id_)
        return id_

    def open_vehicle(self, id_: str, vehicle: str) -> str:
        """Begin to read a vehicle of a fleet, unless that is done; the id of what it becomes.

        Raises
        ------
        DataError
            If the fleet, or a vehicle of this name, is not there.
        """
        known = self.board.get("table", id_)
        found = known and known["found"]
        if known is None or not found or vehicle not in found.get("vehicles", {}).get("vehicle", ()):
            raise DataError(f"{printable(vehicle)}: there is no such vehicle in this fleet.")
        wanted = (known["path"], vehicle)
        same = (one for one in self.board.all("table") if (one["path"], one["vehicle"]) == wanted)
        there = next((one["id"] for one in same if one["status"] not in ("failed", "cancelled")), None)
        return there or self.open_table(Path(known["path"]), vehicle=vehicle)

    def export(self, id_: str, to: str, method: str) -> None:
        """Begin to export the observer of a calibration.

        Raises
        ------
        DataError
            If it is none.
        """
        start = self.calibration_file(id_)
        folder = start.parent
        task = {"do": "export", "start": str(start), "to": to, "method": method, "folder": str(folder), "result": id_}
        known = self.board.get("result", id_) or {}
        self.jobs.submit(f"export {known.get('name', '')}", "fits", task, f"{id_} export")

    def calibration_file(self, id_: str) -> Path:
        """The parameter file of a result.

        Raises
        ------
        DataError
            If there is none.
        """
        known = self.board.get("result", id_)
        path = self.folder / "results" / id_ / "fit.toml"
        if known is None or not path.is_file():
            raise DataError("this calibration is not there any more; choose another one.")
        return path

    def file_of(self, id_: str, name: str) -> Path:
        """A file of a result, by its name.

        Raises
        ------
        DataError
            If there is none.
        """
        known = self.board.get("result", id_)
        found = known and known["found"]
        names = [*(found or {}).get("files", ()), *(one["file"] for one in (known or {}).get("exports", ()))]
        path = self.folder / "results" / id_ / name
        if name not in names or not path.is_file():
            raise DataError(f"{printable(name)}: there is no such file of this result.")
        return path

    def columns_of(self, kind: str, id_: str) -> Path:
        """The stored columns of a recording or of a result.

        Raises
        ------
        DataError
            If there is none.
        """
        if self.board.get(kind, id_) is None:
            raise DataError(f"this {kind} is not there any more.")
        return self.folder / "columns" / id_ if kind == "recording" else self.folder / "results" / id_ / "columns"

    # what jobs say

    def _job_changed(self, job: Job) -> None:
        self.board.put("job", job.id, job.content())
        kind = job.about.partition("-")[0]
        if job.status in ("failed", "cancelled") and " " not in job.about:
            self.board.update(kind, job.about, status=job.status, message=job.message, bad_input=job.bad_input)
        elif job.status == "running" and kind != "recording" and " " not in job.about:
            known = self.board.get(kind, job.about)
            if known is not None and known["status"] == "waiting":
                self.board.update(kind, job.about, status="running")

    def _job_done(self, job: Job, found: dict[str, Any]) -> None:
        if job.task["do"] == "export":
            known = self.board.get("result", found["result"])
            if known is not None:
                self.board.update("result", found["result"], exports=[*known["exports"], found])
        elif job.about.startswith("recording"):
            path = Path(job.task["path"])
            size = path.stat().st_size if path.exists() else 0
            self.board.update("recording", job.about, status="ready", look=found, size=size, message="")
        else:
            self.board.update(job.about.partition("-")[0], job.about, status="done", found=found, message="")

    def _id(self, kind: str) -> str:
        return f"{kind}-{next(self._numbers)}"

    def _recording(self, id_: str) -> Mapping[str, Any]:
        known = self.board.get("recording", id_)
        if known is None:
            raise DataError("this recording is not there any more; open it again.")
        return known

    def _item(self, id_: str) -> dict[str, Any]:
        known = self._recording(id_)
        if known["look"] is None:
            raise DataError(f"{known['name']}: is not read yet.")
        shown = known["name"] if known["uploaded"] else _relative(Path(known["path"]))
        return {"path": known["path"], "map": known["map"], "dbc": known["dbc"], "name": shown}

    def _start_name(self, id_: str) -> str:
        known = self.board.get("result", id_) or {}
        return str(known["name"]) if known.get("verb") == "file" else "CAL.toml"


def _relative(path: Path) -> str:
    """A path as one would write it here."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else os.fspath(path)


def checked_options(options: Any) -> dict[str, Any]:
    """Options of a fit as the page sends them; without those that are left empty.

    Raises
    ------
    ParameterError
        If one cannot be understood, with the sentence of the command line.
    """
    if not isinstance(options, dict):
        raise ParameterError("options: a table is needed.")
    known = {"measure", "free", "method", "bounds", "prior", "ambient", "zero", "force"}
    if unknown := sorted(set(options) - known):
        raise ParameterError(f"options: {', '.join(map(str, unknown))} is not known; {', '.join(sorted(known))}.")
    found: dict[str, Any] = {}
    for name in ("measure", "free", "method", "ambient", "zero"):
        text = options.get(name, "")
        if not isinstance(text, str):
            raise ParameterError(f"--{name}: a text is needed.")
        if text.strip():
            found[name] = text.strip()
    if found.get("method", "") not in METHODS:
        raise ParameterError(f"--method {found['method']}: is not known; {', '.join(METHODS[1:])}.")
    if found.get("zero", "keep") not in ("keep", "subtract"):
        raise ParameterError(f"--zero {found['zero']}: is not known; subtract or keep.")
    for name, parse in (("bounds", bounds), ("prior", priors)):
        items = options.get(name, [])
        if not isinstance(items, list) or not all(isinstance(item, str) for item in items):
            raise ParameterError(f"--{name}: a list of texts is needed.")
        parse(items)
        if items:
            found[name] = items
    pressure(found.get("ambient"))
    if options.get("force"):
        found["force"] = True
    return found


def _options_of(verb: str, several: Sequence[Mapping[str, Any]], used: Mapping[str, Any]) -> list[str]:
    """Options of a command that differ from its defaults."""
    words: list[str] = []
    for name in ("measure", "free", "method", "ambient", "zero"):
        value = used.get(name)
        if value and value != {**VERBS[verb], "zero": "subtract"}.get(name):
            words += [f"--{name}", str(value)]
    if any(item["map"] for item in several):
        words += ["--map", "map.toml"]
    words += ["--force"] if used.get("force") else []
    for name in ("bounds", "prior"):
        if used.get(name):
            words += [f"--{name}", *used[name]]
    return words


def _arguments(
    verb: str, several: Sequence[Mapping[str, Any]], others: Sequence[Mapping[str, Any]], start: str | None, used: Any
) -> list[str]:
    """The command that repeats a fit."""
    words = ["clutchid", verb, *(item["name"] for item in several)]
    words += ["--start", start] if start else []
    words += _options_of(verb, several, used)
    return [*words, *(["--verify", *(item["name"] for item in others)] if others else [])]


def _python(
    verb: str, several: Sequence[Mapping[str, Any]], others: Sequence[Mapping[str, Any]], start: str | None, used: Any
) -> str:
    """The Python that repeats a fit."""

    def read(item: Mapping[str, Any]) -> str:
        return f'clutchid.read({item["name"]!r}, channels="map.toml")' if item["map"] else repr(item["name"])

    def listed(items: Sequence[Mapping[str, Any]]) -> str:
        texts = [read(item) for item in items]
        return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"

    given = [listed(several), *([repr(start)] if start else [])]
    for name in ("measure", "free", "method", "zero"):
        value = used.get(name)
        if value and value != {**VERBS[verb], "zero": "subtract"}.get(name):
            given.append(f"{name}={value!r}")
    given += [f"verify={listed(others)}"] if others else []
    if used.get("bounds"):
        given.append(f"bounds={ {name: tuple(span) for name, span in bounds(used['bounds']).items()}!r}")
    if used.get("prior"):
        each = (f"{name!r}: clutchid.Prior({one.mean!r}, {one.std!r})" for name, one in priors(used["prior"]).items())
        given.append(f"priors={{{', '.join(each)}}}")
    made = f"clutchid.{verb}({', '.join(given)})"
    return f"import clutchid\n\nfound = {made}\nprint(found)\nfound.plot().savefig('load.png')\n"

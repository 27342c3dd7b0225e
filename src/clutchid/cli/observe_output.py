"""Files of `clutchid observe`: what it reads, writes and keeps whatever fails, and its last words."""

from __future__ import annotations

import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TextIO

from clutchid.cli.common import EMPTY, check_outputs, print_json, print_written
from clutchid.cli.observe_sinks import say_unhurried
from clutchid.cli.terminal import print_rows, printable_lines, put, say
from clutchid.errors import ExportError, ParameterError
from clutchid.names import printable
from clutchid.workflow import start_file

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.observer.live import LiveRun
    from clutchid.observer.recording import ObservedRecording
    from clutchid.recordings.spool import AddBlock


@dataclass(frozen=True, slots=True)
class Files:
    """Paths that are read and written; `publishes_frames` is whether results go to a bus, which writes a DBC."""

    log: Path
    start: Path
    out: Path
    save: Path | None
    resume: Path | None
    report: Path | None
    dbc: tuple[Path, ...] = ()
    publishes_frames: bool = False

    @property
    def by_stroke(self) -> Path:
        """The load by stroke, beside the samples."""
        return self.out.with_name(f"{self.out.stem}.load{self.out.suffix}")

    @property
    def results_dbc(self) -> Path:
        """The DBC of published frames, beside the samples."""
        return self.out.with_suffix(".dbc")

    def check(self) -> None:
        """Check, before any work, that the files can be written; a state may replace the one that it went on from."""
        read: list[tuple[str, Path | None]] = [("the recording itself", self.log), ("the calibration", self.start)]
        written = {"--out": self.out, "--out (load by stroke)": self.by_stroke, "--report": self.report}
        if self.publishes_frames:
            written["--publish (DBC)"] = self.results_dbc
        read += [("the DBC of the recording", path) for path in self.dbc]
        check_outputs(written, [*read, ("the state of --resume", self.resume)])
        others = [(f"the file of {option}", path) for option, path in written.items()]
        check_outputs({"--save": self.save}, [*read, *others])

    def write(self, run: ObservedRecording, content: ParameterFile) -> None:
        """Write all files."""
        from clutchid.recordings import write

        write(run.estimates(), self.out)
        write(run.load_by_stroke(), self.by_stroke)
        self.write_rest(run, content)

    def write_rest(self, run: ObservedRecording, content: ParameterFile) -> None:
        """Write the state and the page."""
        for path, write in self.rest(run, content):
            write(path)

    def rest(self, run: ObservedRecording, content: ParameterFile) -> list[tuple[Path, Callable[[Path], None]]]:
        """Paths of the state and of the page, those that are asked for, and the functions that write them."""
        from clutchid.observer.state_file import write_state
        from clutchid.reports.observe_page import observe_page

        origin = origin_of(run.log)
        command = printable(f"clutchid {shlex.join(sys.argv[1:])}")
        each = (
            (self.save, lambda path: write_state(run.observer, run.after, path, origin)),
            (self.report, lambda path: observe_page(run, content.origin, command, path)),
        )
        return [(path, write) for path, write in each if path is not None]


def origin_of(log: Log) -> float | None:
    """Stamp of the bus in s that is the time 0 of a live recording, None for any other recording."""
    from clutchid.recordings.live.bus import ORIGIN

    return float(log.metadata[ORIGIN]) if ORIGIN in log.metadata else None


def calibration_file(path: Path) -> ParameterFile:
    """The calibration, whose file must have a load."""
    from clutchid.recordings.records import read_toml

    content = start_file(path, None)
    if not set(read_toml(path, "parameter file").get("parameters", {})) & set(content.actuator.load.names):
        raise ParameterError(
            f"{path}: has no load weights (theta_1, ...) in [parameters], and an observer starts from a load; "
            "calibrate with pressure first: clutchid calibrate LOG --save CAL.toml."
        )
    return content


def answer(
    run: ObservedRecording,
    content: ParameterFile,
    files: Files,
    *,
    as_json: bool,
    trouble: tuple[str, str] = ("", ""),
    to: TextIO | None = None,
    moved: Mapping[Path, Path | None] = MappingProxyType({}),
) -> None:
    """Say what was found, and which files were written.

    Parameters
    ----------
    trouble
        Status and message, which is empty where a live recording ended without a fault.
    to
        Where sentences go, standard output by default.
    moved
        Places of files that could not be written where they were asked for; None is nowhere.
    """
    from clutchid.reports.observe_text import end_rows, observe_json, observe_sentence

    if as_json:
        ended = dict(zip(("status", "message"), trouble, strict=True)) if trouble[1] else {}
        print_json({**EMPTY, **observe_json(run, content.origin), **ended})
        return
    say(run.log.warnings)
    put(printable_lines(f"observed {run.log.name}: {observe_sentence(run)}"), to=to)
    print_rows(end_rows(run), to)
    published = files.results_dbc if files.publishes_frames else None
    written = [path for path in (files.out, files.by_stroke, files.save, files.report, published) if path is not None]
    print_written(*(moved.get(path, path) for path in written), to=to)


@dataclass(frozen=True, slots=True)
class Kept:
    """What went wrong with the files, as sentences, and where those are that are elsewhere; None is nowhere."""

    troubles: list[str] = field(default_factory=list)
    moved: dict[Path, Path | None] = field(default_factory=dict)

    def _note(self, trouble: str) -> None:
        if trouble not in self.troubles:
            self.troubles.append(trouble)
            say_unhurried([trouble])

    def _move(self, path: Path, place: Path) -> None:
        self.moved[path] = place
        self._note(f"{path}: cannot be written any more; it is in {place} instead.")

    @contextmanager
    def spooled(self, path: Path) -> Iterator[AddBlock]:
        """Function that adds a block to a recording; where that fails, what came before is the file.

        Raises
        ------
        ExportError
            If the file cannot be begun.
        """
        from clutchid.recordings.spool import spooled

        begun, open_, before = False, True, _number(path)
        try:
            with spooled(path, lambda place: self._move(path, place)) as add:

                def added(block: Log, *, now: bool = False) -> None:
                    nonlocal open_
                    try:
                        if open_:
                            add(block, now=now)
                    except ExportError as error:
                        open_ = False
                        self._note(f"{error} What came before is kept, and the recording goes on.")

                begun = True
                yield added
        except ExportError as error:
            if not begun:
                raise
            if _number(path) == before:  # what was there, or nothing
                self.moved[path] = None
            self._note(f"{error} What came before is kept.")

    def cut(self, left: Sequence[Path], time: float) -> None:
        """Cut from files that an earlier run left what comes again, from a time in s on."""
        from clutchid.recordings.spool import cut_behind

        for path in left:
            try:
                cut_behind(path, time)
            except ExportError as error:
                self._note(f"{error} Samples from {time:g} s on are in it and in the new file.")

    def save(self, path: Path | None, run: LiveRun) -> None:
        """Save the state while the recording goes on, if it is asked for."""
        from clutchid.observer.state_file import write_state

        if path is not None:
            try:
                write_state(run.observer, run.after, path, origin_of(run.parts[-1].log))
            except ExportError as error:
                say_unhurried([f"{error} The recording goes on."])

    def write_rest(self, files: Files, run: ObservedRecording, content: ParameterFile) -> None:
        """Write the state and the page; in the folder for temporary files where that cannot be."""
        for path, write in files.rest(run, content):
            try:
                write(path)
            except ExportError as error:
                self._note(str(error))
                self._elsewhere(path, write)

    def _elsewhere(self, path: Path, write: Callable[[Path], None]) -> None:
        try:
            place = Path(tempfile.mkdtemp(prefix="clutchid-")) / path.name
            write(place)
        except OSError:
            self.moved[path] = None
        else:
            self._move(path, place)


def _number(path: Path) -> int | None:
    """Number of a file on its disk, None where there is none."""
    try:
        return path.stat().st_ino
    except OSError:
        return None


def offer(files: Files) -> list[Path]:
    """What an earlier run left that ended without writing its files; says so, and how to go on from it."""
    from clutchid.recordings.spool import recovered

    found = [path for each in (files.out, files.by_stroke) for path in recovered(each)]
    if not found:
        return []
    names = " and ".join(map(str, found))
    sentence = f"an earlier run ended before it wrote {files.out}: what it had observed is in {names}."
    if files.save is not None and files.save.exists() and files.resume is None:
        sentence += f" Its state is in {files.save}: go on from it with --resume {shlex.quote(str(files.save))}."
    say_unhurried([sentence])
    return found

"""Options and files of `clutchid observe`: what it reads, writes and keeps whatever fails, and its last words."""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Literal, TextIO

from cyclopts import Parameter

from clutchid.cli.common import (
    FILES,
    OUTPUT,
    SEARCH,
    FileOptions,
    Flag,
    ForceFlag,
    OutOption,
    OutputFlag,
    PathOutput,
    check_outputs,
    print_json,
    print_written,
)
from clutchid.cli.observe_sinks import say_unhurried
from clutchid.cli.terminal import print_rows, say
from clutchid.errors import ExportError, ParameterError
from clutchid.measurements.live.bus import BusName, bus_name
from clutchid.names import printable
from clutchid.systems import command_line
from clutchid.verbs.live import LiveReading, is_live
from clutchid.verbs.options import USUAL_FILES

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.measurements.spool import AddBlock
    from clutchid.observer.live import LiveRun
    from clutchid.observer.recording import ObservedRecording


#: Name of standard output.
STANDARD_OUTPUT = "-"


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class ObserveOptions:
    """Options of `observe`, and the files that they name.

    Parameters
    ----------
    start
        Calibration (TOML), as written by `clutchid calibrate --save`.
    out
        States by sample to write (.csv, .parquet, .mf4 or .mat); the load by stroke is written beside it, as
        FILE.load.parquet for FILE.parquet.
    method
        joint: load, wearing parameters and states adapt (the default). joint-reduced: modes of the load in place of its
        weights. states: the load stays as calibrated. paper: the paper's three weights. For comparison: adaptive
        (constant gains) and rls (least squares on the balance of forces).
    save
        State after the last sample to write (TOML), for --resume.
    resume
        State to go on from, as written by --save with the same calibration and method.
    report
        Write a self-contained HTML page.
    zero
        Subtract from the position how far the vented rest has moved since the calibration, or keep it as recorded.
    follow
        Go on when LOG, CSV or JSON lines, grows, until Ctrl-C.
    publish
        Results of a live recording while it goes on: `-` writes JSON lines on standard output,
        `can:CHANNEL` frames on a bus, whose DBC is written beside --out, as FILE.dbc.
    publish_every
        Time in ms from one published sample to the next; 0 publishes each, the default for lines; 10 for frames.
    view
        Show load curve, pressure and flags of a live recording on standard error, if that is a terminal.
    force
        Observe although a check of the recording is bad; the checks are those of `clutchid look`.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    start: Path
    out: OutOption
    method: Annotated[str, SEARCH] = "joint"
    save: PathOutput = None
    resume: Annotated[Path | None, FILES] = None
    report: PathOutput = None
    files: FileOptions = USUAL_FILES
    zero: Annotated[Literal["subtract", "keep"], SEARCH] = "subtract"
    follow: Flag = False
    publish: Annotated[str | None, Parameter(allow_leading_hyphen=True), OUTPUT] = None
    publish_every: Annotated[float | None, OUTPUT] = None
    view: OutputFlag = False
    force: ForceFlag = False
    json: OutputFlag = False
    debug: OutputFlag = False

    def live(self, log: Path) -> LiveReading:
        """The recording that arrives, as it is observed with these options."""
        return LiveReading(log, self.files, self.method, self.zero, self.resume, grows=self.follow)

    @property
    def by_stroke(self) -> Path:
        """The load by stroke, beside the samples."""
        return self.out.with_name(f"{self.out.stem}.load{self.out.suffix}")

    @property
    def bus(self) -> BusName | None:
        """The bus that results go to, if they do."""
        return bus_name(self.publish or "")

    @property
    def results_dbc(self) -> Path | None:
        """The DBC of frames that are published, beside the samples."""
        return self.out.with_suffix(".dbc") if self.bus else None

    @property
    def messages(self) -> TextIO:
        """Stream for sentences: standard output, unless lines are published there."""
        return sys.stderr if self.publish == STANDARD_OUTPUT else sys.stdout

    def check(self, log: Path) -> None:
        """Check that the options go together and with the recording, and that the files can be written.

        A state may replace the one that it went on from.

        Raises
        ------
        ExportError, ParameterError
            If they do not, or cannot.
        """
        if (self.publish is not None or self.view) and not (self.follow or is_live(log)):
            option = "--view" if self.publish is None else f"--publish {self.publish}"
            raise ParameterError(f"{option}: is for a live recording; give -, can:CHANNEL, or --follow {log}.")
        if self.publish not in (None, STANDARD_OUTPUT) and self.bus is None:
            raise ParameterError(
                f"--publish {self.publish}: results go to -, standard output, or to a bus, such as can:can0."
            )
        if self.publish == STANDARD_OUTPUT and self.json:
            raise ParameterError("--publish - and --json both write on standard output; leave one of them out.")
        if self.publish_every is not None and not 0.0 <= self.publish_every < math.inf:
            raise ParameterError(f"--publish-every {self.publish_every:g}: a time in ms is at least 0, for example 20.")
        read: list[tuple[str, Path | None]] = [("the recording itself", log), ("the calibration", self.start)]
        read += [("the DBC of the recording", path) for path in self.files.dbc or ()]
        written = {
            "--out": self.out,
            "--out (load by stroke)": self.by_stroke,
            "--report": self.report,
            "--publish (DBC)": self.results_dbc,
        }
        check_outputs(written, [*read, ("the state of --resume", self.resume)])
        others = [(f"the file of {option}", path) for option, path in written.items()]
        check_outputs({"--save": self.save}, [*read, *others])

    def write(self, run: ObservedRecording, content: ParameterFile) -> None:
        """Write all files."""
        from clutchid.measurements import write

        write(run.estimates(), self.out)
        write(run.load_by_stroke(), self.by_stroke)
        for path, write_one in self.rest(run, content):
            write_one(path)

    def rest(self, run: ObservedRecording, content: ParameterFile) -> list[tuple[Path, Callable[[Path], None]]]:
        """Paths of the state and of the page, those that are asked for, and the functions that write them."""
        from clutchid.documents import Observation, document_of, write_page
        from clutchid.observer.state_file import write_state

        origin = origin_of(run.log)
        command = printable(f"clutchid {command_line(sys.argv[1:])}")
        each = (
            (self.save, lambda path: write_state(run.observer, run.after, path, origin)),
            (self.report, lambda path: write_page(document_of(Observation(run, content.origin), command), path)),
        )
        return [(path, write) for path, write in each if path is not None]


def origin_of(log: Log) -> float | None:
    """Stamp of the bus in s that is the time 0 of a live recording, None for any other recording."""
    from clutchid.measurements.live.bus import ORIGIN

    return float(log.metadata[ORIGIN]) if ORIGIN in log.metadata else None


def answer(
    run: ObservedRecording,
    content: ParameterFile,
    options: ObserveOptions,
    *,
    trouble: tuple[str, str] = ("", ""),
    moved: Mapping[Path, Path | None] = MappingProxyType({}),
) -> None:
    """Say what was found, and which files were written.

    Parameters
    ----------
    trouble
        Status and message, which is empty where a live recording ended without a fault.
    moved
        Places of files that could not be written where they were asked for; None is nowhere.
    """
    from clutchid.documents import Observation, On, document_of

    document = document_of(Observation(run, content.origin))
    if options.json:
        ended = dict(zip(("status", "message"), trouble, strict=True)) if trouble[1] else {}
        print_json({**document.data(), **ended})
        return
    say(run.log.warnings)
    print_rows(document.rows_on(On.BRIEF), options.messages)
    written = (options.out, options.by_stroke, options.save, options.report, options.results_dbc)
    print_written(*(moved.get(path, path) for path in written if path is not None), to=options.messages)


@dataclass(frozen=True, slots=True)
class FileTroubles:
    """Faults of the files, as sentences, and the places of those that are elsewhere; None is nowhere."""

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
        from clutchid.measurements.spool import spooled

        begun, open_, before = False, True, _identity(path)
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
            if _identity(path) == before:  # what was there, or nothing
                self.moved[path] = None
            self._note(f"{error} What came before is kept.")

    def cut(self, left: Sequence[Path], time: float) -> None:
        """Cut from files that an earlier run left what comes again, from a time in s on."""
        from clutchid.measurements.spool import cut_behind

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

    def write_rest(self, options: ObserveOptions, run: ObservedRecording, content: ParameterFile) -> None:
        """Write the state and the page; in the folder for temporary files where that cannot be."""
        for path, write in options.rest(run, content):
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


def _identity(path: Path) -> tuple[int, int] | None:
    """What another file in the same place differs by, on every system; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def offer(options: ObserveOptions) -> list[Path]:
    """Files of an earlier run that ended without writing its own; says so, and how to go on from it."""
    from clutchid.measurements.spool import recovered

    found = [path for each in (options.out, options.by_stroke) for path in recovered(each)]
    if not found:
        return []
    names = " and ".join(map(str, found))
    sentence = f"an earlier run ended before it wrote {options.out}: what it had observed is in {names}."
    if options.save is not None and options.save.exists() and options.resume is None:
        sentence += f" Its state is in {options.save}: go on from it with --resume {command_line([str(options.save)])}."
    say_unhurried([sentence])
    return found

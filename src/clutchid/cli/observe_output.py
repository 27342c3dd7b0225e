"""What `clutchid observe` reads and writes, and what it says at the end."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TextIO

from clutchid.cli.common import EMPTY, check_outputs, print_json, print_written
from clutchid.cli.terminal import print_rows, printable_lines, put, say
from clutchid.errors import ParameterError
from clutchid.names import printable
from clutchid.workflow import start_file

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.observer.recording import ObservedRecording


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
    from clutchid.recordings.live.bus_recording import ORIGIN

    return float(log.metadata[ORIGIN]) if ORIGIN in log.metadata else None


def calibration_file(path: Path) -> ParameterFile:
    """The calibration, whose file must have a load."""
    from clutchid.recordings.toml_file import read_toml

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
    from clutchid.reports.observe_json import observe_json
    from clutchid.reports.observe_text import end_rows, observe_sentence

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

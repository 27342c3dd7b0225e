"""``clutchid observe``: follow load and pressure of a recording from position and duty cycles, sample by sample."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from clutchid.cli.common import DONE, EMPTY, check_outputs, guarded, pressure, print_json, print_written
from clutchid.cli.terminal import printable_lines
from clutchid.errors import DataError, ParameterError
from clutchid.names import printable
from clutchid.workflow import Reading, inspected, read_recordings, start_file

if TYPE_CHECKING:
    from clutchid.estimate.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.observe.recording import ObservedRecording


def observe(
    log: Path,
    /,
    *,
    start: Path,
    out: Path,
    method: str = "joint",
    save: Path | None = None,
    resume: Path | None = None,
    report: Path | None = None,
    ambient: str | None = None,
    map_: Annotated[Path | None, Parameter(name="--map")] = None,
    dbc: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Follow the load and the pressure of a recording from position and duty cycles alone, sample by sample.

    The observer starts from the load of a calibration, and only looks back: it is what a control unit could know at
    each sample.

    Parameters
    ----------
    log
        Recording in any format that `clutchid look` reads.
    start
        Calibration (TOML), as written by `clutchid fit --save`.
    out
        States by sample to write (.csv, .parquet, .mf4 or .mat); the load by stroke is written beside it, as
        OUT.load.parquet.
    method
        joint: load, wearing parameters and states adapt (the default). states: the load stays as calibrated.
    save
        State after the last sample to write (TOML), for --resume.
    resume
        State to go on from, as written by --save with the same calibration and method.
    report
        Write a self-contained HTML page.
    ambient
        Ambient pressure for gauge units, for example 1.013bar; P_0 of the calibration by default.
    map_
        Channel map (TOML) of the recording, as written by `clutchid look --save`.
    dbc
        DBC files that decode a bus log; several may follow each other.
    force
        Observe although a check of the recording is bad; the checks are those of `clutchid look`.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    files = _Files(log, start, out, save, resume, report)

    def work() -> int:
        files.check()
        content = _calibration(start)
        air = pressure(ambient, content.actuator.parameters.P_0)
        read = read_recordings([log], Reading(air, map_, tuple(dbc or ())), content.actuator.equipment)
        checked = _fast_enough(inspected(read, content.actuator, force=force)[0], content, force)
        run = _followed(checked, content, method, resume)
        files.write(run, content)
        _answer(run, content, files, json)
        return DONE

    return guarded(work, as_json=json, debug=debug)


@dataclass(frozen=True, slots=True)
class _Files:
    """Paths that are read and written."""

    log: Path
    start: Path
    out: Path
    save: Path | None
    resume: Path | None
    report: Path | None

    @property
    def by_stroke(self) -> Path:
        """The load by stroke, beside the samples."""
        return self.out.with_name(f"{self.out.stem}.load{self.out.suffix}")

    def check(self) -> None:
        """Check, before any work, that the files can be written; a state may replace the one that it went on from."""
        read: list[tuple[str, Path | None]] = [("the recording itself", self.log), ("the calibration", self.start)]
        written = {"--out": self.out, "--out (load by stroke)": self.by_stroke, "--report": self.report}
        check_outputs(written, [*read, ("the state of --resume", self.resume)])
        others = [(f"the file of {option}", path) for option, path in written.items()]
        check_outputs({"--save": self.save}, [*read, *others])

    def write(self, run: ObservedRecording, content: ParameterFile) -> None:
        """Write all files."""
        from clutchid.io import write
        from clutchid.observe.state_file import write_state
        from clutchid.report.observe_page import observe_page

        write(run.estimates(), self.out)
        write(run.load_by_stroke(), self.by_stroke)
        if self.save is not None:
            write_state(run.observer, run.after, self.save)
        if self.report is not None:
            command = printable(f"clutchid {shlex.join(sys.argv[1:])}")
            observe_page(run, content.origin, command, self.report)


def _calibration(path: Path) -> ParameterFile:
    """The calibration, whose file must have a load."""
    from clutchid.io.toml_file import read_toml

    content = start_file(path, None)
    if not set(read_toml(path, "parameter file").get("parameters", {})) & set(content.actuator.load.names):
        raise ParameterError(
            f"{path}: has no load weights (theta_1, ...) in [parameters], and an observer starts from a load; "
            "calibrate with pressure first: clutchid fit LOG --measure position,pressure_a --free auto --save CAL.toml."
        )
    return content


def _fast_enough(log: Log, content: ParameterFile, force: bool) -> Log:
    """The recording; one that is too slow has a warning if it is forced, else it is bad input."""
    from clutchid.observe.recording import too_slow

    sentence = too_slow(log, content.actuator)
    if sentence and not force:
        raise DataError(f"{sentence} Or go on with --force.")
    return replace(log, warnings=(*log.warnings, sentence)) if sentence else log


def _followed(log: Log, content: ParameterFile, method: str, resume: Path | None) -> ObservedRecording:
    from clutchid.observe.observer import observer
    from clutchid.observe.recording import observe_recording, spacing
    from clutchid.observe.state_file import read_state, saved_spacing

    every = spacing(log) if resume is None else saved_spacing(resume)
    one = observer(content.actuator, method, every, content.calibration)
    return observe_recording(one, log, None if resume is None else read_state(one, resume))


def _answer(run: ObservedRecording, content: ParameterFile, files: _Files, json: bool) -> None:
    from clutchid.report.observe_json import observe_json
    from clutchid.report.observe_text import observe_sentence

    if json:
        print_json({**EMPTY, **observe_json(run, content.origin)})
        return
    for warning in run.log.warnings:
        print(f"warning: {printable_lines(warning)}", file=sys.stderr)
    print(printable_lines(f"observed {run.log.name}: {observe_sentence(run)}"))
    print_written(files.out, files.by_stroke, files.save, files.report)

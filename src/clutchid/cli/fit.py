"""``clutchid fit``, ``calibrate`` and ``estimate``: estimate the clutch load from recordings, and print the result."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from clutchid.cli.common import (
    DONE,
    FAILED,
    FILES,
    OUTPUT,
    FileOptions,
    ForceFlag,
    OutputFlag,
    PathOutput,
    SearchOptions,
    guarded,
    print_json,
    print_written,
    progress_bar,
)
from clutchid.documents.console import TERMINAL_WIDTH, print_rows, printable_lines, put
from clutchid.errors import ExportError, ParameterError
from clutchid.names import printable
from clutchid.verbs.commands import FitCommand
from clutchid.verbs.options import USUAL_FILES, USUAL_SEARCH

if TYPE_CHECKING:
    from clutchid.documents import Document

#: Most warnings of a summary.
MOST_WARNINGS = 3

Writers = Mapping[Path | None, Callable[[Path], None]]


def answer(document: Document, writers: Writers, *, json: bool, verbose: bool) -> int:
    """Write the files, and print the result; the exit code. A failure of one does not prevent the other."""
    from clutchid.documents import LabelRow, On

    written, failures = _write(writers)
    if json:
        lost = {"status": "failed", "message": f"the fit is complete, but {'; '.join(failures)}"} if failures else {}
        print_json({**document.data(), **lost})
        return FAILED if failures else DONE
    for failure in failures:
        put(f"clutchid: the fit is complete, but {printable_lines(failure)}", to=sys.stderr)
    print_rows(document.rows_on(On.FULL if verbose else On.BRIEF))
    warnings = [notice.text for notice in document.notices]
    _warn(warnings, len(warnings) if verbose else MOST_WARNINGS)
    print_written(*written)
    if failures:
        return FAILED
    if document.next:
        print_rows([LabelRow("next", f"{document.next.why}:")])
        put(printable(f"  {document.next.command}"))
    return DONE


def _write(writers: Writers) -> tuple[list[Path], list[str]]:
    """Write the files; the paths written, and the reasons of failures."""
    written, failures = [], []
    for path, write in writers.items():
        try:
            if path is not None:
                write(path)
                written.append(path)
        except ExportError as error:
            failures.append(str(error))
    return written, failures


def _warn(warnings: Sequence[str], most: int) -> None:
    """The first warnings on standard error."""
    shown = [f"warning: {printable_lines(warning)}" for warning in warnings[:most]]
    if len(warnings) > most:
        more = len(warnings) - most
        shown.append(f"{more} more warning{'s' if more > 1 else ''}: --verbose")
    for line in shown:
        put(fill(line, TERMINAL_WIDTH, break_long_words=False, break_on_hyphens=False), to=sys.stderr)


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """Options of `fit`, `calibrate` and `estimate`.

    Parameters
    ----------
    start
        Parameter file to start from (TOML), such as a calibration. `estimate` needs one, as written by `clutchid
        calibrate --save`; `calibrate` continues its search; an actuator file has model and start values.
    verify
        Recordings to simulate with the result, but not to fit.
    force
        Fit even if a check of the recording is bad. The checks are those of `clutchid look`.
    save
        Write the result as .toml, for --start, or as .mat, for MATLAB. `simulate` reads .toml too, Octave and Simulink
        .mat; may be given several times.
    report
        Write a self-contained HTML page.
    verbose
        Print all parameters, the errors of all recordings, all reasons of the verdict and all warnings as well.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    start: Path | None = None
    search: SearchOptions = USUAL_SEARCH
    verify: Annotated[list[Path] | None, Parameter(consume_multiple=True), FILES] = None
    files: FileOptions = USUAL_FILES
    force: ForceFlag = False
    save: Annotated[list[Path] | None, OUTPUT] = None
    report: PathOutput = None
    verbose: OutputFlag = False
    json: OutputFlag = False
    debug: OutputFlag = False

    def command(self, verb: str, logs: tuple[Path, ...]) -> FitCommand:
        """The fit that `verb` does with these options."""
        return FitCommand(
            verb=verb,
            logs=logs,
            start=self.start,
            search=self.search,
            verify=tuple(self.verify or ()),
            files=self.files,
            force=self.force,
            save=tuple(self.save or ()),
            report=self.report,
        )


#: The options where none is given.
_DEFAULTS = FitOptions()


@guarded
def fit(*logs: Path, options: FitOptions = _DEFAULTS) -> int:
    """Estimate the load, and any other parameters, with any method; without options, with the method of the paper.

    This is the general command; `calibrate` and `estimate` are for everyday use. Without options it assumes the truck
    of the paper (Appendix A), simulates the recording from its start to its end, and fits three weights of the load to
    the position; ± then includes only noise, not errors of the assumed parameters.

    Parameters
    ----------
    logs
        Recordings, before all options that take several values. They need the columns `time [s]`, `position
        [m]`, `duty_supply [1]`, `duty_exhaust [1]`, or a --map. --verify, --bounds, --prior and --dbc take all
        arguments that follow.
    """
    return run_fit(options.command("fit", logs), options)


def run_fit(asked: FitCommand, options: FitOptions) -> int:
    """Fit as asked, print and write the result; the exit code."""
    if not asked.logs:
        raise ParameterError(
            f"no recording given; clutchid {asked.verb} LOG.csv. Options that take several values (--verify, "
            "--bounds, --prior, --dbc) take every argument that follows them: put the recordings first."
        )
    from clutchid.documents import write_page
    from clutchid.verbs import saving
    from clutchid.verbs.next_step import document_with_next_step
    from clutchid.verbs.progress import CALIBRATION, ESTIMATE, shared

    inputs: list[tuple[str, Path | None]] = [("a recording that is fitted", path) for path in asked.logs]
    inputs += [("a recording to verify with", path) for path in asked.verify]
    inputs += [("the start file itself", asked.start)]
    saving.check_outputs({"--save": asked.save, "--report": asked.report}, inputs)
    for path in asked.save:
        saving.check_save(path)
    with progress_bar(asked.verb) as show:
        usual = CALIBRATION if asked.automatic else ESTIMATE
        fit = asked.run(shared(usual, lambda step: show(step.words, step.share))).raised()
    document = document_with_next_step(fit, asked)
    writers: Writers = {
        **dict.fromkeys(asked.save, lambda path: saving.save_fit(fit, path)),
        asked.report: lambda path: write_page(document, path),
    }
    return answer(document, writers, json=options.json, verbose=options.verbose)


@guarded
def calibrate(*logs: Path, options: FitOptions = _DEFAULTS) -> int:
    """Calibrate a truck once, from recordings with pressure: its load, valves, friction and sensors.

    With the saved calibration, estimate the load of the worn clutch from position alone: `clutchid estimate
    WORN.csv --start CAL.toml`. `calibrate` is the same as `clutchid fit --measure position,pressure_a --free auto`.

    Parameters
    ----------
    logs
        Recordings with pressure, before options that take several values. They need position, duty cycles and
        `pressure_a`, all from one state of wear; --verify, --bounds, --prior and --dbc take all arguments that follow.
    """
    return run_fit(options.command("calibrate", logs), options)


@guarded
def estimate(*logs: Path, options: FitOptions = _DEFAULTS) -> int:
    """Estimate the load from position alone with a calibration, and later changes.

    Make the calibration once, with pressure: `clutchid calibrate CAL.csv --save CAL.toml`. `estimate` is the
    same as `clutchid fit --start CAL.toml --free load`.

    Parameters
    ----------
    logs
        Recordings, before all options that take several values. They need position and duty cycles, in any format
        with a --map; --verify, --bounds, --prior and --dbc take all arguments that follow.
    """
    if options.start is None:
        raise ParameterError(
            "no --start: an estimate of the load from position alone needs a calibration: clutchid estimate "
            "WORN.csv --start CAL.toml. Make the calibration once, from a recording with pressure: clutchid "
            "calibrate CAL.csv --save CAL.toml. Without a calibration, clutchid fit WORN.csv assumes the parameters "
            "of the truck in the paper."
        )
    return run_fit(options.command("estimate", logs), options)

"""``clutchid fit``: estimate the clutch load from recordings, and print the result."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid import workflow
from clutchid.cli.common import (
    DONE,
    FAILED,
    FILES,
    OUTPUT,
    SEARCH,
    AmbientOption,
    DbcOption,
    ForceFlag,
    MapOption,
    OutputFlag,
    PathOutput,
    check_outputs,
    guarded,
    model_of,
    partition_of,
    print_json,
    print_written,
    progress_bar,
)
from clutchid.cli.terminal import WIDTH, print_rows, printable_lines, put
from clutchid.errors import ExportError, ParameterError
from clutchid.names import printable
from clutchid.parameters import known_ambient
from clutchid.workflow.options import bounds, pressure, priors

if TYPE_CHECKING:
    from clutchid.estimation import Fit
    from clutchid.estimation.request import FitRequest
    from clutchid.reports.next_step import Command

#: Most warnings of a summary.
MOST_WARNINGS = 3

Writers = Mapping[Path | None, Callable[[Path], None]]


def answer_json(fit: Fit, writers: Writers) -> int:
    """Write the files, and print the JSON object; the exit code."""
    from clutchid.reports.fit_json import fit_json

    _, failures = _write(writers)
    lost = {"status": "failed", "message": f"the fit is complete, but {'; '.join(failures)}"} if failures else {}
    print_json({**fit_json(fit), **lost})
    return FAILED if failures else DONE


def answer(fit: Fit, writers: Writers, command: Command, verbose: bool) -> int:
    """Write the files, and print the result; the exit code. Neither costs the other where it fails, or stalls."""
    from clutchid.reports.next_step import next_step
    from clutchid.reports.summary import SummaryRow, fit_text, other_warnings, summary

    written, failures = _write(writers)
    for failure in failures:
        put(f"clutchid: the fit is complete, but {printable_lines(failure)}", to=sys.stderr)
    print_rows(summary(fit, in_full=verbose))
    if verbose:
        put(f"\n{printable_lines(fit_text(fit, WIDTH))}")
    warnings = other_warnings(fit)
    _warn(warnings, len(warnings) if verbose else MOST_WARNINGS)
    print_written(*written)
    if failures:
        return FAILED
    step = next_step(fit, command)
    print_rows([SummaryRow("next", f"{step.why}:")])
    put(printable(f"  {step.command}"))
    return DONE


def _write(writers: Writers) -> tuple[list[Path], list[str]]:
    """Write the files; those written, and why others could not be."""
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
        put(fill(line, WIDTH, break_long_words=False, break_on_hyphens=False), to=sys.stderr)


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """Options that `fit`, `calibrate` and `estimate` share.

    Parameters
    ----------
    bounds_
        Bounds in SI units, NAME=LOW:HIGH; several may follow each other; a side may be empty.
    every
        Restart the simulation at the measured position after every N samples.
    parts
        Restart the simulation at the measured position at the start of N equal parts.
    carry
        At a restart, keep the pressures (p, the paper and the default) or the masses of air (q).
    take
        Restart at all measured columns (the default), or at the position alone. With `--every 1 --carry q --take
        position` the measured position is an input, and only the air is simulated.
    model
        Model variant: isothermal (the paper), energy-balance, either with -stribeck; or FILE.py:NAME, a model of your
        own, whose file is executed. By default isothermal; for `--free auto` energy-balance-stribeck, without a carrier
        energy-balance-stribeck-proportional.
    method
        simulation (the paper), shooting (multiple shooting with soft continuity) or prediction-error (a Kalman filter
        that predicts every sample). By default that of the calibration in --start, if there is one; else shooting if
        the request needs it, as a calibration does; else simulation.
    prior
        Priors NAME=VALUE±STD in SI units (or NAME=VALUE+-STD), STD a standard deviation; several may follow each other.
    profile
        Free parameters with intervals by profile likelihood, comma-separated; by shooting only, seconds each.
    bootstrap
        Draws of a bootstrap over strokes, which checks the band of the load, for example 200; 0 for none; by shooting
        only.
    verify
        Recordings to simulate with the result, but not to fit.
    save
        Write the result: .toml (for --start and simulate), or .mat or .m for MATLAB, Octave and Simulink. May be given
        several times.
    report
        Write a self-contained HTML page.
    ambient
        Ambient pressure, for example 1.013bar: a calibration takes it for that of the vented chamber, and gauge units
        count from it; for these P_0 of the start file by default, else 1.013bar.
    map_
        Channel map (TOML) of the recordings, as written by `clutchid look --save`.
    dbc
        DBC files that decode bus logs; several may follow each other.
    zero
        With a calibration in --start: subtract from the position how far its vented rest has moved since, as after an
        exchange of the sensor or with wear, or keep the position as it was recorded.
    force
        Fit although a check of the recording is bad; the checks are those of `clutchid look`.
    verbose
        Print all parameters, the errors of all recordings, all reasons of the verdict and all warnings as well.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    bounds_: Annotated[list[str] | None, Parameter(name="--bounds", consume_multiple=True), SEARCH] = None
    every: Annotated[int | None, SEARCH] = None
    parts: Annotated[int | None, SEARCH] = None
    carry: Annotated[Literal["p", "q"] | None, SEARCH] = None
    take: Annotated[Literal["all", "position"] | None, SEARCH] = None
    model: Annotated[str | None, SEARCH] = None
    method: Annotated[Literal["simulation", "shooting", "prediction-error"] | None, SEARCH] = None
    prior: Annotated[list[str] | None, Parameter(consume_multiple=True), SEARCH] = None
    profile: Annotated[str, Parameter(show_default=False), SEARCH] = ""
    bootstrap: Annotated[int, SEARCH] = 0
    verify: Annotated[list[Path] | None, Parameter(consume_multiple=True), FILES] = None
    save: Annotated[list[Path] | None, OUTPUT] = None
    report: PathOutput = None
    ambient: AmbientOption = None
    map_: MapOption = None
    dbc: DbcOption = None
    zero: Annotated[Literal["subtract", "keep"], FILES] = "subtract"
    force: ForceFlag = False
    verbose: OutputFlag = False
    json: OutputFlag = False
    debug: OutputFlag = False

    def request(self, measure: str, free: str) -> FitRequest:
        """The request of a fit with these options.

        Raises
        ------
        ParameterError
            If an option cannot be understood.
        """
        from clutchid.estimation.fit import request_of

        partition = partition_of(self.every, self.parts, self.carry, self.take)
        limits, prior = bounds(self.bounds_ or ()), priors(self.prior or ())
        return request_of(measure, free, limits, partition, self.method, prior, self.profile, self.bootstrap, self.zero)

    @property
    def reading(self) -> tuple[str, ...]:
        """The options of reading as arguments."""
        ambient = () if self.ambient is None else ("--ambient", self.ambient)
        channels = () if self.map_ is None else ("--map", str(self.map_))
        return (*ambient, *channels, *(word for path in self.dbc or () for word in ("--dbc", str(path))))

    @property
    def own_model(self) -> tuple[str, ...]:
        """The option --model of a model of the user's own, which every command needs again."""
        return ("--model", self.model) if self.model and ".py:" in self.model else ()


#: The options where none is given.
DEFAULTS = FitOptions()


@guarded
def fit(
    *logs: Path,
    measure: str = "position",
    free: str = "load",
    start: Path | None = None,
    options: FitOptions = DEFAULTS,
) -> int:
    """Estimate the load, and any other parameters, by any method; without options, by that of the paper.

    The general command; `calibrate` and `estimate` are for every day. Without options it assumes the truck of the
    paper (Appendix A), simulates the recording from its start to its end, and fits three weights of the load to the
    position; ± is then noise only, because the error of what is assumed is not in it.

    Parameters
    ----------
    logs
        Recordings with columns `time [s]`, `position [m]`, `duty_supply [1]`, `duty_exhaust [1]`, or in any format
        with a --map. Put them before --verify, --bounds and --dbc, which take all arguments that follow.
    measure
        Measured columns to compare: position, or position,pressure_a; pressure_a alone with the position as input.
    free
        Free parameters, comma-separated; `load` means all load weights, `auto` all parameters that a recording with
        pressure can determine, `NAME@EACH` a parameter of its own for every recording, reported as NAME@STEM.
    start
        Parameter file with model and start values; after a calibration only the load needs to be free.
    """
    return fitted("fit", logs, measure, free, start, options)


def fitted(verb: str, logs: Sequence[Path], measure: str, free: str, start: Path | None, options: FitOptions) -> int:
    """Fit as `verb` was asked to, print and write the result; the exit code."""
    if not logs:
        raise ParameterError(
            f"no recording given; clutchid {verb} LOG.csv. Options that take several values (--verify, --bounds, "
            "--prior, --dbc) take all that follows them: put the recordings first."
        )
    from clutchid.numerics.progress import Step
    from clutchid.reports.next_step import Command
    from clutchid.workflow.progress import CALIBRATION, ESTIMATE, shared

    request, saves, verify = options.request(measure, free), tuple(options.save or ()), tuple(options.verify or ())
    inputs: list[tuple[str, Path | None]] = [("a recording that is fitted", path) for path in logs]
    inputs += [("a recording to verify with", path) for path in verify]
    check_outputs({"--save": saves, "--report": options.report}, [*inputs, ("the start file itself", start)])
    for path in saves:
        workflow.check_save(path)
    actuator, request = workflow.start_of(start, model_of(options.model), request)
    added = known_ambient(actuator.parameters.P_0)
    files = workflow.FileOptions(pressure(options.ambient, None), options.map_, tuple(options.dbc or ()), added)
    with progress_bar(verb) as show:
        usual = CALIBRATION if request.automatic else ESTIMATE
        progress = shared(usual, lambda done: show(done.words, done.share))
        progress(Step("reading"))
        read = workflow.read_recordings(logs, files, actuator.equipment, measured=request.measure, verify=verify)
        fit_logs, others = read[: len(logs)], read[len(logs) :]
        done = workflow.fit_recordings(fit_logs, actuator, request, others, progress, force=options.force)
    kept = next((path for path in saves if path.suffix.lower() in ("", ".toml")), None)
    command = Command(
        tuple(sys.argv[1:]),
        tuple(logs),
        start,
        kept,
        options.report,
        (*options.reading, *options.own_model),
        options.force,
        tuple(path for path in saves if path != kept),
    )
    writers: Writers = {
        **dict.fromkeys(saves, lambda path: workflow.save(done, path)),
        options.report: lambda path: workflow.report(done, command.with_options(), path),
    }
    return answer_json(done, writers) if options.json else answer(done, writers, command, options.verbose)

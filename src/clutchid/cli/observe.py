"""``clutchid observe``: follow load and pressure of a recording from position and duty cycles, sample by sample."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Literal, TextIO

from cyclopts import Parameter

from clutchid.cli.common import (
    BAD_INPUT,
    DONE,
    FAILED,
    FILES,
    OUTPUT,
    SEARCH,
    FileOptions,
    ForceFlag,
    OutOption,
    OutputFlag,
    PathOutput,
    complain,
    guarded,
    print_json,
    print_written,
)
from clutchid.documents.console import print_rows, say
from clutchid.errors import ParameterError
from clutchid.verbs.commands import typed
from clutchid.verbs.live.arriving import STANDARD_INPUT, is_live
from clutchid.verbs.live.files import Outputs
from clutchid.verbs.options import USUAL_FILES

if TYPE_CHECKING:
    from clutchid.documents import Observation


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class ObserveOptions:
    """Options of `observe`.

    Parameters
    ----------
    start
        Calibration (TOML), as written by `clutchid calibrate --save`.
    out
        Output file with the states of each sample (.csv, .parquet, .mf4 or .mat); the load of each stroke is
        written beside it, as FILE.load.parquet for FILE.parquet.
    method
        joint: load, wearing parameters and states adapt (the default). states: the load stays as calibrated. paper: the
        paper's three weights.
    save
        State after the last sample to write (TOML), for --resume.
    resume
        State from which to continue, as written by --save with the same calibration and method.
    report
        Write a self-contained HTML page.
    zero
        Subtract the shift of the vented rest since the calibration from the position, or keep the recorded position.
    supply_std
        Standard deviation of a supply pressure that is not recorded from that of the calibration, as a share of it; by
        default 0.03. It widens the bands of load and pressure.
    supply_sensor_std
        The same for a recorded supply pressure, due to the errors of the sensors in both recordings; by default
        from 0.5 % of 10 bar each; 0.02 to 0.03 for a bus signal. It widens the bands of the load.
    publish
        Publish the results of a live recording as JSON lines on standard output.
    force
        Observe even if a check of the recording is bad; the checks are those of `clutchid look`.
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
    supply_std: Annotated[float | None, SEARCH] = None
    supply_sensor_std: Annotated[float | None, SEARCH] = None
    publish: Annotated[Literal["-"] | None, Parameter(allow_leading_hyphen=True), OUTPUT] = None
    force: ForceFlag = False
    json: OutputFlag = False
    debug: OutputFlag = False

    @property
    def outputs(self) -> Outputs:
        """The files that are written, and whether results are published."""
        return Outputs(
            out=self.out, save=self.save, report=self.report, publish=self.publish is not None,
            command=typed(sys.argv[1:]),
        )  # fmt: skip


@guarded
def observe(
    log: Annotated[Path, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    options: ObserveOptions,
) -> int:
    """Estimate load and pressure sample by sample, as a control unit would, from a file or live.

    The observer starts from the load of a calibration and uses past samples only, so its results are those that a
    control unit could have.

    Parameters
    ----------
    log
        Recording in any format that `clutchid look` reads; `-` reads CSV or JSON lines from standard input as they
        arrive, until the end or Ctrl-C; `can:CHANNEL` reads a bus.
    """
    from clutchid.documents import Observation
    from clutchid.verbs.live.following import follow_live
    from clutchid.verbs.live.streams import unhurried_errors
    from clutchid.verbs.observing import ObserveRequest, observed
    from clutchid.verbs.start import calibration_file

    if str(log).startswith("-") and str(log) != STANDARD_INPUT:
        raise ParameterError(f"Unknown option: {log}. Try 'clutchid observe --help'.")
    if options.publish and options.json:
        raise ParameterError("--publish - and --json both write on standard output; leave one of them out.")
    outputs = options.outputs
    outputs.check(log, options.start, options.resume, options.files)
    content = calibration_file(options.start)
    reading = options.files.reading([log], force=options.force, zero=options.zero)
    request = ObserveRequest(options.method, options.resume, options.supply_std, options.supply_sensor_std)
    if not is_live(log):
        run = observed(reading, content, request)
        outputs.write(run, content)
        return _answer(Observation(run, content.origin), outputs, json=options.json)
    end = follow_live(reading, content, request, outputs, say_checks=not options.json)
    with unhurried_errors():
        message = " ".join(filter(None, (end.fault, *end.troubles)))
        trouble = ("bad_input" if end.fault else "failed", message)
        observation = Observation(end.run, content.origin)
        return _answer(observation, outputs, json=options.json, trouble=trouble, moved=end.moved, said=end.said)


def _answer(
    observation: Observation,
    outputs: Outputs,
    *,
    json: bool,
    trouble: tuple[str, str] = ("", ""),
    moved: Mapping[Path, Path | None] = MappingProxyType({}),
    said: Collection[str] = (),
) -> int:
    """Print the result, and which files were written; the exit code.

    Parameters
    ----------
    trouble
        Status and message, which is empty where a live recording ended without a fault.
    moved
        Places of files that could not be written where they were asked for; None is nowhere.
    said
        Warnings that were said already.
    """
    from clutchid.documents import On, document_of

    document, (status, message) = document_of(observation), trouble
    if json:
        print_json({**document.data(), **({"status": status, "message": message} if message else {})})
        return DONE if not message else BAD_INPUT if status == "bad_input" else FAILED
    messages: TextIO = sys.stderr if outputs.publish else sys.stdout
    say(warning for warning in observation.run.log.warnings if warning not in said)
    print_rows(document.rows_on(On.BRIEF), messages)
    print_written(*(moved.get(path, path) for path in outputs.paths), to=messages)
    return complain(message, as_json=False, status=status) if message else DONE

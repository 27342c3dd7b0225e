"""``clutchid observe``: follow load and pressure of a recording from position and duty cycles, sample by sample."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import DONE, guarded, pressure
from clutchid.cli.observe_live import STANDARD_INPUT, LiveOptions, is_live, observe_live
from clutchid.cli.observe_output import Files, answer, calibration_file
from clutchid.errors import ParameterError
from clutchid.workflow import FileOptions, fast_enough, inspected, observed, read_recordings

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.recordings.strokes.vented_rest import Zero


@guarded
def observe(
    log: Annotated[Path, Parameter(allow_leading_hyphen=True)],
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
    zero: Literal["subtract", "keep"] = "subtract",
    follow: Annotated[bool, Parameter(negative="")] = False,
    publish: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    publish_every: float | None = None,
    view: Annotated[bool, Parameter(negative="")] = False,
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
        Recording in any format that `clutchid look` reads; `-` follows CSV or JSON lines on standard input while they
        arrive, until they end or Ctrl-C; `can:CHANNEL` follows a bus.
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
    ambient
        Ambient pressure for gauge units, for example 1.013bar; P_0 of the calibration by default.
    map_
        Channel map (TOML) of the recording, as written by `clutchid look --save`.
    dbc
        DBC files that decode a bus log; several may follow each other.
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
    options = LiveOptions(method, map_, tuple(dbc or ()), resume, follow, publish, publish_every, view, json, zero=zero)
    files = Files(log, start, out, save, resume, report, options.dbc, options.bus is not None)
    if str(log).startswith("-") and str(log) != STANDARD_INPUT:
        raise ParameterError(f"Unknown option: {log}. Try 'clutchid observe --help'.")
    options.check(log)
    files.check()
    content = calibration_file(start)
    air = pressure(ambient, content.actuator.parameters.P_0)
    if options.follow or is_live(log):
        return observe_live(files, content, replace(options, ambient=air))
    checked = _checked(log, content, FileOptions(air, map_, options.dbc), force, zero)
    run = observed(checked, content, method, resume, zero)
    files.write(run, content)
    answer(run, content, files, as_json=json)
    return DONE


def _checked(path: Path, content: ParameterFile, files: FileOptions, force: bool, zero: Zero) -> Log:
    """A recording with the warnings of its checks; a bad one is bad input unless it is forced."""
    read = read_recordings([path], files, content.actuator.equipment)
    rest = content.calibration.rest if content.calibration else None
    (checked,) = inspected(read, content.actuator, force=force, rest=rest, zero=zero)
    return fast_enough(checked, content, force=force)

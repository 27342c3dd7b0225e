"""``clutchid fit``: from recordings to the clutch load."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import (
    DONE,
    EMPTY,
    FAILED,
    bounds,
    check_outputs,
    guarded,
    inspected,
    names,
    partition_of,
    pressure,
    print_json,
    priors,
    progress_bar,
    read_logs,
    start_file,
)
from clutchid.errors import ParameterError

if TYPE_CHECKING:
    from clutchid.assess.evidence import Evidence
    from clutchid.estimate import Fit
    from clutchid.model.actuator import Actuator
    from clutchid.uncertainty.calibration import Calibration


def fit(
    *logs: Path,
    measure: str = "position",
    free: str = "load",
    bounds_: Annotated[list[str] | None, Parameter(name="--bounds", consume_multiple=True)] = None,
    every: int | None = None,
    parts: int | None = None,
    carry: Literal["p", "q"] | None = None,
    take: Literal["all", "position"] | None = None,
    model: str | None = None,
    method: Literal["simulation", "shooting", "prediction-error"] | None = None,
    prior: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    profile: str = "",
    bootstrap: int = 0,
    start: Path | None = None,
    verify: Annotated[list[Path] | None, Parameter(name="--verify", consume_multiple=True)] = None,
    save: Path | None = None,
    report: Path | None = None,
    ambient: str | None = None,
    map_: Annotated[Path | None, Parameter(name="--map")] = None,
    dbc: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Fit the clutch load, and any other parameters, to recordings.

    Without options: position only, ballistic, theta_1 to theta_3 free, everything else from Appendix A of the paper.

    Parameters
    ----------
    logs
        Recordings with columns `time [s]`, `position [m]`, `duty_supply [1]`, `duty_exhaust [1]`, or of any format
        with a --map. They stand before --verify, --bounds and --dbc, which take all that follows.
    measure
        Measured columns to compare with: position, or position,pressure_a; pressure_a alone with the position as input.
    free
        Free parameters, comma-separated; `load` stands for all load weights, `auto` for all that a recording with
        pressure can tell, `NAME@EACH` for an own number of every recording.
    bounds_
        Bounds in SI units, NAME=LOW:HIGH, several after each other; a side may be empty.
    every
        Partitioned: take the measured position again after every N samples.
    parts
        Partitioned: take the measured position again at the start of N equal parts.
    carry
        Across such a reset, carry the pressures (p, the paper and the default) or the masses of air (q).
    take
        Take all measured columns again at a reset (the default), or the position alone. With `--every 1 --carry q
        --take position` the measured position is an input, and only the air is simulated.
    model
        Model variant: isothermal (the paper), energy-balance, either with -stribeck. By default isothermal, and
        energy-balance-stribeck for `--free auto`.
    method
        simulation (the paper), shooting (many short simulations that meet softly) or prediction-error (a filter that
        predicts every sample). By default simulation; shooting where what is asked for needs it, as a calibration
        does; and what made the calibration, where --start has one.
    prior
        What is known before the data, NAME=VALUE±STD in SI units (or NAME=VALUE+-STD), several after each other.
    profile
        Free numbers, comma-separated, whose intervals come from profile likelihood; seconds each.
    bootstrap
        Draws of a bootstrap over strokes that checks the bands, for example 200; 0 for none.
    start
        Parameter file with model and start values; after a calibration only the load need be free.
    verify
        Recordings to simulate with the result, not fitted.
    save
        Write the result as a parameter file (TOML).
    report
        Write a self-contained HTML page.
    ambient
        Ambient pressure for gauge units, for example 1.013bar; default P_0.
    map_
        Channel map (TOML) of the recordings, as written by `clutchid look --save`.
    dbc
        DBC files that decode bus logs, several after each other.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    files = _Files(logs, tuple(verify or ()), start, save, report)
    asked = _Asked(
        measure, free, tuple(bounds_ or ()), tuple(prior or ()), (every, parts, carry, take), model, method, ambient,
        map_, tuple(dbc or ()), profile, bootstrap,
    )  # fmt: skip
    return guarded(lambda: _work(files, asked, json), as_json=json, debug=debug)


@dataclass(frozen=True, slots=True)
class _Files:
    """Paths that a fit reads and writes."""

    logs: tuple[Path, ...]
    verify: tuple[Path, ...]
    start: Path | None
    save: Path | None
    report: Path | None


@dataclass(frozen=True, slots=True)
class _Asked:
    """Options of a fit as the user wrote them."""

    measure: str
    free: str
    bounds: tuple[str, ...]
    priors: tuple[str, ...]
    partition: tuple[int | None, int | None, Literal["p", "q"] | None, Literal["all", "position"] | None]
    model: str | None
    method: Literal["simulation", "shooting", "prediction-error"] | None
    ambient: str | None
    map: Path | None
    dbc: tuple[Path, ...]
    profile: str
    bootstrap: int


def _work(files: _Files, asked: _Asked, json: bool) -> int:
    _check(files.logs, files.verify, (*asked.bounds, *asked.priors))
    _check_files(files)
    from clutchid.assess.evidence import evidence

    result = _fitted(files, asked)
    found = evidence(result)
    _write(result, files.save, files.report, found)
    from clutchid.report.fit_text import fit_json, fit_text

    if json:
        print_json({**EMPTY, **fit_json(result, found)})
    else:
        print(fit_text(result, found))
        for warning in result.warnings:
            print(f"warning: {warning}", file=sys.stderr)
        _print_paths(files.save, files.report)
    return FAILED if result.status == "failed" else DONE


def _fitted(files: _Files, asked: _Asked) -> Fit:
    from clutchid.estimate import fit as fit_logs

    partition = partition_of(*asked.partition)
    automatic = "auto" in names(asked.free)
    builds = partition is None and asked.method != "simulation"
    actuator, calibration = _start(files.start, asked.model, automatic, builds)
    ambient = pressure(asked.ambient, actuator.parameters.P_0)
    logs = read_logs([*files.logs, *files.verify], ambient, asked.map, asked.dbc, actuator.equipment)
    read = inspected(logs, actuator)
    with progress_bar("fit") as show:
        return fit_logs(
            read[: len(files.logs)],
            actuator,
            measure=names(asked.measure),
            free=names(asked.free),
            bounds=bounds(asked.bounds),
            partition=partition,
            verify=read[len(files.logs) :],
            method=asked.method,
            priors=priors(asked.priors),
            calibration=None if automatic else calibration,
            profile=names(asked.profile) if asked.profile else (),
            bootstrap=asked.bootstrap,
            progress=lambda stage, count: show(f"{stage} search, {count} simulations", -1.0),
        )


def _check(logs: Sequence[Path], verify: Sequence[Path], limits: Sequence[str]) -> None:
    if not logs and (verify or limits):
        raise ParameterError(
            "no recording given: --verify, --bounds and --prior take all that follows them; put the recordings before "
            "--verify, --bounds and --prior."
        )
    if not logs:
        raise ParameterError("no recording given; clutchid fit LOG.csv")


def _check_files(files: _Files) -> None:
    inputs: list[tuple[str, Path | None]] = [("a recording that is fitted", path) for path in files.logs]
    inputs += [("a recording to verify with", path) for path in files.verify]
    inputs.append(("the start file itself", files.start))
    check_outputs({"--save": files.save, "--report": files.report}, inputs)


def _start(
    start: Path | None, model: str | None, automatic: bool, calibrated: bool
) -> tuple[Actuator, Calibration | None]:
    """The actuator to start from, and what a calibration left beside it, where that is wanted."""
    from clutchid.estimate.automatic import AUTOMATIC
    from clutchid.model.actuator import Actuator

    if start is None:
        return Actuator(model=model or (AUTOMATIC if automatic else "isothermal")), None
    content = start_file(start, model)
    return content.actuator, content.calibration if calibrated else None


def _write(result: Fit, save: Path | None, report: Path | None, found: Evidence) -> None:
    if save is not None:
        from clutchid.estimate.parameter_file import parameter_file, write_parameters

        write_parameters(parameter_file(result), save)
    if report is not None:
        from clutchid.report.fit_page import fit_page

        fit_page(result, shlex.join(["clutchid", *sys.argv[1:]]), report, found)


def _print_paths(*paths: Path | None) -> None:
    for path in paths:
        if path is not None:
            print(f"written: {path.resolve()}")

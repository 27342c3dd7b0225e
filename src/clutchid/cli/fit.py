"""``clutchid fit``: from recordings to the clutch load."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from clutchid.cli.common import (
    DONE,
    EMPTY,
    FAILED,
    bounds,
    check_outputs,
    guarded,
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
    from clutchid.estimate import Fit
    from clutchid.estimate.calibration import Calibration
    from clutchid.estimate.evidence import Evidence
    from clutchid.model.actuator import Actuator


def fit(
    *logs: Path,
    measure: str = "position",
    free: str = "load",
    bounds_: Annotated[list[str] | None, Parameter(name="--bounds", consume_multiple=True)] = None,
    every: int | None = None,
    parts: int | None = None,
    carry: Literal["p", "q"] | None = None,
    model: str | None = None,
    method: Literal["simulation", "shooting", "prediction-error"] | None = None,
    prior: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    start: Path | None = None,
    verify: Annotated[list[Path] | None, Parameter(name="--verify", consume_multiple=True)] = None,
    save: Path | None = None,
    report: Path | None = None,
    ambient: str | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Fit the clutch load, and any other parameters, to recordings.

    Without options: position only, ballistic, theta_1 to theta_3 free, everything else from Appendix A of the paper.

    Parameters
    ----------
    logs
        Recordings, CSV or Parquet; columns `time [s]`, `position [m]`, `duty_supply [1]`, `duty_exhaust [1]`. They
        stand before --verify and --bounds, which take all that follows.
    measure
        Measured columns to compare with: position, or position,pressure_a.
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
    model
        Model variant: isothermal (the paper), energy-balance, either with -stribeck. By default isothermal, and
        energy-balance-stribeck for `--free auto`.
    method
        simulation (the paper), shooting (many short simulations that meet softly) or prediction-error (a filter that
        predicts every sample). By default simulation; shooting where what is asked for needs it, as a calibration
        does; and what made the calibration, where --start has one.
    prior
        What is known before the data, NAME=VALUE±STD in SI units (or NAME=VALUE+-STD), several after each other.
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
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    files = _Files(logs, tuple(verify or ()), start, save, report)
    asked = _Asked(
        measure, free, tuple(bounds_ or ()), tuple(prior or ()), (every, parts, carry), model, method, ambient
    )
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
    partition: tuple[int | None, int | None, Literal["p", "q"] | None]
    model: str | None
    method: Literal["simulation", "shooting", "prediction-error"] | None
    ambient: str | None


def _work(files: _Files, asked: _Asked, json: bool) -> int:
    _check(files.logs, files.verify, (*asked.bounds, *asked.priors))
    _check_files(files)
    from clutchid.estimate.evidence import evidence

    result = _fitted(files, asked)
    found = evidence(result)
    _write(result, files.save, files.report, found)
    if json:
        print_json(fit_json(result, found))
    else:
        _print(result, found)
        _print_paths(files.save, files.report)
    return FAILED if result.status == "failed" else DONE


def _fitted(files: _Files, asked: _Asked) -> Fit:
    from clutchid.estimate import fit as fit_logs

    partition = partition_of(*asked.partition)
    automatic = "auto" in names(asked.free)
    builds = partition is None and asked.method != "simulation"
    actuator, calibration = _start(files.start, asked.model, automatic, builds)
    read = read_logs([*files.logs, *files.verify], pressure(asked.ambient, actuator.parameters.P_0))
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
    from clutchid.estimate.shooting.automatic import AUTOMATIC
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


def fit_json(result: Fit, found: Evidence) -> dict[str, Any]:
    """The JSON object of a fit and what its verdict rests on, docs/formats.md."""
    from clutchid.estimate.verdict import verdict_json

    curve = result.load_curve
    return {
        **EMPTY,
        "status": result.status,
        "message": result.message,
        "parameters": {
            name: {"value": e.value, "unit": e.unit, "std": e.std, "low": e.low, "high": e.high}
            for name, e in result.parameters.items()
        },
        "load_curve": {
            "position_m": curve.position.tolist(),
            "force_N": curve.force.tolist(),
            "low_N": curve.low.tolist(),
            "high_N": curve.high.tolist(),
        },
        "errors": _errors_json(result.errors),
        "logs": {name: _errors_json(recording.errors) for name, recording in result.recordings.items()},
        "verify": {name: _errors_json(recording.errors) for name, recording in result.verification.items()},
        "noise_scales": dict(result.scales),
        "warnings": list(result.warnings),
        "method": result.method,
        "notes": list(result.notes),
        "verdict": verdict_json(result, found),
    }


def _errors_json(errors: Any) -> dict[str, float | None]:
    return {
        "position_rms_m": errors.position_rms,
        "position_sse_m2": errors.position_sse,
        "pressure_a_rms_Pa": errors.pressure_a_rms,
        "pressure_a_sse_Pa2": errors.pressure_a_sse,
    }


def _print(result: Fit, found: Evidence) -> None:
    width = max([9, *(len(name) for name in result.parameters)])
    print(f"{'parameter':<{width}}  {'value':>12}  {'std':>10}  {'95 % interval':>27}  unit")
    for name, e in result.parameters.items():
        print(f"{name:<{width}}  {e.value:12.5g}  {e.std:10.2g}  {e.low:12.5g} .. {e.high:12.5g}  {e.unit}")
    print(_peak(result))
    for title, recordings in (("fitted", result.recordings), ("verified", result.verification)):
        for name, recording in recordings.items():
            pressure_error = recording.errors.pressure_a_rms
            text = "" if pressure_error is None else f", pressure {pressure_error / 1e3:.1f} kPa rms"
            print(f"{title} {name}: position {recording.errors.position_rms * 1e3:.3f} mm rms{text}")
    for note in result.notes:
        print(note)
    from clutchid.estimate.verdict import verdict

    judged = verdict(result, found)
    print(f"trust: {judged.trust}{''.join(f'; {reason}' for reason in judged.reasons)}")
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)


def _print_paths(*paths: Path | None) -> None:
    for path in paths:
        if path is not None:
            print(f"written: {path.resolve()}")


def _peak(result: Fit) -> str:
    """The greatest load within the reach of the fitted recordings; beyond it the curve is not known."""
    import numpy as np

    measured = [recording.measured["position"] for recording in result.recordings.values()]
    reach = max((float(np.nanmax(y)) for y in measured if np.isfinite(y).any()), default=0.0)
    curve = result.load_curve
    inside = curve.position <= max(reach, float(curve.position[0]))
    peak = int(np.argmax(curve.force[inside]))
    where = f"{curve.position[peak] * 1e3:.2f} mm"
    return f"peak load {curve.force[peak]:.0f} N at {where}, within the {reach * 1e3:.1f} mm that were driven"

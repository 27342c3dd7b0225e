"""``clutchid fit``: from recordings to the clutch load."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
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
    progress_bar,
    read_logs,
    start_actuator,
)
from clutchid.errors import ParameterError

if TYPE_CHECKING:
    from clutchid.estimate import Fit


def fit(
    *logs: Path,
    measure: str = "position",
    free: str = "load",
    bounds_: Annotated[list[str] | None, Parameter(name="--bounds", consume_multiple=True)] = None,
    every: int | None = None,
    parts: int | None = None,
    carry: Literal["p", "q"] | None = None,
    model: str | None = None,
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
        Free parameters, comma-separated; `load` stands for all load weights.
    bounds_
        Bounds in SI units, NAME=LOW:HIGH, several after each other; a side may be empty.
    every
        Partitioned: take the measured position again after every N samples.
    parts
        Partitioned: take the measured position again at the start of N equal parts.
    carry
        Across such a reset, carry the pressures (p, the paper and the default) or the masses of air (q).
    model
        Model variant: isothermal.
    start
        Parameter file with model and start values.
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

    def work() -> int:
        from clutchid.estimate import fit as fit_logs

        _check(logs, verify or [], bounds_ or [], free)
        _check_files(logs, verify or [], start, save, report)
        actuator, partition = start_actuator(start, model), partition_of(every, parts, carry)
        read = read_logs([*logs, *(verify or [])], pressure(ambient, actuator.parameters.P_0))
        with progress_bar("fit") as show:
            result = fit_logs(
                read[: len(logs)],
                actuator,
                measure=names(measure),
                free=names(free),
                bounds=bounds(bounds_ or []),
                partition=partition,
                verify=read[len(logs) :],
                progress=lambda stage, count: show(f"{stage} search, {count} simulations", -1.0),
            )
        _write(result, save, report)
        if json:
            print_json(fit_json(result))
        else:
            _print(result, save, report)
        return FAILED if result.status == "failed" else DONE

    return guarded(work, as_json=json, debug=debug)


def _check(logs: Sequence[Path], verify: Sequence[Path], limits: Sequence[str], free: str) -> None:
    if not logs and (verify or limits):
        raise ParameterError(
            "no recording given: --verify and --bounds take all that follows them; put the recordings before --verify "
            "and --bounds."
        )
    if not logs:
        raise ParameterError("no recording given; clutchid fit LOG.csv")
    if "auto" in names(free):
        raise ParameterError("--free auto is not in this version; name the parameters, for example load,P_S,C_vs.")


def _check_files(
    logs: Sequence[Path], verify: Sequence[Path], start: Path | None, save: Path | None, report: Path | None
) -> None:
    inputs: list[tuple[str, Path | None]] = [("a recording that is fitted", path) for path in logs]
    inputs += [("a recording to verify with", path) for path in verify]
    check_outputs({"--save": save, "--report": report}, [*inputs, ("the start file itself", start)])


def _write(result: Fit, save: Path | None, report: Path | None) -> None:
    if save is not None:
        from clutchid.estimate.parameter_file import parameter_file, write_parameters

        write_parameters(parameter_file(result), save)
    if report is not None:
        from clutchid.report.fit_page import fit_page

        fit_page(result, shlex.join(["clutchid", *sys.argv[1:]]), report)


def fit_json(result: Fit) -> dict[str, Any]:
    """The JSON object of a fit, docs/formats.md."""
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
    }


def _errors_json(errors: Any) -> dict[str, float | None]:
    return {
        "position_rms_m": errors.position_rms,
        "position_sse_m2": errors.position_sse,
        "pressure_a_rms_Pa": errors.pressure_a_rms,
        "pressure_a_sse_Pa2": errors.pressure_a_sse,
    }


def _print(result: Fit, save: Path | None, report: Path | None) -> None:
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
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    for path in (save, report):
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

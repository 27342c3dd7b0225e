"""``clutchid simulate``: simulate an actuator with the inputs of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import (
    DONE,
    EMPTY,
    check_outputs,
    guarded,
    model_of,
    partition_of,
    pressure,
    print_json,
    print_written,
)
from clutchid.cli.terminal import put, say
from clutchid.workflow import FileOptions, inspected, read_recordings, start_file

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.estimation.parameter_tables import Starts
    from clutchid.log import Log
    from clutchid.recordings.strokes.vented_rest import Rested
    from clutchid.simulation import Partition, Simulation


def simulate(
    log: Path,
    /,
    *,
    parameters: Path,
    out: Path,
    model: str | None = None,
    every: int | None = None,
    parts: int | None = None,
    carry: Literal["p", "q"] | None = None,
    band: Path | None = None,
    ambient: str | None = None,
    map_: Annotated[Path | None, Parameter(name="--map")] = None,
    dbc: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Simulate an actuator with the inputs of a recording and write all states.

    If the recording does not start vented and at rest, position and pressure at its start are taken from the parameter
    file if it has them for exactly this file, else estimated from the measured position.

    Parameters
    ----------
    log
        Recording in any format that `clutchid look` reads.
    parameters
        Parameter file (TOML), as written by `clutchid fit --save`.
    out
        Simulation to write (.csv, .parquet, .mf4 or .mat).
    model
        FILE.py:NAME, the model of your own that the parameter file was saved with; the file is executed.
    every
        Reset to the measured position after every N samples.
    parts
        Reset to the measured position at the start of N equal parts.
    carry
        At a reset, keep the pressures (p, the default) or the masses of air (q).
    band
        Recording with pressure of the same actuator with on/off valves; the errors of its simulation give the interval.
    ambient
        Ambient pressure for gauge units, for example 1.013bar; P_0 of the parameter file by default.
    map_
        Channel map (TOML) of the recording, as written by `clutchid look --save`.
    dbc
        DBC files that decode a bus log; several may follow each other.
    force
        Simulate although a check of the recording is bad; the checks are those of `clutchid look`.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    def work() -> int:
        from clutchid.recordings import write
        from clutchid.simulation import simulate as simulate_log

        check_outputs({"--out": out}, _inputs(log, parameters, band))
        partition, content = partition_of(every, parts, carry), start_file(parameters, model_of(model))
        air, files = pressure(ambient, content.actuator.parameters.P_0), [log] if band is None else [log, band]
        read = read_recordings(files, FileOptions(air, map_, tuple(dbc or ())), content.actuator.equipment)
        rested = [content.from_rest(each) for each in read]
        recording, *others = inspected([one.log for one in rested], content.actuator, force=force)
        starts, notes = _starts(recording, content, partition, parameters)
        done = simulate_log(content.actuator, recording, partition=partition, starts=starts)
        write(_banded(done.log, others, content, partition), out)
        _answer(recording, done, (*recording.warnings, *_moved(rested[0]), *notes, *done.warnings), out, json)
        return DONE

    return guarded(work, as_json=json, debug=debug)


def _moved(rested: Rested) -> tuple[str, ...]:
    """That the vented rest has moved since the calibration, where that was subtracted."""
    if not rested.subtracted:
        return ()
    return (
        f"{rested.log.name}: its vented rest has moved by {rested.subtracted * 1e3:+.2f} mm since the calibration, "
        "which is subtracted from the measured position.",
    )


def _answer(recording: Log, done: Simulation, warnings: Sequence[str], out: Path, json: bool) -> None:
    """Print the errors of the simulation against what was measured, and its warnings."""
    from clutchid.estimation.result import errors_over
    from clutchid.reports.fit_json import errors_json
    from clutchid.reports.summary import errors_text

    errors = errors_over([(recording, done.log)]) if "position" in recording else None
    distinct = list(dict.fromkeys(warnings))
    if json:
        logs = {} if errors is None else {"errors": errors_json(errors), "logs": {recording.name: errors_json(errors)}}
        print_json(
            {**EMPTY, "status": "warning" if distinct else "ok", "message": done.message, "warnings": distinct, **logs}
        )
        return
    say(distinct)
    if errors is not None:
        put(f"simulated {recording.name}: {errors_text(errors)}")
    print_written(out)


def _inputs(log: Path, parameters: Path, band: Path | None) -> list[tuple[str, Path | None]]:
    return [("the recording itself", log), ("the parameter file itself", parameters), ("the recording of --band", band)]


def _banded(simulated: Log, others: list[Log], content: ParameterFile, partition: Partition | None) -> Log:
    """`simulated` with an interval of its pressure from the recordings `others`, simulated in the same way."""
    from clutchid.estimation.verification import starts_of
    from clutchid.inference.uncertainty.switching_band import switching_band
    from clutchid.simulation import simulate as simulate_log

    known = []
    for other in others:
        starts = content.starts_for(other) or starts_of(other, content.actuator, partition)
        known.append((other, simulate_log(content.actuator, other, partition=partition, starts=starts).log))
    return switching_band(simulated, known) if known else simulated


def _starts(
    recording: Log, content: ParameterFile, partition: Partition | None, file: Path
) -> tuple[Starts, tuple[str, ...]]:
    """Start values of the segments, from the parameter file `file` if it has them for exactly this recording."""
    from clutchid.estimation.verification import starts_of

    from_file = content.starts_for(recording)
    if from_file is not None:
        return from_file, ()
    notes: tuple[str, ...] = ()
    if content.starts.get(recording.name):
        notes = (
            f"{recording.name}: {file} has start values for a recording of this name, but not for exactly this file "
            "(sha256 in [fit] data); they were estimated again.",
        )
    return starts_of(recording, content.actuator, partition), notes

"""``clutchid simulate``: simulate an actuator with the inputs of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from clutchid.cli.common import (
    DONE,
    FILES,
    SEARCH,
    FileOptions,
    ForceFlag,
    OutOption,
    OutputFlag,
    check_outputs,
    guarded,
    print_json,
    print_written,
)
from clutchid.cli.terminal import put, say
from clutchid.verbs.options import USUAL_FILES, model_of, partition_of

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.simulation import Partition, Simulation
    from clutchid.strokes.vented_rest import ZeroedLog


@guarded
def simulate(
    log: Path,
    /,
    *,
    parameters: Path,
    out: OutOption,
    model: Annotated[str | None, SEARCH] = None,
    every: Annotated[int | None, SEARCH] = None,
    parts: Annotated[int | None, SEARCH] = None,
    carry: Annotated[Literal["p", "q"] | None, SEARCH] = None,
    band: Annotated[Path | None, FILES] = None,
    files: FileOptions = USUAL_FILES,
    force: ForceFlag = False,
    json: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Simulate an actuator with the duty cycles of a recording, and write all states, such as the pressure.

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
        Restart at the measured position after every N samples.
    parts
        Restart at the measured position at the start of N equal parts.
    carry
        At a restart, keep the pressures (p, the default) or the masses of air (q).
    band
        Recording with pressure of the same actuator with on/off valves; the errors of its simulation give the interval.
    force
        Simulate although a check of the recording is bad; the checks are those of `clutchid look`.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.inference.uncertainty.switching_band import switching_band
    from clutchid.measurements import write
    from clutchid.strokes.values import values_of
    from clutchid.verbs.start import start_file

    inputs = [
        ("the recording itself", log),
        ("the parameter file itself", parameters),
        ("the recording of --band", band),
    ]
    check_outputs({"--out": out}, inputs)
    partition, content = partition_of(every, parts, carry), start_file(parameters, model_of(model))
    reading = files.reading([log] if band is None else [log, band], force=force)
    logs = reading.checked(content.actuator, rest=content.rest)
    rested = [content.from_rest(values_of(each, content.actuator).log) for each in logs]
    recording, *others = [zeroed.log for zeroed in rested]
    done, from_file = _simulated(recording, content, partition)
    known = [(other, _simulated(other, content, partition)[0].log) for other in others]
    write(switching_band(done.log, known) if known else done.log, out)
    notes = () if from_file else _starts_of_another(recording, content, parameters)
    _answer(recording, done, (*recording.warnings, *_moved(rested[0]), *notes, *done.warnings), out, json)
    return DONE


def _moved(rested: ZeroedLog) -> tuple[str, ...]:
    """That the vented rest has moved since the calibration, where that was subtracted."""
    if not rested.subtracted:
        return ()
    return (
        f"{rested.log.name}: its vented rest has moved by {rested.subtracted * 1e3:+.2f} mm since the calibration, "
        "which is subtracted from the measured position.",
    )


def _answer(recording: Log, done: Simulation, warnings: Sequence[str], out: Path, json: bool) -> None:
    """Print the errors of the simulation against what was measured, and its warnings."""
    from clutchid.documents.fit_json import errors_json
    from clutchid.documents.summary import errors_text
    from clutchid.estimation.result import errors_over

    errors = errors_over([(recording, done.log)]) if "position" in recording else None
    distinct = list(dict.fromkeys(warnings))
    if json:
        logs = {} if errors is None else {"errors": errors_json(errors), "logs": {recording.name: errors_json(errors)}}
        print_json({"status": "warning" if distinct else "ok", "message": done.message, "warnings": distinct, **logs})
        return
    say(distinct)
    if errors is not None:
        put(f"simulated {recording.name}: {errors_text(errors)}")
    print_written(out)


def _simulated(log: Log, content: ParameterFile, partition: Partition | None) -> tuple[Simulation, bool]:
    """Simulation of a recording, and whether the file has the start values of exactly this one; else estimated."""
    from clutchid.estimation.verification import starts_of
    from clutchid.simulation import simulate as simulate_log
    from clutchid.strokes.vented_pressure import with_ambient

    from_file = content.starts_for(log)
    starts = starts_of(log, with_ambient(content.actuator, [log])[0], partition) if from_file is None else from_file
    return simulate_log(content.actuator, log, partition=partition, starts=starts), from_file is not None


def _starts_of_another(recording: Log, content: ParameterFile, file: Path) -> tuple[str, ...]:
    """That the parameter file has start values for another recording of this name."""
    if not content.starts.get(recording.name):
        return ()
    return (
        f"{recording.name}: {file} has start values for a recording of this name, but not for exactly this file "
        "(sha256 in [fit] data); they were estimated again.",
    )

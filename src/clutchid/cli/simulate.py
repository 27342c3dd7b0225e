"""``clutchid simulate``: an actuator along a recording."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import DONE, EMPTY, check_outputs, guarded, partition_of, pressure, print_json, read_logs

if TYPE_CHECKING:
    from clutchid.estimate.parameter_file import ParameterFile
    from clutchid.estimate.recording_sections import Starts
    from clutchid.log import Log
    from clutchid.simulation import Partition


def simulate(
    log: Path,
    /,
    *,
    parameters: Path,
    out: Path,
    every: int | None = None,
    parts: int | None = None,
    carry: Literal["p", "q"] | None = None,
    ambient: str | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Simulate an actuator with the inputs of a recording and write all states.

    Where the recording does not start vented and at rest, position and pressure at its start are taken from the
    parameter file if it has them for this very file, else estimated from the measured position.

    Parameters
    ----------
    log
        Recording, CSV or Parquet.
    parameters
        Parameter file (TOML), as written by `clutchid fit --save`.
    out
        Simulation to write, .csv or .parquet.
    every
        Take the measured position again after every N samples.
    parts
        Take the measured position again at the start of N equal parts.
    carry
        Across such a reset, carry the pressures (p, the default) or the masses of air (q).
    ambient
        Ambient pressure for gauge units, for example 1.013bar; default P_0 of the parameter file.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    def work() -> int:
        from clutchid.estimate.parameter_file import read_parameters
        from clutchid.io import write
        from clutchid.simulation import simulate as simulate_log

        check_outputs({"--out": out}, [("the recording itself", log), ("the parameter file itself", parameters)])
        partition, content = partition_of(every, parts, carry), read_parameters(parameters)
        recording = read_logs([log], pressure(ambient, content.actuator.parameters.P_0))[0]
        starts, told = _starts(recording, content, partition, parameters)
        done = simulate_log(content.actuator, recording, partition=partition, starts=starts)
        write(done.log, out)
        warnings = list(dict.fromkeys((*recording.warnings, *told, *done.warnings)))
        if json:
            status = "warning" if warnings else "ok"
            print_json({**EMPTY, "status": status, "message": done.message, "warnings": warnings})
            return DONE
        for warning in warnings:
            print(f"warning: {warning}", file=sys.stderr)
        print(f"written: {out.resolve()}")
        return DONE

    return guarded(work, as_json=json, debug=debug)


def _starts(
    recording: Log, content: ParameterFile, partition: Partition | None, file: Path
) -> tuple[Starts, tuple[str, ...]]:
    """The starts of the segments, from the parameter file `file` only if it has them for this very recording."""
    from clutchid.estimate.fit import starts_of

    kept = content.starts_for(recording)
    if kept is not None:
        return kept, ()
    told: tuple[str, ...] = ()
    if content.starts.get(recording.name):
        told = (
            f"{recording.name}: {file} has starts for a recording of this name, but not for this very file (sha256 in "
            "[fit] data); they were estimated anew.",
        )
    return starts_of(recording, content.actuator, partition), told

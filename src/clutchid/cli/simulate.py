"""``clutchid simulate``: an actuator along a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import DONE, EMPTY, guarded, pressure, print_json, read_logs, start_actuator
from clutchid.errors import ParameterError


def simulate(
    log: Path,
    /,
    *,
    parameters: Path,
    out: Path,
    every: int | None = None,
    parts: int | None = None,
    carry: Literal["p", "q"] = "p",
    ambient: str | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Simulate an actuator with the inputs of a recording and write all states.

    Where the recording does not start vented and at rest, position and pressure at its start are taken from the
    parameter file if it has them for this recording, else estimated from the measured position.

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
        Across such a reset, carry the pressures (p) or the masses of air (q).
    ambient
        Ambient pressure for gauge units, for example 1.013bar; default P_0 of the parameter file.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    def work() -> int:
        from clutchid.estimate.fit import starts_of
        from clutchid.io import write
        from clutchid.io.files import check_writable
        from clutchid.simulation import Partition
        from clutchid.simulation import simulate as simulate_log

        check_writable(out)
        if out.resolve() == log.resolve():
            raise ParameterError(f"--out {out}: is the recording itself; name another file.")
        actuator, content = start_actuator(parameters, None)
        recording = read_logs([log], pressure(ambient, actuator.parameters.P_0))[0]
        partition = None if every is None and parts is None else Partition(every=every, parts=parts, carry=carry)
        starts = content.starts.get(recording.name) or starts_of(recording, actuator, partition)
        done = simulate_log(actuator, recording, partition=partition, starts=starts)
        write(done.log, out)
        if json:
            print_json({**EMPTY, "status": "ok", "message": done.message, "warnings": list(done.warnings)})
        else:
            print(f"written: {out.resolve()}")
        return DONE

    return guarded(work, as_json=json, debug=debug)

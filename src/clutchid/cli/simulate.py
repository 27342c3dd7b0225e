"""``clutchid simulate``: simulate an actuator with the inputs of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from clutchid.cli.common import (
    DONE,
    FILES,
    SEARCH,
    FileOptions,
    ForceFlag,
    OutOption,
    OutputFlag,
    guarded,
    print_document,
    print_written,
)
from clutchid.verbs.options import USUAL_FILES, model_of, partition_of


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
        Simulate even if a check of the recording is bad; the checks are those of `clutchid look`.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.documents import document_of
    from clutchid.verbs.saving import check_outputs, write_log
    from clutchid.verbs.simulating import simulated
    from clutchid.verbs.start import content_of

    inputs = [
        ("the recording itself", log),
        ("the parameter file itself", parameters),
        ("the recording of --band", band),
    ]
    check_outputs({"--out": out}, inputs)
    partition, content = partition_of(every, parts, carry), content_of(parameters, model_of(model))
    reading = files.reading([log], [] if band is None else [band], force=force)
    simulation = simulated(reading, content, partition, parameters)
    write_log(simulation.log, out)
    print_document(document_of(simulation), json=json)
    if not json:
        print_written(out)
    return DONE

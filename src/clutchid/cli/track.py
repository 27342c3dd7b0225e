"""``clutchid track``: the wear of one clutch over its life."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from clutchid.cli.common import (
    DONE,
    FAILED,
    FILES,
    FLEET,
    SEARCH,
    FileOptions,
    OutOption,
    OutputFlag,
    PathOutput,
    guarded,
    print_json,
    print_written,
    progress_of,
)
from clutchid.documents.console import print_rows, say
from clutchid.errors import ExportError, ParameterError
from clutchid.verbs.commands import typed
from clutchid.verbs.options import USUAL_FILES, life_limit, pressure_option
from clutchid.verbs.saving import check_outputs, loads_path


@guarded
def track(
    *logs: Path,
    start: Path,
    out: OutOption,
    table: Annotated[Path | None, FILES] = None,
    limit: float | None = None,
    wear_table: Annotated[Path | None, FILES] = None,
    by: Annotated[Literal["estimate", "observe", "auto"], SEARCH] = "estimate",
    report: PathOutput = None,
    workers: Annotated[int, FLEET] = 1,
    files: FileOptions = USUAL_FILES,
    zero: Annotated[Literal["subtract", "keep"], SEARCH] = "subtract",
    json: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Follow the wear of one clutch through its recordings: trend, replaced clutches, remaining life.

    Every load is read from position alone, as by `clutchid estimate` or `clutchid observe`. A recording that cannot be
    read is a row with the reason.

    Parameters
    ----------
    logs
        Recordings of one vehicle, or a folder with them.
    start
        Calibration (TOML) of its type, as written by `clutchid calibrate --save`.
    out
        Output file with one row per recording, FILE.parquet; the loads are written beside it, as FILE.load.parquet.
    table
        CSV with recording, vehicle, date, odometer_km and strokes, as far as they are known.
    limit
        Shift of the half-load position in mm that ends the life of the clutch, negative if the position falls; by
        default from the last row of the wear table. Without either, the remaining life is unknown.
    wear_table
        CSV with wear [mm], half_load [mm] and load [N] of this type, for example from a test rig; it gives the wear of
        the facing. By default CAL.wear.csv beside the calibration CAL.toml, if it is there.
    by
        What reads the recordings: estimate, or observe at a fifteenth of the time, for recordings with the supply
        pressure; auto observes where that can be trusted, and estimates the others and what the trend does not expect.
    report
        Write a self-contained HTML page.
    workers
        Number of processes; does not affect the results.
    zero
        Subtract the shift of the vented rest since the calibration from the position, or keep the recorded position.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.documents import document_of, write_page
    from clutchid.verbs import tracking

    shift, results = life_limit(limit), (out, loads_path(out))
    _check(out, report, start, table, wear_table, logs)
    with progress_of("track") as progress:
        tracked = tracking.track(
            logs, start, table=table, wear_table=wear_table, limit=shift, by=by, workers=workers,
            ambient=pressure_option(files.ambient), channels=files.map, dbc=files.dbc or (), zero=zero, results=results,
            progress=progress,
        )  # fmt: skip
    tracking.write_tracked(tracked, out)
    document = document_of(tracked, typed(sys.argv[1:]))
    if report is not None:
        write_page(document, report)
    ended = DONE if any(tracked.wear.counted) else FAILED  # as its JSON object says
    if json:
        print_json(document.data())
        return ended
    say(filter(None, (tracked.left_out, *tracked.wear.warnings)))
    print_rows(document.rows)
    print_written(*results, report)
    return ended


def _check(
    out: OutOption, report: Path | None, start: Path, table: Path | None, wear_table: Path | None, logs: Sequence[Path]
) -> None:
    """Check before any work that the files can be written."""
    if out.suffix.lower() != ".parquet":
        raise ExportError(f"--out {out}: is written as .parquet.")
    read: list[tuple[str, Path | None]] = [
        ("the calibration", start),
        ("the table", table),
        ("the table of wear", wear_table),
        *(("a recording", path) for path in logs),
    ]
    check_outputs({"--out": out, "--report": report}, read)
    if start.is_dir():
        raise ParameterError(f"--start {start}: is a folder; track needs the calibration file of the vehicle's type.")

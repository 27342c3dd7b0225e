"""``clutchid fleet``: read the load of every recording of a fleet, on many workers; nothing is lost on the way."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import (
    DONE,
    FAILED,
    FLEET,
    SEARCH,
    FileOptions,
    Flag,
    OutOption,
    OutputFlag,
    guarded,
    print_json,
    progress_of,
)
from clutchid.documents.console import printable_lines, put, say
from clutchid.errors import ParameterError
from clutchid.names import printable
from clutchid.verbs.commands import typed
from clutchid.verbs.options import USUAL_FILES, life_limit, pressure_option

if TYPE_CHECKING:
    from clutchid.fleets.cluster import Workers
    from clutchid.fleets.verbs import FleetRun

#: Statuses in the order in which they are said.
_STATUSES = ("ok", "warning", "bad_input", "failed", "timed_out", "killed")

#: Bytes by unit of --memory.
_UNITS = {"GB": 1e9, "MB": 1e6}


@dataclass(frozen=True, slots=True)
class WorkerLimits:
    """Workers, and their limits of time and memory for a recording.

    Parameters
    ----------
    workers
        Number of processes on this machine, at most 4 a processor or 16; does not affect the results.
    scheduler
        Address of a Dask scheduler, which hands the work to workers on other machines, for example tcp://host:8786.
        They see files under the same paths and have the same clutchid; needs the extra fleet.
    timeout
        Time in s that one recording may take; 0 for no limit.
    memory
        Memory for one recording, for example 2GB; by default this machine's by the number of its processors, or what
        the workers of the scheduler have.
    """

    workers: int = 1
    scheduler: Annotated[str, Parameter(show_default=False)] = ""
    timeout: float = 600.0
    memory: Annotated[str, Parameter(show_default=False)] = ""


#: One worker on this machine.
_ONE_PROCESS = WorkerLimits()


@guarded
def fleet(
    source: Path,
    /,
    *,
    start: Path,
    out: OutOption,
    verb: Literal["fit", "observe", "track"] = "fit",
    by: Annotated[Literal["estimate", "observe", "auto"], SEARCH] = "estimate",
    pool: Annotated[WorkerLimits, Parameter(name="*"), FLEET] = _ONE_PROCESS,
    limit: float | None = None,
    retry: Annotated[Flag, FLEET] = False,
    fail_share: Annotated[float, FLEET] = 0.2,
    false_share: Annotated[float, FLEET] = 0.1,
    forget_missing: Annotated[Flag, FLEET] = False,
    table: Annotated[Flag, FLEET] = False,
    part: Annotated[str, FLEET] = "",
    once: Annotated[str, FLEET] = "",
    within: Annotated[str, FLEET] = "",
    files: FileOptions = USUAL_FILES,
    json: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Read the load of every recording of a fleet, and follow the wear of its vehicles.

    Every recording ends as a row with a status and a sentence. Run again, the command goes on where it ended: only new
    recordings, and those whose file, calibration or clutchid has changed, are read.

    Parameters
    ----------
    source
        A folder, in which each folder of recordings is a vehicle; or a table (CSV) with recording, vehicle and type.
        Both may be an address of objects, such as s3://bucket/fleet; a table also one of a web server.
    start
        Calibration (TOML) for all, or a folder with one for each type or vehicle: TYPE.toml or VEHICLE.toml; with
        track, a table of wear TYPE.wear.csv or VEHICLE.wear.csv beside it is used.
    out
        Folder of the results, new or that of a run to go on with; or an address of objects.
    verb
        fit: the load of each recording, as `clutchid estimate`. observe: as `clutchid observe`, at its end. track:
        as fit, and the wear of each vehicle.
    by
        With track, what reads the recordings: estimate, or observe at a fifteenth of the time, for recordings with the
        supply pressure; auto observes where that can be trusted, and estimates the others and what the trend does not
        expect.
    limit
        With track: shift of the half-load position in mm that ends the life of a clutch, below 0 if it falls; by
        default the last row of TYPE.wear.csv ends it. Without either, what is left is not known.
    retry
        Read recordings once more that ended their worker or took too long.
    fail_share
        Share of the recordings that may have no result. If there are more, or a vehicle has no reading at all, the
        exit code is 1.
    false_share
        With track: share of the listed alarms that may be expected to be false; alarms.parquet has all, the most
        probable first.
    forget_missing
        Leave out recordings whose files are gone; else their readings are kept, and counted.
    table
        Write results.parquet also for more than 100,000 recordings.
    part
        Read only the vehicles of a part of the fleet, such as 3/64, and write neither tables nor pages: several
        processes may read a part each, and a run without --part makes the tables of all.
    once
        Read only this recording, a file or an address as an event names it, and append its row; the same event twice
        is one row. The next run without --once makes the tables.
    within
        With track: print the vehicles by the probability that they reach the limit within a distance, a time, or by a
        day: 20000km, 90d or 2027-03-01.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.fleets import once as one_recording
    from clutchid.fleets import verbs

    ambient, dbc = pressure_option(files.ambient), files.dbc or ()
    if once:
        row = one_recording.fleet_once(
            once, start, out, source=source, verb=verb, by=by, ambient=ambient, channels=files.map, dbc=dbc
        )
        _say_row(row, as_json=json)
        return DONE
    shift, place = life_limit(limit), _place(pool)
    with progress_of("fleet") as progress:
        run = verbs.fleet(
            source, start, out, verb=verb, by=by, place=place, limit=shift, retry=retry, fail_share=fail_share,
            false_share=false_share, forget_missing=forget_missing, table=table, part=part, within=within,
            ambient=ambient, channels=files.map, dbc=dbc, command=typed(sys.argv[1:]), progress=progress,
        )  # fmt: skip
    _say(run, part, within, as_json=json)
    return FAILED if run.failure else DONE


def _place(pool: WorkerLimits) -> Workers:
    """Workers with their limits in SI."""
    from clutchid.fleets.cluster import Workers

    return Workers(pool.workers, pool.scheduler, _memory(pool.memory), _seconds(pool.timeout))


def _say_row(row: Mapping[str, object], *, as_json: bool) -> None:
    """Print the status of one recording, or its row without the points of its load."""
    if as_json:
        print_json(
            {name: str(v) if isinstance(v, datetime) else v for name, v in row.items() if not isinstance(v, list)}
        )
        return
    put(printable_lines(f"{row['vehicle']}, {row['recording']}: {row['status']}. {row['message']}".strip()))


def _say(run: FleetRun, part: str, within: str, *, as_json: bool) -> None:
    """Print how many recordings there are by status, and what was written."""
    statuses, vehicles = run.statuses, run.vehicles
    count, where = sum(statuses.values()), run.out if isinstance(run.out, str) else run.out.resolve().as_posix()
    words = ", ".join(f"{statuses[name]:,} {name}" for name in _STATUSES if statuses.get(name))
    message = f"{count:,} recording{'' if count == 1 else 's'}, {run.read:,} read in this run: {words or 'none'}"
    if as_json:
        ended = "failed" if run.failure else "ok" if statuses.get("ok") == count else "warning"
        print_json(
            {
                "status": ended,
                "message": run.failure or message,
                "alarms": run.alarms,
                "statuses": dict(statuses),
                "read": run.read,
                "out": where,
                "warnings": list(run.warnings),
                **({"due": [row._asdict() for row in run.due]} if within else {}),
            }
        )
        return
    say(run.warnings)
    put(printable_lines(message))
    if run.failure:
        put(printable_lines(f"clutchid: {run.failure}"), to=sys.stderr)
    tables = f"part {part}; a run without --part makes the tables" if part else f"{printable(where)}/index.html"
    put(f"{vehicles:,} vehicle{'' if vehicles == 1 else 's'}: {tables}")
    if run.alarms:
        put(f"{run.alarms}: {printable(where)}/alarms.parquet")
    if within:
        put(_due_lines(run, within))


#: Vehicles that are listed as due in a terminal, and the least probability of one.
_LISTED, _LEAST = 10, 0.01


def _due_lines(run: FleetRun, within: str) -> str:
    """The vehicles that may be due within a horizon, the most probable first."""
    due = [row for row in run.due if row.probability >= _LEAST]
    if not run.due:
        return f"due within {within}: not known, as no vehicle has a limit of its wear and a known use (--limit)."
    expected = sum(row.probability for row in run.due)
    lines = [f"due within {within}: {expected:.1f} of {len(run.due):,} vehicles expected"]
    for row in due[:_LISTED]:
        bands = [(band, unit) for band, unit in ((row.left_km, "km"), (row.left_days, "days")) if band.value >= 0.0]
        left = " or ".join(f"{band.low:,.0f} to {band.high:,.0f} {unit}".replace("inf", "∞") for band, unit in bands)
        kind = f" ({printable(row.type)})" if row.type else ""
        lines.append(f"  {100 * row.probability:3.0f} %  {printable(row.vehicle)}{kind}: {left} left")
    more = len(due) - _LISTED
    return "\n".join([*lines, f"  and {more:,} more with at least 1 %"] if more > 0 else lines)


def _seconds(timeout: float) -> float:
    if not 0.0 <= timeout < math.inf:
        raise ParameterError(f"--timeout {timeout}: a time in s of at least 0 is needed; 0 is no limit.")
    return timeout


def _memory(text: str) -> int:
    """Bytes of a size such as 2GB; 0 where none is given."""
    if not text:
        return 0
    unit = text.strip()[-2:].upper()
    try:
        size = float(text.strip()[:-2]) * _UNITS[unit]
    except (KeyError, ValueError):
        size = math.nan
    if not size >= 3e8:
        raise ParameterError(f"--memory {text}: at least 300MB is needed, for example 2GB.")
    return int(size)

"""`fleet`: the recordings of many vehicles, read and kept; then the tables of all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Literal

from clutchid.arguments import checked
from clutchid.documents.fleet_tables import VehicleRow
from clutchid.errors import ParameterError
from clutchid.fleets.cluster import ONE_WORKER, Workers
from clutchid.fleets.jobs import COMPILATION, Fleet, compile_first, fleet_of, read_all, tasks
from clutchid.fleets.output import RESULTS, VEHICLES, vehicles_of, write_results, write_vehicles
from clutchid.fleets.store import run_store
from clutchid.names import as_text
from clutchid.verbs.reading import Reading
from clutchid.verbs.start import content_of
from clutchid.verbs.wear_reading import read_recording
from clutchid.wear.life import LifeLimits
from clutchid.wear.tables import read_wear_table


@dataclass(frozen=True, slots=True)
class FleetRun:
    """A run over a fleet.

    Attributes
    ----------
    statuses
        Number of recordings by status, such as 'ok' and 'bad_input'.
    vehicles
        Number of vehicles.
    read
        Number of recordings that were read now; the others are from an earlier run.
    out
        Folder of the results, see docs/commands/fleet.md.
    warnings
        What lies in the folder beside the recordings, and what contradicts in their times, one sentence each.

    Examples
    --------
    >>> run = FleetRun({"ok": 118, "failed": 2}, vehicles=12, read=20, out=Path("result"))
    >>> f"{sum(run.statuses.values())} recordings of {run.vehicles} vehicles, {run.read} read in this run"
    '120 recordings of 12 vehicles, 20 read in this run'
    """

    statuses: Mapping[str, int]
    vehicles: int
    read: int
    out: Path
    warnings: tuple[str, ...] = ()


@checked
def fleet(
    source: str | PathLike[str],
    start: str | PathLike[str],
    out: str | PathLike[str],
    *,
    verb: Literal["fit", "observe", "track"] = "fit",
    place: Workers = ONE_WORKER,
    limit: float | None = None,
    retry: bool = False,
    ambient: float | None = None,
    channels: str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    command: str = "clutchid.fleet(...) in Python",
    progress: Callable[[int, int], None] | None = None,
) -> FleetRun:
    """Read the load of every recording of a fleet, and write its tables and pages; go on where an earlier run ended.

    Parameters
    ----------
    source : path
        A folder, in which each folder of recordings is a vehicle, or a table with recording, vehicle and type.
    start : path
        Calibration for all, or a folder with one for each type or vehicle.
    out : path
        Folder of the results, new or that of a run to go on with.
    verb : 'fit', 'observe' or 'track'
        What reads the load; with 'track' the wear of each vehicle is followed as well.
    place : Workers
        Number of workers or a scheduler, and limits of time and memory, see `clutchid.fleets.cluster.Workers`.
    limit : m, optional
        With 'track': shift of the half-load position that ends the life of a clutch.
    retry : bool
        Read recordings once more that ended their worker or took too long.
    ambient : Pa, optional
        Ambient pressure for gauge units; P_0 of each calibration by default.
    channels, dbc : paths
        Channel map (TOML), and DBC files of bus logs.
    command : text
        What repeats the run, for the pages.
    progress : function(done, all), optional
        Called after each recording.

    Returns
    -------
    found : FleetRun
        Its tables are in ``out``, see docs/commands/fleet.md.

    Raises
    ------
    DataError, ExportError, ParameterError, SolveError
        If the fleet cannot be read, `out` cannot be written, or the workers cannot be used.

    Examples
    --------
    A fleet of one vehicle with one recording; its load is in ``out/results.parquet``:

    >>> import clutchid, tempfile
    >>> log = clutchid.bundled_recording().slice(0, 4000)
    >>> cal = clutchid.calibrate(log, free="load,P_S")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (Path(folder) / "trucks" / "V1").mkdir(parents=True)
    ...     clutchid.write(log, f"{folder}/trucks/V1/run.csv")
    ...     clutchid.write_parameters(clutchid.parameter_file(cal), f"{folder}/cal.toml")
    ...     run = clutchid.fleet(f"{folder}/trucks", f"{folder}/cal.toml", f"{folder}/out")
    >>> run.vehicles, run.read
    (1, 1)
    """
    if limit is not None and verb != "track":
        raise ParameterError("--limit: belongs to --verb track, which follows the wear.")
    folder, calibrations, origin = Path(out), Path(start), Path(source)
    listed = fleet_of(origin, calibrations)
    if calibrations.is_file():
        content_of(calibrations)  # a broken one is one sentence, not one a recording
    how = "observe" if verb == "observe" else "fit"
    reading = Reading(ambient=ambient, channels=channels, dbc=tuple(dbc))
    with run_store(folder, {"source": as_text(str(origin.resolve())), "verb": verb}) as base:
        todo = tasks(listed, reading, how, base, retry=retry)
        if todo:
            if 0 < place.seconds < COMPILATION and not place.scheduler:
                compile_first(how, {job.start for job in todo if job.start})
            read_all(place, partial(read_recording, reading, how), todo, base, progress or (lambda _done, _all: None))
        trends = verb == "track"
        statuses = write_results(listed, base, folder, trends=trends)
        vehicles = vehicles_of(listed, base, _limits(listed, calibrations, limit))
        rows = write_vehicles(vehicles, command, folder, trends=trends)
    warnings = [listed.left_out, _time_warnings(rows) if trends else ""]
    return FleetRun(statuses, len(rows), len(todo), folder, tuple(filter(None, warnings)))


def _time_warnings(rows: Sequence[VehicleRow]) -> str:
    """Warning of vehicles whose recordings have no time, or contradictory times, with the first of them."""
    warned = [row for row in rows if row.warnings]
    if not warned:
        return ""
    first, count = warned[0], len(warned)
    return (
        f"times of recordings of {count:,} vehicle{'s' if count > 1 else ''} are missing or contradict: column "
        f"`warnings` of {VEHICLES} and {RESULTS}; {first.name}: {first.warnings[0]}"
    )


def _limits(listed: Fleet, start: Path, shift: float | None) -> dict[str, LifeLimits]:
    """End of a life by type: a shift in m for all, and the load against wear of a type, beside its calibration."""
    tables = {kind: start / f"{kind}.wear.csv" for kind in {job.type for job in listed.jobs}}
    return {
        kind: LifeLimits(shift, read_wear_table(path) if kind and path.is_file() else None)
        for kind, path in tables.items()
    }

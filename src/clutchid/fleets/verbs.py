"""`fleet`: the recordings of many vehicles, read and kept; then the tables of all of them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import Literal, NamedTuple

from clutchid.arguments import check_share, checked
from clutchid.documents.fleet_tables import VehicleRow
from clutchid.errors import ParameterError
from clutchid.fleets.cluster import ONE_WORKER, Workers
from clutchid.fleets.forecasts import DueVehicle, forecast_of, horizon_of
from clutchid.fleets.jobs import (
    Fleet,
    NoRecordingsError,
    by_own_name,
    calibrations_of,
    fleet_of,
    key_of,
    with_dependencies,
    with_known,
)
from clutchid.fleets.output import MOST_ROWS, RESULTS, VEHICLES, to_read_again, vehicles_of, write_results, write_tables
from clutchid.fleets.parts import adopt, append
from clutchid.fleets.plan import (
    COMPILATION,
    RecordingKey,
    RecordingState,
    compile_first,
    planned,
    read_all,
    read_object,
    reader_of,
    recording_states,
)
from clutchid.fleets.storage import (
    Folder,
    Objects,
    Storage,
    objects_at,
    path_of,
    scratch_of,
    target_at,
    times_of,
    upload,
)
from clutchid.fleets.store import Store, StoredRow, run_store
from clutchid.messages import listed as listed_names
from clutchid.names import as_text
from clutchid.verbs.folders import STORE
from clutchid.verbs.reading import Reading
from clutchid.verbs.start import content_of
from clutchid.verbs.tracking import WEAR_TABLE
from clutchid.verbs.wear_reading import read_recording
from clutchid.wear.history import RecordingJob
from clutchid.wear.life import LifeLimits
from clutchid.wear.tables import read_wear_table
from clutchid.wear.trend import WearTable


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
        Folder of the results, or their address, see docs/commands/fleet.md.
    warnings
        What lies in the folder beside the recordings, and what contradicts in their times, one sentence each.
    failure
        Why the run as a whole has failed, in a sentence; empty if it has not.
    alarms
        With 'track': how many alarms are listed, and how many of them are expected to be false.
    due
        With `within`: vehicles by the probability that their clutch reaches the limit, the largest first.

    Examples
    --------
    >>> run = FleetRun({"ok": 118, "failed": 2}, vehicles=12, read=20, out=Path("result"))
    >>> f"{sum(run.statuses.values())} recordings of {run.vehicles} vehicles, {run.read} read in this run"
    '120 recordings of 12 vehicles, 20 read in this run'
    """

    statuses: Mapping[str, int]
    vehicles: int
    read: int
    out: Path | str
    warnings: tuple[str, ...] = ()
    failure: str = ""
    alarms: str = ""
    due: tuple[DueVehicle, ...] = ()


@checked
def fleet(
    source: str | PathLike[str],
    start: str | PathLike[str],
    out: str | PathLike[str],
    *,
    verb: Literal["fit", "observe", "track"] = "fit",
    by: Literal["estimate", "observe", "auto"] = "estimate",
    place: Workers = ONE_WORKER,
    limit: float | None = None,
    retry: bool = False,
    fail_share: float = 0.2,
    false_share: float = 0.1,
    forget_missing: bool = False,
    table: bool = False,
    part: str = "",
    within: str = "",
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
        A folder, in which each folder of recordings is a vehicle, or a table with recording, vehicle and type. It may
        be an address of objects, such as ``s3://bucket/fleet`` (extra ``cloud``), a table also one of a web server.
    start : path
        Calibration for all, or a folder with one for each type or vehicle.
    out : path
        Folder of the results, new or that of a run to go on with; or an address of objects.
    verb : 'fit', 'observe' or 'track'
        What reads the load; with 'track' the wear of each vehicle is followed as well.
    by : 'estimate', 'observe' or 'auto'
        With 'track': what reads the recordings, as in `clutchid.track`.
    place : Workers
        Number of workers or a scheduler, and limits of time and memory, see `clutchid.fleets.cluster.Workers`.
    limit : m, optional
        With 'track': shift of the half-load position that ends the life of a clutch.
    retry : bool
        Read recordings once more that ended their worker or took too long.
    fail_share : 1
        Share of the recordings that may have no result, from 0 to 1; the run has failed if there are more, or if a
        vehicle has no reading at all.
    false_share : 1
        With 'track': share of the listed alarms that may be expected to be false, from 0 to 1.
    forget_missing : bool
        Leave out recordings whose files are gone; else their readings are kept.
    table : bool
        Write ``results.parquet`` also for more than 100,000 recordings, of which the parts alone are written else.
    part : text
        Read only the vehicles of a part of the fleet, such as "3/64", and write neither tables nor pages: several
        processes may each read a part, and a run without this option makes the tables of all.
    within : text
        With 'track': list the vehicles by the probability that they reach the limit within "20000km" or "90d" of their
        last recording, or by a day such as "2027-03-01".
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
    horizon = horizon_of(within)
    if (limit is not None or horizon) and verb != "track":
        option = "--limit" if horizon is None else "--within"
        raise ParameterError(f"{option}: belongs to --verb track, which follows the wear.")
    check_share("--fail-share", fail_share, 0.2)
    check_share("--false-share", false_share, 0.1)
    places, calibrations = _places(source, out), Path(start)
    folder, storage = places.folder, places.target or Folder(places.folder)
    listed, absent = _listed(source, calibrations, folder, forget=forget_missing)
    if calibrations.is_file():
        content_of(calibrations)  # a broken one is one sentence, not one a recording
    tables = _wear_tables(calibrations)
    reading = Reading(ambient=ambient, channels=channels, dbc=tuple(dbc))
    work = _Work(place, reading, reader_of(verb, by), progress or (lambda _done, _all: None))
    share, about = _share(part), {"source": as_text(places.origin), "verb": verb}
    with run_store(folder, about, share.file if share else STORE) as base:
        before = times_of(folder) if places.target else {}
        adopt(base, storage)
        keys = base.keys()
        read, states, by_date = 0, list[RecordingState](), calibrations_of(calibrations)
        for _ in range(2 if by_date.has_dates else 1):  # the dates in files are known when they have been read
            listed = with_dependencies(with_known(listed, by_date, keys, missing=not forget_missing), reading, work.how)
            if share:
                listed = listed._replace(jobs=tuple(job for job in listed.jobs if share.has(job.vehicle)))
            if not listed.jobs and not share:
                raise NoRecordingsError(absent)
            options = {"retry": retry and not states, "forget": forget_missing, "fold": not share}
            states, count = _read_new(listed, work, keys, base, storage, **options)
            keys, read = base.keys() if count else keys, read + count

        def limits(job: RecordingJob) -> LifeLimits:
            return LifeLimits(limit, tables.of(job))

        while by == "auto" and not share and (again := to_read_again(states, base, limits)):
            work.read(listed, again, {}, base, "estimate")
            append(base, storage)
            states, read = recording_states([state.job for state in states], base.keys()), read + len(again)
        statuses, gone = Counter(state.status for state in states), sum(state.file_gone for state in states)
        if share:
            return FleetRun(statuses, len({state.job.vehicle for state in states}), read, places.shown)
        if table or len(states) <= MOST_ROWS:
            write_results(states, base, storage, folder)
        trends = verb == "track"
        rows = vehicles_of(states, base, limits, command, folder, trends=trends)
        forecast = forecast_of(rows, horizon)
        alarms = write_tables(forecast, command, folder, trends=trends, false_share=false_share)
        if places.target:
            upload(folder, before, places.target)
    times, missing = _time_warnings(rows) if trends else "", _missing_files(gone, statuses.total(), absent)
    warnings = [missing, listed.left_out, listed.renamed, tables.unused(rows), times]
    named = len(states) - sum(bool(state.copy_of) for state in states) if listed.has_table else 0
    failure = _failure(rows, fail_share, named, trends=trends)
    sentences = tuple(filter(None, warnings))
    return FleetRun(statuses, len(rows), read, places.shown, sentences, failure, alarms, forecast.due)


class _Work(NamedTuple):
    """How the recordings of a fleet are read: by which workers, with what, and who follows the progress."""

    place: Workers
    reading: Reading
    how: str
    progress: Callable[[int, int], None]

    def read(
        self,
        fleet: Fleet,
        jobs: Sequence[RecordingJob],
        keys: Mapping[RecordingKey, StoredRow],
        store: Store,
        how: str = "",
    ) -> None:
        """Read recordings of a fleet, also in another way than the usual one."""
        read = partial(read_recording, self.reading, how or self.how)
        read = partial(read_object, fleet.objects, read) if fleet.objects else read
        read_all(self.place, read, jobs, keys, store, self.progress)


def _read_new(
    listed: Fleet,
    work: _Work,
    keys: Mapping[RecordingKey, StoredRow],
    base: Store,
    storage: Storage,
    *,
    retry: bool,
    forget: bool,
    fold: bool,
) -> tuple[list[RecordingState], int]:
    """Read what is new or has changed, and append it; what is known of all recordings then, and how many were read."""
    plan = planned(listed.jobs, keys, retry=retry, forget=forget, objects=listed.objects is not None)
    base.rename(plan.same)
    base.forget(plan.forgotten)
    if plan.todo:
        if 0 < work.place.seconds < COMPILATION and not work.place.scheduler:
            compile_first(work.how, {job.start for job in plan.todo if job.start})
        work.read(listed, plan.todo, keys, base)
    is_new = append(base, storage, fold=fold) or any(plan)
    jobs = [job for job in listed.jobs if job.path or job.problem or key_of(job) not in plan.forgotten]
    return recording_states(jobs, base.keys() if is_new else keys), len(plan.todo)


class _Places(NamedTuple):
    """Where a fleet and its tables lie: the address or path of the fleet, and the folder of this machine of the run.

    `target` are the objects of the tables, None where these lie in the folder.
    """

    origin: str
    folder: Path
    target: Objects | None

    @property
    def shown(self) -> Path | str:
        """Where the tables lie."""
        return self.target.address if self.target else self.folder


def _places(source: str | PathLike[str], out: str | PathLike[str]) -> _Places:
    objects, target = objects_at(source), target_at(out)
    if target and target == objects:
        raise ParameterError(f"--out {target.address}: is the fleet itself; name a folder of its own.")
    origin = objects.address if objects else str(path_of(source).resolve())
    return _Places(origin, scratch_of(target) if target else path_of(out), target)


class _Share(NamedTuple):
    """A part of a fleet: its number, and how many there are."""

    number: int
    of: int

    @property
    def file(self) -> str:
        """Name of its index."""
        return f"run-{self.number}-of-{self.of}.sqlite"

    def has(self, vehicle: str) -> bool:
        """Whether it has a vehicle."""
        return int.from_bytes(sha256(vehicle.encode()).digest()[:8]) % self.of == self.number - 1


def _share(text: str) -> _Share | None:
    """A part such as 3/64; None for the whole fleet."""
    if not text:
        return None
    match = re.fullmatch(r"(\d{1,5})/(\d{1,5})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise ParameterError(f"--part {text}: is a part of the fleet, such as 3/64 for the third of 64.")
    return _Share(int(match[1]), int(match[2]))


def _time_warnings(rows: Sequence[VehicleRow]) -> str:
    """Warning of vehicles whose recordings have no time, or contradictory times, with the first of them."""
    warned = [row for row in rows if row.warnings]
    if not warned:
        return ""
    first, count = warned[0], len(warned)
    return (
        f"times of recordings of {count:,} vehicle{'s' if count > 1 else ''} are missing or contradict: column "
        f"`warnings` of {VEHICLES}; {first.name}: {first.warnings[0]}"
    )


def _listed(source: str | PathLike[str], start: Path, out: Path, *, forget: bool) -> tuple[Fleet, str]:
    """The recordings of a fleet; of one whose files are all gone none, if it has been read, and why in a sentence."""
    try:
        return fleet_of(source, start), ""
    except NoRecordingsError as error:
        if forget or not (out / STORE).exists():
            raise
        return Fleet(()), str(error)


def _missing_files(gone: int, recordings: int, absent: str) -> str:
    """Warning of readings whose files are gone, `absent` being why all of them are; empty if there are none."""
    words = f"{gone:,} of {recordings:,} recordings: the file is gone, and the reading is kept (column `file_gone`)"
    return f"{f'{absent} ' if absent else ''}{words}; --forget-missing leaves them out." if gone else ""


def _failure(rows: Sequence[VehicleRow], share: float, named: int, *, trends: bool) -> str:
    """Why a run has failed, in sentences: too many recordings without a result, or vehicles without a reading.

    The recordings are those that a table has `named`, whatever their files are, or else the files that are recordings.
    """
    recordings = max(sum(row.recordings for row in rows), named)
    failed = recordings - sum(row.has_result for row in rows)
    without = [row.name for row in rows if not (row.counted if trends else row.has_result)]
    sentences = []
    if failed > share * recordings:
        sentences.append(f"{failed:,} of {recordings:,} recordings failed, more than --fail-share {share:g} allows")
    if without:
        what = f"{len(without):,} vehicles have" if len(without) > 1 else "1 vehicle has"
        sentences.append(f"{what} no reading ({listed_names(without, 3)})")
    return f"{', and '.join(sentences)}: column `message` of {RESULTS} says why." if sentences else ""


class _WearTables(NamedTuple):
    """Load against wear by name of a vehicle or type; the table `of_all` is beside the one calibration of all."""

    by_name: Mapping[str, WearTable]
    of_all: WearTable | None = None

    def of(self, job: RecordingJob) -> WearTable | None:
        """That of the vehicle, else of its type."""
        return self.by_name.get(job.vehicle) or self.by_name.get(job.type) or self.of_all

    def unused(self, rows: Sequence[VehicleRow]) -> str:
        """Warning of tables that belong to no vehicle and no type."""
        names = sorted({*self.by_name} - {row.name for row in rows} - {row.type for row in rows})
        files = listed_names((f"{name}{WEAR_TABLE}" for name in names), 3)
        return f"{files}: no vehicle and no type has that name, so that it is not used." if names else ""


def _wear_tables(start: Path) -> _WearTables:
    """The tables of wear beside calibrations."""
    if start.is_dir():
        return _WearTables({name: read_wear_table(path) for name, path in by_own_name(start, WEAR_TABLE).items()})
    path = start.with_suffix(WEAR_TABLE)
    return _WearTables({}, read_wear_table(path) if path.is_file() else None)

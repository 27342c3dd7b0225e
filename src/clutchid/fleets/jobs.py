"""The recordings of a fleet, their vehicles, types and calibrations; those that are not done yet, read by workers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import as_file, files
from os import PathLike
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from clutchid.errors import DataError, ParameterError
from clutchid.files import digest, is_there, not_an_address
from clutchid.fleets.cluster import Workers, results, version_and_source
from clutchid.fleets.store import Store, StoredResult
from clutchid.names import as_text
from clutchid.processes import FinishedWork, Pool
from clutchid.verbs.folders import (
    FolderContent,
    ListedFile,
    files_by_name,
    folder_content,
    left_out,
    name_of,
    no_recordings,
)
from clutchid.verbs.reading import Reading, by_suffix
from clutchid.verbs.start import compile_models
from clutchid.verbs.wear_reading import RecordingResult, checksum_of, read_recording, unless_lost
from clutchid.wear.history import Listed
from clutchid.wear.tables import read_fleet_table

#: A folder with this file is a fleet with a table, as `clutchid drive --fleet` writes it.
_TABLE = "recordings.csv"


class FleetJob(NamedTuple):
    """A recording to be read: `path` and `start`, its calibration, are None where `problem` says why it cannot be."""

    vehicle: str
    recording: str
    type: str
    path: Path | None
    start: Path | None
    problem: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Fleet:
    """Recordings of a fleet in the order of vehicle and name, and the rows of its table by (vehicle, recording).

    `left_out` says what its folder holds beside them, empty if nothing.
    """

    source: Path
    jobs: tuple[FleetJob, ...]
    rows: Mapping[tuple[str, str], Listed]
    left_out: str = ""


def fleet_of(source: Path, start: Path) -> Fleet:
    """The recordings of a fleet, each with the calibration that it starts from.

    Parameters
    ----------
    source
        A table of recordings, whose files lie in its folder or below; or a folder, in which each folder of recordings
        is a vehicle, or which has such a table as ``recordings.csv``.
    start
        A calibration for all, or a folder with one for each type, ``TYPE.toml``, or each vehicle, ``VEHICLE.toml``.

    Raises
    ------
    DataError
        If there is no recording, two vehicles have one name, or the table contradicts itself.
    ParameterError
        If no recording has a calibration.
    """
    not_an_address(source)
    if not is_there(source):
        raise DataError(f"{source}: there is no such folder or table.")
    table = source if source.is_file() else source / _TABLE
    if table.is_file():
        rows = read_fleet_table(table)
        _check_vehicles(rows.values(), table)
        content = folder_content(table.parent, {table.resolve()})
        files = files_by_name(content, {recording for _, recording in rows})
        by_key = {(vehicle, recording): files.file_of(recording, vehicle) for vehicle, recording in rows}
        beside = _unlisted(by_key.values(), content) if source.is_dir() else ""
    else:
        rows, content = {}, folder_content(source)
        beside = left_out(content.others, content.results)
        by_key = {key: ListedFile(path) for key, path in _in_folders(source, content.recordings).items()}
    if not by_key:
        raise DataError(no_recordings(str(source), beside))
    if all(file.path is None for file in by_key.values()):
        raise DataError(f"{source}: none of the files of its {len(by_key):,} recordings exists.")
    calibrations = _calibrations(start)
    jobs = tuple(_job(key, file, rows.get(key), start, calibrations) for key, file in sorted(by_key.items()))
    if all(job.start is None for job in jobs):
        raise ParameterError(f"--start {start}: {jobs[0].problem}")
    return Fleet(source, jobs, rows, beside)


def _in_folders(source: Path, recordings: Iterable[Path]) -> dict[tuple[str, str], Path]:
    """Recordings by (vehicle, name): the vehicle is their folder."""
    folders: dict[str, Path] = {}
    by_key: dict[tuple[str, str], Path] = {}
    for path in recordings:
        vehicle = as_text(path.parent.resolve().name)
        other = folders.setdefault(vehicle, path.parent)
        if other != path.parent:
            raise DataError(
                f"{source}: '{other}' and '{path.parent}' are two vehicles under one name, '{vehicle}'; rename one, or "
                "say in a table which recordings belong together."
            )
        first = by_key.setdefault((vehicle, name_of(path)), path)
        if first is not path:
            raise DataError(f"{first} and {path}: have the same name; every recording of a vehicle needs its own.")
    return by_key


def _check_vehicles(rows: Iterable[Listed], table: Path) -> None:
    """Check that every row has a vehicle, and that a vehicle has one type."""
    types: dict[str, str] = {}
    for row in rows:
        if not row.vehicle:
            raise DataError(f"{table}: '{row.recording}' has no vehicle; a fleet needs the column 'vehicle'.")
        kind = types.setdefault(row.vehicle, row.type)
        if kind != row.type:
            raise DataError(
                f"{table}: vehicle '{row.vehicle}' is of type '{kind}' and of type '{row.type}', so it is two vehicles "
                "under one name; rename one."
            )


def _unlisted(listed: Iterable[ListedFile], content: FolderContent) -> str:
    """Sentence about recordings that lie beside those of a table and are not in it."""
    paths = {file.path for file in listed if file.path is not None}
    folders = {path.parent for path in paths}
    beside = [path for path in content.recordings if path not in paths and path.parent in folders]
    return f"not read, because the table does not name them: {by_suffix(beside)}." if beside else ""


def _calibrations(start: Path) -> dict[str, Path] | None:
    """Calibrations by type or vehicle; None where one serves all."""
    not_an_address(start, "--start")
    if not is_there(start):
        raise ParameterError(f"--start {start}: there is no such file or folder.")
    if start.is_file():
        return None
    by_name = {as_text(path.stem): path for path in sorted(start.glob("*.toml"))}
    if not by_name:
        raise ParameterError(
            f"--start {start}: has no calibrations (TYPE.toml); `clutchid calibrate --save` writes them."
        )
    return by_name


def _job(
    key: tuple[str, str], file: ListedFile, row: Listed | None, start: Path, calibrations: Mapping[str, Path] | None
) -> FleetJob:
    vehicle, recording = key
    kind = row.type if row else ""
    calibration = start if calibrations is None else calibrations.get(vehicle) or calibrations.get(kind)
    problem = file.problem
    if file.path is not None and calibration is None:
        what = f"type '{kind}'" if kind else f"vehicle '{vehicle}'"
        problem = as_text(f"there is no calibration of {what}: {start / (kind or vehicle)}.toml.")
    return FleetJob(vehicle, recording, kind, file.path, calibration, problem)


#: Lost results, which are tried again where the user says so.
_LOST = ("killed", "timed_out")


class FleetTask(NamedTuple):
    """A recording of a vehicle to be read, the calibration to start from, and what its result depends on."""

    vehicle: str
    recording: str
    path: Path
    start: Path
    inputs: str
    file: str


def tasks(fleet: Fleet, reading: Reading, verb: str, store: Store, *, retry: bool = False) -> list[FleetTask]:
    """The recordings without a result, or whose file, calibration or clutchid has changed since.

    With `retry` also those that ended their worker or took too long.
    """
    stored, inputs = store.keys(), _inputs(fleet, reading, verb)
    todo = []
    for job in fleet.jobs:
        if job.path is None or job.start is None:
            continue
        key, file = (job.vehicle, job.recording), _file(job.path)
        task = FleetTask(*key, job.path, job.start, inputs[job.start], file)
        known_inputs, known_file, checksum, status = stored.get(key, ("", "", "", ""))
        unread = file and not checksum  # as where a share was away for a while
        if known_inputs != task.inputs or unread or (retry and status in _LOST):
            todo.append(task)
        elif known_file != file:
            if checksum_of(job.path) == checksum:
                store.same_file(key, file)
            else:
                todo.append(task)
    return todo


def read_all(
    workers: Workers,
    read: Callable[[FleetTask], RecordingResult],
    todo: Sequence[FleetTask],
    store: Store,
    progress: Callable[[int, int], None],
) -> None:
    """Read recordings, and keep every result as it comes.

    Parameters
    ----------
    read
        What reads one, `work` with its first arguments.
    progress
        Is called with the numbers of recordings that have been read, and of all.

    Raises
    ------
    ExportError
        If a result cannot be kept; those before are.
    MissingExtra, ParameterError, SolveError
        If the workers of a scheduler cannot be used, see `clutchid.fleets.cluster.results`.
    """
    last, count = monotonic(), 0
    try:
        for finished in results(read, todo, workers):
            store.put(_result(finished))
            last, count = store.saved(last), count + 1
            progress(count, len(todo))
    finally:
        store.saved()


#: The bundled recording.
_BUNDLED = files("clutchid.study") / "data" / "truck1_calibration.csv"

#: Time in s that a compilation may take on a slow machine: workers with less for a recording would be ended in it.
COMPILATION = 300.0


def compile_first(verb: str, calibrations: Iterable[Path]) -> None:
    """Compile in a worker without a limit what later workers need for some calibrations; these only load it.

    The bundled recording is read as well, for what is compiled by use only.
    """
    pool, starts = Pool(), sorted(calibrations)
    pool.do(compile_models, starts)
    with as_file(_BUNDLED) as recording:
        pool.do(partial(read_recording, Reading(), verb, starts[0]), recording)


def work(reading: Reading, verb: str, task: FleetTask) -> RecordingResult:
    """`read_recording` of a task."""
    return read_recording(reading, verb, task.start, task.path)


def _result(finished: FinishedWork[FleetTask, RecordingResult]) -> StoredResult:
    task = finished.item
    read = unless_lost(task.path, finished.result)
    return StoredResult(task.vehicle, task.recording, task.inputs, task.file, read, finished.seconds)


def _inputs(fleet: Fleet, reading: Reading, verb: str) -> Mapping[Path, str]:
    """Inputs of results beside the recording, by calibration."""
    files = [Path(path) for path in (reading.channels, *reading.dbc) if isinstance(path, str | PathLike)]
    common = [version_and_source(), verb, repr(reading.ambient), [digest(path) for path in files]]
    starts = {job.start for job in fleet.jobs if job.start is not None}
    return {start: json.dumps([digest(start), *common], sort_keys=True) for start in starts}


def _file(path: Path) -> str:
    """Size and time of a file, to detect changes without reading it; empty if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return ""
    return f"{status.st_size} {status.st_mtime_ns}"

"""The recordings of a fleet, their vehicles, types and calibrations; those that are not done yet, read by workers."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.resources import as_file, files
from os import PathLike
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from clutchid.errors import DataError, ParameterError
from clutchid.files import digest, is_there, not_an_address
from clutchid.fleets.cluster import Workers, results, version_and_source
from clutchid.fleets.store import RecordingRow, Store, StoredKey, place_of
from clutchid.messages import listed
from clutchid.names import as_text
from clutchid.processes import Pool
from clutchid.verbs.folders import FolderContent, files_by_name, folder_content, left_out, name_of, no_recordings
from clutchid.verbs.reading import Reading, by_suffix
from clutchid.verbs.start import compile_models
from clutchid.verbs.wear_reading import checksum_of, read_recording, unless_lost
from clutchid.wear.history import RecordingJob, WearReading
from clutchid.wear.tables import read_fleet_table

#: A folder with this file is a fleet with a table, as `clutchid drive --fleet` writes it.
_TABLE = "recordings.csv"


class Fleet(NamedTuple):
    """Recordings of a fleet in the order of vehicle and name.

    `left_out` says what its folder holds beside them, `renamed` which vehicles have a longer name here; empty if none.
    """

    jobs: tuple[RecordingJob, ...]
    left_out: str = ""
    renamed: str = ""


class NoRecordingsError(DataError):
    """A fleet without the file of a single recording."""


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
    NoRecordingsError
        If there is no recording.
    DataError
        If the table contradicts itself.
    ParameterError
        If no recording has a calibration.
    """
    not_an_address(source)
    if not is_there(source):
        raise NoRecordingsError(f"{source}: there is no such folder or table.")
    table = source if source.is_file() else source / _TABLE
    if table.is_file():
        rows = read_fleet_table(table).values()
        content = folder_content(table.parent, {table.resolve()})
        files = files_by_name(content, {row.recording for row in rows})
        located, renamed = _one_type_each([files.located(row) for row in rows], table)
        beside = _unlisted(located, content) if source.is_dir() else ""
    else:
        content = folder_content(source)
        located, renamed = _in_folders(source, content.recordings)
        beside = left_out(content.others, content.results)
    if not located:
        raise NoRecordingsError(no_recordings(str(source), beside))
    if all(job.path is None for job in located):
        raise NoRecordingsError(f"{source}: none of the files of its {len(located):,} recordings exists.")
    calibrations = _calibrations(start)
    located.sort(key=_key)
    jobs = tuple(_with_calibration(job, start, calibrations) for job in located)
    if all(job.start is None for job in jobs):
        raise ParameterError(f"--start {start}: {jobs[0].problem}")
    return Fleet(jobs, beside, _RENAMED.format(listed(sorted(renamed), 3)) if renamed else "")


#: What is said of vehicles of one name.
_RENAMED = "several vehicles have one name, and are named by their folder or type: {}; give each a name of its own."


def _in_folders(source: Path, paths: Sequence[Path]) -> tuple[list[RecordingJob], set[str]]:
    """Recordings whose vehicle is their folder, and the vehicles that have their path as the name.

    These are folders of one name. Recordings of one name in a folder have their suffix in it.
    """
    folders = {folder: as_text(folder.resolve().name) for folder in {path.parent for path in paths}}
    common = {vehicle for vehicle, count in Counter(folders.values()).items() if count > 1}
    several = {folder: vehicle for folder, vehicle in folders.items() if vehicle in common}
    for folder, vehicle in several.items():
        below = as_text(folder.relative_to(source).as_posix())
        folders[folder] = f"{vehicle}/." if below == "." else below
    names = Counter((path.parent, name_of(path)) for path in paths)
    whole = {(path.parent, as_text(path.name)) for path in paths}
    jobs = []
    for path in paths:
        name = (path.parent, name_of(path))
        recording = as_text(path.name) if names[name] > 1 or name in whole else name[1]
        jobs.append(RecordingJob(recording, folders[path.parent], path=path))
    return jobs, {folders[folder] for folder in several}


def _one_type_each(rows: Sequence[RecordingJob], table: Path) -> tuple[list[RecordingJob], set[str]]:
    """Rows of a table with a vehicle each; one of several types is several, named by type and vehicle, which follow."""
    types: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        if not row.vehicle:
            raise DataError(f"{table}: '{row.recording}' has no vehicle; a fleet needs the column 'vehicle'.")
        types[row.vehicle].add(row.type)
    several = {vehicle for vehicle, own in types.items() if len(own) > 1}
    names = [f"{row.type or 'no type'}/{row.vehicle}" if row.vehicle in several else row.vehicle for row in rows]
    renamed = {name for name, row in zip(names, rows, strict=True) if name != row.vehicle}
    return [replace(row, vehicle=name) for row, name in zip(rows, names, strict=True)], renamed


def _unlisted(listed: Iterable[RecordingJob], content: FolderContent) -> str:
    """Sentence about recordings that lie beside those of a table and are not in it."""
    paths = {job.path for job in listed if job.path is not None}
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
    by_name = by_own_name(start, ".toml")
    if not by_name:
        raise ParameterError(
            f"--start {start}: has no calibrations (TYPE.toml); `clutchid calibrate --save` writes them."
        )
    return by_name


def by_own_name(folder: Path, suffix: str) -> dict[str, Path]:
    """The files of a folder and below with a suffix, by their path in it without the suffix, as vehicles are named."""
    paths = [path for path in sorted(folder.rglob(f"*{suffix}")) if not path.name.startswith(".")]
    return {as_text(path.relative_to(folder).as_posix()).removesuffix(suffix): path for path in paths}


def _with_calibration(job: RecordingJob, start: Path, calibrations: Mapping[str, Path] | None) -> RecordingJob:
    """A recording with its calibration, or with the problem that there is none."""
    calibration = start if calibrations is None else calibrations.get(job.vehicle) or calibrations.get(job.type)
    if calibration is not None or job.path is None:
        return replace(job, start=calibration)
    what = f"type '{job.type}'" if job.type else f"vehicle '{job.vehicle}'"
    place = start / (job.type or job.vehicle)
    return replace(job, problem=as_text(f"there is no calibration of {what}: {place}.toml."))


#: Lost results, which are tried again where the user says so.
_LOST = ("killed", "timed_out")


#: A recording without a result.
_NONE = StoredKey(RecordingJob(""), "", "")


def tasks(fleet: Fleet, reading: Reading, verb: str, store: Store, *, retry: bool = False) -> list[RecordingJob]:
    """The recordings without a result, or whose file, calibration or clutchid has changed since.

    With `retry` also those that ended their worker or took too long. What identifies a reading is the SHA-256 of the
    file with the inputs: the same file under another name has the reading already, and takes it over from a name whose
    file is gone.
    """
    stored, inputs = store.keys(), _inputs(fleet, reading, verb)
    there = {_key(job): stamp for job in fleet.jobs if job.path and (stamp := stamp_of(job.path))}
    by_checksum = {entry.checksum: key for key, entry in stored.items() if entry.has_result}
    sizes = {entry.job.file.partition(" ")[0] for entry in stored.values() if entry.has_result}
    todo: list[RecordingJob] = []
    same: list[tuple[tuple[str, str], RecordingJob]] = []
    moved: set[tuple[str, str]] = set()
    for job in fleet.jobs:
        if job.path is None or job.start is None:
            continue
        key, stamp = _key(job), there.get(_key(job), "")
        task, entry = replace(job, inputs=inputs[job.start], file=stamp), stored.get(key, _NONE)
        if not stamp and entry.has_result:
            continue
        changed = entry.job.file != stamp
        unread = stamp and not entry.checksum  # as where a share was away for a while
        as_before = entry.job.inputs == task.inputs and not unread and not (retry and entry.status in _LOST)
        if as_before and not (changed and checksum_of(job.path) != entry.checksum):
            if changed or place_of(entry.job) != place_of(task):
                same.append((key, task))
            continue
        source = by_checksum.get(checksum_of(job.path)) if changed and stamp.partition(" ")[0] in sizes else None
        if source and source != key and source not in there:
            moved.add(source)
        if source and source != key and stored[source].job.inputs == task.inputs:
            same.append((source, task))
        else:
            todo.append(task)
    store.rename(same)
    store.forget(moved - {_key(task) for _, task in same})
    return todo


def with_missing(fleet: Fleet, start: Path, store: Store, *, forget: bool) -> Fleet:
    """A fleet with the stored recordings whose files are gone; with `forget` they are deleted from the store."""
    stored = {key: entry for key, entry in store.keys().items() if entry.has_result}
    listed = {_key(job): job for job in fleet.jobs}
    if forget:
        gone = {key for key in stored if not (key in listed and (path := listed[key].path) and stamp_of(path))}
        store.forget(gone)
        return fleet
    calibrations = _calibrations(start)
    missing = (_with_calibration(entry.job, start, calibrations) for key, entry in stored.items() if key not in listed)
    return fleet._replace(jobs=tuple(sorted((*fleet.jobs, *missing), key=_key)))


def _key(job: RecordingJob) -> tuple[str, str]:
    return job.vehicle, job.recording


def read_all(
    workers: Workers,
    read: Callable[[RecordingJob], WearReading],
    todo: Sequence[RecordingJob],
    store: Store,
    progress: Callable[[int, int], None],
) -> None:
    """Read recordings, and keep every result as it comes.

    Parameters
    ----------
    read
        What reads one.
    progress
        Is called with the numbers of recordings that have been read, and of all.

    Raises
    ------
    ExportError
        If a result cannot be kept; those before are.
    MissingExtra, ParameterError, SolveError
        If the workers of a scheduler cannot be used, see `clutchid.fleets.cluster.results`.
    """
    last, count, stored = monotonic(), 0, store.keys()
    try:
        for finished in results(read, todo, workers):
            job, reading = finished.item, unless_lost(finished.item, finished.result)
            entry = stored.get(_key(job), _NONE)
            # a stub, or a file that went meanwhile, takes no reading of what it was
            if not (reading.apart and entry.has_result and reading.sha256 != entry.checksum):
                store.put(RecordingRow(job, reading, finished.timing))
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
        job = RecordingJob("bundled", path=recording, start=starts[0])
        pool.do(partial(read_recording, Reading(), verb), job)


def _inputs(fleet: Fleet, reading: Reading, verb: str) -> Mapping[Path, str]:
    """Inputs of results beside the recording, by calibration."""
    files = [Path(path) for path in (reading.channels, *reading.dbc) if isinstance(path, str | PathLike)]
    common = [version_and_source(), verb, repr(reading.ambient), [digest(path) for path in files]]
    starts = {job.start for job in fleet.jobs if job.start is not None}
    return {start: json.dumps([digest(start), *common], sort_keys=True) for start in starts}


def stamp_of(path: Path) -> str:
    """Size and time of a file, to detect changes without reading it; empty if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return ""
    return f"{status.st_size} {status.st_mtime_ns}"

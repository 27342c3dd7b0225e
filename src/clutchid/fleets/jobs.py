"""The recordings of a fleet, their vehicles, types and calibrations."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import date
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from clutchid.errors import DataError, ParameterError
from clutchid.files import digest, is_there, not_an_address
from clutchid.fleets.cluster import version_and_source
from clutchid.fleets.storage import NoObjectError, Objects, objects_at, path_of, run_of
from clutchid.fleets.store import StoredRow
from clutchid.messages import listed
from clutchid.names import as_text
from clutchid.verbs.folders import (
    FilesByName,
    FolderContent,
    files_by_name,
    folder_content,
    is_hidden,
    left_out,
    name_of,
    no_recordings,
    recordings_and_others,
)
from clutchid.verbs.reading import Reading, by_suffix
from clutchid.wear.history import RecordingJob, dated
from clutchid.wear.tables import read_fleet_table

#: A folder with this file is a fleet with a table, as `clutchid drive --fleet` writes it.
_TABLE = "recordings.csv"


class Fleet(NamedTuple):
    """Recordings of a fleet in the order of vehicle and name.

    `left_out` says what its folder holds beside them, `renamed` which vehicles have a longer name here; empty if none.
    `has_table` says whether a table names them. Where recordings are `objects` in a storage, `stamps` are theirs by
    the paths that stand for them here.
    """

    jobs: tuple[RecordingJob, ...]
    left_out: str = ""
    renamed: str = ""
    has_table: bool = False
    objects: Objects | None = None
    stamps: Mapping[Path, str] = MappingProxyType({})


class NoRecordingsError(DataError):
    """A fleet without the file of a single recording."""


def fleet_of(source: str | PathLike[str], start: Path) -> Fleet:
    """The recordings of a fleet, each with the calibration that it starts from.

    Parameters
    ----------
    source
        A table of recordings, whose files lie in its folder or below; or a folder, in which each folder of recordings
        is a vehicle, or which has such a table as ``recordings.csv``. Both may lie at an address of objects.
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
    objects = objects_at(source)
    if objects:
        objects, rows, content, stamps = _objects(objects)
        root, is_folder = objects.root, True
    else:
        root, rows, content = _files(path_of(source))
        stamps, is_folder = {}, root == path_of(source)
    if rows is not None:
        files = files_by_name(content, {row.recording for row in rows})
        located, renamed = _one_type_each([_located(row, root, objects, stamps, files) for row in rows], source)
        beside = _unlisted(located, content) if is_folder else ""
    else:
        located, renamed = _in_folders(root, content.recordings)
        beside = left_out(content.others, content.results)
    if not located:
        raise NoRecordingsError(no_recordings(str(source), beside))
    if all(job.path is None for job in located):
        raise NoRecordingsError(f"{source}: none of the files of its {len(located):,} recordings exists.")
    calibrations = calibrations_of(start)
    located.sort(key=key_of)
    jobs = tuple(_with_calibration(job, calibrations) for job in located)
    if all(job.start is None for job in jobs):
        raise ParameterError(f"--start {start}: {jobs[0].problem}")
    return Fleet(
        jobs, beside, _RENAMED.format(listed(sorted(renamed), 3)) if renamed else "", rows is not None, objects, stamps
    )


#: The rows of a table of recordings, None without one.
_Rows = Collection[RecordingJob] | None


def _files(source: Path) -> tuple[Path, _Rows, FolderContent]:
    """A folder of this machine, or that of a table, with the rows of the table and its files."""
    not_an_address(source)
    if not is_there(source):
        raise NoRecordingsError(f"{source}: there is no such folder or table.")
    table = source if source.is_file() else source / _TABLE
    if not table.is_file():
        return source, None, folder_content(source)
    return table.parent, read_fleet_table(table).values(), folder_content(table.parent, {table.resolve()})


def row_of(source: str | PathLike[str], job: RecordingJob) -> RecordingJob:
    """A recording with what the table of its fleet says of it, if there is one and it names the recording."""
    objects, rows = objects_at(source), None
    if objects:
        objects, name = _table_place(objects)
        with suppress(NoObjectError):  # no table
            rows = _rows(objects, name, objects.stamp(name))
    else:
        path = path_of(source)
        table = path if path.is_file() else path / _TABLE
        rows = read_fleet_table(table).values() if table.is_file() else None
    own = (row for row in rows or () if row.recording == job.recording and row.vehicle == job.vehicle)
    return replace(next(own, job), path=job.path)


def _objects(source: Objects) -> tuple[Objects, _Rows, FolderContent, Mapping[Path, str]]:
    """Objects below an address, or beside a table there, each with a path that stands for it, and their stamps."""
    objects, name = _table_place(source)
    if objects.is_web:
        return _on_web(objects, name, is_folder=objects == source)
    stamps, root = objects.stamps(), objects.root
    if not stamps:
        raise NoRecordingsError(f"{source.address}: there are no objects.")
    runs = tuple({run for other in stamps if (run := run_of(other))})
    paths = [root / other for other in sorted(stamps) if not (runs and other.startswith(runs))]
    shown = [path for path in paths if path != root / name and not is_hidden(path.relative_to(root))]
    rows = _rows(objects, name, stamps[name]) if name in stamps else None
    by_path = {root / other: stamp for other, stamp in stamps.items()}
    return objects, rows, recordings_and_others(shown, len(stamps) - len(paths)), by_path


def _on_web(
    objects: Objects, table: str, *, is_folder: bool
) -> tuple[Objects, _Rows, FolderContent, Mapping[Path, str]]:
    """The rows of a table on a web server, and the stamps of the files that it names."""
    if is_folder:
        where = f"{objects.address}/{table}"
        raise DataError(f"{objects.address}: cannot be listed; name the table of its recordings, such as {where}.")
    rows = _rows(objects, table, "")
    paths = list({row.path for row in rows if row.path and not _is_outside(row.path)})
    stamps = zip((objects.root / path for path in paths), objects.stamps_of([*map(Path.as_posix, paths)]), strict=True)
    return objects, rows, FolderContent((), (), 0), dict(stamps)


def _is_outside(path: Path) -> bool:
    """Whether a path of a table may lead out of its folder."""
    return path.is_absolute() or ".." in path.parts


def _located(
    row: RecordingJob, root: Path, objects: Objects | None, stamps: Mapping[Path, str], files: FilesByName
) -> RecordingJob:
    """A row with the file to which its path leads from the folder of the table, else with the one of its name."""
    path = row.path or Path(row.recording)
    whole = root / path
    if objects and objects.is_web:
        outside = _OUTSIDE.format(as_text(str(path))) if _is_outside(path) else ""
        return replace(row, path=None if outside else whole, problem=outside)
    if len(path.parts) > 1 and (whole in stamps if objects else is_there(whole) and whole.is_file()):
        return replace(row, path=whole)
    return files.located(row)


#: Problem of a row of a table on a web server.
_OUTSIDE = "'{}' leads out of the folder of the table, in which its files must lie; move it there."


def _table_place(source: Objects) -> tuple[Objects, str]:
    """The objects of a fleet, and the name of its table among them, at an address of the fleet or of the table."""
    if source.name.endswith(".csv"):
        return Objects(source.address.rpartition("/")[0]), source.name
    return source, _TABLE


def _rows(objects: Objects, name: str, stamp: str) -> Collection[RecordingJob]:
    """The rows of a table in an object."""
    with objects.staged(name, stamp) as table:
        return read_fleet_table(table).values()


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


def _one_type_each(rows: Sequence[RecordingJob], table: str | PathLike[str]) -> tuple[list[RecordingJob], set[str]]:
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


class Calibrations(NamedTuple):
    """Calibrations by type or vehicle, each with the date from which it holds, in order; or the one of all.

    A name without a date holds from the beginning, and has an empty one.
    """

    place: Path
    by_name: Mapping[str, Sequence[tuple[str, Path]]] = MappingProxyType({})

    @property
    def has_dates(self) -> bool:
        """Whether one holds from a date only."""
        return any(date for several in self.by_name.values() for date, _ in several)

    def of(self, job: RecordingJob, date_in_file: str) -> tuple[Path | None, str]:
        """The calibration that holds for a recording, whose date may be known from its file; or why none does.

        Where the date is not known, it is the first one.
        """
        if not self.by_name:
            return self.place, ""
        what = f"type '{job.type}'" if job.type else f"vehicle '{job.vehicle}'"
        several = self.by_name.get(job.vehicle) or self.by_name.get(job.type) or ()
        if not several:
            return None, f"there is no calibration of {what}: {self.place / (job.type or job.vehicle)}.toml."
        begin = dated(job, "").begin if len(several) > 1 or several[0][0] else None
        day = date_in_file or (f"{begin:%Y-%m-%d}" if begin else "")
        if not day:
            return several[0][1], ""
        holding = [entry for entry in several if entry[0] <= day]
        if not holding:
            return None, f"no calibration of {what} holds on {day}: the first one is of {several[0][0]}."
        same = [path for first, path in holding if first == holding[-1][0]]
        if len(same) > 1:
            return None, f"{same[0].name} and {same[1].name} hold from the same date; keep one of them."
        return same[0], ""


def calibrations_of(start: Path) -> Calibrations:
    """Calibrations by type or vehicle, or the one of all."""
    not_an_address(start, "--start")
    if not is_there(start):
        raise ParameterError(f"--start {start}: there is no such file or folder.")
    if start.is_file():
        return Calibrations(start)
    by_name: dict[str, list[tuple[str, Path]]] = defaultdict(list)
    for name, path in by_own_name(start, ".toml").items():
        owner, _, text = name.rpartition("@")
        begin = _date(text)
        by_name[owner if owner and begin else name].append((begin if owner else "", path))
    if not by_name:
        raise ParameterError(
            f"--start {start}: has no calibrations (TYPE.toml); `clutchid calibrate --save` writes them."
        )
    return Calibrations(start, {name: sorted(several) for name, several in by_name.items()})


def _date(text: str) -> str:
    """A date as ISO 8601; empty if it is none."""
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        return ""


def by_own_name(folder: Path, suffix: str) -> dict[str, Path]:
    """The files of a folder and below with a suffix, by their path in it without the suffix, as vehicles are named."""
    paths = [path for path in sorted(folder.rglob(f"*{suffix}")) if not path.name.startswith(".")]
    return {as_text(path.relative_to(folder).as_posix()).removesuffix(suffix): path for path in paths}


def _with_calibration(job: RecordingJob, calibrations: Calibrations, date_in_file: str = "") -> RecordingJob:
    """A recording with its calibration, or with the problem that there is none; its date may be known from its file."""
    start, problem = calibrations.of(job, date_in_file)
    if start is not None or job.path is None:
        return replace(job, start=start)
    return replace(job, start=None, problem=as_text(problem))


def with_own_calibration(job: RecordingJob, start: Path) -> RecordingJob:
    """A recording with its calibration, which is that of all or of its vehicle or type."""
    return _with_calibration(job, calibrations_of(start))


def with_known(
    fleet: Fleet, calibrations: Calibrations, keys: Mapping[tuple[str, str], StoredRow], *, missing: bool
) -> Fleet:
    """A fleet whose calibrations hold on the dates in its index; with `missing` also what has no file any more."""
    jobs = list(fleet.jobs)
    if calibrations.has_dates:
        dates = {key: entry.date for key, entry in keys.items()}
        of_date = (
            _with_calibration(replace(job, problem=""), calibrations, dates.get(key_of(job), "")) for job in jobs
        )
        jobs = [new if job.path else job for job, new in zip(jobs, of_date, strict=True)]
    if missing:
        listed = {key_of(job) for job in jobs}
        gone = [entry for key, entry in keys.items() if entry.has_result and key not in listed]
        jobs += (_with_calibration(replace(entry.job, file=""), calibrations, entry.date) for entry in gone)
    return fleet._replace(jobs=tuple(sorted(jobs, key=key_of)))


def with_dependencies(fleet: Fleet, reading: Reading, verb: str) -> Fleet:
    """A fleet whose recordings have what their results depend on: their calibration and all else, and their file."""
    files = [Path(path) for path in (reading.channels, *reading.dbc) if isinstance(path, str | PathLike)]
    common = [version_and_source(), verb, repr(reading.ambient), [digest(path) for path in files]]
    starts = {job.start for job in fleet.jobs if job.start is not None}
    inputs = {start: json.dumps([digest(start), *common], sort_keys=True) for start in starts}
    stamp = (lambda path: fleet.stamps.get(path, "")) if fleet.objects else _stamp_of
    return fleet._replace(jobs=tuple(
        replace(job, inputs=inputs[job.start] if job.start else "", file=stamp(job.path) if job.path else "")
        for job in fleet.jobs
    ))  # fmt: skip


def key_of(job: RecordingJob) -> tuple[str, str]:
    """Vehicle and recording."""
    return job.vehicle, job.recording


def _stamp_of(path: Path) -> str:
    """Size and time of a file, to detect changes without reading it; empty if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return ""
    return f"{status.st_size} {status.st_mtime_ns}"

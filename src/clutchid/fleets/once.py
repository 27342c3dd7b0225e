"""One recording of a fleet, apart from all others: its row of the table, from bytes or as an event names it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from os import PathLike
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Literal

from clutchid.arguments import checked
from clutchid.errors import ParameterError
from clutchid.fleets.jobs import Fleet, row_of, with_dependencies, with_own_calibration
from clutchid.fleets.parts import recordings_frame, write_once
from clutchid.fleets.plan import now, read_object, reader_of
from clutchid.fleets.storage import Folder, Objects, objects_at, path_of, target_at
from clutchid.fleets.store import StoredRow, stored_row
from clutchid.names import as_text
from clutchid.processes import Timing
from clutchid.verbs.folders import name_of
from clutchid.verbs.reading import Reading
from clutchid.verbs.wear_reading import read_recording
from clutchid.wear.history import RecordingJob

#: What reads a recording.
ReadBy = Literal["estimate", "observe", "auto"]


@checked
def recording_row(
    content: bytes,
    name: str,
    start: str | PathLike[str],
    *,
    by: ReadBy = "estimate",
    ambient: float | None = None,
    channels: str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
) -> dict[str, object]:
    """Row of the table of a fleet for the bytes of a recording: what Spark, a queue or a loop of one's own calls.

    Parameters
    ----------
    content
        Bytes of the recording.
    name
        Its name with a suffix and the folder of its vehicle, such as ``V1/run.mf4``.
    start : path
        Calibration for all (TOML), or a folder with one for each vehicle.
    by
        What reads it, as in `clutchid.track`.
    ambient, channels, dbc
        As in `clutchid.fleet`.

    Returns
    -------
    row
        The columns of ``recordings/``, see docs/commands/fleet.md; a fault is a status with a message.

    Raises
    ------
    ParameterError
        If there is no calibration.

    Examples
    --------
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "cal.toml").write_text("[parameters]")
    ...     row = recording_row(b"no recording", "V1/run.csv", Path(folder, "cal.toml"), ambient=1e5)
    >>> row["vehicle"], row["recording"], row["status"]
    ('V1', 'run', 'bad_input')
    """
    path = PurePosixPath(name)
    with TemporaryDirectory(prefix="clutchid-") as folder:
        file = Path(folder) / (path.parent.name or "vehicle") / path.name
        file.parent.mkdir()
        file.write_bytes(content)
        job = _job(file, as_text(path.parent.name), Path(start))
        return _shown(_read(Fleet((job,)), Reading(ambient=ambient, channels=channels, dbc=tuple(dbc)), by))


@checked
def fleet_once(
    recording: str | PathLike[str],
    start: str | PathLike[str],
    out: str | PathLike[str],
    *,
    source: str | PathLike[str] | None = None,
    verb: Literal["fit", "observe", "track"] = "fit",
    by: ReadBy = "estimate",
    ambient: float | None = None,
    channels: str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
) -> dict[str, object]:
    """Read one recording of a fleet, as an event names it, and append its row to the table; the row.

    The row is a part of its own, whose name is that of the file or object with its content: the same event twice is
    one row. No index is needed; the next run of `clutchid.fleet` takes the row in, and makes the tables and pages.

    Parameters
    ----------
    recording : path
        A file, or the address of an object; the folder it lies in is its vehicle.
    start, out : paths
        As in `clutchid.fleet`.
    source : path, optional
        The fleet, whose table says type, date, distance and strokes of the recording.
    verb, by, ambient, channels, dbc
        As in `clutchid.fleet`.

    Returns
    -------
    row
        As of `clutchid.recording_row`.

    Raises
    ------
    DataError, ExportError, ParameterError
        If the storage cannot be reached, or there is no calibration; a recording that cannot be read is a row.

    Examples
    --------
    The same event twice is one part with one row:

    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "cal.toml").write_text("[parameters]")
    ...     _ = Path(folder, "V1").mkdir(), Path(folder, "V1", "run.csv").write_text("no recording")
    ...     event = f"{folder}/V1/run.csv", f"{folder}/cal.toml", f"{folder}/wear"
    ...     rows = [fleet_once(*event, ambient=1e5) for _ in range(2)]
    ...     parts = list(Path(folder, "wear").rglob("part-*.parquet"))
    >>> rows[0]["vehicle"], rows[1]["status"], len(parts)
    ('V1', 'bad_input', 1)
    """
    address, target = objects_at(recording), target_at(out)
    if address:
        folder = Objects(address.address.rpartition("/")[0])
        job = _job(folder.root / address.name, as_text(folder.name), Path(start), source)
        stamps = {folder.root / address.name: folder.stamp(address.name)}
        fleet = Fleet((job,), objects=folder, stamps=stamps)
    else:
        path = path_of(recording)
        fleet = Fleet((_job(path, as_text(path.resolve().parent.name), Path(start), source),))
    row = _read(fleet, Reading(ambient=ambient, channels=channels, dbc=tuple(dbc)), reader_of(verb, by))
    write_once(row, target or Folder(path_of(out)))
    return _shown(row)


def _job(path: Path, vehicle: str, start: Path, source: str | PathLike[str] | None = None) -> RecordingJob:
    """The recording in a file, with its calibration, and what the table of its fleet says of it."""
    job = RecordingJob(name_of(path), vehicle, path=path)
    job = with_own_calibration(job if source is None else row_of(source, job), start)
    if job.start is None:
        raise ParameterError(f"--start {start}: {job.problem}")
    return job


def _read(fleet: Fleet, reading: Reading, how: str) -> StoredRow:
    """The row of the one recording of a fleet."""
    (job,) = with_dependencies(fleet, reading, how).jobs
    begin, read = perf_counter(), partial(read_recording, reading, how)
    result = read_object(fleet.objects, read, job) if fleet.objects else read(job)
    return stored_row(job, result, Timing(perf_counter() - begin, attempt=1), now())


def _shown(row: StoredRow) -> dict[str, object]:
    """The row of the table."""
    return recordings_frame([row]).drop("record").row(0, named=True)

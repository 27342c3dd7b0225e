"""Recordings of a fleet that are to be read, their reading by workers, and the state of every recording after it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from clutchid.errors import DataError, ParameterError
from clutchid.fleets.cluster import Workers, results
from clutchid.fleets.jobs import key_of
from clutchid.fleets.storage import Objects
from clutchid.fleets.store import Store, StoredRow, place_of, stored_row
from clutchid.names import as_text
from clutchid.processes import Pool
from clutchid.verbs.reading import Reading
from clutchid.verbs.start import compile_models
from clutchid.verbs.wear_reading import as_copy, checksum_of, read_recording, unless_lost
from clutchid.wear.history import RecordingJob, WearReading

#: A recording by vehicle and name.
RecordingKey = tuple[str, str]

#: Lost results, which are tried again where the user says so.
_LOST = ("killed", "timed_out")

#: A recording without a result.
_NONE = StoredRow("", "", "", "", "", "", "", None, "", "", "", "")


class ReadingPlan(NamedTuple):
    """Recordings to be read; readings that other names have too, each with its key; and keys that are forgotten."""

    todo: Sequence[RecordingJob]
    same: Sequence[tuple[RecordingKey, RecordingJob]]
    forgotten: frozenset[RecordingKey]


def planned(
    jobs: Sequence[RecordingJob],
    keys: Mapping[RecordingKey, StoredRow],
    *,
    retry: bool,
    forget: bool,
    objects: bool = False,
) -> ReadingPlan:
    """Plan of a run: recordings without a result, or whose file, calibration or clutchid has changed since.

    With `retry` also those that ended their worker or took too long; with `forget` readings without a file are
    forgotten. What identifies a reading is the SHA-256 of the file with the inputs: the same file under another name
    has the reading already, and takes it over from a name whose file is gone. Of `objects` in a storage it is that of
    an object with the same size and ETag.
    """
    by_stamp = {entry.file: entry.sha256 for entry in keys.values() if entry.has_result} if objects else {}
    there = {key_of(job) for job in jobs if job.file}
    by_checksum = {entry.sha256: key for key, entry in keys.items() if entry.has_result}
    sizes = {entry.file.partition(" ")[0] for entry in keys.values() if entry.has_result}
    todo: list[RecordingJob] = []
    same: list[tuple[RecordingKey, RecordingJob]] = []
    present = {entry.sha256 for key, entry in keys.items() if entry.has_result and key in there} - {""}
    moved = {key for key, entry in keys.items() if key not in there and entry.has_result and entry.sha256 in present}
    for job in jobs:
        key, entry = key_of(job), keys.get(key_of(job), _NONE)
        if job.path is None or job.start is None or (entry.has_result and not job.file):
            continue
        changed = entry.file != job.file
        unread = job.file and not entry.sha256 and entry.status not in _LOST  # as where a share was away
        as_before = entry.inputs == job.inputs and not unread and not (retry and entry.status in _LOST)
        checksum = ""
        if changed and (as_before or job.file.partition(" ")[0] in sizes):
            checksum = by_stamp.get(job.file, "") if objects else checksum_of(job.path)
        if as_before and not (changed and checksum != entry.sha256):
            if changed or entry.place != place_of(job):
                same.append((key, job))
            continue
        source = by_checksum.get(checksum) if checksum else None
        if source and source != key and source not in there:
            moved.add(source)
        if source and source != key and keys[source].inputs == job.inputs:
            same.append((source, job))
        else:
            todo.append(job)
    missing = {key for key, entry in keys.items() if entry.has_result and key not in there} if forget else set()
    return ReadingPlan(todo, same, frozenset(missing | (moved - {key_of(job) for _, job in same})))


def read_all(
    workers: Workers,
    read: Callable[[RecordingJob], WearReading],
    todo: Sequence[RecordingJob],
    keys: Mapping[RecordingKey, StoredRow],
    store: Store,
    progress: Callable[[int, int], None],
) -> None:
    """Read recordings, and keep every result as it comes.

    Parameters
    ----------
    read
        What reads one.
    keys
        What was known before.
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
            job, reading = finished.item, unless_lost(finished.item, finished.result)
            entry = keys.get(key_of(job), _NONE)
            # a stub, or a file that went meanwhile, takes no reading of what it was
            if not (reading.apart and entry.has_result and reading.sha256 != entry.sha256):
                store.put([stored_row(job, reading, finished.timing, now())])
            last, count = store.saved(last), count + 1
            progress(count, len(todo))
    finally:
        store.saved()


def reader_of(verb: str, by: str) -> str:
    """Reader of the recordings of a fleet by its verb: `by` names it for `track`.

    Raises
    ------
    ParameterError
        If it is said for another verb.
    """
    if by != "estimate" and verb != "track":
        raise ParameterError(f"--by {by}: belongs to --verb track; for --verb {verb} leave it out.")
    return by if verb == "track" else "observe" if verb == "observe" else "estimate"


def now() -> str:
    """The time, ISO 8601."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%S.%f+00:00}"


def read_object(objects: Objects, read: Callable[[RecordingJob], WearReading], job: RecordingJob) -> WearReading:
    """Read the recording in an object, of which a file is made for that time; a fault is a status."""
    assert job.path is not None, "others are not read"
    try:
        with objects.staged(job.path.relative_to(objects.root).as_posix(), job.file) as path:
            return read(replace(job, path=path))
    except DataError as error:
        return WearReading("bad_input", as_text(str(error)), apart=True)


class RecordingState(NamedTuple):
    """A recording of a fleet after a run, with its entry in the index.

    `copy_of` is the recording that has the same samples, empty if there is none; `is_comparable` whether its reading is
    of the calibration of today, or its file is there to be read again.
    """

    job: RecordingJob
    entry: StoredRow | None = None
    file_gone: bool = False
    copy_of: str = ""
    is_comparable: bool = True

    @property
    def is_plain(self) -> bool:
        """Whether what is known of it is the row of its index."""
        return self.entry is not None and not self.copy_of and self.is_comparable

    @property
    def status(self) -> str:
        """Status of the recording."""
        return self.entry.status if self.entry and self.is_plain else self.reading(None).status

    def reading(self, stored: WearReading | None) -> WearReading:
        """The reading that counts, where the entry has the `stored` one."""
        if self.entry is None:
            problem = WearReading("bad_input", self.job.problem, apart=True)
            return problem if self.job.problem else _UNREAD
        reading = stored or WearReading("warning", "")
        if not self.is_comparable:
            reading = WearReading(
                "warning", _OTHER_CALIBRATION, clock=reading.clock, sha256=reading.sha256, curve=reading.curve
            )
        return as_copy(reading, self.copy_of) if self.copy_of else reading


#: A recording that was not read.
_UNREAD = WearReading("failed", "was not read; run the same command again to go on.")

#: Why the reading of a file that is gone is not used.
_OTHER_CALIBRATION = (
    "the file is gone, and was read from another calibration than that of today, so that its change cannot be compared."
)


def recording_states(jobs: Iterable[RecordingJob], keys: Mapping[RecordingKey, StoredRow]) -> list[RecordingState]:
    """Every recording of a fleet in the order of vehicle and name; of copies the first counts."""
    first: dict[str, str] = {}
    states = []
    for job in jobs:
        entry = keys.get(key_of(job))
        if entry is None or entry.is_forgotten or (job.problem and (job.path or not entry.has_result)):
            states.append(RecordingState(job))
            continue
        gone = entry.has_result and (not job.file or entry.file not in ("", job.file))
        is_comparable = not gone or not job.inputs or _start(entry.inputs) == _start(job.inputs)
        name = f"{job.recording} of {job.vehicle}"
        copied = first.setdefault(entry.sha256, name) if entry.has_result and entry.sha256 else name
        states.append(RecordingState(job, entry, gone, copied if copied != name else "", is_comparable))
    return states


def _start(inputs: str) -> str:
    """Hash of the calibration of a result."""
    return str(json.loads(inputs)[0]) if inputs else ""


def readings_of(states: Sequence[RecordingState], store: Store) -> list[WearReading]:
    """The readings that count of the recordings of a vehicle."""
    stored = store.of_vehicle(states[0].job.vehicle)
    readings = []
    for state in states:
        row = stored.get(state.job.recording) if state.entry else None
        intact = state if row else state._replace(entry=None)
        readings.append(intact.reading(row.result if row else None))
    return readings


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

"""A run over a fleet: what is not done yet, done by workers and kept; then the tables of all of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from clutchid.errors import ClutchidError
from clutchid.fleets.cluster import Place, results
from clutchid.fleets.jobs import Fleet, Job, version_and_source
from clutchid.fleets.reading import How, RecordingResult, checksum_of, read_recording, without_result
from clutchid.fleets.store import Store, StoredResult
from clutchid.processes import FinishedWork, LostWork, Pool
from clutchid.recordings.files import digest

#: Lost results, which are tried again where the user says so.
LOST = ("killed", "timed_out")


@dataclass(frozen=True, slots=True)
class Options:
    """Options for reading the recordings of a fleet: ambient pressure in Pa, or NaN for that of the calibration."""

    verb: str = "fit"
    ambient: float = float("nan")
    channel_map: Path | None = None
    dbc: tuple[Path, ...] = ()

    def how(self, start: Path) -> How:
        """The same for the recordings of one calibration."""
        return How(start, self.ambient, self.channel_map, self.dbc, self.verb)


class Task(NamedTuple):
    """A recording to be read, how, and what its result depends on."""

    job: Job
    how: How
    inputs: str
    file: str


def tasks(fleet: Fleet, options: Options, kept: Store, *, retry: bool = False) -> list[Task]:
    """The recordings that are not done, or whose file, calibration or clutchid has changed since.

    With `retry` also those that ended their worker or took too long.
    """
    done, inputs = kept.keys(), _inputs(fleet, options)
    found = []
    for job in fleet.jobs:
        if job.path is None or job.start is None:
            continue
        key, file = (job.vehicle, job.recording), _file(job.path)
        task = Task(job, options.how(job.start), inputs[job.start], file)
        known_inputs, known_file, checksum, status = done.get(key, ("", "", "", ""))
        unread = file and not checksum  # as where a share was away for a while
        if known_inputs != task.inputs or unread or (retry and status in LOST):
            found.append(task)
        elif known_file != file:
            if checksum_of(job.path) == checksum:
                kept.same_file(key, file)
            else:
                found.append(task)
    return found


def run(place: Place, todo: Sequence[Task], kept: Store, progress: Callable[[int, int], None]) -> None:
    """Read recordings, and keep every result as it comes.

    Parameters
    ----------
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
        for done in results(_work, todo, place):
            kept.put(_result(done))
            last, count = kept.saved(last), count + 1
            progress(count, len(todo))
    finally:
        kept.saved()


def compile_first(calibrations: Iterable[Path]) -> None:
    """Compile the kernels of the models of some calibrations, in a worker that ends: all others only load them.

    Workers on other machines compile once a machine, by themselves.
    """
    Pool().do(_compiled, tuple(calibrations))


def _compiled(calibrations: Iterable[Path]) -> None:
    from clutchid.model.compiled import compile_ahead
    from clutchid.workflow import start_file

    models = set()
    for path in calibrations:
        with suppress(ClutchidError):  # each of its recordings says so
            models.add(start_file(path, None).actuator.model)
    compile_ahead(models)


def _work(task: Task) -> RecordingResult:
    assert task.job.path is not None
    return read_recording(task.how, task.job.path)


def _result(done: FinishedWork[Task, RecordingResult]) -> StoredResult:
    task, read = done.item, done.result
    if isinstance(read, LostWork):
        assert task.job.path is not None
        read = without_result(task.job.path, read)
    return StoredResult(task.job.vehicle, task.job.recording, task.inputs, task.file, read, done.seconds)


def _inputs(fleet: Fleet, options: Options) -> Mapping[Path, str]:
    """Inputs of results beside the recording, by calibration."""
    files = [path for path in (options.channel_map, *options.dbc) if path]
    common = [version_and_source(), options.verb, repr(options.ambient), [digest(path) for path in files]]
    starts = {job.start for job in fleet.jobs if job.start is not None}
    return {start: json.dumps([digest(start), *common], sort_keys=True) for start in starts}


def _file(path: Path) -> str:
    """Size and time of a file, which tell that it has not changed without reading it; empty where it is gone."""
    try:
        known = path.stat()
    except OSError:
        return ""
    return f"{known.st_size} {known.st_mtime_ns}"

"""Results of a run over a fleet: an SQLite file, which stays consistent however the run ends."""

from __future__ import annotations

import hashlib
import json
import math
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

from clutchid.errors import ExportError
from clutchid.files import atomic_write, make_folder
from clutchid.processes import Timing
from clutchid.verbs.folders import STORE
from clutchid.wear.history import RecordingJob, WearReading, packed_reading, restored

#: Time in s after which results are on the disk at the latest.
COMMIT = 0.5

#: Codes of SQLite where a file cannot be opened to write, which has nothing to do with room on the disk.
_CLOSED = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM)

#: Columns of what is done, with their types.
_COLUMNS = {
    "vehicle": "TEXT", "recording": "TEXT", "inputs": "TEXT NOT NULL", "file": "TEXT NOT NULL",
    "status": "TEXT NOT NULL", "sha256": "TEXT NOT NULL", "reading": "TEXT NOT NULL", "curve": "BLOB",
    "place": "TEXT NOT NULL", "timing": "TEXT NOT NULL", "checksum": "TEXT NOT NULL",
}  # fmt: skip

#: Columns of the version before, which knew of a recording neither its place in the life of its vehicle nor a worker.
_BEFORE = [*list(_COLUMNS)[:-3], "seconds", "checksum"]

_TABLE = f"""
CREATE TABLE IF NOT EXISTS done (
    {", ".join(map(" ".join, _COLUMNS.items()))}, PRIMARY KEY (vehicle, recording)
);
"""

_SCHEMA = f"CREATE TABLE IF NOT EXISTS about (what TEXT PRIMARY KEY, value TEXT NOT NULL); {_TABLE}"

#: Key of the checksum of what the run is about.
_CHECKSUM = "checksum"

#: A row of what is done, without and with its checksum.
_StoredRow = tuple[str | float | bytes | None, ...]


class RecordingRow(NamedTuple):
    """A recording of a fleet, what its reading gave, what that cost, and whether the samples are not there any more."""

    job: RecordingJob
    reading: WearReading
    timing: Timing = Timing()
    file_gone: bool = False


class StoredKey(NamedTuple):
    """A stored recording without its reading: its job with names, inputs, file and place, its checksum and status."""

    job: RecordingJob
    checksum: str
    status: str

    @property
    def has_result(self) -> bool:
        """Whether it was read."""
        return self.status in ("ok", "warning")


@dataclass(frozen=True, slots=True, eq=False)
class Store:
    """An open store, locked against other runs.

    A row whose checksum is not that of its content does not count, so that its recording is read again.
    """

    path: Path
    base: sqlite3.Connection

    def keys(self) -> dict[tuple[str, str], StoredKey]:
        """The finished recordings by vehicle and recording."""
        return {(row[0], row[1]): StoredKey(_job(row), row[5], row[4]) for row in self._rows()}

    def results(self) -> Iterator[RecordingRow]:
        """All results, in the order of vehicle and recording; of a job its names, inputs, file and place are kept."""
        return map(_kept, self._rows())

    def _rows(self) -> Iterator[tuple[Any, ...]]:
        """The intact rows, in the order of vehicle and recording."""
        with _room(self.path):
            yield from filter(_is_whole, self.base.execute("SELECT * FROM done ORDER BY vehicle, recording"))

    def put(self, result: RecordingRow) -> None:
        """Keep a result; it is on the disk after `saved`."""
        with _room(self.path):
            _insert(self.base, [_row(result)])

    def rename(self, same: Sequence[tuple[tuple[str, str], RecordingJob]]) -> None:
        """Keep readings under the names, files and places of jobs too, whose samples are those under other keys."""
        with _room(self.path):
            where = "SELECT * FROM done WHERE vehicle = ? AND recording = ?"
            rows = [(job, row) for key, job in same for row in self.base.execute(where, key).fetchall()]
            renamed = (
                (job.vehicle, job.recording, row[2], job.file, *row[4:8], place_of(job), row[9]) for job, row in rows
            )
            _insert(self.base, list(map(_with_checksum, renamed)))

    def forget(self, keys: Iterable[tuple[str, str]]) -> None:
        """Delete results by vehicle and recording."""
        with _room(self.path):
            self.base.executemany("DELETE FROM done WHERE vehicle = ? AND recording = ?", list(keys))

    def saved(self, last: float = 0.0) -> float:
        """Write results to the disk, unless that was done a moment before; the time of the last write."""
        now = monotonic()
        if now - last < COMMIT:
            return last
        with _room(self.path):
            self.base.commit()
        return now


@contextmanager
def run_store(folder: Path, about: dict[str, str]) -> Iterator[Store]:
    """The store of the run in a folder, new or existing.

    Parameters
    ----------
    about
        What the run is about, which must be the same to go on.

    Raises
    ------
    ExportError
        If the folder has other files, the run of something else, a run that is going on, or cannot be written.
    """
    path = folder / STORE
    make_folder(folder, "--out")
    try:
        occupied = not path.exists() and any(folder.iterdir())
    except OSError as error:
        raise ExportError(f"--out {folder}: cannot be read ({error.strerror}); name another folder.") from error
    if occupied:
        raise ExportError(f"--out {folder}: is not empty and has no run of a fleet; name a new folder.")
    with _room(path):
        base = _whole(path)
    try:
        with _room(path):
            base.executescript(_SCHEMA)
            base.execute("BEGIN IMMEDIATE")
            _check_columns(base, folder)
            _check_about(base, folder, about)
        opened = Store(path, base)
        opened.saved()
        yield opened
        opened.saved()
    finally:
        base.close()


def _whole(path: Path) -> sqlite3.Connection:
    """An open file without faults, locked against other runs; of a damaged file a copy with its intact rows."""
    try:
        return _connected(path)
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF != sqlite3.SQLITE_CORRUPT:
            raise
    rows = _readable(path)
    with atomic_write(path) as temporary, closing(sqlite3.connect(temporary)) as new:
        new.executescript(_SCHEMA)
        _insert(new, rows)
        new.commit()
    path.with_name(f"{path.name}-journal").unlink(missing_ok=True)  # of the damaged file
    return _connected(path)


def _connected(path: Path) -> sqlite3.Connection:
    """An open file, locked against other runs.

    Raises
    ------
    sqlite3.DatabaseError
        If it is in use, no store, or damaged.
    """
    base = sqlite3.connect(path, timeout=1.0)
    try:
        base.text_factory = _text
        base.execute("PRAGMA locking_mode = EXCLUSIVE")
        base.execute("BEGIN IMMEDIATE")
        _check_integrity(base)
    except BaseException:
        base.close()
        raise
    return base


def _check_integrity(base: sqlite3.Connection) -> None:
    fault = base.execute("PRAGMA integrity_check(1)").fetchone()[0]
    if fault != "ok":
        raise sqlite3.DatabaseError(fault)


def _readable(path: Path) -> list[_StoredRow]:
    """The intact rows of a damaged file: those before its first fault, and those after its last."""
    rows: dict[object, _StoredRow] = {}
    for order in ("ASC", "DESC"):
        with suppress(sqlite3.DatabaseError), closing(sqlite3.connect(path, timeout=1.0)) as base:
            base.text_factory = _text
            for row in base.execute(f"SELECT * FROM done NOT INDEXED ORDER BY rowid {order}"):
                if _is_whole(row):
                    rows[row[:2]] = row
    return list(rows.values())


def _text(content: bytes) -> str:
    """Text of a file that may be damaged."""
    return content.decode("utf-8", "replace")


def _check_columns(base: sqlite3.Connection, folder: Path) -> None:
    columns = [column[0] for column in base.execute("SELECT * FROM done LIMIT 0").description]
    if columns == _BEFORE:
        rows = [(*row[:8], "[]", json.dumps([row[8]])) for row in filter(_is_whole, base.execute("SELECT * FROM done"))]
        base.execute("DROP TABLE done")
        base.execute(_TABLE)
        _insert(base, map(_with_checksum, rows))
    elif columns != list(_COLUMNS):
        raise ExportError(
            f"--out {folder}: its {STORE} is not from this version of clutchid; name another folder: "
            "`clutchid fleet ... --out NEWFOLDER` makes its results anew."
        )


def _check_about(base: sqlite3.Connection, folder: Path, about: dict[str, str]) -> None:
    """Check that the run has the same source and verb, unless it is empty or that record was damaged."""
    begun = base.execute("SELECT 1 FROM done LIMIT 1").fetchone() is not None
    entries = dict(base.execute("SELECT what, value FROM about")) if begun else {}
    if entries.pop(_CHECKSUM, None) != _checksum(sorted(entries.items())):
        entries = {}
        base.execute("DELETE FROM about")
    for what, value in about.items():
        if entries.setdefault(what, value) != value:
            raise ExportError(
                f"--out {folder}: has a run whose {what} is {entries[what]}, not {value}; name another folder."
            )
    entries[_CHECKSUM] = _checksum(sorted(entries.items()))
    base.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", entries.items())


@contextmanager
def _room(path: Path) -> Iterator[None]:
    """Errors of the disk as one sentence."""
    try:
        yield
    except sqlite3.DatabaseError as error:
        if "locked" in str(error):
            raise ExportError(
                f"--out {path.parent}: another run is going on in this folder; wait until it ends."
            ) from error
        if "not a database" in str(error) or "malformed" in str(error):
            raise ExportError(
                f"{path}: is not the file of a run, or was damaged ({error}); name another folder."
            ) from error
        if getattr(error, "sqlite_errorcode", 0) & 0xFF in _CLOSED:
            raise ExportError(
                f"--out {path.parent}: cannot be written ({error}); allow writing in it, or name another folder."
            ) from error
        raise ExportError(
            f"{path}: cannot be written ({error}); what was written before is intact. Make room on the disk, and run "
            "the same command again to go on."
        ) from error


def _checksum(values: Iterable[object]) -> str:
    total = hashlib.sha256()
    for value in values:
        total.update(value if isinstance(value, bytes) else f"{value!r}\n".encode())
    return total.hexdigest()


def _is_whole(row: _StoredRow) -> bool:
    """Whether a row matches its checksum."""
    return row[-1] == _checksum(row[:-1])


def _insert(base: sqlite3.Connection, rows: Iterable[_StoredRow]) -> None:
    base.executemany(f"INSERT OR REPLACE INTO done VALUES ({', '.join('?' * len(_COLUMNS))})", rows)


def _with_checksum(row: _StoredRow) -> _StoredRow:
    return (*row, _checksum(row))


def _row(result: RecordingRow) -> _StoredRow:
    job, reading = result.job, result.reading
    key = job.vehicle, job.recording, job.inputs, job.file, reading.status, reading.sha256
    return _with_checksum((*key, *packed_reading(reading), place_of(job), json.dumps(result.timing)))


def place_of(job: RecordingJob) -> str:
    """Type of the vehicle, and place of a recording in its life, as a table has them; they are kept with a reading."""
    return json.dumps([job.type, job.begin.isoformat() if job.begin else None, job.odometer, job.strokes])


def _job(row: tuple[Any, ...]) -> RecordingJob:
    kind, begin, odometer, strokes = json.loads(row[8]) or ("", None, math.nan, math.nan)
    began = datetime.fromisoformat(begin) if begin else None
    return RecordingJob(row[1], row[0], kind, began, odometer, strokes, inputs=row[2], file=row[3])


def _kept(row: tuple[Any, ...]) -> RecordingRow:
    return RecordingRow(_job(row), restored(row[6], row[7]), Timing(*json.loads(row[9])))

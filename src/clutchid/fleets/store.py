"""Index of a fleet: an SQLite file with what is known of every recording, consistent however a run ends.

Results are first kept here, then written as parts of the table of recordings, from which a lost index is made anew.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from clutchid.errors import ExportError
from clutchid.files import make_folder
from clutchid.fleets.storage import PARTS_FOLDER
from clutchid.names import as_text
from clutchid.processes import Timing
from clutchid.verbs.folders import INDEX_NAME, STORE
from clutchid.wear.history import RecordingJob, WearReading, dated, packed_reading, restored

#: Time in s after which results are on the disk at the latest.
COMMIT = 0.5

#: Status of the row of a recording that was left out.
_FORGOTTEN = "forgotten"

#: Codes of SQLite where a file cannot be opened to write, which has nothing to do with room on the disk.
_CLOSED = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM)


class StoredRow(NamedTuple):
    """A row of the index: names, what the result was made from, the result packed, its cost, its date and its part.

    `part` is empty until the row is in a part of the table; `checksum` is that of all columns before it.
    """

    vehicle: str
    recording: str
    inputs: str
    file: str
    status: str
    sha256: str
    reading: str
    curve: bytes | None
    place: str
    timing: str
    date: str
    read_at: str
    checksum: str = ""
    part: str = ""

    @property
    def is_whole(self) -> bool:
        """Whether it matches its checksum."""
        return self.checksum == _checksum(self[:-2])

    def with_checksum(self) -> StoredRow:
        """The row with the checksum of its content."""
        return self._replace(checksum=_checksum(self[:-2]))

    @property
    def job(self) -> RecordingJob:
        """The recording by its names, inputs, file and place."""
        kind, begin, odometer, strokes, _, tags = json.loads(self.place)
        began = datetime.fromisoformat(begin) if begin else None
        own = tuple((str(name), str(value)) for name, value in tags)
        return RecordingJob(
            self.recording, self.vehicle, kind, began, odometer, strokes, inputs=self.inputs, file=self.file, tags=own
        )

    @property
    def has_result(self) -> bool:
        """Whether it was read."""
        return self.status in ("ok", "warning")

    @property
    def is_forgotten(self) -> bool:
        """Whether it says that the recording was left out."""
        return self.status == _FORGOTTEN

    @property
    def calibration(self) -> str:
        """Name of the calibration from which it was read."""
        return str(json.loads(self.place)[4])

    @property
    def result(self) -> WearReading:
        """The reading."""
        return restored(self.reading, self.curve)


#: Columns of the index, of which only the load is no text.
_COLUMNS = [f"{name} {'BLOB' if name == 'curve' else 'TEXT NOT NULL'}" for name in StoredRow._fields]

_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS about (what TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS done ({", ".join(_COLUMNS)}, PRIMARY KEY (vehicle, recording));
CREATE TABLE IF NOT EXISTS parts (part TEXT PRIMARY KEY, count INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS vehicles (vehicle TEXT PRIMARY KEY, made TEXT NOT NULL, state TEXT NOT NULL);
"""

#: RecordingKey of the checksum of what the run is about.
_CHECKSUM = "checksum"


@dataclass(frozen=True, slots=True, eq=False)
class Store:
    """An open index, locked against other runs.

    A row whose checksum is not that of its content does not count, so that its recording is read again.
    """

    path: Path
    base: sqlite3.Connection

    def keys(self) -> dict[tuple[str, str], StoredRow]:
        """The rows by vehicle and recording, in their order, without their readings, so that a million have room."""
        rows = self._rows("ORDER BY vehicle, recording")
        return {row[:2]: row._replace(reading="", curve=None, timing="") for row in rows}

    def of_vehicle(self, vehicle: str) -> dict[str, StoredRow]:
        """The rows of a vehicle by recording."""
        return {row.recording: row for row in self._rows("WHERE vehicle = ?", vehicle)}

    def pending(self) -> Iterator[StoredRow]:
        """The rows that are in no part yet, in the order of date, vehicle and recording."""
        return self._rows("WHERE part NOT IN (SELECT part FROM parts) ORDER BY date, vehicle, recording")

    def _rows(self, which: str, *values: str) -> Iterator[StoredRow]:
        """The intact rows that meet a condition."""
        with _room(self.path):
            for row in self.base.execute(f"SELECT * FROM done {which}", values):
                stored = StoredRow(*row)
                if stored.is_whole:
                    yield stored

    def put(self, rows: Iterable[StoredRow]) -> None:
        """Keep rows; they are on the disk after `saved`."""
        with _room(self.path):
            _insert(self.base, rows)

    def rename(self, same: Sequence[tuple[tuple[str, str], RecordingJob]]) -> None:
        """Keep readings under the names, files and places of jobs too, whose samples are those under other keys.

        Only a row that has another name or place is to be written again.
        """
        with _room(self.path):
            where = "SELECT * FROM done WHERE vehicle = ? AND recording = ?"
            rows = [(job, StoredRow(*row)) for key, job in same for row in self.base.execute(where, key).fetchall()]
            renamed = (
                (stored_row(replace(job, inputs=row.inputs), row.result, _timing(row), row.read_at), row)
                for job, row in rows
            )
            as_before = ((new, row, (*new[:2], new.place) == (*row[:2], row.place)) for new, row in renamed)
            _insert(self.base, [new._replace(part=row.part if same_row else "") for new, row, same_row in as_before])

    def forget(self, keys: Iterable[tuple[str, str]]) -> None:
        """Replace rows by vehicle and recording by ones that say so, for the parts have the readings too."""
        rows = [row for key in keys for row in self._rows("WHERE vehicle = ? AND recording = ?", *key)]
        reading, curve = packed_reading(WearReading(_FORGOTTEN, "its file is gone, or has another name.", apart=True))
        self.put(
            row._replace(
                inputs="",
                file="",
                status=_FORGOTTEN,
                reading=reading,
                curve=curve,
                timing=json.dumps(_NOT_DONE),
                part="",
            ).with_checksum()
            for row in rows
        )

    def parts(self) -> dict[str, int]:
        """The parts of the table that the index knows, each with its number of rows."""
        with _room(self.path):
            return dict(self.base.execute("SELECT part, count FROM parts ORDER BY part"))

    def set_part(self, part: str, count: int, rows: Iterable[tuple[str, str]] = (), old: Iterable[str] = ()) -> None:
        """Keep that a part has been written, which holds rows by vehicle and recording, and those of `old` parts.

        It is on the disk after `saved`.
        """
        with _room(self.path):
            self.base.execute("INSERT OR REPLACE INTO parts VALUES (?, ?)", (part, count))
            where = "UPDATE done SET part = ? WHERE vehicle = ? AND recording = ?"
            self.base.executemany(where, ((part, *key) for key in rows))
            before = [(name,) for name in old]
            self.base.executemany("DELETE FROM parts WHERE part = ?", before)
            self.base.execute("CREATE TEMP TABLE IF NOT EXISTS folded (part TEXT PRIMARY KEY)")
            self.base.execute("DELETE FROM folded")
            self.base.executemany("INSERT INTO folded VALUES (?)", before)
            if before:
                self.base.execute("UPDATE done SET part = ? WHERE part IN (SELECT part FROM folded)", (part,))

    def lose_parts(self, names: Iterable[str]) -> None:
        """Forget parts that are not there any more, so that their rows are in no part."""
        with _room(self.path):
            self.base.executemany("DELETE FROM parts WHERE part = ?", [(name,) for name in names])

    def vehicles(self) -> dict[str, tuple[str, str]]:
        """States of vehicles, each with the hash of what it was made from."""
        with _room(self.path):
            rows = self.base.execute("SELECT * FROM vehicles")
            return {vehicle: (made, state) for vehicle, made, state in rows}

    def put_vehicles(self, states: Mapping[str, tuple[str, str]]) -> None:
        """Keep the states of all vehicles, and no others."""
        with _room(self.path):
            self.base.execute("DELETE FROM vehicles")
            self.base.executemany("INSERT INTO vehicles VALUES (?, ?, ?)", ((v, *state) for v, state in states.items()))

    def saved(self, last: float = 0.0) -> float:
        """Write results to the disk, unless that was done a moment before; the time of the last write."""
        now = monotonic()
        if now - last < COMMIT:
            return last
        with _room(self.path):
            self.base.commit()
        return now


@contextmanager
def run_store(folder: Path, about: dict[str, str], name: str = STORE) -> Iterator[Store]:
    """The store of the run in a folder, new or existing.

    Parameters
    ----------
    about
        What the run is about, which must be the same to go on.
    name
        Name of the index.

    Raises
    ------
    ExportError
        If the folder has other files, the run of something else, a run that is going on, or cannot be written.
    """
    path = folder / name
    make_folder(folder, "--out")
    try:
        files = [file.name for file in folder.iterdir()]
        occupied = files and not (PARTS_FOLDER in files or any(map(INDEX_NAME.fullmatch, files)))
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
    """An open file without faults, locked against other runs; a new one instead of a damaged one."""
    try:
        return _connected(path)
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF != sqlite3.SQLITE_CORRUPT:
            raise
    path.unlink()
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


def _text(content: bytes) -> str:
    """Text of a file that may be damaged."""
    return content.decode("utf-8", "replace")


def _check_columns(base: sqlite3.Connection, folder: Path) -> None:
    columns = [column[0] for column in base.execute("SELECT * FROM done LIMIT 0").description]
    if columns != list(StoredRow._fields):
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


def _insert(base: sqlite3.Connection, rows: Iterable[StoredRow]) -> None:
    base.executemany(f"INSERT OR REPLACE INTO done VALUES ({', '.join('?' * len(StoredRow._fields))})", rows)


#: Cost of what was not done.
_NOT_DONE = Timing()


def stored_row(job: RecordingJob, reading: WearReading, timing: Timing = _NOT_DONE, read_at: str = "") -> StoredRow:
    """The row of a reading with its cost and its time (ISO 8601), in no part yet."""
    begin = dated(job, reading.clock).begin
    return StoredRow(
        job.vehicle, job.recording, job.inputs, job.file, reading.status, reading.sha256, *packed_reading(reading),
        place_of(job), json.dumps(timing), f"{begin.astimezone(UTC):%Y-%m-%d}" if begin else "", read_at,
    ).with_checksum()  # fmt: skip


def place_of(job: RecordingJob) -> str:
    """Place of a recording by its table and calibrations: type, time, distance, strokes, calibration, and tags."""
    begin, calibration = job.begin.isoformat() if job.begin else None, as_text(job.start.name) if job.start else ""
    return json.dumps([job.type, begin, job.odometer, job.strokes, calibration, job.tags])


def _timing(row: StoredRow) -> Timing:
    return Timing(*json.loads(row.timing))

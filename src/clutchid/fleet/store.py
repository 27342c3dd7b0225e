"""What a run over a fleet has done so far: an SQLite file, so that what was done before is whole however a run ends."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import numpy as np

from clutchid.assess.half_load import HalfLoad
from clutchid.errors import ExportError
from clutchid.fleet.reading import Read
from clutchid.strokes.vented_rest import RestShift
from clutchid.wear.life import Curve
from clutchid.wear.measurement import Leak, Measurement, Reading

#: The file in the folder of a run.
STORE = "run.sqlite"

#: Time in s after which results are on the disk at the latest.
COMMIT = 0.5

_SCHEMA = """
CREATE TABLE IF NOT EXISTS about (what TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS done (
    vehicle TEXT, recording TEXT, inputs TEXT NOT NULL, file TEXT NOT NULL, status TEXT NOT NULL, message TEXT NOT NULL,
    sha256 TEXT NOT NULL, content TEXT NOT NULL, curve BLOB, seconds REAL NOT NULL, PRIMARY KEY (vehicle, recording)
);
"""


_COLUMNS = ("vehicle", "recording", "inputs", "file", "status", "message", "sha256", "content", "curve", "seconds")


class Kept(NamedTuple):
    """A result: `inputs` are version and calibration that it came from, `file` size and time of its recording."""

    vehicle: str
    recording: str
    inputs: str
    file: str
    read: Read
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class Store:
    """An open store, of which no other run has a hand in the file."""

    path: Path
    base: sqlite3.Connection

    def keys(self) -> dict[tuple[str, str], tuple[str, str, str, str]]:
        """Inputs, file, checksum and status of what is done, by vehicle and recording."""
        with _room(self.path):
            rows = self.base.execute("SELECT vehicle, recording, inputs, file, sha256, status FROM done")
            return {(row[0], row[1]): (row[2], row[3], row[4], row[5]) for row in rows}

    def results(self) -> Iterator[Kept]:
        """All results, in the order of vehicle and recording."""
        order = "SELECT * FROM done ORDER BY vehicle, recording"
        for vehicle, recording, inputs, file, status, message, sha256, content, curve, seconds in self.base.execute(
            order
        ):
            read = _read(recording, status, message, sha256, json.loads(content), curve)
            yield Kept(vehicle, recording, inputs, file, read, seconds)

    def put(self, kept: Kept) -> None:
        """Keep a result; it is on the disk after `saved`."""
        read = kept.read
        with _room(self.path):
            self.base.execute(
                "INSERT OR REPLACE INTO done VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    kept.vehicle, kept.recording, kept.inputs, kept.file, read.reading.status, read.reading.message,
                    read.sha256, json.dumps(_content(read)), _packed(read.curve), kept.seconds,
                ),
            )  # fmt: skip

    def same_file(self, key: tuple[str, str], file: str) -> None:
        """Note that a recording's file has another time, but the same content."""
        with _room(self.path):
            self.base.execute("UPDATE done SET file = ? WHERE vehicle = ? AND recording = ?", (file, *key))

    def saved(self, last: float = 0.0) -> float:
        """Bring results to the disk, unless that was done a moment before; the time when it was."""
        now = monotonic()
        if now - last < COMMIT:
            return last
        with _room(self.path):
            self.base.commit()
        return now


@contextmanager
def store(folder: Path, about: dict[str, str]) -> Iterator[Store]:
    """The store of the run in a folder, new or to go on with.

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
    if folder.exists() and not path.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ExportError(f"--out {folder}: is not empty and has no run of a fleet; name a new folder.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(f"--out {folder}: the folder cannot be created ({error.strerror}).") from error
    with _room(path):
        base = sqlite3.connect(path, timeout=1.0)
    try:
        with _room(path):
            base.execute("PRAGMA locking_mode = EXCLUSIVE")
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


def _check_columns(base: sqlite3.Connection, folder: Path) -> None:
    names = [column[0] for column in base.execute("SELECT * FROM done LIMIT 0").description]
    if names != list(_COLUMNS):
        raise ExportError(f"--out {folder}: its {STORE} is not from this version of clutchid; name another folder.")


def _check_about(base: sqlite3.Connection, folder: Path, about: dict[str, str]) -> None:
    """Check that the run is about the same, unless nothing has been done yet."""
    begun = base.execute("SELECT 1 FROM done LIMIT 1").fetchone() is not None
    known = dict(base.execute("SELECT what, value FROM about")) if begun else {}
    for what, value in about.items():
        if known.setdefault(what, value) != value:
            raise ExportError(
                f"--out {folder}: has a run whose {what} is {known[what]}, not {value}; name another folder."
            )
    base.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", known.items())


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
                f"{path}: is not the file of a run, or was damaged ({error}); name another folder, or remove the file."
            ) from error
        raise ExportError(
            f"{path}: cannot be written ({error}); what was written before is whole. Make room on the disk, and run "
            "the same command again to go on."
        ) from error


def _content(read: Read) -> dict[str, object]:
    one = read.reading
    return {
        "trust": one.trust, "measurement": one.measurement and list(one.measurement), "clock": read.clock,
        "half_load": list(read.half_load), "changes": list(read.changes), "leak": one.leak and list(one.leak),
        "departs": one.departs, "rest": one.rest and list(one.rest), "reason": one.reason,
    }  # fmt: skip


def _read(
    recording: str, status: str, message: str, sha256: str, content: dict[str, list[float]], curve: bytes | None
) -> Read:
    measured, leak, rest = content["measurement"], content.get("leak"), content.get("rest")
    reading = Reading(
        status, message, str(content["trust"]), Measurement(*measured) if measured else None,
        Leak(*leak) if leak else None, bool(content.get("departs")), RestShift(*rest) if rest else None,
        str(content.get("reason", "")),
    )  # fmt: skip
    half, changes = HalfLoad(*content["half_load"]), tuple(map(str, content["changes"]))
    return Read(Path(recording), reading, str(content["clock"]), sha256, _unpacked(curve), half, changes)


def _packed(curve: Curve | None) -> bytes | None:
    return None if curve is None else np.array(curve, dtype="<f8").tobytes()


def _unpacked(content: bytes | None) -> Curve | None:
    return None if content is None else Curve(*np.frombuffer(content, dtype="<f8").reshape(4, -1))

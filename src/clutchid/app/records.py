"""Frozen records of the content of the page, and of the tasks that its jobs send to another process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

from clutchid.verbs.commands import FitCommand
from clutchid.verbs.options import RequestText

#: Content of a recording or a result as a job reports it, in the keys of ``--json`` and of the page.
Json = Mapping[str, Any]


#: Metadata of a field that the page does not get.
PRIVATE = {"private": True}


def content(record: Any) -> dict[str, Any]:
    """A record as the JSON object that the page gets, by the names of its fields."""
    return {item.name: _plain(getattr(record, item.name)) for item in fields(record) if not item.metadata}


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, tuple):
        return [_plain(inner) for inner in value]
    return content(value) if is_dataclass(value) else value


@dataclass(frozen=True, slots=True)
class File:
    """A recording as a job reads it: its path, channel map, and the name that a command has for it."""

    path: Path
    map: Path | None = None
    name: str = ""


# what the page shows


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording: its file and channel map, and what `look` reports of it."""

    id: str
    name: str
    path: Path
    uploaded: bool = False
    status: str = "reading"
    size: int = 0
    message: str = ""
    bad_input: bool = False
    look: Json | None = None
    map: Path | None = None
    ambient: str = ""


@dataclass(frozen=True, slots=True)
class Result:
    """A fit, or with the verb "file" a calibration from a file; `found` is its content once there is one."""

    id: str
    verb: str
    name: str
    status: str = "waiting"
    recordings: tuple[str, ...] = ()
    verify: tuple[str, ...] = ()
    start: str | None = None
    options: RequestText | None = None
    made: float = 0.0
    found: Json | None = None
    message: str = ""
    bad_input: bool = False
    command: str = ""
    python: str = ""
    exports: tuple[Json, ...] = ()
    map: Path | None = None


@dataclass(frozen=True, slots=True)
class Observation:
    """A recording that an observer follows."""

    id: str
    name: str
    method: str
    recording: str
    start: str
    status: str = "waiting"
    found: Json | None = None
    message: str = ""
    bad_input: bool = False
    command: str = ""
    python: str = ""


PageItem = Recording | Result | Observation

# tasks


@dataclass(frozen=True, slots=True)
class Look:
    """Look at a recording and check it; its columns are copied into a folder first, unless they are there."""

    file: File
    folder: Path
    ambient: str = ""
    copied: bool = False


@dataclass(frozen=True, slots=True)
class Cut:
    """Write a span of time in s of copied columns to a new file, and look at it."""

    source: Path
    map: Path | None
    span: tuple[float, float]
    look: Look


@dataclass(frozen=True, slots=True)
class FitRecordings:
    """Calibrate or estimate as requested, and write the files of the result into a folder.

    Recordings and start are files of the server, which have other names in what was `asked`.
    """

    asked: FitCommand
    name: str
    recordings: tuple[File, ...]
    folder: Path
    verify: tuple[File, ...] = ()
    start: Path | None = None


@dataclass(frozen=True, slots=True)
class ReadCalibration:
    """Read a calibration from a file that was given under a name."""

    path: Path
    name: str


@dataclass(frozen=True, slots=True)
class Observe:
    """Follow a recording with the observer of a calibration."""

    recording: File
    start: Path
    method: str
    folder: Path
    force: bool = False


@dataclass(frozen=True, slots=True)
class Export:
    """Export the observer of a calibration, and pack it."""

    start: Path
    to: str
    method: str
    folder: Path


Task = Look | Cut | FitRecordings | ReadCalibration | Observe | Export

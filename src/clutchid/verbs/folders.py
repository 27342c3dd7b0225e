"""The files of a folder: recordings, results of clutchid, and others; and the names that tables give to them."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from clutchid.measurements import is_recording
from clutchid.measurements.suffixes import SUFFIXES_SHOWN, by_suffix, recording_name, split_name
from clutchid.names import as_text
from clutchid.wear.history import RecordingJob

#: The file that says that a folder is that of a run of `fleet`, and names of those of parts of a fleet.
STORE = "run.sqlite"
INDEX_NAME = re.compile(r"run(-\d+-of-\d+)?\.sqlite")

#: Problem of a row of a table without a file.
_ABSENT = "the table names it, but its file is not there."


class FolderContent(NamedTuple):
    """Files below a folder, in order: `recordings`, `others`, and the number of `results` of clutchid.

    Links to files that are gone are recordings or others as well. What is hidden is neither, as what a write that was
    cut off has left.
    """

    recordings: tuple[Path, ...]
    others: tuple[Path, ...]
    results: int


def folder_content(folder: Path, apart: Collection[Path] = ()) -> FolderContent:
    """Content of a folder and its subfolders, without the files `apart`, which are resolved paths.

    Results of clutchid are the folder of a fleet, and the two files of `observe` and `track`, FILE.* and FILE.load.*.
    """
    names, files = {path.name for path in apart}, [*_files_below(folder)]
    if apart:
        files = [path for path in files if not ((path.name in names or path.is_symlink()) and path.resolve() in apart)]
    results = {*_results(files)}
    return recordings_and_others((path for path in files if path not in results), len(results))


def recordings_and_others(files: Iterable[Path], results: int) -> FolderContent:
    """Recordings and other files of a folder, beside a number of results of clutchid."""
    recordings: list[Path] = []
    others: list[Path] = []
    for path in files:
        (recordings if is_recording(path) else others).append(path)
    return FolderContent(tuple(recordings), tuple(others), results)


def _files_below(folder: Path) -> Iterator[Path]:
    """Files of a folder and below in order, without what is hidden; also links to files that are gone."""
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except OSError:  # a folder without permission
        return
    for entry in entries:
        if entry.name.startswith("."):
            continue
        if entry.is_dir(follow_symlinks=False):
            yield from _files_below(Path(entry.path))
        elif entry.is_file() or (entry.is_symlink() and not Path(entry.path).exists()):
            yield Path(entry.path)


def _results(files: Sequence[Path]) -> Iterator[Path]:
    runs, names = {path.parent for path in files if INDEX_NAME.fullmatch(path.name)}, {*files}
    for path in files:
        if runs and not runs.isdisjoint(path.parents):
            yield path
        elif Path(path.stem).suffix == ".load":
            whole = path.with_name(f"{Path(path.stem).stem}{path.suffix}")
            yield from (whole, path) if whole in names else ()


def is_hidden(path: Path) -> bool:
    """Whether a path has a part that begins with a dot."""
    return any(part.startswith(".") for part in path.parts)


def name_of(recording: Path) -> str:
    """The name of a recording in tables: that of its file, without the suffix."""
    return as_text(recording_name(recording.name))


def name_in(names: Collection[str], file: Path) -> str:
    """The name by which a table knows a file: all of it, or without the suffix; empty if it does not."""
    possible = (as_text(file.name), as_text(split_name(file.name)[0]), as_text(file.stem))
    return next((name for name in possible if name in names), "")


def left_out(others: Sequence[Path], results: int) -> str:
    """Sentence about files of a folder that are not read as recordings, by suffix; empty if there are none."""
    counted = [by_suffix(others)] if others else []
    if results:
        counted.append(f"{results:,} result{'s' if results > 1 else ''} of clutchid")
    count = len(others) + results
    what = "1 file is" if count == 1 else f"{count:,} files are"
    return f"{what} not read as recordings: {', '.join(counted)}." if counted else ""


def no_recordings(where: str, beside: str) -> str:
    """Sentence about a folder without a recording, with what is there `beside` them."""
    hint = f" {beside} `clutchid look FILE` says whether a file can be read." if beside else ""
    return f"{where}: has no recordings; they are files with {SUFFIXES_SHOWN}.{hint}"


#: Files by the names of their rows, then by their folders.
_Named = Mapping[str, Mapping[str, Sequence[Path]]]


@dataclass(frozen=True, slots=True)
class FilesByName:
    """The files of folders that the rows of a table name, by name and folder."""

    recordings: _Named
    others: _Named

    def located(self, row: RecordingJob) -> RecordingJob:
        """A row with its file: one in a folder of the vehicle before others, a recording by its suffix before others.

        Without one, or with several, it has the problem with that.
        """
        folders = [files.get(row.recording, {}) for files in (self.recordings, self.others)]
        own = (files.get(row.vehicle, ()) for files in folders)
        several = ([path for paths in files.values() for path in paths] for files in folders)
        files = next((group for group in chain(own, several) if group), ())
        if len(files) == 1:
            return replace(row, path=files[0])
        names = [f"'{as_text(str(path))}'" for path in sorted(files)[:3]]
        problem = f"several files have its name: {', '.join(names)}; rename all but one." if names else _ABSENT
        return replace(row, path=None, problem=problem)


def files_by_name(content: FolderContent, names: Collection[str]) -> FilesByName:
    """The files of a folder by the `names` of a table."""

    def named(paths: Iterable[Path]) -> _Named:
        groups: dict[str, dict[str, list[Path]]] = {}
        for path in paths:
            if name := name_in(names, path):
                groups.setdefault(name, {}).setdefault(as_text(path.parent.name), []).append(path)
        return groups

    return FilesByName(named(content.recordings), named(content.others))

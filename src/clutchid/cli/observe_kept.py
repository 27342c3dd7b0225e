"""Files of a live recording: what can be written is kept, whatever fails, and what an earlier run left is offered."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.cli.observe_output import origin_of
from clutchid.cli.observe_sinks import say_unhurried
from clutchid.errors import ExportError

if TYPE_CHECKING:
    from clutchid.cli.observe_output import Files
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.observer.live import LiveRun
    from clutchid.observer.recording import ObservedRecording
    from clutchid.recordings.spool import Add


@dataclass(frozen=True, slots=True)
class Kept:
    """What went wrong with the files, as sentences, and where those are that are elsewhere; None is nowhere."""

    troubles: list[str] = field(default_factory=list)
    moved: dict[Path, Path | None] = field(default_factory=dict)

    def _note(self, trouble: str) -> None:
        if trouble not in self.troubles:
            self.troubles.append(trouble)
            say_unhurried([trouble])

    def _move(self, path: Path, place: Path) -> None:
        self.moved[path] = place
        self._note(f"{path}: cannot be written any more; it is in {place} instead.")

    @contextmanager
    def spooled(self, path: Path) -> Iterator[Add]:
        """Function that adds a block to a recording; where that fails, what came before is the file.

        Raises
        ------
        ExportError
            If the file cannot be begun.
        """
        from clutchid.recordings.spool import spooled

        begun, open_, before = False, True, _number(path)
        try:
            with spooled(path, lambda place: self._move(path, place)) as add:

                def added(block: Log, *, now: bool = False) -> None:
                    nonlocal open_
                    try:
                        if open_:
                            add(block, now=now)
                    except ExportError as error:
                        open_ = False
                        self._note(f"{error} What came before is kept, and the recording goes on.")

                begun = True
                yield added
        except ExportError as error:
            if not begun:
                raise
            if _number(path) == before:  # what was there, or nothing
                self.moved[path] = None
            self._note(f"{error} What came before is kept.")

    def cut(self, left: Sequence[Path], time: float) -> None:
        """Cut from files that an earlier run left what comes again, from a time in s on."""
        from clutchid.recordings.spool import cut_behind

        for path in left:
            try:
                cut_behind(path, time)
            except ExportError as error:
                self._note(f"{error} Samples from {time:g} s on are in it and in the new file.")

    def save(self, path: Path | None, run: LiveRun) -> None:
        """Save the state while the recording goes on, if it is asked for."""
        from clutchid.observer.state_file import write_state

        if path is not None:
            try:
                write_state(run.observer, run.after, path, origin_of(run.parts[-1].log))
            except ExportError as error:
                say_unhurried([f"{error} The recording goes on."])

    def write_rest(self, files: Files, run: ObservedRecording, content: ParameterFile) -> None:
        """Write the state and the page; in the folder for temporary files where that cannot be."""
        for path, write in files.rest(run, content):
            try:
                write(path)
            except ExportError as error:
                self._note(str(error))
                self._elsewhere(path, write)

    def _elsewhere(self, path: Path, write: Callable[[Path], None]) -> None:
        try:
            place = Path(tempfile.mkdtemp(prefix="clutchid-")) / path.name
            write(place)
        except OSError:
            self.moved[path] = None
        else:
            self._move(path, place)


def _number(path: Path) -> int | None:
    """Number of a file on its disk, None where there is none."""
    try:
        return path.stat().st_ino
    except OSError:
        return None


def offer(files: Files) -> list[Path]:
    """What an earlier run left that ended without writing its files; says so, and how to go on from it."""
    from clutchid.recordings.spool import recovered

    found = [path for each in (files.out, files.by_stroke) for path in recovered(each)]
    if not found:
        return []
    names = " and ".join(map(str, found))
    sentence = f"an earlier run ended before it wrote {files.out}: what it had observed is in {names}."
    if files.save is not None and files.save.exists() and files.resume is None:
        sentence += f" Its state is in {files.save}: go on from it with --resume {shlex.quote(str(files.save))}."
    say_unhurried([sentence])
    return found

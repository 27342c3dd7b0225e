"""Files of an observed recording: written as results arise, kept after faults, and recovered from an earlier run."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.errors import ExportError, ParameterError
from clutchid.systems import command_line
from clutchid.verbs.live.arriving import is_live
from clutchid.verbs.live.streams import say_unhurried
from clutchid.verbs.options import ReadingText
from clutchid.verbs.saving import check_outputs, loads_path

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log
    from clutchid.measurements.spool import AddBlock
    from clutchid.observer.live import LiveRun
    from clutchid.observer.run import ObservedRecording


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Files that `observe` writes, and whether results of a live recording are published.

    Attributes
    ----------
    out
        Estimates by sample; the load by stroke is written beside them.
    save, report
        State after the last sample, and page.
    publish
        Whether results are written on standard output as they arise.
    command
        Command of the page.
    """

    out: Path
    save: Path | None = None
    report: Path | None = None
    publish: bool = False
    command: str = ""

    @property
    def by_stroke(self) -> Path:
        """The load by stroke, beside the samples."""
        return loads_path(self.out)

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files, in the order in which they are named."""
        return tuple(filter(None, (self.out, self.by_stroke, self.save, self.report)))

    def check(self, log: Path, start: Path, resume: Path | None, files: ReadingText) -> None:
        """Check that the options go together and with the recording, and that the files can be written.

        A state may replace the file that it was resumed from.

        Raises
        ------
        ExportError, ParameterError
            If they do not, or cannot.
        """
        if self.publish and not is_live(log):
            raise ParameterError("--publish -: is for a live recording; give - or can:CHANNEL.")
        read: list[tuple[str, Path | None]] = [("the recording itself", log), ("the calibration", start)]
        read += [("the DBC of the recording", path) for path in files.dbc or ()]
        written = {"--out": self.out, "--out (load by stroke)": self.by_stroke, "--report": self.report}
        check_outputs(written, [*read, ("the state of --resume", resume)])
        others = [(f"the file of {option}", path) for option, path in written.items()]
        check_outputs({"--save": self.save}, [*read, *others])

    def write(self, run: ObservedRecording, content: ParameterFile) -> None:
        """Write all files of a recording."""
        from clutchid.measurements import write

        write(run.estimates(), self.out)
        write(run.load_by_stroke(), self.by_stroke)
        for path, write_file in self.at_the_end(run, content):
            write_file(path)

    def at_the_end(self, run: ObservedRecording, content: ParameterFile) -> list[tuple[Path, Callable[[Path], None]]]:
        """Paths of the state and of the page, if they are written, and the functions that write them."""
        from clutchid.documents import Observation, document_of, write_page
        from clutchid.observer.state_file import write_state

        origin = _origin_of(run.log)
        writers = (
            (self.save, lambda path: write_state(run.observer, run.after, path, origin)),
            (self.report, lambda path: write_page(document_of(Observation(run, content.origin), self.command), path)),
        )
        return [(path, write) for path, write in writers if path is not None]


def _origin_of(log: Log) -> float | None:
    """Stamp in s that is the time 0 of a live recording, None where that is 0."""
    from clutchid.measurements.live.arrival import ORIGIN

    return float(log.metadata[ORIGIN]) if ORIGIN in log.metadata else None


@dataclass(frozen=True, slots=True)
class FileTroubles:
    """Faults of the files, as sentences, and the new paths of moved files; None if a file is lost."""

    troubles: list[str] = field(default_factory=list)
    moved: dict[Path, Path | None] = field(default_factory=dict)

    def _note(self, trouble: str) -> None:
        if trouble not in self.troubles:
            self.troubles.append(trouble)
            say_unhurried([trouble])

    def _move(self, path: Path, place: Path) -> None:
        self.moved[path] = place
        self._note(f"{path}: can no longer be written; it is in {place} instead.")

    @contextmanager
    def spooled(self, path: Path) -> Iterator[AddBlock]:
        """Function that adds a block to a file; after a fault the file has the blocks before.

        Raises
        ------
        ExportError
            If the file cannot be begun.
        """
        from clutchid.measurements.spool import spooled

        begun, open_, before = False, True, _identity(path)
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
            if _identity(path) == before:  # nobody has replaced the file
                self.moved[path] = None
            self._note(f"{error} What came before is kept.")

    def save(self, path: Path | None, run: LiveRun) -> None:
        """Save the state while the recording goes on, if requested."""
        from clutchid.observer.state_file import write_state

        if path is not None:
            try:
                write_state(run.observer, run.after, path, _origin_of(run.parts[-1].log))
            except ExportError as error:
                say_unhurried([f"{error} The recording goes on."])

    def write_at_the_end(self, outputs: Outputs, run: ObservedRecording, content: ParameterFile) -> None:
        """Write the state and the page; in the folder for temporary files if that fails."""
        for path, write in outputs.at_the_end(run, content):
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


def _identity(path: Path) -> tuple[int, int] | None:
    """Inode and modification time of a file, which change when another file replaces it; None if there is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def left_by_earlier_run(outputs: Outputs, resume: Path | None) -> list[Path]:
    """Files recovered from an earlier run that was killed, with a message how to continue."""
    from clutchid.measurements.spool import recovered

    files = [path for file in (outputs.out, outputs.by_stroke) for path in recovered(file)]
    if not files:
        return []
    names = " and ".join(map(str, files))
    sentence = f"an earlier run ended before it wrote {outputs.out}: what it had observed is in {names}."
    if outputs.save is not None and outputs.save.exists() and resume is None:
        state = command_line([str(outputs.save)])
        sentence += f" Its state is in {outputs.save}: go on from it with --resume {state}."
    say_unhurried([sentence])
    return files

"""Open a recording: the format is detected from the content.

Text is read in this process; everything else in the guarded reader process. A library may end its process on a damaged
file, never return, or unpack a small file to gigabytes: all that then ends is the reader process, a
`clutchid.processes.Worker`, and the user gets one sentence.
"""

from __future__ import annotations

import os
import re
import weakref
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from clutchid.errors import DataError, MissingExtra, ParameterError
from clutchid.files import plain_file, reason_of
from clutchid.measurements.formats.kinds import readable_kind
from clutchid.measurements.formats.opening import opened_here
from clutchid.measurements.grids import with_own_grids
from clutchid.measurements.reader_service import ServiceMessage, decoded, encoded
from clutchid.measurements.source import BLOCK, Source, Table, joined_tables
from clutchid.processes import Limits, Worker, WorkerEnd

#: Kinds of text that are read in this process, by our own code.
_OWN = ("csv", "candump")


def open_source(path: str | PathLike[str], dbc: Sequence[str | PathLike[str]] = ()) -> Source:
    """Open a file of any known format; `dbc` files decode the frames of a bus log.

    Raises
    ------
    DataError
        If the recording or a DBC file is not a readable plain file, is no recording, or ended the reader process;
        problems inside a recording are in ``Source.problems``.
    MissingExtra
        If the format needs a library that is not installed.
    """
    file = plain_file(path)
    databases = [plain_file(name, "DBC file") for name in dbc]
    kind = readable_kind(file)
    return with_own_grids((opened_here if kind in _OWN else _guarded_source)(file, databases, kind))


class NoFramesError(DataError):
    """A DBC was named for a recording that is no log of frames."""


def with_dbc(source: Source, dbc: Sequence[str | PathLike[str]]) -> Source:
    """The source, of which DBC files that the user names must decode frames; of an MDF file a warning says if not.

    Raises
    ------
    NoFramesError
        If the recording is a table, which has none.
    """
    if not dbc or source.one_clock or source.problems:
        return source
    idle = f"is {source.format} with channels, not a log of frames, so a DBC has no effect on it"
    if source.format.startswith("MDF"):
        return replace(source, warnings=(*source.warnings, f"{idle}."))
    raise NoFramesError(f"{source.path}: {idle}; leave --dbc out.")


MEMORY_VARIABLE, _SECONDS_VARIABLE = "CLUTCHID_READER_MEMORY", "CLUTCHID_READER_SECONDS"

#: Bytes by default, and those that the libraries may allocate before a file is open.
_MEMORY, _BEGINS = 1_250_000_000, 500_000_000
_SECONDS = 60.0

#: Bytes of a file for which the reader has a further second, as a large sound file takes long.
_BYTES_PER_SECOND = 1e6

_SIZE = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(GB|MB)\s*", re.IGNORECASE)


def memory() -> int:
    """Bytes that the reader process may have in memory: 1.25 GB, or as the user has set it.

    Raises
    ------
    ParameterError
        If the environment variable is not a size.
    """
    text = os.environ.get(MEMORY_VARIABLE)
    if text is None:
        return _MEMORY
    match = _SIZE.fullmatch(text)
    if match is None:
        raise ParameterError(f"{MEMORY_VARIABLE} = '{text}': a size in MB or GB is needed, for example 4GB.")
    return int(float(match[1]) * (1e9 if match[2].upper() == "GB" else 1e6))


def seconds(size: int) -> float:
    """Time in s that one answer about a file of `size` bytes may take.

    Raises
    ------
    ParameterError
        If the environment variable is not a time.
    """
    text = os.environ.get(_SECONDS_VARIABLE)
    try:
        least = _SECONDS if text is None else float(text)
    except ValueError:
        raise ParameterError(f"{_SECONDS_VARIABLE} = '{text}': a time in s is needed, for example 300.") from None
    return least + size / _BYTES_PER_SECOND


def too_large() -> str:
    """End of the sentence about a file that needs more memory than the reader process may have."""
    return (
        f"needs more than {memory() / 1e9:.3g} GB to be read; save only the channels that are needed, convert it to "
        f"Parquet, or allow more with the environment variable {MEMORY_VARIABLE}=4GB."
    )


_SPOILED = "it is damaged, or of a kind that the library cannot read; copy it again or convert it to Parquet or CSV."


class ReaderProcess:
    """A worker process that answers questions about files; it is used up when it ends, however it ends.

    An allocation of much more than the limit of memory fails at once in it; the rest is watched.
    """

    def __init__(self) -> None:
        self.forgotten: deque[int] = deque()
        environment = {"OPENBLAS_NUM_THREADS": "1"}
        self.worker = Worker(
            "clutchid.measurements.reader_service:reader_service",
            allocations=max(2 * memory(), _BEGINS),
            environment=environment,
        )

    def ask(self, question: ServiceMessage, path: Path) -> ServiceMessage:
        """The answer to a question about the file at `path`.

        Raises
        ------
        DataError
            If the file cannot be read, or the process ended or had to be ended on it; the text names the file.
        MissingExtra
            If a library is not installed.
        """
        if not self.worker.end.alive:
            raise DataError(f"{path}: the reader process has ended since it was opened; open the file again.")
        forget = [self.forgotten.popleft() for _ in range(len(self.forgotten))]
        limits = Limits(seconds(path.stat().st_size if path.exists() else 0), memory())
        parts = self.worker.ask(encoded({**question, "forget": forget}), limits)
        if isinstance(parts, WorkerEnd):
            reasons = {
                "itself": f"the reader process crashed while reading it ({parts.how}): {_SPOILED}",
                "memory": too_large(),
                "time": f"was not read within {limits.seconds:.0f} s, so it is damaged or very slow to read; copy it "
                f"again, or allow more with the environment variable {_SECONDS_VARIABLE}=600.",
            }
            raise DataError(f"{path}: {reasons[parts.why]}")
        message = decoded(parts)
        if "failed" in message:
            raise _error(message, path)
        return message


def _error(message: ServiceMessage, path: Path) -> DataError | MissingExtra:
    """The error that the reader process answered with."""
    texts = {
        "data": message["text"],
        "missing": message["text"],
        "memory": f"{path}: {too_large()}",
        "unreadable": f"{path}: cannot be read ({message['text']}).",
        "unexpected": f"{path}: cannot be read ({message['text']}): {_SPOILED}",
    }
    kind = MissingExtra if message["failed"] == "missing" else DataError
    error = kind(texts[message["failed"]])
    error.add_note(f"In the reader process:\n{message['traceback']}")
    return error


_current: list[ReaderProcess] = []


def reader(path: Path) -> ReaderProcess:
    """The reader process of this command, started when it is needed first and again after it ended or has grown.

    A process that has grown is left to the files that are open in it: libraries keep address space (Polars 2.3 GB for
    a damaged Parquet file), so that later files would be refused for memory that they do not need.

    Raises
    ------
    DataError
        If it cannot be started; the text names the file at `path`, which is to be read.
    """
    worker = _current[0].worker if _current else None
    if worker is None or not worker.alive or worker.memory().allocated > memory() / 2:
        try:
            _current[:] = [ReaderProcess()]
        except OSError as error:
            raise DataError(f"{path}: the process that reads it could not be started ({reason_of(error)}).") from error
    return _current[0]


def _guarded_source(path: Path, dbc: Sequence[Path], kind: str) -> Source:
    """The file, open in the reader process; errors are those of `ReaderProcess.ask`."""
    process = reader(path)
    files = {"path": str(path.absolute()), "dbc": [str(name.absolute()) for name in dbc]}
    message = process.ask({"do": "open", **files, "kind": kind}, path)
    source: Source = replace(message["source"], path=path)
    file = message["number"]

    def blocks(raster: int, columns: Sequence[int], rows: int | None) -> Iterator[Table]:
        question = {"do": "tables", "number": file, "raster": raster, "columns": list(columns), "rows": rows}
        number = process.ask(question, path)["number"]
        try:
            while (table := process.ask({"do": "next", "number": number}, path)["table"]) is not None:
                yield replace(table, headings=source.rasters[raster].headings)
        finally:
            process.forgotten.append(number)

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Tables of one time grid, see `Tables`; the samples that are asked for as a whole still come in blocks."""
        if rows is not None or source.format == "CSV":
            yield from blocks(raster, columns, rows)
        elif parts := list(blocks(raster, columns, BLOCK)):
            yield joined_tables(parts)

    weakref.finalize(tables, process.forgotten.append, file)
    return replace(source, tables=tables)

"""`guarded_source`: a file that is opened in the reader process, and read from there block by block."""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from pathlib import Path

from clutchid.recordings.columns import Heading
from clutchid.recordings.guard.messages import Message, source_of, unpacked
from clutchid.recordings.guard.process import ReaderProcess, reader
from clutchid.recordings.source import BLOCK, Source
from clutchid.recordings.table import Table, joined_samples


def guarded_source(path: Path, dbc: Sequence[Path], kind: str = "") -> Source:
    """Open a file of any known format in the reader process; `dbc` files decode the frames of a bus log.

    `kind` is its format where that is known already.

    Raises
    ------
    DataError
        If it cannot be read, or takes more memory or time than the reader process has.
    MissingExtra
        If the format needs a library that is not installed.
    """
    process = reader(path)
    files = {"path": str(path.absolute()), "dbc": [str(name.absolute()) for name in dbc]}
    question = {"do": "open", **files, "kind": kind}
    message, _ = process.ask(question, path)
    tables = _RemoteTables(process, path, message)
    weakref.finalize(tables, process.forgotten.append, message["source"])
    source = source_of(message, path, tables)
    tables.headings = tuple(raster.headings for raster in source.rasters)
    return source


class _RemoteTables:
    """Reads channels of one time grid through the reader process, see `Tables`."""

    def __init__(self, process: ReaderProcess, path: Path, opened: Message) -> None:
        self._process, self._path, self._number = process, path, opened["source"]
        self._by_text = opened["format"] == "CSV"
        self.headings: tuple[tuple[Heading, ...], ...] = ()

    def __call__(self, raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Consecutive tables of at most `rows` samples; what is asked for as a whole still comes in blocks."""
        if rows is not None or self._by_text:
            yield from self._blocks(raster, columns, rows)
        else:
            blocks = list(self._blocks(raster, columns, BLOCK))
            if blocks:
                yield _joined(blocks)

    def _blocks(self, raster: int, columns: Sequence[int], rows: int | None) -> Iterator[Table]:
        question = {"do": "tables", "source": self._number, "raster": raster, "columns": list(columns), "rows": rows}
        stream = {"stream": self._process.ask(question, self._path)[0]["stream"]}
        try:
            while "end" not in (found := self._process.ask({"do": "next", **stream}, self._path))[0]:
                yield unpacked(*found, self.headings[raster])
        finally:
            self._process.forgotten.append(stream["stream"])


def _joined(tables: list[Table]) -> Table:
    """Blocks as one table."""
    if len(tables) == 1:
        return tables[0]
    numbers, size, places, unread = joined_samples(tables)
    problems = tuple(dict.fromkeys(problem for table in tables for problem in table.problems))
    return Table(tables[0].headings, numbers, size, places, problems, unread, tables[0].metadata)

"""The guarded reader process: what runs in it, and the messages that it exchanges with clutchid.

A message is a JSON object, with arrays as they lie in memory. Nothing that comes from a file is executed, as it could
be with pickle; Arrow's stream format copies each column twice more on either side.
"""

from __future__ import annotations

import json
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import ClutchidError, MissingExtra
from clutchid.files import reason_of
from clutchid.measurements.columns import Heading
from clutchid.measurements.formats.opening import opened_here
from clutchid.measurements.source import Places, Raster, Source, Table
from clutchid.messages import shortened
from clutchid.processes.frames import MessagePart, MessageParts
from clutchid.processes.serving import Service

ServiceMessage = dict[str, Any]

#: Records that a message may hold.
_RECORDS = {record.__name__: record for record in (Source, Raster, Heading, Table, Places)}


def encoded(message: ServiceMessage) -> MessageParts:
    """One message as parts of bytes: what it holds but for arrays, and these as floats or integers of 64 bits.

    Paths and functions are left out.
    """
    arrays: list[NDArray[Any]] = []
    return [json.dumps(_plain(message, arrays)).encode("ascii"), *(array.data for array in arrays)]


def decoded(parts: MessageParts) -> ServiceMessage:
    """The message; its sequences are tuples."""
    message: ServiceMessage = _restored(json.loads(bytes(parts[0])), iter(parts[1:]))
    return message


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """A value as JSON has it; its arrays are added in their order."""
    match value:
        case np.ndarray():
            arrays.append(np.ascontiguousarray(value, "=i8" if value.dtype.kind in "iu" else "=f8"))
            return {"array": arrays[-1].dtype.kind}
        case Mapping():
            return {"pairs": [[_plain(key, arrays), _plain(item, arrays)] for key, item in value.items()]}
        case list() | tuple():
            return [_plain(item, arrays) for item in value]
        case np.integer():
            return int(value)
    if type(value).__name__ in _RECORDS:
        values = [_plain(getattr(value, item.name), arrays) for item in fields(value)]
        return {"record": type(value).__name__, "values": values}
    return None if callable(value) or isinstance(value, Path) else value


def _restored(value: Any, arrays: Iterator[MessagePart]) -> Any:
    if isinstance(value, list):
        return tuple(_restored(item, arrays) for item in value)
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return np.frombuffer(next(arrays), {"i": "=i8", "f": "=f8"}[value["array"]])
    if "pairs" in value:
        return dict(_restored(value["pairs"], arrays))
    return _RECORDS[value["record"]](*_restored(value["values"], arrays))


def reader_service() -> Service:
    """Service that answers questions about files, and reads a block ahead while the other side works on the last."""
    files = _OpenFiles()
    return Service(lambda question: encoded(_answered(files, decoded(question))), files.read_ahead)


def _answered(files: _OpenFiles, question: ServiceMessage) -> ServiceMessage:
    """The answer, or the failure."""
    try:
        return files.answer(question)
    except MissingExtra as error:
        return _failure("missing", str(error))
    except MemoryError:
        return _failure("memory", "")
    except OSError as error:
        return _failure("unreadable", reason_of(error))
    except ClutchidError as error:
        return _failure("data", str(error))
    except Exception as error:
        return _failure("unexpected", shortened(f"{type(error).__name__}: {error}", 200))


def _failure(kind: str, text: str) -> ServiceMessage:
    return {"failed": kind, "text": text, "traceback": traceback.format_exc()}


class _OpenFiles:
    """The files that are open, and the tables that are read from them, by the numbers that the other side knows."""

    def __init__(self) -> None:
        self._sources: dict[int, Source] = {}
        self._tables: dict[int, _TablesAhead] = {}
        self._count = 0
        self._last: _TablesAhead | None = None

    def answer(self, question: ServiceMessage) -> ServiceMessage:
        """Answer a question, and close files and tables that are not needed any more."""
        for number in question["forget"]:
            self._sources.pop(number, None)
            if self._tables.pop(number, None) is self._last:
                self._last = None
        return {"open": self._open, "tables": self._begin, "next": self._next}[question["do"]](question)

    def read_ahead(self) -> None:
        """Read a block more of the tables that were asked for last."""
        if self._last is not None:
            self._last.read_ahead()

    def _open(self, question: ServiceMessage) -> ServiceMessage:
        source = opened_here(Path(question["path"]), [Path(name) for name in question["dbc"]], question["kind"])
        self._count += 1
        self._sources[self._count] = source
        return {"number": self._count, "source": source}

    def _begin(self, question: ServiceMessage) -> ServiceMessage:
        tables = self._sources[question["number"]].tables(question["raster"], question["columns"], question["rows"])
        self._count += 1
        self._tables[self._count] = _TablesAhead(tables)
        return {"number": self._count}

    def _next(self, question: ServiceMessage) -> ServiceMessage:
        self._last = self._tables[question["number"]]
        table = self._last.next()
        return {"table": None if table is None else replace(table, headings=())}  # which the other side has


class _TablesAhead:
    """Consecutive tables, from the second one on read ahead: 6 million samples of MDF take 4.0 s instead of 4.9."""

    def __init__(self, tables: Iterator[Table]) -> None:
        self._tables = tables
        self._given = 0
        self._ahead: list[Table | Exception | None] = []

    def next(self) -> Table | None:
        """The next table; None behind the last."""
        self._given += 1
        table = self._ahead.pop() if self._ahead else next(self._tables, None)
        if isinstance(table, Exception):
            raise table
        return table

    def read_ahead(self) -> None:
        """Read the next table, or keep the error for when it is asked for."""
        if self._given > 1 and not self._ahead:
            try:
                self._ahead.append(next(self._tables, None))
            except Exception as error:
                self._ahead.append(error)

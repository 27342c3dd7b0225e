"""What runs in the reader process: it opens files, and reads their channels block by block, as it is asked."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

from clutchid.errors import ClutchidError, DataError, MissingExtra
from clutchid.processes.frames import Parts
from clutchid.processes.serving import Service
from clutchid.recordings.columns import shortened
from clutchid.recordings.formats.opening import opened_here
from clutchid.recordings.guard.messages import Arrays, Message, decoded, described, encoded, packed
from clutchid.recordings.source import Source, Table

Answer = tuple[Message, Arrays]


def reader_service() -> Service:
    """Answers questions about files; a block more is read while the other side works on the one before."""
    reading = _Reading()
    return Service(lambda question: _answered(reading, question), reading.read_ahead)


def _answered(reading: _Reading, question: Parts) -> Parts:
    """The answer, or what went wrong."""
    return encoded(*_answer(reading, decoded(question)[0]))


def _answer(reading: _Reading, question: Message) -> Answer:
    try:
        return reading.answer(question)
    except (MissingExtra, DataError) as error:
        return _failure("missing" if isinstance(error, MissingExtra) else "data", str(error))
    except MemoryError:
        return _failure("memory", "")
    except OSError as error:
        return _failure("unreadable", error.strerror or str(error))
    except ClutchidError as error:
        return _failure("data", str(error))
    except Exception as error:
        return _failure("unexpected", shortened(f"{type(error).__name__}: {error}", 200))


def _failure(kind: str, text: str) -> Answer:
    return {"failed": kind, "text": text, "traceback": traceback.format_exc()}, {}


class _Reading:
    """The files that are open, and the readings that go on."""

    def __init__(self) -> None:
        self._opened: dict[int, Source] = {}
        self._streams: dict[int, _Stream] = {}
        self._count = 0
        self._last: _Stream | None = None

    def answer(self, question: Message) -> Answer:
        """Do what is asked, and forget what is not needed any more."""
        for number in question["forget"]:
            self._opened.pop(number, None)
            if self._streams.pop(number, None) is self._last:
                self._last = None
        deeds: dict[str, Callable[[Message], Answer]] = {
            "open": self._open,
            "tables": self._tables,
            "next": self._next,
        }
        return deeds[question["do"]](question)

    def read_ahead(self) -> None:
        """Read a block more of the reading that goes on, while the other side works on the one before."""
        if self._last is not None:
            self._last.read_ahead()

    def _number(self) -> int:
        self._count += 1
        return self._count

    def _open(self, question: Message) -> Answer:
        source = opened_here(Path(question["path"]), [Path(name) for name in question["dbc"]], question["kind"])
        number = self._number()
        self._opened[number] = source
        return {"source": number, **described(source)}, {}

    def _tables(self, question: Message) -> Answer:
        number, source = self._number(), self._opened[question["source"]]
        self._streams[number] = _Stream(source.tables(question["raster"], question["columns"], question["rows"]))
        return {"stream": number}, {}

    def _next(self, question: Message) -> Answer:
        self._last = self._streams[question["stream"]]
        table = self._last.next()
        return ({"end": True}, {}) if table is None else packed(table)


class _Stream:
    """A reading that goes on; from its second block on it is a block ahead of what was asked for."""

    def __init__(self, tables: Iterator[Table]) -> None:
        self._tables = tables
        self._given = 0
        self._ahead: list[Table | Exception | None] = []

    def next(self) -> Table | None:
        """The next block; None behind the last."""
        self._given += 1
        found = self._ahead.pop() if self._ahead else next(self._tables, None)
        if isinstance(found, Exception):
            raise found
        return found

    def read_ahead(self) -> None:
        """Read the next block, or keep the error for when it is asked for."""
        if self._given > 1 and not self._ahead:
            try:
                self._ahead.append(next(self._tables, None))
            except Exception as error:
                self._ahead.append(error)

"""Messages between clutchid and its reader process: a JSON object each, and arrays as they lie in memory.

Nothing that comes from a file is executed, as it could be with pickle; Arrow's stream format copies each column twice
more on either side.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.processes.frames import Parts
from clutchid.recordings.columns import Heading
from clutchid.recordings.source import Places, Raster, Rows, Source, Table, Tables

Message = dict[str, Any]
Arrays = Mapping[str, FloatArray | Rows]

_ROWS = "places"
_TYPES = {"f": np.dtype("=f8"), "i": np.dtype("=i8")}


def encoded(message: Message, arrays: Arrays | None = None) -> Parts:
    """One message, and arrays of floats or integers by name, as parts of bytes."""
    sent = {
        name: np.ascontiguousarray(array, _TYPES["i" if array.dtype.kind in "iu" else "f"])
        for name, array in (arrays or {}).items()
    }
    layout = [(name, array.dtype.kind) for name, array in sent.items()]
    return [json.dumps([message, layout]).encode("ascii"), *(array.data for array in sent.values())]


def decoded(parts: Parts) -> tuple[Message, Arrays]:
    """The message, and the arrays that came with it."""
    message, layout = json.loads(bytes(parts[0]))
    pairs = zip(layout, parts[1:], strict=True)
    arrays: dict[str, Any] = {name: np.frombuffer(part, _TYPES[kind]) for (name, kind), part in pairs}
    return message, arrays


def described(source: Source) -> Message:
    """All of an opened file but the function that reads it."""
    return {
        "format": source.format,
        "rasters": [asdict(replace(raster, size=int(raster.size))) for raster in source.rasters],
        "problems": source.problems,
        "warnings": source.warnings,
        "metadata": dict(source.metadata),
        "unnamed": source.unnamed,
    }


def source_of(message: Message, path: Path, tables: Tables) -> Source:
    """The opened file at `path` that `described` wrote, with the function `tables` to read it."""
    return Source(
        path,
        message["format"],
        tuple(map(_raster, message["rasters"])),
        tables,
        tuple(message["problems"]),
        tuple(message["warnings"]),
        message["metadata"],
        message["unnamed"],
    )


def _raster(message: Message) -> Raster:
    headings = tuple(Heading(**heading) for heading in message["headings"])
    return Raster(**message | {"headings": headings, "others": tuple(map(tuple, message["others"]))})


def packed(table: Table) -> tuple[Message, Arrays]:
    """A table without its headings, which both sides know: a message, and its columns."""
    places = table.places
    arrays: dict[str, FloatArray | Rows] = {str(index): values for index, values in table.numbers.items()}
    if places.numbers is not None:
        arrays[_ROWS] = places.numbers
    message = {
        "size": int(table.size),
        "word": places.word,
        "first": int(places.first),
        "problems": table.problems,
        "unread": {str(index): rows.tolist() for index, rows in table.unread.items()},
        "metadata": dict(table.metadata),
    }
    return message, arrays


def unpacked(message: Message, arrays: Arrays, headings: Sequence[Heading]) -> Table:
    """The table that `packed` wrote."""
    numbers: dict[str, Any] = dict(arrays)
    rows = numbers.pop(_ROWS, None)
    return Table(
        tuple(headings),
        {int(name): values for name, values in numbers.items()},
        message["size"],
        Places(message["word"], message["first"], rows),
        tuple(message["problems"]),
        {int(index): np.array(rows, dtype=np.int64) for index, rows in message["unread"].items()},
        message["metadata"],
    )

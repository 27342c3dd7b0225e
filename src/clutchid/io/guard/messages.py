"""Messages between clutchid and its reader process: a JSON object each, and columns in Arrow's stream format."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from clutchid.io.columns import Heading
from clutchid.io.source import Raster, Source, Tables
from clutchid.io.table import Places, Rows, Table
from clutchid.log import FloatArray

Message = dict[str, Any]

_HEAD = struct.Struct("<QQ")
_ROWS = "places"


def send(stream: IO[bytes], message: Message, columns: bytes = b"") -> None:
    """Write one message.

    Raises
    ------
    OSError
        If the other process has ended.
    """
    text = json.dumps(message).encode("ascii")
    stream.write(_HEAD.pack(len(text), len(columns)))
    stream.write(text)
    stream.write(columns)
    stream.flush()


def receive(stream: IO[bytes]) -> tuple[Message, bytes]:
    """Read one message, and the columns that came with it.

    Raises
    ------
    EOFError
        If the other process has ended.
    """
    sizes = _HEAD.unpack(_exactly(stream, _HEAD.size))
    text, columns = (_exactly(stream, size) for size in sizes)
    return json.loads(text), columns


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data


def described(source: Source) -> Message:
    """All of an opened file but the function that reads it."""
    return {
        "format": source.format,
        "rasters": [_raster_described(raster) for raster in source.rasters],
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


def _raster_described(raster: Raster) -> Message:
    headings = [[h.index, h.text, h.name, h.unit, h.comment] for h in raster.headings]
    return {
        "headings": headings, "size": int(raster.size), "name": raster.name, "clock": raster.clock,
        "others": raster.others,
    }  # fmt: skip


def _raster(message: Message) -> Raster:
    headings = tuple(Heading(*heading) for heading in message["headings"])
    others = tuple((name, what) for name, what in message["others"])
    return Raster(headings, message["size"], message["name"], message["clock"], others)


def packed(table: Table) -> tuple[Message, bytes]:
    """A table without its headings, which both sides know: a message, and its columns."""
    import polars as pl

    places = table.places
    arrays: dict[str, FloatArray | Rows] = {str(index): values for index, values in table.numbers.items()}
    if places.numbers is not None:
        arrays[_ROWS] = places.numbers
    columns = io.BytesIO()
    pl.DataFrame(arrays).write_ipc_stream(columns)
    message = {
        "size": int(table.size),
        "word": places.word,
        "first": int(places.first),
        "problems": table.problems,
        "unread": {str(index): rows.tolist() for index, rows in table.unread.items()},
        "metadata": dict(table.metadata),
    }
    return message, columns.getvalue()


def unpacked(message: Message, columns: bytes, headings: Sequence[Heading]) -> Table:
    """The table that `packed` wrote."""
    import polars as pl

    arrays = {series.name: series.to_numpy() for series in pl.read_ipc_stream(io.BytesIO(columns)).iter_columns()}
    rows = arrays.pop(_ROWS, None)
    return Table(
        tuple(headings),
        {int(index): values for index, values in arrays.items()},
        message["size"],
        Places(message["word"], message["first"], rows),
        tuple(message["problems"]),
        {int(index): np.array(rows, dtype=np.int64) for index, rows in message["unread"].items()},
        message["metadata"],
    )

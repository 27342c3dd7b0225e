"""Write a recording piece by piece while it grows, in constant memory; the file appears whole, at the end."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

import numpy as np

from clutchid.errors import ExportError
from clutchid.io.files import atomic_write, polars_errors
from clutchid.io.formats.parquet.file import KEY
from clutchid.io.table import to_frame
from clutchid.log import Log

#: Numbers in a piece of a Parquet file, and blocks that are joined before: a short one takes more than its numbers.
PIECE, BLOCKS = 1 << 20, 64

#: Suffixes of files that can be written piece by piece.
SPOOLED = (".parquet", ".csv")

Add = Callable[[Log], None]


@contextmanager
def spooled(path: str | PathLike[str]) -> Iterator[Add]:
    """Function that adds a block to a recording, which replaces `path` when the ``with`` block ends without an error.

    On any error what was written is removed, and an existing file stays unchanged. A block without samples defines the
    columns of a recording that stays empty. The metadata are those of the first block.

    Raises
    ------
    ExportError
        If the suffix is not one of `SPOOLED`, or a file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SPOOLED:
        raise ExportError(f"{path}: a recording that is not known whole is written as {' or '.join(SPOOLED)}.")
    with polars_errors(path), atomic_write(path) as temporary:
        make = _as_text if suffix == ".csv" else _as_parquet
        with make(temporary) as add:
            yield add


@contextmanager
def _as_text(path: Path) -> Iterator[Add]:
    import polars as pl

    begun = False
    with path.open("wb") as file:

        def add(block: Log) -> None:
            nonlocal begun
            if len(block) or not begun:
                to_frame(block).with_columns(pl.all().fill_nan(None)).write_csv(file, include_header=not begun)
                begun = True

        yield add


@contextmanager
def _as_parquet(path: Path) -> Iterator[Add]:
    """Blocks are collected to pieces, and pieces to the file at the end."""
    import polars as pl

    with tempfile.TemporaryDirectory(prefix=".clutchid-", dir=path.parent) as folder:
        pieces: list[Path] = []
        held: list[Log] = []
        short: list[Log] = []
        metadata: dict[str, str] = {}
        size = 0

        def write_piece() -> None:
            nonlocal size
            pieces.append(Path(folder) / f"{len(pieces):08d}.parquet")
            to_frame(_joined([*held, *short])).write_parquet(pieces[-1])
            held.clear()
            short.clear()
            size = 0

        def add(block: Log) -> None:
            nonlocal size
            if not metadata:
                metadata[KEY] = json.dumps(dict(block.metadata))
            if len(block) or not (held or short or pieces):
                short.append(block)
                size += len(block) * (1 + len(block.columns))
            if len(short) >= BLOCKS:
                held.append(_joined(short))
                short.clear()
            if size >= PIECE:
                write_piece()

        yield add
        if held or short:
            write_piece()
        if pieces:
            pl.scan_parquet(pieces).sink_parquet(path, metadata=metadata, engine="streaming")


def _joined(blocks: Sequence[Log]) -> Log:
    columns = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0].columns}
    return Log(np.concatenate([block.time for block in blocks]), columns, blocks[0].name)

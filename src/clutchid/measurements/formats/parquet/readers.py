"""The libraries that read Parquet files: polars, and PyArrow for what polars refuses."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from clutchid.messages import shortened

if TYPE_CHECKING:
    import polars as pl


class UnreadParquet(ValueError):
    """A library does not read a file; the text is why, empty where the library only panicked."""


@dataclass(frozen=True, slots=True)
class LibraryReader:
    """A file as a library reads it: types of the columns by name, samples, text of its metadata by key.

    `frames` gives columns by name in consecutive frames of a number of samples, from the start; it raises
    `UnreadParquet`. `unread` are the reasons why single columns cannot be read.
    """

    kinds: Mapping[str, pl.DataType]
    size: int
    metadata: Mapping[str, str]
    frames: Callable[[Sequence[str], int], Iterator[pl.DataFrame]]
    unread: Mapping[str, str] = field(default_factory=dict)


def with_polars(path: Path) -> LibraryReader:
    """The file as polars reads it.

    Raises
    ------
    UnreadParquet
        If polars does not read it.
    """
    import polars as pl

    with _sound(), path.open("rb") as file:
        kinds = dict(pl.read_parquet_schema(file))
        file.seek(0)
        metadata = pl.read_parquet_metadata(file)
        file.seek(0)
        size = int(_scan(file).select(pl.len()).collect().item()) if kinds else 0
    return LibraryReader(kinds, size, metadata, partial(_polars_frames, path, size))


def _polars_frames(path: Path, size: int, columns: Sequence[str], rows: int) -> Iterator[pl.DataFrame]:
    for start in range(0, size, rows):
        with _sound(), path.open("rb") as file:
            frame = _scan(file).select(columns).slice(start, rows).collect()
        yield frame


def _scan(file: BinaryIO) -> pl.LazyFrame:
    """The file as polars reads it piece by piece; its name may be no text, which polars does not take."""
    import polars as pl

    return pl.scan_parquet(file, hive_partitioning=False)


def with_arrow(path: Path) -> LibraryReader:
    """The file as PyArrow reads it; columns of one name get numbers.

    Raises
    ------
    ImportError
        If PyArrow is not installed.
    UnreadParquet
        If PyArrow does not read it.
    """
    parquet = import_module("pyarrow.parquet")
    with _sound(), path.open("rb") as stream:  # PyArrow takes no name that is no text either
        file = parquet.ParquetFile(stream)
        schema, footer = file.schema_arrow, file.metadata
        kinds = dict(zip(_apart(schema.names), map(_kind, schema.types), strict=True))
        size = sum(footer.row_group(i).num_rows for i in range(footer.num_row_groups))
        metadata = {key.decode(): text.decode("utf-8", "replace") for key, text in (footer.metadata or {}).items()}
    return LibraryReader(kinds, size, metadata, partial(_arrow_frames, path))


def _arrow_frames(path: Path, columns: Sequence[str], rows: int) -> Iterator[pl.DataFrame]:
    import polars as pl

    arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    with path.open("rb") as stream:
        with _sound():
            file = parquet.ParquetFile(stream)
            names = dict(zip(_apart(file.schema_arrow.names), file.schema_arrow.names, strict=True))
            batches = file.iter_batches(batch_size=rows, columns=list({names[name] for name in columns}))
        while True:
            with _sound():
                batch = next(batches, None)
                if batch is None:
                    return
                named = arrow.RecordBatch.from_arrays(batch.columns, names=_apart(batch.schema.names))
                frame = pl.DataFrame(named.select(list(columns)))
            yield frame


def _kind(arrow_type: Any) -> pl.DataType:
    """The type in polars; that of objects for what polars does not have."""
    import polars as pl

    try:
        return pl.Series(import_module("pyarrow").array([], arrow_type)).dtype
    except (Exception, pl.exceptions.PanicException):
        return pl.Object()


def _apart(names: Sequence[str]) -> list[str]:
    """
    >>> _apart(["p", "t", "p"])
    ['p', 't', 'p (2)']
    """
    count: Counter[str] = Counter()
    distinct = []
    for name in names:
        count[name] += 1
        distinct.append(name if count[name] == 1 else f"{name} ({count[name]})")
    return distinct


@contextmanager
def _sound() -> Iterator[None]:
    """Errors of the libraries as `UnreadParquet`, and without the standard error, where polars prints panics."""
    import polars as pl

    try:
        with _without_panics():
            yield
    except (MemoryError, ImportError):
        raise
    except pl.exceptions.PanicException as error:
        raise UnreadParquet from error
    except Exception as error:
        raise UnreadParquet(shortened(str(error), 200)) from error


@contextmanager
def _without_panics() -> Iterator[None]:
    try:
        standard_error, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    except OSError:  # there is no standard error
        yield
        return
    try:
        os.dup2(nothing, 2)
        yield
    finally:
        os.dup2(standard_error, 2)
        os.close(standard_error)
        os.close(nothing)

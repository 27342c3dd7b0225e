"""A source copied to a folder of columns: a file is parsed once, and any part of any channel is read at once.

The copy has the numbers as written, so that `look`, the checks and a channel map give the same sentences on it as on
the file. Beside each column lie its least and greatest values over every `BIN` samples.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.source import Source, Table, joined_tables, no_tables

#: Samples whose least and greatest values are kept beside a column; a plot of 1,400 pixels reads at most 360,000.
BIN = 256

#: Bytes of data up to which a time grid is read in one piece, so that every problem is counted once.
WHOLE = 1 << 29

_SOURCE, _TABLES = "source.pickle", "tables.pickle"


def store(
    source: Source, folder: Path, block: int, progress: Callable[[int, int], None] = lambda _done, _all: None
) -> Source:
    """Copy a source into an empty `folder`, and return it as read from there.

    Parameters
    ----------
    source
        An opened file.
    folder
        It is made, and must be the user's own: nobody else may write to it.
    block
        Samples of a large time grid that are in memory at a time.
    progress
        Called with the samples that are copied, and with all.

    Raises
    ------
    DataError
        If the file cannot be read.
    OSError
        If the disk is full.
    """
    folder.mkdir(parents=True, exist_ok=True)
    size, count = sum(raster.size for raster in source.rasters), 0
    tables: list[list[Table]] = []
    for index, raster in enumerate(source.rasters):
        columns = [heading.index for heading in raster.headings]
        rows = None if raster.size * len(columns) * 8 < WHOLE else block
        stored_tables = []
        for table in source.tables(index, columns, rows):
            for column, values in table.numbers.items():
                _append(folder, index, column, values)
            stored_tables.append(replace(table, numbers=dict.fromkeys(table.numbers, np.empty(0))))
            count += table.size
            progress(count, max(size, count))
        for column in {column for table in stored_tables for column in table.numbers}:
            _write_ends(folder, index, column)
        tables.append(stored_tables)
    (folder / _TABLES).write_bytes(pickle.dumps(tables))
    (folder / _SOURCE).write_bytes(pickle.dumps(replace(source, tables=no_tables)))
    return stored(folder)


def stored(folder: Path) -> Source:
    """The source that `store` copied into a folder; only for a folder of the user's own.

    Raises
    ------
    OSError
        If the copy is not there.
    """
    source: Source = pickle.loads((folder / _SOURCE).read_bytes())
    stored_tables: list[list[Table]] = pickle.loads((folder / _TABLES).read_bytes())

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        begin, parts = 0, list[Table]()
        for table in stored_tables[raster]:
            end = begin + table.size
            held = [column for column in columns if column in table.numbers]
            numbers = {column: column_of(folder, raster, column).read(begin, end) for column in held}
            parts.append(replace(table, numbers=numbers))
            begin = end
            if rows is not None:
                yield from parts.pop().parts(rows)
        if rows is None and parts:
            yield joined_tables(parts)

    return replace(source, tables=tables)


@dataclass(frozen=True, slots=True)
class StoredColumn:
    """A column of numbers in a file, and in another one their ends over every `BIN` samples."""

    values: Path
    ends: Path

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.values.stat().st_size // 8

    def read(self, begin: int, end: int) -> FloatArray:
        """The samples from `begin` up to `end`."""
        return np.fromfile(self.values, np.float64, max(end - begin, 0), offset=8 * begin)

    def extremes(self, begin: int, end: int) -> FloatArray:
        """Least and greatest values over the bins from `begin` up to `end`, shape (bins, 2); NaN where none is."""
        return np.fromfile(self.ends, np.float64, 2 * max(end - begin, 0), offset=16 * begin).reshape(-1, 2)


def column_of(folder: Path, raster: int, column: int) -> StoredColumn:
    """The stored column of a time grid, by its index."""
    name = f"{raster}-{column}"
    return StoredColumn(folder / f"{name}.f8", folder / f"{name}.ends")


def write_column(folder: Path, raster: int, column: int, values: FloatArray) -> None:
    """Write a column that was computed, such as a time in s, in place of what stood there."""
    stored_column = column_of(folder, raster, column)
    stored_column.values.unlink(missing_ok=True)
    _append(folder, raster, column, values)
    _write_ends(folder, raster, column)


def _append(folder: Path, raster: int, column: int, values: FloatArray) -> None:
    with column_of(folder, raster, column).values.open("ab") as file:
        np.ascontiguousarray(values, np.float64).tofile(file)


def _write_ends(folder: Path, raster: int, column: int) -> None:
    stored_column = column_of(folder, raster, column)
    step = BIN * 4096
    with stored_column.ends.open("wb") as file:
        for begin in range(0, stored_column.size, step):
            extremes_of(stored_column.read(begin, begin + step), BIN).tofile(file)


def extremes_of(values: FloatArray, width: int) -> FloatArray:
    """Least and greatest of every `width` values, shape (bins, 2); NaN where no value is finite.

    Examples
    --------
    >>> extremes_of(np.array([3.0, 1.0, np.nan, np.nan, 5.0]), 2)
    array([[ 1.,  3.],
           [nan, nan],
           [ 5.,  5.]])
    """
    finite = np.isfinite(values)
    begins = np.arange(0, values.size, width)
    if not begins.size:
        return np.empty((0, 2))
    low = np.minimum.reduceat(np.where(finite, values, np.inf), begins)
    high = np.maximum.reduceat(np.where(finite, values, -np.inf), begins)
    ends: FloatArray = np.column_stack([low, high])
    ends[~np.isfinite(ends).all(axis=1)] = np.nan
    return ends

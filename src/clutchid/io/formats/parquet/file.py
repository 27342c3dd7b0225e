"""Parquet: columns named ``name [unit]``, one row a sample."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchid.io.columns import Heading, headings, shortened
from clutchid.io.formats.parquet.pages import damage
from clutchid.io.source import Raster, Source
from clutchid.io.table import EXAMPLE, Places, Table, to_frame
from clutchid.log import INPUTS, FloatArray, Log

if TYPE_CHECKING:
    import polars as pl

_KEY = "clutchid"

#: Rows in which the first stamp is looked for.
_TELLING = 1000


def open_file(path: Path) -> Source:
    """A Parquet file: one raster, with the metadata of the log that was written.

    Dates with times and times of day are read in seconds from the first, which is in the metadata under ``start``.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    OSError
        If the file cannot be read; what is wrong inside it is in `Source.problems` and `Table.problems`.
    """
    import polars as pl

    if wrong := damage(path):
        return Source(path, "Parquet", (), lambda *_: iter(()), (_damaged(wrong),))
    try:
        with _without_panics(), path.open("rb") as file:
            schema = pl.read_parquet_schema(file)
            file.seek(0)
            metadata = _metadata(pl.read_parquet_metadata(file).get(_KEY))
            size = int(_scan(path).select(pl.len()).collect().item()) if schema else 0
            columns = tuple(map(_heading, headings(schema), schema.values()))
            firsts = _firsts(path, [name for name, kind in schema.items() if kind.is_temporal()])
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, ValueError) as error:
        return Source(path, "Parquet", (), lambda *_: iter(()), (_damaged(error),))
    clock = next((column.index for column in columns if column.name == "time"), None)
    if clock is not None and list(schema)[clock] in firsts:
        metadata["start"] = str(firsts[list(schema)[clock]][1])
    raster = Raster(columns, size, clock=clock)
    origins = {name: origin for name, (origin, _) in firsts.items()}
    tables = partial(_tables, path, raster, list(schema), origins)
    return Source(path, "Parquet", (raster,), tables, metadata=metadata)


@contextmanager
def _without_panics() -> Iterator[None]:
    """A while without standard error, where polars prints what it also raises on damaged files."""
    try:
        kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    except OSError:  # there is no standard error
        yield
        return
    try:
        os.dup2(nothing, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


def _heading(column: Heading, kind: pl.DataType) -> Heading:
    return replace(column, unit="s") if kind.is_temporal() and column.name in (None, "time") else column


def _firsts(path: Path, names: Sequence[str]) -> dict[str, tuple[int, object]]:
    """The first stamp of each of these columns, as the whole number that it is in the file and as it reads."""
    if not names:
        return {}
    frame = _scan(path).select(names).head(_TELLING).collect()
    firsts: dict[str, tuple[int, object]] = {}
    for name in names:
        given = frame[name].drop_nulls()
        if len(given):
            firsts[name] = (int(given.to_physical()[0]), given[0])
    return firsts


def _damaged(error: BaseException | str) -> str:
    return f"is no complete Parquet file ({shortened(str(error), 200)}); copy or write it again."


def _scan(path: Path) -> pl.LazyFrame:
    """The file as polars reads it piece by piece; its name is no pattern, and its folders are no columns."""
    import polars as pl

    return pl.scan_parquet(path, glob=False, hive_partitioning=False)


def _tables(
    path: Path,
    raster: Raster,
    names: Sequence[str],
    origins: Mapping[str, int],
    _raster: int,
    columns: Sequence[int],
    rows: int | None = None,
) -> Iterator[Table]:
    """The tables of the only raster, see `Tables`."""
    import polars as pl

    if names and raster.size == 0:
        yield Table(raster.headings, problems=(f"there are columns, but no samples; {EXAMPLE}",))
        return
    selected = [names[index] for index in columns] or list(names[:1])
    step = max(1, min(rows or raster.size, raster.size))
    for start in range(0, raster.size, step):
        try:
            with _without_panics():
                frame = _scan(path).select(selected).slice(start, step).collect()
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            yield Table(raster.headings, problems=(_damaged(error),))
            return
        yield _table(frame, raster, columns, origins, start)
        if frame.height < min(step, raster.size - start):
            return


def _table(
    frame: pl.DataFrame, raster: Raster, columns: Sequence[int], origins: Mapping[str, int], start: int
) -> Table:
    numbers: dict[int, FloatArray] = {}
    problems = []
    for index, name in zip(columns, frame.columns, strict=False):
        heading = raster.headings[index]
        values = _numbers(heading, frame[name], origins.get(name, 0))
        numbers[index] = np.full(frame.height, np.nan) if values is None else values
        if values is None and heading.name is not None:
            problems.append(
                f"column '{heading.text}' holds {frame[name].dtype} values; write numbers (Float64) in its unit."
            )
    return Table(raster.headings, numbers, frame.height, Places(first=start + 1), tuple(problems))


def _numbers(heading: Heading, series: pl.Series, origin: int) -> FloatArray | None:
    """The column as numbers; None where it holds text, or something that cannot be what its name says."""
    import polars as pl

    kind = series.dtype
    truth = kind == pl.Boolean and heading.name in (None, *INPUTS)
    if kind.is_numeric() or kind == pl.Null or truth:
        return series.cast(pl.Float64).to_numpy()
    if heading.name not in (None, "time") or not isinstance(kind, pl.Datetime | pl.Time | pl.Duration):
        return None
    second = {"ms": 1e3, "us": 1e6, "ns": 1e9}[getattr(kind, "time_unit", None) or "ns"]
    return (series.to_physical() - origin).cast(pl.Float64).to_numpy() / second


def save(log: Log, path: Path) -> None:
    """Write `log` in SI with its metadata; a missing sample is NaN.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    to_frame(log).write_parquet(path, metadata={_KEY: json.dumps(dict(log.metadata))})


def _metadata(text: str | None) -> dict[str, str]:
    """The metadata of the log that was written; none where they are from another program."""
    try:
        values = json.loads(text or "{}")
    except json.JSONDecodeError:
        return {}
    return {str(key): str(value) for key, value in values.items()} if isinstance(values, dict) else {}

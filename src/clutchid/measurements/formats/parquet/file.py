"""Parquet: columns named ``name [unit]``, one row a sample, read by polars.

Columns that hold no numbers are named, and never loaded. polars ends its process on some damaged files, and asks for
more memory than there is for a page that claims too many samples, so files are opened in the guarded process.
"""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchid.log import INPUTS, FloatArray, Log, Samples
from clutchid.measurements.columns import Heading, headings, without_numbers
from clutchid.measurements.source import EXAMPLE, Places, Raster, Source, Table, own_metadata, refused, to_frame
from clutchid.messages import shortened

if TYPE_CHECKING:
    import polars as pl

#: Keys of a log's metadata and edges in the footer.
KEY, _EDGES = "clutchid", "clutchid edges"

#: What polars makes of an INT96 stamp in ns that 64 bits do not hold: before 1677, after 2262.
_BEYOND = 2**63 - 1

#: Rows in which the first stamp is looked for.
_TELLING = 1000

#: Column in which pandas writes an index without a name: the time, if it holds stamps and no other column is the time.
INDEX = "__index_level_0__"

#: What the columns without numbers hold, by the name of their type in polars.
_HELD = {"String": "text", "Categorical": "text", "Enum": "text", "Binary": "bytes", "Date": "dates"} | {
    **{"List": "lists", "Array": "lists", "Struct": "structures", "Map": "maps", "Boolean": "truth values"},
    **{"Datetime": "dates and times", "Time": "times of day", "Duration": "durations"},
}

#: Function that reads columns by name from a first row on, up to a number of rows.
_Rows = Callable[[Sequence[str], int, int], "pl.DataFrame"]


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

    try:
        with path.open("rb") as file:  # polars takes no name that is no text
            kinds = dict(pl.read_parquet_schema(file))
            file.seek(0)
            metadata = pl.read_parquet_metadata(file)
            file.seek(0)
            size = int(pl.scan_parquet(file).select(pl.len()).collect().item()) if kinds else 0
        dates = [name for name, kind in kinds.items() if kind == pl.Datetime("ns")]
        first = _rows(path, kinds, dates, 0, _TELLING)
        kinds |= {name: pl.Datetime("us") for name in dates if (first[name].to_physical() == _BEYOND).any()}
        return _source(path, kinds, size, metadata, partial(_rows, path, kinds))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        return refused(path, "Parquet", _unreadable(error))


def frame_source(frame: pl.DataFrame, name: str) -> Source:
    """A data frame as a file of the same columns."""

    def rows(columns: Sequence[str], start: int, count: int) -> pl.DataFrame:
        return frame.select(columns).slice(start, count)

    return _source(Path(name), frame.schema, frame.height, {}, rows)


def _rows(path: Path, kinds: Mapping[str, pl.DataType], names: Sequence[str], start: int, count: int) -> pl.DataFrame:
    """Rows of columns, whose types may have a coarser unit of stamps than in the file."""
    import polars as pl

    coarser = pl.ScanCastOptions(datetime_cast="nanosecond-downcast")
    with path.open("rb") as file:
        return (
            pl.scan_parquet(file, schema=dict(kinds), cast_options=coarser).select(names).slice(start, count).collect()
        )


def _unreadable(error: BaseException) -> str:
    """Sentence about a file that polars does not read; a panic says nothing to a user."""
    import polars as pl

    if "encrypt" in str(error).lower():
        return "is encrypted; decrypt it with the program that wrote it, or write it again without encryption."
    reason = shortened(str(error), 200) if isinstance(error, pl.exceptions.PolarsError) else "polars cannot read it"
    return (
        f"is not a complete Parquet file, or has columns of a kind that polars cannot read ({reason}); copy it "
        "again, or write its channels as Float64."
    )


def _source(
    path: Path, kinds: Mapping[str, pl.DataType], size: int, written: Mapping[str, str], rows_of: _Rows
) -> Source:
    import polars as pl

    every = dict(zip(kinds, headings(kinds), strict=True))
    timed = any(heading.name == "time" or heading.si == "s" for heading in every.values())
    if not timed and _is_stamp(kinds.get(INDEX)):
        every[INDEX] = replace(every[INDEX], name="time")
    shown = [name for name, heading in every.items() if heading.name is not None or _is_numeric(kinds[name], heading)]
    held = {name: _HELD.get(type(kind).__name__, "values of an unknown type") for name, kind in kinds.items()}
    others = tuple((name, held[name]) for name in every if name not in shown)
    if not shown:
        problem = "holds no column of numbers; write the channels as Float64."
        return refused(path, "Parquet", problem, *without_numbers(others))
    columns = tuple(_heading(replace(every[name], index=i), kinds[name]) for i, name in enumerate(shown))
    stamps = [name for name in shown if kinds[name].is_temporal()]
    firsts = {series.name: series.drop_nulls().head(1) for series in rows_of(stamps, 0, _TELLING)}
    origins = {name: int(first.to_physical().item()) for name, first in firsts.items() if len(first)}
    metadata = own_metadata(written.get(KEY)) or {}
    clock = next((column.index for column in columns if column.name == "time"), None)
    if clock is not None and shown[clock] in origins:
        metadata["start"] = str(firsts[shown[clock]].item())

    def tables(_raster: int, chosen: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        if size == 0:
            yield Table(columns, problems=(f"there are columns, but no samples; {EXAMPLE}",))
            return
        read = {i: shown[i] for i in chosen if _is_numeric(kinds[shown[i]], columns[i])}
        missing = [i for i in chosen if i not in read]
        problems = tuple(
            f"column '{columns[i].text}' holds {held[shown[i]]}; write numbers (Float64) in its unit." for i in missing
        )
        for start in range(0, size, rows or size):
            count = min(rows or size, size - start)
            try:
                frame = rows_of(list(read.values()), start, count)
                if read and frame.height < count:
                    raise pl.exceptions.ComputeError(f"it ends after row {start + frame.height} of {size}")
            except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
                yield Table(columns, problems=(_unreadable(error),))
                return
            numbers = {i: _numbers(frame[name], origins.get(name, 0)) for i, name in read.items()}
            numbers |= {i: np.full(count, np.nan) for i in missing}
            yield Table(columns, numbers, count, Places(first=start + 1), problems)

    warnings, edges = tuple(without_numbers(others)), _edges(written.get(_EDGES))
    raster = Raster(columns, size, clock=clock, others=others)
    return Source(path, "Parquet", (raster,), tables, (), warnings, metadata, edges=edges)


def _heading(column: Heading, kind: pl.DataType) -> Heading:
    """The heading of a column: dates and times are read in seconds, and truth under % is all or nothing."""
    import polars as pl

    if kind == pl.Boolean and column.unit == "%":
        return replace(column, unit="1")
    return replace(column, unit="s") if kind.is_temporal() and column.name in (None, "time") else column


def _is_numeric(kind: pl.DataType, heading: Heading) -> bool:
    """Whether a column of this type can hold what its name says."""
    import polars as pl

    if kind.is_numeric() or kind == pl.Null:
        return True
    if kind == pl.Boolean:
        return heading.name in (None, *INPUTS)
    return heading.name in (None, "time") and _is_stamp(kind)


def _is_stamp(kind: pl.DataType | None) -> bool:
    import polars as pl

    return isinstance(kind, pl.Datetime | pl.Time | pl.Duration)


def _numbers(series: pl.Series, origin: int) -> FloatArray:
    """The samples as numbers; dates and times in seconds from `origin`."""
    import polars as pl

    kind = series.dtype
    if not kind.is_temporal():
        return series.cast(pl.Float64).to_numpy()
    second = {"ms": 1e3, "us": 1e6, "ns": 1e9}[getattr(kind, "time_unit", None) or "ns"]
    return (series.to_physical() - origin).cast(pl.Float64).to_numpy() / second


def save(log: Log, path: Path) -> None:
    """Write `log` in SI with its metadata and edges; a missing sample is NaN.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    metadata = {KEY: json.dumps(dict(log.metadata))}
    if log.edges:
        numbers = {name: [b64encode(a.astype("<f8").tobytes()).decode() for a in s] for name, s in log.edges.items()}
        metadata[_EDGES] = json.dumps(numbers)
    with path.open("wb") as file:  # polars takes no name that is no text
        to_frame(log).write_parquet(file, metadata=metadata)


def _edges(text: str | None) -> dict[str, Samples]:
    """The edges of the log that was written; none where they are damaged or from another program."""
    try:
        every = {
            name: tuple(np.frombuffer(b64decode(part, validate=True), "<f8").astype(np.float64) for part in parts)
            for name, parts in json.loads(text or "{}").items()
        }
    except (ValueError, TypeError, AttributeError):
        return {}
    return {name: (parts[0], parts[1]) for name, parts in every.items() if len(parts) == 2 and name in INPUTS}

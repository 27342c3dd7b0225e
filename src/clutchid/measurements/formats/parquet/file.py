"""Parquet: columns named ``name [unit]``, one row a sample; read by polars, and by PyArrow where polars refuses it.

Columns that hold no numbers are named, and never loaded.
"""

from __future__ import annotations

import json
import os
from base64 import b64decode, b64encode
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from clutchid.errors import install_command
from clutchid.log import INPUTS, FloatArray, Log, Samples
from clutchid.measurements.columns import Heading, headings
from clutchid.measurements.formats.parquet.footer import EncryptedParquet, damage
from clutchid.measurements.source import EXAMPLE, Places, Raster, Source, Table, own_metadata, refused, to_frame
from clutchid.messages import listed, shortened

if TYPE_CHECKING:
    import polars as pl

#: Keys of a log's metadata and edges in the footer.
KEY, _EDGES = "clutchid", "clutchid edges"

#: What polars makes of an INT96 stamp in ns that 64 bits do not hold: before 1677, after 2262.
_BEYOND = 2**63 - 1

#: Rows in which the first stamp is looked for, and columns without numbers that a warning names.
_TELLING = 1000
_SHOWN = 3

_ENCRYPTED = "is encrypted; decrypt it with the program that wrote it, or write it again without encryption."

#: What the columns without numbers hold, by the name of their type in polars.
_HELD = {"String": "text", "Categorical": "text", "Enum": "text", "Binary": "bytes", "Date": "dates"} | {
    **{"List": "lists", "Array": "lists", "Struct": "structures", "Map": "maps", "Boolean": "truth values"},
    **{"Datetime": "dates and times", "Time": "times of day", "Duration": "durations"},
}


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
        dates = [name for name, kind in kinds.items() if kind == pl.Datetime("ns")]
        first = _scan(file).select(dates).head(_TELLING).collect() if dates else pl.DataFrame()
    beyond = [name for name in dates if (first[name].to_physical() == _BEYOND).any()]
    kinds |= dict.fromkeys(beyond, pl.Datetime("us"))
    return LibraryReader(kinds, size, metadata, partial(_polars_frames, path, size, kinds if beyond else None))


def _polars_frames(
    path: Path, size: int, kinds: Mapping[str, pl.DataType] | None, columns: Sequence[str], rows: int
) -> Iterator[pl.DataFrame]:
    for start in range(0, size, rows):
        with _sound(), path.open("rb") as file:
            frame = _scan(file, kinds).select(columns).slice(start, rows).collect()
        yield frame


def _scan(file: BinaryIO, kinds: Mapping[str, pl.DataType] | None = None) -> pl.LazyFrame:
    """The file as polars reads it piece by piece; its name may be no text, which polars does not take.

    `kinds` are its types where stamps are read in a coarser unit than polars takes by itself.
    """
    import polars as pl

    if kinds is None:
        return pl.scan_parquet(file, hive_partitioning=False)
    coarser = pl.ScanCastOptions(datetime_cast="nanosecond-downcast")
    return pl.scan_parquet(file, hive_partitioning=False, schema=dict(kinds), cast_options=coarser)


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
        file = parquet.ParquetFile(stream, coerce_int96_timestamp_unit="us")
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
            file = parquet.ParquetFile(stream, coerce_int96_timestamp_unit="us")  # in ns it wraps before 1677
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


def _is_read(file: LibraryReader, name: str, heading: Heading) -> bool:
    return name not in file.unread and _is_numeric(file.kinds[name], heading)


def _held(file: LibraryReader, name: str) -> str:
    """Kind of the samples of a column that is not read."""
    if name in file.unread:
        return f"numbers that cannot be read: {file.unread[name]}"
    return _HELD.get(type(file.kinds[name]).__name__, "values of an unknown type")


def promised_bytes(path: Path) -> int | None:
    """Bytes that the columns of numbers in a Parquet file take in memory; None where its footer cannot be read."""
    try:
        reader = with_polars(path)
    except (UnreadParquet, OSError):
        return None
    return 8 * reader.size * sum(kind.is_numeric() or kind.is_temporal() for kind in reader.kinds.values())


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
    try:
        try:
            return _source(path, _opened(path))
        except UnreadParquet as error:
            return refused(path, "Parquet", _damaged(damage(path, ()) or str(error)))
    except EncryptedParquet:
        return refused(path, "Parquet", _ENCRYPTED)


def frame_source(frame: pl.DataFrame, name: str) -> Source:
    """A data frame as a file of the same columns."""

    def frames(columns: Sequence[str], rows: int) -> Iterator[pl.DataFrame]:
        return frame.select(columns).iter_slices(max(rows, 1))

    return _source(Path(name), LibraryReader(frame.schema, frame.height, {}, frames))


def _damaged(reason: str) -> str:
    return f"is no complete Parquet file ({reason or 'its pages are damaged'}); copy or write it again."


def _opened(path: Path) -> LibraryReader:
    """The file as polars reads it, or as PyArrow where polars refuses it, or columns of it.

    Raises
    ------
    UnreadParquet
        If neither reads it.
    """
    file, reason = None, ""
    try:
        file = _with(path, with_polars)
        if not file.unread and (file.size or not file.kinds):
            return file
    except UnreadParquet as error:
        reason = str(error)
    try:
        other = _with(path, with_arrow)
    except ImportError:
        reason += f"; PyArrow may read it: {install_command('parquet')}"
    except UnreadParquet:
        pass
    else:
        if file is None or len(other.unread) < len(file.unread) or other.size > file.size:
            return other
    if file is None:
        raise UnreadParquet(reason.removeprefix("; "))
    return file


def _with(path: Path, library: Callable[[Path], LibraryReader]) -> LibraryReader:
    """The file as a library reads it, with the columns of which it cannot read the first sample.

    Raises
    ------
    UnreadParquet
        If it can read none, or the pages are damaged.
    """
    reader = library(path)
    names = [name for name, kind in reader.kinds.items() if kind.is_numeric() or kind.is_temporal()]
    if wrong := damage(path, names):
        raise UnreadParquet(wrong)
    unread = _unread(reader, names)
    for name in names if unread else ():
        unread |= _unread(reader, [name])
    if names and len(unread) == len(names):
        raise UnreadParquet(next(iter(unread.values())))
    return replace(reader, unread=unread)


def _unread(reader: LibraryReader, names: Sequence[str]) -> dict[str, str]:
    """Reason why the first sample of these columns cannot be read; empty where it can."""
    try:
        next(reader.frames(names, 1), None)
    except UnreadParquet as error:
        return dict.fromkeys(names, str(error) or "its pages are damaged")
    return {}


def _source(path: Path, file: LibraryReader) -> Source:
    kinds = file.kinds
    every = dict(zip(kinds, headings(kinds), strict=True))
    shown = [name for name, heading in every.items() if heading.name is not None or _is_read(file, name, heading)]
    others = tuple((name, _held(file, name)) for name in every if name not in shown)
    unread = listed((f"'{shortened(name)}' ({held})" for name, held in others), _SHOWN)
    left = f"({len(others)}): {unread}"
    if not shown:
        problem = f"holds no column of numbers, only others {left}; write the channels as Float64."
        return refused(path, "Parquet", problem)
    columns = tuple(_heading(replace(every[name], index=i), kinds[name]) for i, name in enumerate(shown))
    firsts = _firsts(file, [name for name in shown if kinds[name].is_temporal() and name not in file.unread])
    metadata = own_metadata(file.metadata.get(KEY)) or {}
    clock = next((column.index for column in columns if column.name == "time"), None)
    if clock is not None and shown[clock] in firsts:
        metadata["start"] = str(firsts[shown[clock]][1])
    raster = Raster(columns, file.size, clock=clock, others=others)
    origins = {name: origin for name, (origin, _) in firsts.items()}

    def tables(_raster: int, chosen: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        if raster.size == 0:
            yield Table(columns, problems=(f"there are columns, but no samples; {EXAMPLE}",))
            return
        read = {i: shown[i] for i in chosen if _is_read(file, shown[i], columns[i])}
        missing = [i for i in chosen if i not in read]
        problems = tuple(
            f"column '{columns[i].text}' holds {_held(file, shown[i])}; write numbers (Float64) in its unit."
            for i in missing
        )
        try:
            for start, frame in _frames(file, list(read.values()), raster.size, rows or raster.size):
                numbers = {i: _numbers(frame[name], origins.get(name, 0)) for i, name in read.items()}
                numbers |= {i: np.full(frame.height, np.nan) for i in missing}
                yield Table(columns, numbers, frame.height, Places(first=start + 1), problems)
        except UnreadParquet as error:
            yield Table(columns, problems=(_damaged(str(error)),))

    warnings = (f"left out columns without numbers {left}.",) if others else ()
    edges = _edges(file.metadata.get(_EDGES))
    return Source(path, "Parquet", (raster,), tables, (), warnings, metadata, edges=edges)


def _heading(column: Heading, kind: pl.DataType) -> Heading:
    """The heading of a column: dates and times are read in seconds, and truth under % is all or nothing."""
    import polars as pl

    if kind == pl.Boolean and column.unit == "%":
        return replace(column, unit="1")
    return replace(column, unit="s") if kind.is_temporal() and column.name in (None, "time") else column


def _firsts(reader: LibraryReader, names: Sequence[str]) -> dict[str, tuple[int, object]]:
    """The first stamp of each of these columns, as the whole number that it is in the file and as it reads."""
    firsts: dict[str, tuple[int, object]] = {}
    frame = next(reader.frames(names, _TELLING), None) if names else None
    if frame is None:
        return firsts
    for name in names:
        stamps = frame[name].drop_nulls()
        if len(stamps):
            firsts[name] = (int(stamps.to_physical()[0]), stamps[0])
    return firsts


def _frames(reader: LibraryReader, names: Sequence[str], size: int, rows: int) -> Iterator[tuple[int, pl.DataFrame]]:
    """Consecutive frames of these columns with the number of their first row; of none, frames of rows alone."""
    import polars as pl

    if not names:
        for start in range(0, size, rows):
            yield start, pl.DataFrame({"": np.zeros(min(rows, size - start), np.int8)})
        return
    start = 0
    for frame in reader.frames(names, min(rows, size)):
        yield start, frame
        start += frame.height


def _is_numeric(kind: pl.DataType, heading: Heading) -> bool:
    """Whether a column of this type can hold what its name says."""
    import polars as pl

    if kind.is_numeric() or kind == pl.Null:
        return True
    if kind == pl.Boolean:
        return heading.name in (None, *INPUTS)
    return heading.name in (None, "time") and isinstance(kind, pl.Datetime | pl.Time | pl.Duration)


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

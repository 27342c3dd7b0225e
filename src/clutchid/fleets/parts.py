"""The table of recordings: Parquet parts by date, to which every run appends, and from which its index can be made.

A part is named by its content, so that writing it twice is writing it once. Small parts of a date are folded into one.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.errors import DataError
from clutchid.fleets.storage import PARTS_FOLDER, Storage
from clutchid.fleets.store import Store, StoredRow
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.wear.columns import LOAD_COLUMNS, METADATA, NUMBER_COLUMNS, SIDES, TEXT_COLUMNS, banded, reading_columns
from clutchid.wear.history import dated

if TYPE_CHECKING:
    import polars as pl

#: Value of an unknown date in the name of a folder, as Hive, Spark, DuckDB and Polars have it.
_NO_DATE = "__HIVE_DEFAULT_PARTITION__"

#: Rows of a part that is not folded with others of its date.
_FULL = 1000

#: Positions in mm at which the table has the load.
PLACES = (5, 6, 7, 8)

#: The name of a part in its place.
_PART = re.compile(rf"{PARTS_FOLDER}/date=([^/]+)/part-[0-9a-f]+\.parquet")


def _columns() -> dict[str, Any]:
    """Columns of a recording by type: text, number, whole number, time or truth."""
    loads = [f"{name}{side}_N" for name in (*(f"load_{place}mm" for place in PLACES), "peak") for side in SIDES]
    return {
        "vehicle": str, "type": str, "recording": str, "begin": datetime, "odometer_km": float, "strokes": float,
        "is_recording": bool, **dict.fromkeys((*TEXT_COLUMNS, "reason"), str),
        **dict.fromkeys((*loads, *NUMBER_COLUMNS), float),
        **dict.fromkeys(("calibration", "calibration_sha256", "version"), str), "read_at": datetime,
        "written_at": datetime, "wall_s": float, "processor_s": float, "host": str, "worker": int, "attempt": int,
    }  # fmt: skip


#: Column of the record from which the row of the index is made again.
_RECORD = "record"


def schema(tags: Iterable[str] = (), *, whole: bool = True) -> dict[str, Any]:
    """Columns of the table with the types of Polars, in their order; without loads and record if it is not `whole`."""
    import polars as pl

    kinds = {
        str: pl.String, float: pl.Float64, bool: pl.Boolean, int: pl.Int64, datetime: pl.Datetime("us", "UTC"),
    }  # fmt: skip
    rest = {**dict.fromkeys(LOAD_COLUMNS, pl.List(pl.Float64)), _RECORD: pl.String} if whole else {}
    return {name: kinds[kind] for name, kind in _columns().items()} | dict.fromkeys(sorted(tags), pl.String) | rest


def recordings_frame(rows: Sequence[StoredRow], *, whole: bool = True) -> pl.DataFrame:
    """Rows of the table for rows of the index; without loads and records if it is not to be `whole`."""
    import polars as pl

    records = [_record(row, whole=whole) for row in rows]
    tags = {name for record in records for name in record if name.startswith("tag_")}
    return pl.DataFrame(records, schema(tags, whole=whole), orient="row").fill_nan(None)


def _record(row: StoredRow, *, whole: bool) -> dict[str, Any]:
    reading, inputs = row.result, json.loads(row.inputs or "[]")
    job = dated(row.job, reading.clock)
    wall, processor, host, worker, attempt = json.loads(row.timing)
    start, made = inputs[:2] if inputs else (None, None)
    return {
        "vehicle": row.vehicle, "type": job.type or None, "recording": row.recording, "begin": job.begin,
        "odometer_km": job.odometer, "strokes": job.strokes, "is_recording": not reading.apart,
        **reading_columns(reading), "reason": reading.unmeasured, **_loads(reading.curve),
        "calibration": row.calibration or None, "calibration_sha256": start,
        "version": made["clutchid"] if made else None, "read_at": _instant(row.read_at),
        "written_at": datetime.now(UTC) if whole else None, "wall_s": wall, "processor_s": processor, "host": host,
        "worker": worker, "attempt": attempt or None, **{f"tag_{name}": value for name, value in job.tags},
        **(_whole(row, reading.curve) if whole else {}),
    }  # fmt: skip


def _instant(text: str) -> datetime | None:
    return datetime.fromisoformat(text) if text else None


def _loads(curve: LoadCurve | None) -> dict[str, float]:
    """The load at `PLACES` that it reaches, and its peak, with the intervals there."""
    if curve is None or not np.isfinite(curve.force).any():
        return {}
    position, *sides = curve.table().T
    peak = int(np.nanargmax(curve.force))
    numbers = banded("peak", [float(side[peak]) for side in sides], "_N")
    for place in PLACES:
        if 1e-3 * place <= position[-1]:
            loads = [float(np.interp(1e-3 * place, position, side)) for side in sides]
            numbers |= banded(f"load_{place}mm", loads, "_N")
    return numbers


def _whole(row: StoredRow, curve: LoadCurve | None) -> dict[str, Any]:
    """The points of a load, and what else the row of the index is."""
    points = curve.table().T.tolist() if curve else [None] * 4
    record = [row.inputs, row.file, row.reading, row.place, row.timing, row.date, row.read_at]
    return dict(zip(LOAD_COLUMNS, points, strict=True)) | {_RECORD: json.dumps(record)}


def _restored(row: Mapping[str, Any]) -> StoredRow:
    """The row of the index for one of the table."""
    inputs, file, reading, place, timing, date, read_at = json.loads(row[_RECORD])
    points = [row[name] for name in LOAD_COLUMNS]
    curve = None if points[0] is None else np.array(points, dtype="<f8").tobytes()
    return StoredRow(
        row["vehicle"], row["recording"], inputs, file, row["status"], row["sha256"] or "", reading, curve, place,
        timing, date, read_at,
    ).with_checksum()  # fmt: skip


def part_content(frame: pl.DataFrame) -> bytes:
    """A table as Parquet, with the version of its columns in the metadata."""
    content = io.BytesIO()
    frame.write_parquet(content, metadata=METADATA)
    return content.getvalue()


def _part_name(date: str, rows: Iterable[str]) -> str:
    """Name of a part of a date, by the checksums of its rows."""
    key = hashlib.sha256(" ".join(rows).encode()).hexdigest()[:16]
    return f"{PARTS_FOLDER}/date={date or _NO_DATE}/part-{key}.parquet"


def _read_part(storage: Storage, name: str, *, whole: bool = True) -> pl.DataFrame:
    """The rows of a part, without loads and records if it is not to be `whole`.

    Raises
    ------
    DataError
        If it cannot be read, or has other columns.
    """
    import polars as pl

    try:
        rows = pl.scan_parquet(io.BytesIO(storage.read(name)))
        kinds = rows.collect_schema()
        needed = {column: kind for column, kind in schema().items() if column in _NEEDED}
        wrong = [column for column, kind in needed.items() if kinds.get(column) != kind]
        if not wrong:
            return (rows if whole else rows.drop(*LOAD_COLUMNS, _RECORD)).collect()
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).partition("\n")[0][:160]
        raise DataError(f"{name}: cannot be read as a part of the table ({reason}); {_DELETE}") from error
    columns = ", ".join(wrong)
    raise DataError(f"{name}: is no part of this table ({columns} is missing or of another type); {_DELETE}")


#: Parts that are read at the same time, and that are read ahead.
_TOGETHER, _AHEAD = 16, 128


def _read_parts(storage: Storage, names: Sequence[str]) -> Iterator[tuple[str, pl.DataFrame]]:
    """Parts with their names in this order, by threads, since most of the time an answer of the storage is awaited."""
    with ThreadPoolExecutor(_TOGETHER) as pool:
        for first in range(0, len(names), _AHEAD):
            some = names[first : first + _AHEAD]
            yield from zip(some, pool.map(partial(_read_part, storage), some), strict=True)


#: Columns of a part that the index needs.
_NEEDED = ("vehicle", "recording", "status", "sha256", "written_at", *LOAD_COLUMNS, _RECORD)

#: Way out of a part that cannot be used.
_DELETE = "move it away, so that its recordings are read again."


def adopt(store: Store, storage: Storage) -> None:
    """Take into the index the rows of parts that it does not know: of another process, or after the index was lost.

    Of several rows of a recording the newest counts. What was in parts that are gone, and is in no other one, is
    written again.
    """
    names, indexed = {name for name in storage.names(f"{PARTS_FOLDER}/") if _PART.fullmatch(name)}, store.parts()
    store.lose_parts(indexed.keys() - names)
    if not names - indexed.keys():
        return
    newest = {key: (entry.read_at, "" if entry.part in names else _LOST) for key, entry in store.keys().items()}
    last = 0.0
    for name, table in _read_parts(storage, sorted(names - indexed.keys())):
        rows = []
        for entry in table.iter_rows(named=True):
            row = _restored(entry)
            key, age = row[:2], (row.read_at, entry["written_at"].isoformat())
            before = newest.get(key)
            if before is None or age[0] > before[0] or (age[0] == before[0] and "" < before[1] < age[1]):
                newest[key] = age
                rows.append(row._replace(part=name))
        store.put(rows)
        store.set_part(name, table.height)
        last = store.saved(last)


#: Age of a row whose part is gone, below that of every part.
_LOST = "0"


def write_once(row: StoredRow, storage: Storage) -> None:
    """Write a row as a part of its own, which is there already where the same file was read with the same inputs."""
    name = _part_name(row.date, [row.vehicle, row.recording, row.sha256 or row.file, row.inputs])
    storage.write(name, part_content(recordings_frame([row])), once=True)


def append(store: Store, storage: Storage, *, fold: bool = True) -> bool:
    """Write the rows that are in no part yet, a part a date; with `fold`, small parts of a date become one.

    Whether a part was written.
    """
    before = store.parts()
    for date, rows in groupby(store.pending(), key=lambda row: row.date):
        some = list(rows)
        name = _part_name(date, [row.checksum for row in some])
        storage.write(name, part_content(recordings_frame(some)))
        store.set_part(name, len(some), [row[:2] for row in some])
        store.saved()
    if fold:
        _fold(store, storage)
    return store.parts() != before


def _fold(store: Store, storage: Storage) -> None:
    """Fold the small parts of a date into one, of which a run that ends in between leaves nothing twice."""
    import polars as pl

    small: dict[str, list[str]] = defaultdict(list)
    for name, count in store.parts().items():
        if count < _FULL and (match := _PART.fullmatch(name)):
            small[match[1]].append(name)
    for date, names in small.items():
        if len(names) > 1:
            tables = [table for _, table in _read_parts(storage, names)]
            table = pl.concat(tables, how="diagonal_relaxed").sort("vehicle", "recording", "written_at")
            folded = table.unique(["vehicle", "recording", _RECORD], keep="last", maintain_order=True)
            content = map(str, folded.select("vehicle", "recording", _RECORD).rows())
            name = _part_name("" if date == _NO_DATE else date, content)
            storage.write(name, part_content(folded))
            store.set_part(name, folded.height, old=[other for other in names if other != name])
            store.saved()
            storage.delete([other for other in names if other != name])


def rows_in_parts(storage: Storage, keys: Mapping[str, Sequence[tuple[str, str]]]) -> Iterator[pl.DataFrame]:
    """The rows of the table by part, vehicle and recording, without loads; of parts that are not there none."""
    import polars as pl

    for name, own in keys.items():
        table = _read_part(storage, name, whole=False)
        wanted = pl.DataFrame(own, {"vehicle": pl.String, "recording": pl.String}, orient="row")
        rows = table.join(wanted, on=["vehicle", "recording"], how="semi", maintain_order="left")
        yield rows.unique(["vehicle", "recording"], keep="last", maintain_order=True)

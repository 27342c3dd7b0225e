"""The tables of a fleet: results, times and loads of recordings, and the wear of each vehicle."""

from __future__ import annotations

import hashlib
import json
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import groupby, islice, tee
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents import FleetWear, WornClutch, document_of, write_page
from clutchid.documents.fleet_tables import ReasonCount, VehicleRow
from clutchid.documents.wear_rows import alarm_words
from clutchid.files import atomic_write, digest, make_folder, write_frame
from clutchid.fleets.cluster import version_and_source
from clutchid.fleets.jobs import Fleet, stamp_of
from clutchid.fleets.store import RecordingRow, Store
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.systems import is_device
from clutchid.verbs.tracking import load_frame, table_of
from clutchid.verbs.wear_reading import counted_once
from clutchid.wear.history import RecordingJob, WearReading, arranged
from clutchid.wear.life import UNKNOWN_INTERVAL, LifeLimits, Wear, wear_of
from clutchid.wear.trend import Interval

if TYPE_CHECKING:
    import polars as pl

#: Files of a run, beside the store.
RESULTS, _TIMINGS, CURVES = "results.parquet", "timings.parquet", "curves"

#: Recordings in one file of loads.
_PART = 1000


#: A recording that was not read.
_UNREAD = WearReading("failed", "was not read; run the same command again to go on.")


def recording_rows(fleet: Fleet, store: Store) -> Iterator[RecordingRow]:
    """Every recording of a fleet in the order of vehicle and name; duplicates count once."""
    merged, again = tee(_merged(fleet.jobs, store.results()))
    named = ((f"{row.job.recording} of {row.job.vehicle}", row.reading) for row in again)
    for row, reading in zip(merged, counted_once(named), strict=True):
        yield row._replace(reading=reading)


#: Why the reading of a file that is gone is not used.
_OTHER_CALIBRATION = (
    "the file is gone, and was read from another calibration than that of today, so that its change cannot be compared."
)


def _merged(jobs: Iterable[RecordingJob], stored: Iterator[RecordingRow]) -> Iterator[RecordingRow]:
    """Jobs with their results, both in the same order; other results are skipped."""

    def key(job: RecordingJob) -> tuple[str, str]:
        return job.vehicle, job.recording

    hashed = cache(digest)
    row = next(stored, None)
    for job in jobs:
        while row is not None and key(row.job) < key(job):
            row = next(stored, None)
        if row is not None and key(row.job) == key(job) and (row.reading.has_result or not job.problem):
            stamp = stamp_of(job.path) if job.path else ""
            gone = row.reading.has_result and (not stamp or row.job.file not in ("", stamp))
            if gone and job.start and not row.job.inputs.startswith(f'["{hashed(job.start)}"'):
                clock, sha256, curve = row.reading.clock, row.reading.sha256, row.reading.curve
                reading = WearReading("warning", _OTHER_CALIBRATION, clock=clock, sha256=sha256, curve=curve)
                row = row._replace(reading=reading)
            yield row._replace(job=job, file_gone=gone)
        elif job.problem:
            yield RecordingRow(job, WearReading("bad_input", job.problem, apart=True))
        else:
            yield RecordingRow(job, _UNREAD)


def _with_warnings(rows: Iterable[RecordingRow]) -> Iterator[RecordingRow]:
    """Recordings with what is missing or contradicts in their times."""
    for own in _by_vehicle(rows):
        history = arranged([row.job for row in own], [row.reading for row in own])
        yield from (row._replace(job=job) for row, job in zip(own, history.dated, strict=True))


def _by_vehicle(rows: Iterable[RecordingRow]) -> Iterator[list[RecordingRow]]:
    return (list(own) for _, own in groupby(rows, key=lambda row: row.job.vehicle))


def write_results(fleet: Fleet, store: Store, out: Path, *, trends: bool = False) -> tuple[Counter[str], int]:
    """Write results, times and loads of all recordings; how many there are by status, and whose files are gone.

    With `trends` a recording also has the warnings about its time, which is its place in the life of its vehicle.

    Raises
    ------
    ExportError
        If a file cannot be written; an existing one is then unchanged.
    """
    import polars as pl

    statuses: Counter[str] = Counter()
    results: list[Mapping[str, object]] = []
    timings: list[tuple[str | float | None, ...]] = []
    gone = 0
    make_folder(out / CURVES)
    rows, part = recording_rows(fleet, store), 0
    rows = _with_warnings(rows) if trends else rows
    while some := list(islice(rows, _PART)):
        statuses.update(row.reading.status for row in some)
        gone += sum(row.file_gone for row in some)
        results += map(_result, some)
        timings += [(row.job.recording, row.job.vehicle, *row.timing) for row in some]
        keys = {what: [getattr(row.job, what) for row in some] for what in ("recording", "vehicle")}
        write_frame(load_frame(keys, [row.reading.curve for row in some]), out / CURVES / f"part-{part:05d}.parquet")
        part += 1
    for old in sorted((out / CURVES).glob("part-*.parquet"))[part:]:
        old.unlink()
    table = pl.DataFrame(results, schema_overrides=dict.fromkeys(_TEXT, pl.String), infer_schema_length=None)
    write_frame(table.fill_nan(None), out / RESULTS)
    write_frame(pl.DataFrame(timings, _TIMED, orient="row").fill_nan(None), out / _TIMINGS)
    return statuses, gone


#: Columns of text that may be empty throughout.
_TEXT = ("changes", "sha256", "message", "reason", "warnings")

#: Columns of the cost of recordings.
_TIMED = {
    "recording": str, "vehicle": str, "wall_s": float, "processor_s": float, "host": str, "worker": int, "attempt": int,
}  # fmt: skip


def _result(row: RecordingRow) -> Mapping[str, object]:
    reading, nothing = row.reading, (float("nan"),) * 3
    peak = _peak(reading.curve) if reading.curve else nothing
    half = tuple(1e3 * value for value in reading.half_load)
    measured = reading.measurement
    shift, load = (measured[0:2], measured[2:4]) if measured else (nothing, nothing)
    return {
        "recording": row.job.recording, "vehicle": row.job.vehicle, "type": row.job.type,
        "is_recording": not reading.apart, "status": reading.status, "message": reading.message, "trust": reading.trust,
        "peak_N": peak[0], "peak_low_N": peak[1], "peak_high_N": peak[2],
        "half_load_mm": half[0], "half_load_low_mm": half[1], "half_load_high_mm": half[2],
        "shift_mm": 1e3 * shift[0], "shift_std_mm": 1e3 * shift[1],
        "load_change": load[0], "load_change_std": load[1],
        "temperature_K": measured.temperature if measured else float("nan"),
        "changes": ", ".join(reading.changes), "sha256": reading.sha256, "reason": reading.unmeasured,
        "file_gone": row.file_gone, "warnings": " ".join(row.job.warnings),
    }  # fmt: skip


def _peak(curve: LoadCurve) -> tuple[float, float, float]:
    """Largest load in N, with the band there."""
    if not np.isfinite(curve.force).any():
        return (float("nan"),) * 3
    at = int(np.nanargmax(curve.force))
    return float(curve.force[at]), float(curve.low[at]), float(curve.high[at])


#: Files of a run, and the folder of the pages of its vehicles, with what each was made from.
WEAR, VEHICLES, _INDEX, _PAGES, _MADE = "wear.parquet", "vehicles.parquet", "index.html", "vehicles", "made.json"

#: Parts of a sentence that belong to one recording only: names in quotes, paths, and numbers.
_PARTICULAR = re.compile(r"'[^']*'|\S*[/\\]\S*|\b\d[\d.,]*\b")

#: Bytes of the name of a page, beside its mark and its suffix: most systems have 255 for all, some fewer.
_LONGEST_NAME = 120

#: Length of a reason.
_LONGEST = 160


def vehicles_of(fleet: Fleet, store: Store, limits: Callable[[RecordingJob], LifeLimits]) -> Iterator[Wear]:
    """The wear of every vehicle of a fleet, from its results.

    Parameters
    ----------
    limits
        What ends the life of the vehicle of a recording.
    """
    for rows in _by_vehicle(recording_rows(fleet, store)):
        jobs, job = [row.job for row in rows], rows[0].job
        yield wear_of(job.vehicle, jobs, [row.reading for row in rows], limits(job))


def write_vehicles(vehicles: Iterable[Wear], command: str, out: Path, *, trends: bool) -> list[VehicleRow]:
    """Write the page of the fleet, and with `trends` the tables and pages of its vehicles, whose rows are returned.

    A vehicle's page is only made anew if something of it has changed.

    Raises
    ------
    ExportError
        If a file cannot be written; an existing one is then unchanged.
    """
    import polars as pl

    rows: list[VehicleRow] = []
    reasons: dict[tuple[str, str], list[str]] = {}
    tables: list[pl.DataFrame] = []
    made: dict[str, str] = {}
    names: set[str] = set()
    before = _made(out / _PAGES)
    for wear in vehicles:
        page = ""
        if trends:
            table = table_of(wear)
            tables.append(table)
            page = f"{_PAGES}/{_page_name(wear.vehicle, names)}.html"
            made[page] = _write_page(wear, table, before, command, out, page)
        rows.append(_row(wear, page))
        _add_reasons(wear, reasons)
    if trends:
        write_frame(pl.concat(tables, how="diagonal_relaxed"), out / WEAR)
        text = dict.fromkeys(("alarms", "warnings"), pl.String)
        table = pl.DataFrame([_listed(row) for row in rows], schema_overrides=text)
        write_frame(table.fill_nan(None), out / VEHICLES)
        with atomic_write(out / _PAGES / _MADE) as temporary:
            temporary.write_text(json.dumps(made), encoding="utf-8")
    write_page(document_of(FleetWear(rows, _reasons(reasons)), command), out / _INDEX)
    return rows


def _made(folder: Path) -> Mapping[str, str]:
    """Hashes of the content of an earlier run's pages."""
    try:
        hashes = json.loads((folder / _MADE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return hashes if isinstance(hashes, dict) else {}


def _page_name(vehicle: str, taken: set[str]) -> str:
    """A file name for a vehicle, unique on any system; it is added to `taken`.

    A name that cannot be that of a file, or differs from another one by case only, is marked by its checksum.
    """
    name = re.sub(r"[^\w.-]", "_", vehicle).encode()[:_LONGEST_NAME].decode(errors="ignore")
    if name != vehicle or name.startswith(".") or is_device(name) or _same(name) in taken:
        name = f"{'_' if is_device(name) else ''}{name.lstrip('.')}-{hashlib.sha256(vehicle.encode()).hexdigest()[:8]}"
    taken.add(_same(name))
    return name


def _same(name: str) -> str:
    """Common form of file names that are one on some systems: they differ in case, or in composed letters."""
    return unicodedata.normalize("NFC", name).casefold()


def _write_page(
    wear: Wear, table: pl.DataFrame, before: Mapping[str, str], command: str, out: Path, address: str
) -> str:
    """Write the page of a vehicle if its content has changed; the hash of the content."""
    make_folder(out / _PAGES)
    content = json.dumps([version_and_source(), table.to_dicts(), repr(wear.left), wear.warnings], default=str)
    digest = hashlib.sha256(content.encode()).hexdigest()
    if before.get(address) != digest or not (out / address).exists():
        write_page(document_of(WornClutch(wear, home=f"../{_INDEX}"), command), out / address)
    return digest


def _row(wear: Wear, page: str) -> VehicleRow:
    """The state of a vehicle at its last recording."""
    counted = sum(wear.counted)
    now = wear.present if counted else {}
    left = Interval(wear.left.median, wear.left.low, wear.left.high) if wear.left else UNKNOWN_INTERVAL
    last = next((job.begin for job in reversed(wear.dated) if job.begin), None)
    return VehicleRow(
        wear.vehicle, wear.rows[0].job.type, wear.recordings, counted,
        Counter(row.reading.status for row in wear.rows if not row.reading.apart), last,
        now.get("shift", UNKNOWN_INTERVAL), now.get("load", UNKNOWN_INTERVAL), now.get("wear", UNKNOWN_INTERVAL),
        wear.present_rate.value, left, wear.axis,
        tuple(map(alarm_words, wear.alarms)), page, np.nan if wear.limit is None else wear.limit,
        wear.warnings,
    )  # fmt: skip


def _listed(row: VehicleRow) -> Mapping[str, object]:
    """A vehicle as a row of a table."""

    def columns(name: str, band: Interval, factor: float = 1.0, unit: str = "") -> Mapping[str, float]:
        return {f"{name}{side}{unit}": factor * value for side, value in zip(("", "_low", "_high"), band, strict=True)}

    return {
        "vehicle": row.name, "type": row.type, "recordings": row.recordings, "counted": row.counted,
        "last": row.last.isoformat() if row.last else None, "axis": row.axis,
        **columns("shift", row.shift, 1e3, "_mm"), **columns("wear", row.wear, 1e3, "_mm"),
        **columns("load_change", row.load), **columns("left", row.left), "alarms": "; ".join(row.alarms),
        "warnings": " ".join(row.warnings),
    }  # fmt: skip


def _add_reasons(wear: Wear, reasons: dict[tuple[str, str], list[str]]) -> None:
    """Count reasons why recordings do not count, without names and numbers of single recordings."""
    for row in wear.rows:
        if row.reason:
            sentence = _PARTICULAR.sub("…", row.reason.splitlines()[0])
            reasons.setdefault((row.reading.status, sentence[:_LONGEST]), []).append(row.job.recording)


def _reasons(reasons: Mapping[tuple[str, str], Sequence[str]]) -> list[ReasonCount]:
    """The most frequent first."""
    counts = [ReasonCount(status, sentence, len(names), names[0]) for (status, sentence), names in reasons.items()]
    return sorted(counts, key=lambda count: -count.recordings)

"""The tables and pages of a fleet: its recordings, its vehicles, and the wear of each vehicle."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.documents import FleetWear, WornClutch, document_of, write_page
from clutchid.documents.fleet_tables import ReasonCount, VehicleRow
from clutchid.documents.wear_rows import alarm_words
from clutchid.files import make_folder, write_bytes
from clutchid.fleets.alarm_table import ALARM_LIST, alarm_list, list_words
from clutchid.fleets.cluster import version_and_source
from clutchid.fleets.forecasts import FleetForecast, TypeRow
from clutchid.fleets.jobs import key_of
from clutchid.fleets.parts import part_content, recordings_frame, rows_in_parts, schema
from clutchid.fleets.plan import RecordingKey, RecordingState, readings_of
from clutchid.fleets.storage import Storage
from clutchid.fleets.store import Store, StoredRow, place_of, stored_row
from clutchid.systems import is_device
from clutchid.verbs.tracking import write_tracked
from clutchid.verbs.wear_reading import later_calibrations
from clutchid.wear import Alarm
from clutchid.wear.columns import SIDES, banded
from clutchid.wear.due import WITHIN_DAYS, WITHIN_KM
from clutchid.wear.history import RecordingJob
from clutchid.wear.life import UNKNOWN_INTERVAL, LifeLimits, Wear, to_estimate, wear_of
from clutchid.wear.trend import Interval

if TYPE_CHECKING:
    import polars as pl

#: Files of a run beside its index, and the folder of the files of its vehicles.
RESULTS, VEHICLES, TYPES, REPLACEMENTS, _INDEX, _FILES = (
    "results.parquet", "vehicles.parquet", "types.parquet", "replacements.parquet", "index.html", "vehicles",
)  # fmt: skip

#: Most recordings of which a table is written in one file without being asked for.
MOST_ROWS = 100_000


def write_results(states: Sequence[RecordingState], store: Store, storage: Storage, out: Path) -> None:
    """Write the newest row of every recording: those of its parts, and of what was not read why.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing one is then unchanged.
    """
    write_bytes(part_content(results_table(states, store, storage)), out / RESULTS)


def results_table(states: Sequence[RecordingState], store: Store, storage: Storage) -> pl.DataFrame:
    """A row a recording in the order of vehicle and name; see `write_results`."""
    import polars as pl

    parts: dict[str, list[RecordingKey]] = defaultdict(list)
    special = []
    for vehicle, own in _by_vehicle(states):
        for state in own:
            if state.entry and state.is_plain:
                parts[state.entry.part].append((vehicle, state.job.recording))
        if not all(state.is_plain for state in own):
            rows = zip(own, readings_of(own, store), strict=True)
            special += [stored_row(state.job, reading) for state, reading in rows if not state.is_plain]
    tables = [recordings_frame(special, whole=False), *rows_in_parts(storage, parts)]
    table = pl.concat(tables, how="diagonal_relaxed")
    keys = [(*key_of(state.job), state.file_gone) for state in states]
    listed = pl.DataFrame(keys, {"vehicle": pl.String, "recording": pl.String, "file_gone": pl.Boolean}, orient="row")
    table = listed.join(table, on=["vehicle", "recording"], how="left", maintain_order="left")
    tags = [name for name in table.columns if name.startswith("tag_")]
    return table.select(*schema(tags, whole=False), "file_gone")


def _by_vehicle(states: Sequence[RecordingState]) -> Iterator[tuple[str, list[RecordingState]]]:
    return ((vehicle, list(own)) for vehicle, own in itertools.groupby(states, key=lambda state: state.job.vehicle))


#: Parts of a sentence that belong to one recording only: names in quotes, paths, and numbers.
_PARTICULAR = re.compile(r"'[^']*'|\S*[/\\]\S*|\b\d[\d.,]*\b")

#: Bytes of the name of a page, beside its mark and its suffix: most systems have 255 for all, some fewer.
_LONGEST_NAME = 120

#: Length of a reason.
_LONGEST = 160


def vehicles_of(
    states: Sequence[RecordingState],
    store: Store,
    limits: Callable[[RecordingJob], LifeLimits],
    command: str,
    out: Path,
    *,
    trends: bool,
) -> list[VehicleRow]:
    """The vehicles of a fleet; with `trends` also their files: page, trend and loads.

    Only those of which something is new are made again, from the readings of the index.

    Parameters
    ----------
    limits
        What ends the life of the vehicle of a recording.

    Raises
    ------
    ExportError
        If a file cannot be written; an existing one is then unchanged.
    """
    before, after = store.vehicles(), {}
    names: set[str] = set()
    vehicles = []
    for vehicle, own in _by_vehicle(states):
        limit, name = limits(own[0].job), _file_name(vehicle, names)
        file = f"{_FILES}/{name}" if trends else ""
        made, earlier = _hash(own, limit, file), before.get(vehicle)
        if earlier and earlier[0] == made and (not file or (out / f"{file}.html").exists()):
            after[vehicle] = earlier
            vehicles.append(_restored(earlier[1]))
            continue
        wear = _wear(own, store, limit)
        if file:
            _write_vehicle(WornClutch(wear, home=f"../{_INDEX}"), command, out / file)
        row = _row(wear, f"{file}.html" if file else "")
        after[vehicle] = made, json.dumps(row, default=_packed)
        vehicles.append(row)
    store.put_vehicles(after)
    return vehicles


def to_read_again(
    states: Sequence[RecordingState], store: Store, limits: Callable[[RecordingJob], LifeLimits]
) -> list[RecordingJob]:
    """The observed recordings that are to be estimated, of the vehicles of which something is new."""
    before, jobs = store.vehicles(), []
    names: set[str] = set()
    for vehicle, own in _by_vehicle(states):
        limit, file = limits(own[0].job), f"{_FILES}/{_file_name(vehicle, names)}"
        if before.get(vehicle, ("",))[0] != _hash(own, limit, file):
            again = {job.recording for job in to_estimate(_wear(own, store, limit))}
            jobs += [state.job for state in own if state.job.recording in again and not state.file_gone]
    return jobs


def _wear(states: Sequence[RecordingState], store: Store, limit: LifeLimits) -> Wear:
    """The wear of a vehicle; of calibrations that hold from a date, later ones have an offset in its trend."""
    jobs = [state.job for state in states]
    starts = sorted({job.start for job in jobs if job.start}, key=lambda path: path.name)
    later = later_calibrations(starts) if len(starts) > 1 else {}
    return wear_of(jobs[0].vehicle, jobs, readings_of(states, store), limit, later=later)


def _hash(states: Sequence[RecordingState], limit: LifeLimits, file: str) -> str:
    """Hash of what the state of a vehicle is made from."""
    recordings = [
        (state.job.recording, state.job.problem, place_of(state.job), state.entry and _result(state.entry), *state[2:])
        for state in states
    ]
    tables = None if limit.table is None else [side.tolist() for side in limit.table]
    made = json.dumps([version_and_source(), limit.shift, tables, file, recordings], default=str)
    return hashlib.sha256(made.encode()).hexdigest()


def _result(entry: StoredRow) -> tuple[str, ...]:
    """Identity of a reading, whatever the stamp of its file."""
    return entry.inputs, entry.sha256, entry.status, entry.read_at


def _write_vehicle(clutch: WornClutch, command: str, path: Path) -> None:
    """Write trend and loads of a vehicle as `clutchid track` does, then its page, whose presence says that all are."""
    make_folder(path.parent)
    write_tracked(clutch, path.with_name(f"{path.name}.parquet"))
    write_page(document_of(clutch, command), path.with_name(f"{path.name}.html"))


def _packed(value: object) -> object:
    if isinstance(value, datetime):
        return value.isoformat()
    raise TypeError(value)


def _instant(text: object) -> datetime | None:
    return datetime.fromisoformat(text) if isinstance(text, str) else None


def _restored(text: str) -> VehicleRow:
    """The row of a vehicle from its text."""
    row = VehicleRow(*json.loads(text))  # without a forecast, which is made anew with those of the other vehicles
    return row._replace(
        last=_instant(row.last), shift=Interval(*row.shift),
        load=Interval(*row.load), wear=Interval(*row.wear), left=Interval(*row.left), alarms=tuple(row.alarms),
        warnings=tuple(row.warnings), reasons=tuple(ReasonCount(*reason) for reason in row.reasons),
        tags=tuple((name, value) for name, value in row.tags),
        left_days=UNKNOWN_INTERVAL, left_km=UNKNOWN_INTERVAL, within=(), by_month=(),
        events=tuple(alarm._replace(begin=_instant(alarm.begin)) for alarm in itertools.starmap(Alarm, row.events)),
    )  # fmt: skip


def write_tables(fleet: FleetForecast, command: str, out: Path, *, trends: bool, false_share: float = 0.1) -> str:
    """Write the page of a fleet, and with `trends` the tables of all but its recordings; listed alarms, in words.

    Raises
    ------
    ExportError
        If a file cannot be written; an existing one is then unchanged.
    """
    import polars as pl

    rows = fleet.rows
    if trends:
        tags = dict.fromkeys(sorted({f"tag_{name}" for row in rows for name, _ in row.tags}), pl.String)
        for file, schema_of, listed in (
            (VEHICLES, _vehicle_schema() | tags, map(_listed, rows)),
            (TYPES, _type_schema(), map(_listed_type, fleet.types)),
            (
                REPLACEMENTS,
                _replacement_schema(),
                (dict(zip(_replacement_schema(), row, strict=True)) for row in fleet.replacements),
            ),
        ):
            table = pl.DataFrame(list(listed), schema=schema_of, orient="row")
            write_bytes(part_content(table.fill_nan(None)), out / file)
        alarms = alarm_list(rows, false_share)
        write_bytes(part_content(alarms), out / ALARM_LIST)
    write_page(document_of(FleetWear(rows, _reasons(rows), fleet.replacements), command), out / _INDEX)
    return list_words(alarms) if trends else ""


def _file_name(vehicle: str, taken: set[str]) -> str:
    """A name for the files of a vehicle, unique on any system; it is added to `taken`.

    A name that no file can have, or that differs from another by case only, is marked by its checksum.
    """
    name = re.sub(r"[^\w.-]", "_", vehicle).encode()[:_LONGEST_NAME].decode(errors="ignore")
    if name != vehicle or name.startswith(".") or is_device(name) or _same(name) in taken:
        name = f"{'_' if is_device(name) else ''}{name.lstrip('.')}-{hashlib.sha256(vehicle.encode()).hexdigest()[:8]}"
    taken.add(_same(name))
    return name


def _same(name: str) -> str:
    """Common form of file names that are one on some systems: they differ in case, or in composed letters."""
    return unicodedata.normalize("NFC", name).casefold()


def _row(wear: Wear, page: str) -> VehicleRow:
    """The state of a vehicle at its last recording."""
    counted = sum(wear.counted)
    now = wear.present if counted else {}
    left = Interval(wear.left.median, wear.left.low, wear.left.high) if wear.left else UNKNOWN_INTERVAL
    last = next((job.begin for job in reversed(wear.dated) if job.begin), None)
    jobs = [*(job for job, _ in wear.apart), *wear.dated]  # those that have a place in its life say what holds last
    return VehicleRow(
        wear.vehicle, wear.rows[0].job.type, wear.recordings, counted,
        Counter(row.reading.status for row in wear.rows if not row.reading.apart), last,
        now.get("shift", UNKNOWN_INTERVAL), now.get("load", UNKNOWN_INTERVAL), now.get("wear", UNKNOWN_INTERVAL),
        wear.present_rate.value, left, wear.axis,
        tuple(map(alarm_words, wear.alarms)), page, np.nan if wear.limit is None else wear.limit,
        wear.warnings, _reasons_of(wear), tuple({name: value for job in jobs for name, value in job.tags}.items()),
        _pool(wear.rows[0].job), "shift" if wear.end_of_table is None else "wear",
        wear.evidence.packed if wear.evidence else "", events=(*wear.alarms, *wear.suspects),
    )  # fmt: skip


def _pool(job: RecordingJob) -> str:
    """The vehicles that are forecast together: of a type, or else of a calibration."""
    return job.type or (job.start.stem if job.start else "")


#: Axes of lives that have a unit, and the name of one.
_AXES = {"strokes": "stroke", "km": "km", "days": "day"}


#: Columns of the probabilities to reach the limit within a horizon.
WITHIN = (
    *(f"p_within_{km:.0f}_km" for km in WITHIN_KM), *(f"p_within_{days:.0f}_days" for days in WITHIN_DAYS),
)  # fmt: skip


def _type_schema() -> dict[str, Any]:
    """Columns of the table of types; medians of vehicles with their 90 % spread."""
    import polars as pl

    bands = [f"rate_mm_per_{span}" for span in _AXES.values()]
    bands += [f"{axis}_per_{use}" for use in ("day", "km") for axis in _AXES if axis[:3] != use[:3]]
    return {
        "type": pl.String, "vehicles": pl.Int64, "is_learnt": pl.Boolean, "axis": pl.String,
        **{f"{name}{side}": pl.Float64 for name in bands for side in SIDES},
        "noise_share": pl.Float64, "walk_share": pl.Float64,
    }  # fmt: skip


def _listed_type(row: TypeRow) -> dict[str, object]:
    """A type as a row of a table."""
    numbers: dict[str, object] = {}
    if row.axis in _AXES:
        numbers |= banded(f"rate_mm_per_{_AXES[row.axis]}", row.rate, factor=1e3)
        numbers |= banded(f"{row.axis}_per_day", row.per_day) | banded(f"{row.axis}_per_km", row.per_km)
    own = {"type": row.name, "vehicles": row.vehicles, "is_learnt": row.learnt, "axis": row.axis}
    columns = _type_schema()
    shares = {"noise_share": row.noise, "walk_share": row.walk}
    return own | {name: value for name, value in numbers.items() if name in columns} | shares


def _replacement_schema() -> dict[str, Any]:
    """Columns of the table of replacements."""
    import polars as pl

    numbers = dict.fromkeys(("expected", "low", "high"), pl.Float64)
    return {"tag": pl.String, "value": pl.String, "month": pl.Int64, **numbers}


def _vehicle_schema() -> dict[str, Any]:
    """Columns of the table of vehicles with the types of Polars."""
    import polars as pl

    bands = [*((name, "_mm") for name in ("shift", "wear")), ("load_change", "_percent")]
    bands += [(f"left_{axis}", "") for axis in _AXES]
    return {
        "vehicle": pl.String, "type": pl.String, "recordings": pl.Int64, "counted": pl.Int64,
        "last": pl.Datetime("us", "UTC"), "axis": pl.String,
        **{f"{name}{side}{unit}": pl.Float64 for name, unit in bands for side in SIDES},
        **dict.fromkeys(WITHIN, pl.Float64),
        **{f"rate_mm_per_{span}": pl.Float64 for span in _AXES.values()}, "limit_mm": pl.Float64,
        **dict.fromkeys(("alarms", "warnings", "file"), pl.String),
    }  # fmt: skip


def _listed(row: VehicleRow) -> Mapping[str, object]:
    """A vehicle as a row of a table."""
    own = row.axis in _AXES
    return {
        "vehicle": row.name, "type": row.type or None, "recordings": row.recordings, "counted": row.counted,
        "last": row.last, "axis": row.axis, **banded("shift", row.shift, "_mm", 1e3),
        **banded("wear", row.wear, "_mm", 1e3), **banded("load_change", row.load, "_percent", 100.0),
        **(banded(f"left_{row.axis}", row.left) if own else {}),
        **({f"rate_mm_per_{_AXES[row.axis]}": 1e3 * row.rate} if own else {}),
        **({f"left_{name}{end}": side for name, band in (("days", row.left_days), ("km", row.left_km))
            for end, side in zip(SIDES, band, strict=True)} if row.within else {}),
        **dict(zip(WITHIN, row.within, strict=False)),
        "limit_mm": 1e3 * row.limit, "alarms": "; ".join(row.alarms), "warnings": " ".join(row.warnings),
        "file": row.page.removesuffix(".html"), **{f"tag_{name}": value for name, value in row.tags},
    }  # fmt: skip


def _reasons_of(wear: Wear) -> tuple[ReasonCount, ...]:
    """Reasons why recordings do not count, without names and numbers of single recordings."""
    recordings: dict[tuple[str, str], list[str]] = defaultdict(list)
    for row in wear.rows:
        if row.reason:
            sentence = _PARTICULAR.sub("…", row.reason.splitlines()[0])
            recordings[row.reading.status, sentence[:_LONGEST]].append(row.job.recording)
    return tuple(ReasonCount(*reason, len(names), names[0]) for reason, names in recordings.items())


def _reasons(rows: Sequence[VehicleRow]) -> list[ReasonCount]:
    """Those of all vehicles, the most frequent first."""
    counts: dict[tuple[str, str], ReasonCount] = {}
    for row in rows:
        for reason in row.reasons:
            first = counts.get(reason[:2])
            counts[reason[:2]] = reason if first is None else first._replace(recordings=first[2] + reason.recordings)
    return sorted(counts.values(), key=lambda count: -count.recordings)

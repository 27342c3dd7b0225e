"""The vehicles of a fleet: the wear of each, their tables, and pages."""

from __future__ import annotations

import hashlib
import json
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from clutchid.fleets.jobs import Fleet
from clutchid.fleets.output import rows_of
from clutchid.fleets.store import Store
from clutchid.fleets.tracking import Limits, Tracked, table_of
from clutchid.fleets.version import version_and_source
from clutchid.recordings.files import atomic_write, make_folder, write_frame
from clutchid.reports.fleet_page import fleet_page
from clutchid.reports.fleet_values import Reason, VehicleRow
from clutchid.reports.wear_page import wear_page
from clutchid.reports.wear_text import alarm_words
from clutchid.wear.history import arranged
from clutchid.wear.life import wear_of

#: Files of a run, and the folder of the pages of its vehicles, with what each was made from.
WEAR, VEHICLES, INDEX, PAGES, MADE = "wear.parquet", "vehicles.parquet", "index.html", "vehicles", "made.json"

#: What a sentence says of one recording only: names in quotes, paths, and numbers.
_PARTICULAR = re.compile(r"'[^']*'|\S*[/\\]\S*|\b\d[\d.,]*\b")

#: A value with its band, of which nothing is known.
UNKNOWN = (float("nan"), float("nan"), float("nan"))

#: Bytes of the name of a page, beside its mark and its suffix: most systems have 255 for all, some fewer.
_LONGEST_NAME = 120

#: Length of a reason.
_LONGEST = 160


class Vehicle(NamedTuple):
    """A vehicle of a fleet: its type, and its wear."""

    type: str
    tracked: Tracked


def vehicles_of(fleet: Fleet, kept: Store, limits: Mapping[str, Limits]) -> Iterator[Vehicle]:
    """The wear of every vehicle of a fleet, from its results.

    Parameters
    ----------
    limits
        What ends a life, by type.
    """
    for vehicle, group in groupby(rows_of(fleet, kept), key=lambda row: row.job.vehicle):
        rows = list(group)
        table = {row.job.recording: fleet.rows[vehicle, row.job.recording] for row in rows if fleet.rows}
        reads = [row.read for row in rows]
        history = arranged([row.job.recording for row in rows], [read.clock for read in reads], table)
        kind = rows[0].job.type
        wear = wear_of(vehicle, history, [read.reading for read in reads], limits[kind].table, limits[kind].shift)
        yield Vehicle(kind, Tracked(wear, tuple(reads[i] for i in history.order)))


def write_vehicles(vehicles: Iterable[Vehicle], command: str, out: Path, *, trends: bool) -> int:
    """Write the page of the fleet, and with `trends` the tables and pages of its vehicles; the number of vehicles.

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
    before = _made(out / PAGES)
    for one in vehicles:
        page = ""
        if trends:
            table = table_of(one.tracked)
            tables.append(table)
            page = f"{PAGES}/{_page_name(one.tracked.wear.vehicle, names)}.html"
            made[page] = _write_page(one.tracked, table, before, command, out, page)
        rows.append(_row(one, page))
        _add_reasons(one.tracked, reasons)
    if trends:
        write_frame(pl.concat(tables, how="diagonal_relaxed"), out / WEAR)
        write_frame(
            pl.DataFrame([_listed(row) for row in rows], schema_overrides={"alarms": pl.String}), out / VEHICLES
        )
        with atomic_write(out / PAGES / MADE) as temporary:
            temporary.write_text(json.dumps(made), encoding="utf-8")
    fleet_page(rows, _reasons(reasons), command, out / INDEX)
    return len(rows)


def _made(folder: Path) -> Mapping[str, str]:
    """What the pages of an earlier run were made from."""
    try:
        found = json.loads((folder / MADE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _page_name(vehicle: str, taken: set[str]) -> str:
    """The name of a file for a vehicle, which no other one has, on any system; it is added to those that are `taken`.

    A name that cannot be that of a file, or differs from another one by case only, is marked by its checksum.
    """
    name = re.sub(r"[^\w.-]", "_", vehicle).encode()[:_LONGEST_NAME].decode(errors="ignore")
    if name != vehicle or name.startswith(".") or _same(name) in taken:
        name = f"{name.lstrip('.')}-{hashlib.sha256(vehicle.encode()).hexdigest()[:8]}"
    taken.add(_same(name))
    return name


def _same(name: str) -> str:
    """What names of files have in common that are one on some systems: case, and how letters are composed."""
    return unicodedata.normalize("NFC", name).casefold()


def _write_page(
    tracked: Tracked, table: object, before: Mapping[str, str], command: str, out: Path, address: str
) -> str:
    """What the page of a vehicle is made from; made, unless it was made from the same."""
    make_folder(out / PAGES)
    content = json.dumps([version_and_source(), table.to_dicts(), repr(tracked.wear.left)], default=str)  # type: ignore[attr-defined]
    digest = hashlib.sha256(content.encode()).hexdigest()
    if before.get(address) != digest or not (out / address).exists():
        wear_page(tracked.wear, tracked.curves, command, out / address, home=f"../{INDEX}")
    return digest


def _row(one: Vehicle, page: str) -> VehicleRow:
    """The state of a vehicle at its last recording."""
    wear = one.tracked.wear
    counted = sum(wear.counted)

    def now(name: str) -> tuple[float, float, float]:
        band = wear.then.get(name)
        return (float(band.value[-1]), float(band.low[-1]), float(band.high[-1])) if band and counted else UNKNOWN

    rates = wear.rate.get("wear") or wear.rate["shift"]
    rate = float(rates.value[-1]) if counted else float("nan")
    last = next((dated.begin for dated in reversed(wear.dated) if dated.begin), None)
    return VehicleRow(
        wear.vehicle, one.type, len(wear.dated), counted, Counter(reading.status for reading in wear.readings), last,
        *now("shift"), *now("load"), *now("wear"), rate, *(wear.left or UNKNOWN), wear.axis,
        tuple(map(alarm_words, wear.alarms)), page, float("nan") if wear.limit is None else wear.limit,
    )  # fmt: skip


def _listed(row: VehicleRow) -> Mapping[str, object]:
    """A vehicle as a row of a table."""
    lengths = {f"{name}{side}_mm": 1e3 * getattr(row, f"{name}{side}") for name in ("shift", "wear") for side in _SIDES}
    return {
        "vehicle": row.name, "type": row.type, "recordings": row.recordings, "counted": row.counted,
        "last": row.last.isoformat() if row.last else None, "axis": row.axis, **lengths,
        **{f"load_change{side}": getattr(row, f"load{side}") for side in _SIDES},
        **{f"left{side}": getattr(row, f"left{side}") for side in _SIDES}, "alarms": "; ".join(row.alarms),
    }  # fmt: skip


_SIDES = ("", "_low", "_high")


def _add_reasons(tracked: Tracked, reasons: dict[tuple[str, str], list[str]]) -> None:
    """Count why recordings do not count, without what is particular to one of them."""
    wear = tracked.wear
    for dated, reading, reason in zip(wear.dated, wear.readings, wear.reasons, strict=True):
        if reason:
            sentence = _PARTICULAR.sub("…", reason.splitlines()[0])
            reasons.setdefault((reading.status, sentence[:_LONGEST]), []).append(dated.name)


def _reasons(reasons: Mapping[tuple[str, str], Sequence[str]]) -> list[Reason]:
    """The most frequent first."""
    found = [Reason(status, sentence, len(names), names[0]) for (status, sentence), names in reasons.items()]
    return sorted(found, key=lambda one: -one.recordings)

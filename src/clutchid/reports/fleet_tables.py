"""Tables of a fleet: by type, the worst, the odd, the reasons, and every vehicle."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from clutchid.names import printable
from clutchid.reports.fleet_odd import MARKS, Odd
from clutchid.reports.fleet_values import (
    Reason,
    Spans,
    VehicleRow,
    has_reading,
    left_shown,
    quantiles,
    quantity_of,
    rate_shown,
)
from clutchid.reports.link import Link
from clutchid.reports.style import MM
from clutchid.reports.tables import Cell, Column, Table
from clutchid.wear.settings import LIFE

#: Rows of the tables of the worst, of one kind of the odd, of types and of reasons, at most.
WORST, ODD, TYPES, REASONS = 20, 12, 30, 40


def worst_table(vehicles: Sequence[VehicleRow], spans: Spans) -> Table:
    """The vehicles with the least left, then the most worn ones; first what is left, by which they are sorted."""
    known = sorted(filter(has_reading, vehicles), key=_worst)[:WORST]
    quantities = _quantities(known)
    columns = [Column("vehicle", "vehicle"), Column("type", "type"), *_left_columns(known, spans)]
    columns += [column for name, banded in quantities.items() for column in _columns(name, banded=banded)]
    columns += [Column("load [1]", "now", 0.01, 1, group="load [%]"), _band_column("load", "load [%]")]
    columns.append(_rate_column(known, spans))
    rows = [
        (
            _link(one), printable(one.type), *_left_cells(one, known, spans),
            *(cell for name, banded in quantities.items() for cell in _cells(one, name, banded=banded)),
            *_banded(one, "load", 0.01, 1), rate_shown(one, spans),
        )
        for one in known
    ]  # fmt: skip
    return Table(
        f"The worst {len(known)} of {len(vehicles):,} vehicles", tuple(columns), tuple(rows), note=_note(spans)
    )


def all_table(vehicles: Sequence[VehicleRow], odd: Sequence[Odd], spans: Spans) -> Table:
    """Every vehicle, by name."""
    marks: dict[int, list[str]] = defaultdict(list)
    for each in odd:
        marks[id(each.vehicle)].append(each.mark)
    ordered = sorted(vehicles, key=lambda one: _natural(one.name))
    quantities = _quantities(vehicles)
    columns = [
        Column("vehicle", "vehicle"), Column("type", "type"), Column("last", "last"),
        Column("recordings", "all", decimals=0, group="recordings"),
        Column("counted", "counted", decimals=0, group="recordings"),
    ]  # fmt: skip
    columns += [column for name, banded in quantities.items() for column in _columns(name, banded=banded)]
    columns += [
        Column("load [1]", "load\n[%]", 0.01, 1), _rate_column(vehicles, spans), *_left_columns(vehicles, spans),
        Column("odd", "odd"),
    ]  # fmt: skip
    rows = [
        (
            _link(one), printable(one.type), f"{one.last:%Y-%m-%d}" if one.last else None,
            one.recordings, one.counted,
            *(cell for name, banded in quantities.items() for cell in _cells(one, name, banded=banded)),
            one.load, rate_shown(one, spans), *_left_cells(one, vehicles, spans), ", ".join(marks[id(one)]),
        )
        for one in ordered
    ]  # fmt: skip
    return Table("All vehicles", tuple(columns), tuple(rows), note=_note(spans))


def odd_tables(odd: Sequence[Odd]) -> list[Table]:
    """The oddest vehicles and why, a table a mark."""
    columns = (Column("vehicle", "vehicle"), Column("type", "type"), Column("reason", "why"))
    found = []
    for mark, meaning in MARKS.items():
        members = [one for one in odd if one.mark == mark]
        rows = tuple((_link(one.vehicle), printable(one.vehicle.type), one.reason) for one in members[:ODD])
        number = f"{len(rows)} of {len(members):,}" if len(members) > ODD else f"{len(rows)}"
        if rows:
            found.append(Table(f"{mark[:1].upper()}{mark[1:]}, {meaning}: {number}", columns, rows))
    return found


def reasons_table(reasons: Sequence[Reason]) -> Table:
    """Why recordings do not count, the most frequent reason first."""
    columns = (
        Column("status", "status"), Column("recordings", "recordings", decimals=0), Column("reason", "reason"),
        Column("example", "for example"),
    )  # fmt: skip
    ordered = sorted(reasons, key=lambda reason: -reason.recordings)
    rows = [(one.status, one.recordings, printable(one.sentence), printable(one.example)) for one in ordered[:REASONS]]
    rest = ordered[REASONS:]
    more = f"{len(rest):,} rarer reasons, of {sum(one.recordings for one in rest):,} recordings, are left out here."
    total = sum(reason.recordings for reason in reasons)
    return Table(f"{total:,} recordings by reason", columns, tuple(rows), note=more if rest else "")


def types_table(vehicles: Sequence[VehicleRow], spans: Spans) -> Table:
    """A row a type of vehicle: how many, and how wear, its rate and what is left are distributed."""
    name = quantity_of(vehicles)
    groups: dict[str, list[VehicleRow]] = defaultdict(list)
    for one in vehicles:
        groups[one.type].append(one)
    columns = (
        Column("type", "type"), Column("vehicles", "vehicles", decimals=0),
        Column("reading", "with a\nreading", decimals=0),
        *(Column(f"{name} {share} [m]", f"{share} %", MM, 3, group=f"{name} [mm]") for share in (5, 50, 95)),
        Column(f"rate [m per {spans.rate_words}]", f"median rate\n[mm per {spans.rate_words}]", MM, 3),
        Column("left", f"median left\n[{spans.left_words}]", decimals=0),
        Column("limit [m]", f"limit of\n{name} [mm]", MM, 2),
    )  # fmt: skip
    largest = sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    rows: list[tuple[Cell, ...]] = [
        (
            printable(type_) or "none given", len(members), sum(map(has_reading, members)),
            *quantiles([getattr(one, name) for one in members], (0.05, 0.5, 0.95)),
            *quantiles([rate_shown(one, spans) for one in members], (0.5,)),
            *quantiles([left_shown(one, spans)[1] for one in members], (0.5,)),
            *quantiles([one.limit for one in members], (0.5,)),
        )
        for type_, members in largest[:TYPES]
    ]  # fmt: skip
    more = f"{len(largest) - TYPES:,} smaller types are left out here." if len(largest) > TYPES else ""
    return Table("By type, with quantiles over its vehicles", columns, tuple(rows), note=more)


def _worst(one: VehicleRow) -> tuple[float, float, float, float]:
    """Sorts by what is left, in lives, then by wear and shift."""
    life = LIFE[one.axis]
    left = [np.inf if np.isnan(value) else value / life for value in (one.left, one.left_low)]
    return left[0], left[1], -np.nan_to_num(one.wear), -abs(np.nan_to_num(one.shift))


def _quantities(vehicles: Sequence[VehicleRow]) -> dict[str, bool]:
    """Lengths to show, each with its band: that of the shift only where the wear of a vehicle is not known."""
    wear, shift = (np.isfinite([getattr(one, name) for one in vehicles]) for name in ("wear", "shift"))
    shown = {"wear": True} if wear.any() else {}
    return {**shown, "shift": bool((shift & ~wear).any())} if shift.any() else shown


def _columns(name: str, *, banded: bool) -> tuple[Column, ...]:
    """A length now, and its band."""
    value = Column(f"{name} [m]", "now", MM, 3, group=f"{name} [mm]")
    return (value, _band_column(name, value.group)) if banded else (value,)


def _cells(one: VehicleRow, name: str, *, banded: bool) -> tuple[Cell, ...]:
    return _banded(one, name, MM, 3) if banded else (getattr(one, name),)


def _band_column(name: str, group: str) -> Column:
    return Column(f"{name} band", "95 % band", group=group)


def _banded(one: VehicleRow, name: str, scale: float, decimals: int) -> tuple[Cell, Cell]:
    """A value and its band in words."""
    low, high = getattr(one, f"{name}_low"), getattr(one, f"{name}_high")
    return getattr(one, name), _range(low, high, Column("", "", scale, decimals))


def _range(low: float, high: float, column: Column) -> str | None:
    if np.isnan(low) or np.isnan(high):
        return None
    return f"{column.shown(low)} to {column.shown(high)}".replace(" ", "\N{NO-BREAK SPACE}")


def _rate_column(vehicles: Sequence[VehicleRow], spans: Spans) -> Column:
    heading = f"rate of\n{quantity_of(vehicles)}\n[mm per\n{spans.rate_words.replace(' ', chr(10))}]"
    return Column(f"rate [m per {spans.rate_words}]", heading, MM, 3)


def _left_columns(vehicles: Sequence[VehicleRow], spans: Spans) -> list[Column]:
    """Two columns where a limit is known."""
    if all(np.isnan(one.left) for one in vehicles):
        return []
    group = f"left [{spans.left_words}]"
    return [Column("left", "median", decimals=0, group=group), Column("left band", "90 % band", group=group)]


def _left_cells(one: VehicleRow, vehicles: Sequence[VehicleRow], spans: Spans) -> tuple[Cell, ...]:
    if not _left_columns(vehicles, spans):
        return ()
    low, median, high = left_shown(one, spans)
    return median, _range(low, high, Column("", "", decimals=0))


def _note(spans: Spans) -> str:
    """What signs mean, and lives as long as forecasts and shares of a life take them to be."""
    lives = ", ".join(f"{LIFE[axis]:,.0f} {axis}" for axis in spans.rate)
    return f"Changes since the calibration. ∞: not within five lives; –: not known. A life is {lives}."


def _link(one: VehicleRow) -> Link:
    return Link(printable(one.name), one.page)


def _natural(name: str) -> list[tuple[bool, int, str]]:
    """Sorts names so that their numbers count as such."""
    parts = re.split(r"(\d+)", name)
    return [(part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in parts]

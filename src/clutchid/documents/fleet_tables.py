"""Tables of a fleet: what is due, replacements, alarms, types, reasons for failures, and every vehicle."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from itertools import groupby
from math import isnan
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from clutchid.documents.style import MM
from clutchid.documents.tables import Cell, Column, Link, ReportTable
from clutchid.log import FloatArray
from clutchid.names import capital, natural, printable
from clutchid.wear import LIFE, Alarm, Axis, Interval
from clutchid.wear.due import WITHIN_DAYS, WITHIN_KM
from clutchid.wear.life import UNKNOWN_INTERVAL


class ReasonCount(NamedTuple):
    """Recordings without result: status, reason as a sentence without names or numbers, how many, one of them."""

    status: str
    sentence: str
    recordings: int
    example: str


class VehicleRow(NamedTuple):
    """A vehicle: its recordings, and its clutch at the last one with 95 % bands; NaN is unknown.

    `counted` are the recordings that count in the trend, without a trend those with a load; `statuses` their number by
    status. `shift` of the half-load position [m] and relative `load` are changes since the calibration; `wear` [m] is
    known with a table of it. `rate` is that of wear, or else of shift, a stroke, km, day or recording, as `axis` says,
    and so is what is `left` to the limit: median and 90 % interval, infinite beyond five lives. `alarms` are
    sentences. `page` is the file of its own page relative to that of the fleet. `limit` [m] of wear, or else of shift,
    ends its life, NaN without one. `warnings` are what contradicts in the times of its recordings, `reasons` why
    some do not count, `tags` the last values of further columns of the table of recordings.
    `events` are the alarms, with those that are in the list of the fleet only.

    With a limit of a `quantity` also the forecast with the vehicles of its `pool`: `left_days` and `left_km` as
    `left`, probabilities `within` the horizons of `clutchid.wear.due` (km, then days) and `by_month`; `evidence` is
    what it is made from.
    """

    name: str
    type: str
    recordings: int
    counted: int
    statuses: Mapping[str, int]
    last: datetime | None
    shift: Interval
    load: Interval
    wear: Interval
    rate: float
    left: Interval
    axis: Axis
    alarms: tuple[str, ...] = ()
    page: str = ""
    limit: float = float("nan")
    warnings: tuple[str, ...] = ()
    reasons: tuple[ReasonCount, ...] = ()
    tags: tuple[tuple[str, str], ...] = ()
    pool: str = ""
    quantity: str = "shift"
    evidence: str = ""
    left_days: Interval = UNKNOWN_INTERVAL
    left_km: Interval = UNKNOWN_INTERVAL
    within: tuple[float, ...] = ()
    by_month: tuple[float, ...] = ()
    events: tuple[Alarm, ...] = ()

    @property
    def has_result(self) -> int:
        """Number of its recordings that were read."""
        return sum(number for status, number in self.statuses.items() if status in ("ok", "warning"))


class ReplacementRow(NamedTuple):
    """Expected replacements in a month from each vehicle's last recording on, with their 95 % interval.

    They are those of the vehicles whose tag `name` has a `value`; of all where both are empty.
    """

    name: str
    value: str
    month: int
    expected: float
    low: float
    high: float


class Spans(NamedTuple):
    """Units of rates and of what is left: by axis how many strokes, km and so on, and in words.

    What is left is the field `left_in` of a vehicle.
    """

    rate: Mapping[str, float]
    rate_words: str
    left: Mapping[str, float]
    left_words: str
    left_in: str = "left"


_SPANS = {
    "strokes": (1e5, "100,000 strokes", 1e3, "thousand strokes"),
    "km": (1e4, "10,000 km", 1e3, "thousand km"),
    "days": (100.0, "100 days", 1.0, "days"),
    "recordings": (10.0, "10 recordings", 1.0, "recordings"),
}


def spans_of(vehicles: Sequence[VehicleRow]) -> Spans:
    """The unit of the fleet's only axis; shares of a life where vehicles have different ones.

    What is left is in km, or else in days, where it is known so of every vehicle with a limit.
    """
    limited = [vehicle for vehicle in vehicles if not np.isnan(vehicle.left.value)]
    axes = {vehicle.axis for vehicle in vehicles if np.isfinite(vehicle.rate)} | {vehicle.axis for vehicle in limited}
    if len(axes) > 1:
        spans = Spans(LIFE, "life", {axis: life / 100 for axis, life in LIFE.items()}, "% of a life")
    else:
        axis = axes.pop() if axes else "strokes"
        rate, rate_words, left, left_words = _SPANS[axis]
        spans = Spans({axis: rate}, rate_words, {axis: left}, left_words)
    for name in ("km", "days"):
        if limited and not any(np.isnan(getattr(vehicle, f"left_{name}").value) for vehicle in limited):
            *_, span, words = _SPANS[name]
            return spans._replace(left=dict.fromkeys(LIFE, span), left_words=words, left_in=f"left_{name}")
    return spans


def rate_shown(vehicle: VehicleRow, spans: Spans) -> float:
    """The rate over the span of the page, in m."""
    return vehicle.rate * spans.rate.get(vehicle.axis, np.nan)


def left_shown(vehicle: VehicleRow, spans: Spans) -> Interval:
    """Remaining life in the unit of the page."""
    span = spans.left.get(vehicle.axis, np.nan)
    return Interval(*(value / span for value in getattr(vehicle, spans.left_in)))


def quantiles(values: Sequence[float], shares: Sequence[float]) -> list[float | None]:
    """Quantiles of the known values, which may be infinite; between two values by linear interpolation."""
    finite = np.sort([value for value in values if not np.isnan(value)])
    return [_between(finite, share * (finite.size - 1)) if finite.size else None for share in shares]


def _between(values: FloatArray, place: float) -> float:
    """The value at a place that need not be a whole number; infinite where it is beyond the last finite one."""
    below = int(place)
    low, high = float(values[below]), float(values[min(below + 1, values.size - 1)])
    return low if place == below or low == high else low + (place - below) * (high - low)


def quantity_of(vehicles: Sequence[VehicleRow]) -> str:
    """Quantity that ends the life: wear where that of a vehicle is known, else shift."""
    return "wear" if any(np.isfinite(vehicle.wear.value) for vehicle in vehicles) else "shift"


def has_reading(vehicle: VehicleRow) -> bool:
    """Whether its shift or wear is known."""
    return bool(np.isfinite(vehicle.shift.value) or np.isfinite(vehicle.wear.value))


def _sentence(words: str) -> str:
    return f"{capital(printable(words).rstrip('.'))}."


_NBSP = "\N{NO-BREAK SPACE}"

#: Rows of the tables of what is due, alarms, values of a tag, types and reasons, at most.
_DUE, SHOWN_ALARMS, _VALUES, _TYPES, _REASONS = 20, 40, 30, 30, 40

#: Horizons that are shown: their places among the probabilities of a vehicle, and words.
_HORIZONS = (
    (0, f"{WITHIN_KM[0]:,.0f} km"),
    *((len(WITHIN_KM) + k, f"{days:.0f} days") for k, days in enumerate(WITHIN_DAYS) if k != 1),
)  # fmt: skip

#: Share of a life that is as long as the shortest horizons are.
_SOON = WITHIN_KM[0] / LIFE["km"]

#: Months that are added up for a value of a tag.
_QUARTER = 3


#: A column with the cell of a vehicle in it.
_Entry = tuple[Column, Callable[[VehicleRow], Cell]]


def due_table(vehicles: Sequence[VehicleRow], spans: Spans) -> ReportTable:
    """The vehicles most probable to reach their limit soon, then the most worn ones."""
    first = sorted(filter(has_reading, vehicles), key=_soon)[:_DUE]
    entries = [*_NAMES, *_within(first), *_left(first, spans), *_lengths(first), _rate(first, spans)]
    return _table(f"{len(first)} of {len(vehicles):,} vehicles", first, entries, spans)


def expected_due(vehicles: Sequence[VehicleRow]) -> list[tuple[str, float]]:
    """The expected number of clutches that reach their limit within each horizon that is known of some vehicle."""
    sums = ((words, [row.within[place] for row in vehicles if row.within]) for place, words in _HORIZONS)
    return [(words, float(np.nansum(shares))) for words, shares in sums if np.isfinite(shares).any()]


def _soon(vehicle: VehicleRow) -> tuple[float, ...]:
    """Sorts by the probability within the first horizon that is known, what is left in lives, wear and shift."""
    life = LIFE[vehicle.axis]
    shares = (vehicle.within[place] for place, _ in _HORIZONS[:2] if vehicle.within)
    soon = next((share for share in shares if np.isfinite(share)), 0.5 * (vehicle.left.value <= _SOON * life))
    left = [np.inf if np.isnan(value) else value / life for value in (vehicle.left.value, vehicle.left.low)]
    worn = (0.0 if np.isnan(size) else -abs(size) for size in (vehicle.wear.value, vehicle.shift.value))
    return -soon, *left, *worn


def months_table(rows: Sequence[ReplacementRow]) -> ReportTable:
    """Replacements of all vehicles, a column a month."""
    months = [row for row in rows if not row.name]
    columns = (
        Column("number", "replacements"),
        *(Column(f"{row.month}", f"{row.month}", decimals=1, group="month") for row in months),
    )
    sides = ("expected", "95 % band, from", "to")
    cells = tuple(
        (side, *numbers) for side, numbers in zip(sides, zip(*(row[3:] for row in months), strict=True), strict=True)
    )
    note = (
        "Months after the last recording of each vehicle. Each clutch reaches its limit by chance, and the error of a "
        "calibration moves all of its vehicles."
    )
    return ReportTable("Replacements in each month", columns, cells, note=note)


def tag_tables(rows: Sequence[ReplacementRow]) -> list[ReportTable]:
    """Replacements in the next months by the values of each tag, the most first."""
    tables, shown = [], Column("replacements", "", decimals=1).shown
    for name, own in groupby(filter(attrgetter("name"), rows), key=attrgetter("name")):
        values = [list(months)[:_QUARTER] for _, months in groupby(own, key=attrgetter("value"))]
        sums = sorted(((sum(row.expected for row in months), months) for months in values), reverse=True)
        columns = (
            Column("value", printable(name)), Column("sum", f"{_QUARTER} months", decimals=1),
            *(Column(f"month {month}", f"{month}", group="month") for month in range(1, _QUARTER + 1)),
        )  # fmt: skip
        cells = tuple(
            (
                printable(months[0].value),
                total,
                *(f"{shown(row[3])} ({shown(row[4])} to {shown(row[5])})".replace(" ", _NBSP) for row in months),
            )
            for total, months in sums[:_VALUES]
        )
        more = f"{len(sums) - _VALUES:,} values with fewer replacements are left out here." if sums[_VALUES:] else ""
        title = f"Replacements in the next {_QUARTER} months by {printable(name)}, with 95 % bands"
        tables.append(ReportTable(title, columns, cells, note=more))
    return tables


def alarms_table(vehicles: Sequence[VehicleRow]) -> ReportTable:
    """Alarms, those without a probability and the most probable first, and of these the newest."""
    alarms = [
        (row, words, event)
        for row in vehicles
        for words, event in zip(row.alarms, row.events[: len(row.alarms)], strict=True)
    ]
    alarms.sort(key=lambda entry: (entry[2].begin is not None, entry[2].begin), reverse=True)
    alarms.sort(key=lambda entry: -np.nan_to_num(entry[2].probability, nan=1.0))
    columns = (
        *(column for column, _ in _NAMES),
        Column("probability", "probability\n[%]", 0.01, 1),
        Column("alarm", "alarm"),
    )
    rows = tuple(
        (_link(row), printable(row.type), event.probability, _sentence(words))
        for row, words, event in alarms[:SHOWN_ALARMS]
    )
    more = (
        f"{len(alarms) - SHOWN_ALARMS:,} less probable ones are on the pages of their vehicles."
        if alarms[SHOWN_ALARMS:]
        else ""
    )
    count = sum(bool(row.alarms) for row in vehicles)
    return ReportTable(f"{len(alarms):,} alarms of {count:,} vehicles", columns, rows, note=more)


def all_table(vehicles: Sequence[VehicleRow], spans: Spans) -> ReportTable:
    """Every vehicle, by name."""
    entries: list[_Entry] = [
        *_NAMES,
        *_within(vehicles)[:1],
        *_left(vehicles, spans),
        (Column("last", "last"), lambda vehicle: f"{vehicle.last:%Y-%m-%d}" if vehicle.last else None),
        (Column("recordings", "all", decimals=0, group="recordings"), lambda vehicle: vehicle.recordings),
        (Column("counted", "counted", decimals=0, group="recordings"), lambda vehicle: vehicle.counted),
        *_lengths(vehicles),
        (Column("load [1]", "load\n[%]", 0.01, 1), lambda vehicle: vehicle.load.value),
        _rate(vehicles, spans),
    ]
    return _table("All vehicles", sorted(vehicles, key=lambda vehicle: natural(vehicle.name)), entries, spans)


def _table(title: str, vehicles: Sequence[VehicleRow], entries: Sequence[_Entry], spans: Spans) -> ReportTable:
    """A row a vehicle; below it the meaning of the signs, and the lives that forecasts and shares of a life assume."""
    rows = tuple(tuple(cell(vehicle) for _, cell in entries) for vehicle in vehicles)
    lives = ", ".join(f"{LIFE[axis]:,.0f} {axis}" for axis in spans.rate)
    note = f"Changes since the calibration. ∞: not within five lives; –: not known. A life is {lives}."
    return ReportTable(title, tuple(column for column, _ in entries), rows, note=note)


def reasons_table(reasons: Sequence[ReasonCount]) -> ReportTable:
    """Reasons why recordings do not count, the most frequent first."""
    columns = (
        Column("status", "status"), Column("recordings", "recordings", decimals=0), Column("reason", "reason"),
        Column("example", "for example"),
    )  # fmt: skip
    ordered = sorted(reasons, key=lambda reason: -reason.recordings)
    rows = [
        (row.status.replace("_", " "), row.recordings, printable(row.sentence), printable(row.example))
        for row in ordered[:_REASONS]
    ]
    rest = ordered[_REASONS:]
    more = f"{len(rest):,} rarer reasons, of {sum(row.recordings for row in rest):,} recordings, are left out here."
    total = sum(reason.recordings for reason in reasons)
    return ReportTable(f"{total:,} recordings by reason", columns, tuple(rows), note=more if rest else "")


def types_table(vehicles: Sequence[VehicleRow], spans: Spans) -> ReportTable:
    """A row a type of vehicle: how many, and how wear, its rate and what is left are distributed."""
    name = quantity_of(vehicles)
    groups: dict[str, list[VehicleRow]] = defaultdict(list)
    for vehicle in vehicles:
        groups[vehicle.type].append(vehicle)
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
            *quantiles([getattr(vehicle, name).value for vehicle in members], (0.05, 0.5, 0.95)),
            *quantiles([rate_shown(vehicle, spans) for vehicle in members], (0.5,)),
            *quantiles([left_shown(vehicle, spans).value for vehicle in members], (0.5,)),
            *quantiles([vehicle.limit for vehicle in members], (0.5,)),
        )
        for type_, members in largest[:_TYPES]
    ]  # fmt: skip
    more = f"{len(largest) - _TYPES:,} smaller types are left out here." if len(largest) > _TYPES else ""
    return ReportTable("By type, with quantiles over its vehicles", columns, tuple(rows), note=more)


def _within(vehicles: Sequence[VehicleRow]) -> list[_Entry]:
    """Probabilities to reach the limit within the horizons of which some are known."""
    entries: list[_Entry] = []
    for place, words in _HORIZONS:
        if any(row.within and np.isfinite(row.within[place]) for row in vehicles):
            column = Column(f"within {words} [1]", words, 0.01, 1, group="reaches its limit within [%]")
            entries.append((column, partial(_probability, place=place)))
    return entries


def _probability(vehicle: VehicleRow, place: int) -> float | None:
    return vehicle.within[place] if vehicle.within else None


def _lengths(vehicles: Sequence[VehicleRow]) -> Iterator[_Entry]:
    """Wear and shift that are known, each with its band: that of the shift only where a vehicle has no wear."""
    wear, shift = (np.isfinite([getattr(vehicle, name).value for vehicle in vehicles]) for name in ("wear", "shift"))
    for name, shown, banded in (("wear", wear, True), ("shift", shift, bool((shift & ~wear).any()))):
        if shown.any():
            column, length = Column(f"{name} [m]", "now", MM, 3, group=f"{name} [mm]"), attrgetter(name)
            yield column, attrgetter(f"{name}.value")
            if banded:
                yield _band(column, length)


def _band(column: Column, of: Callable[[VehicleRow], Interval], words: str = "95 % band") -> _Entry:
    """The interval of the values of a column, in words."""
    name = column.name.split(" [", maxsplit=1)[0]

    def shown(vehicle: VehicleRow) -> Cell:
        _, low, high = of(vehicle)
        if isnan(low) or isnan(high):
            return None
        return f"{column.shown(low)} to {column.shown(high)}".replace(" ", _NBSP)

    return Column(f"{name} band", words, group=column.group), shown


def _rate(vehicles: Sequence[VehicleRow], spans: Spans) -> _Entry:
    heading = f"rate of\n{quantity_of(vehicles)}\n[mm per\n{spans.rate_words.replace(' ', chr(10))}]"
    return Column(f"rate [m per {spans.rate_words}]", heading, MM, 3), lambda vehicle: rate_shown(vehicle, spans)


def _left(vehicles: Sequence[VehicleRow], spans: Spans) -> list[_Entry]:
    """Two columns where a limit is known."""
    if all(np.isnan(vehicle.left.value) for vehicle in vehicles):
        return []
    column = Column("left", "median", decimals=0, group=f"left [{spans.left_words}]")
    return [
        (column, lambda vehicle: left_shown(vehicle, spans).value),
        _band(column, lambda vehicle: left_shown(vehicle, spans), "90 % band"),
    ]


def _link(vehicle: VehicleRow) -> Link:
    return Link(printable(vehicle.name), vehicle.page)


_NAMES: tuple[_Entry, ...] = (
    (Column("vehicle", "vehicle"), _link),
    (Column("type", "type"), lambda vehicle: printable(vehicle.type)),
)

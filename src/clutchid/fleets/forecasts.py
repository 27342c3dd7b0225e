"""Forecast of a fleet: its vehicles with those of their type, the types, replacements, and which clutches are due."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

import numpy as np

from clutchid.documents.fleet_tables import ReplacementRow, VehicleRow
from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.wear import Axis
from clutchid.wear.due import FORECAST_MONTHS, Forecast, forecast, reached_within, replacements
from clutchid.wear.evidence import WEAR_NODES, evidence_from
from clutchid.wear.pooling import TypePool, TypeSpread, pooled
from clutchid.wear.trend import GROWTH, LIFE, Interval

#: Standard deviations of a 90 % interval, either way.
_NINETY = 1.6449


class Horizon(NamedTuple):
    """A distance in km, a time in days from the last recording of each vehicle, or a day: the others are None."""

    km: float | None = None
    days: float | None = None
    day: date | None = None


class DueVehicle(NamedTuple):
    """A vehicle whose clutch may be due.

    Attributes
    ----------
    vehicle, type
        Its name and its type.
    probability : 1
        That its clutch reaches the limit within the horizon.
    left_km, left_days
        Until the limit, in km and days: median and 90 % interval; NaN where the use is not known.
    """

    vehicle: str
    type: str
    probability: float
    left_km: Interval
    left_days: Interval


class TypeRow(NamedTuple):
    """Vehicles of a type with a forecast, and what they share: medians of vehicles with their 90 % spread.

    `rate` is that of wear, or else of shift, in m per stroke, km, day or recording, as `axis` says; `per_day` and
    `per_km` are strokes, km or recordings a day and a km. `learnt` is False for fewer vehicles than can be pooled.
    `noise` is the standard deviation of independent errors as a share of the usual one, `walk` that of the rate over a
    life as a share of the usual rate.
    """

    name: str
    vehicles: int
    learnt: bool
    axis: Axis
    rate: Interval
    per_day: Interval
    per_km: Interval
    noise: float
    walk: float


class FleetForecast(NamedTuple):
    """Vehicles with their forecast, types, replacements by month, and vehicles by the probability to be due."""

    rows: list[VehicleRow]
    types: list[TypeRow]
    replacements: list[ReplacementRow]
    due: tuple[DueVehicle, ...]


def horizon_of(text: str) -> Horizon | None:
    """A horizon such as 20000km, 90d or 2027-03-01; None where none is asked for.

    Raises
    ------
    ParameterError
        If the text is none of these.
    """
    if not text:
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?(km|d)", text)
    if match and float(match[1]) > 0.0:
        return Horizon(km=float(match[1])) if match[2] == "km" else Horizon(days=float(match[1]))
    try:
        return Horizon(day=date.fromisoformat(text))
    except ValueError:
        raise ParameterError(f"--within {text}: is a distance, a time or a day: 20000km, 90d or 2027-03-01.") from None


def forecast_of(rows: Sequence[VehicleRow], horizon: Horizon | None = None) -> FleetForecast:
    """The forecast of all vehicles; with a horizon also which are due within it."""
    groups: dict[tuple[str, str, str], list[int]] = defaultdict(list)
    for i, row in enumerate(rows):
        if row.evidence:
            groups[row.pool, row.axis, row.quantity].append(i)
    result, types, due = list(rows), list[TypeRow](), list[DueVehicle]()
    by_month, common = (np.full((len(rows), FORECAST_MONTHS), np.nan) for _ in range(2))
    for places in groups.values():
        own = [rows[i] for i in places]
        evidence = evidence_from([row.evidence for row in own])
        pool = pooled(evidence)
        table = forecast(evidence, pool)
        types.append(_type_row(own[0], pool))
        by_month[places], common[places] = table.by_month, table.common
        for k, i in enumerate(places):
            result[i] = _with_forecast(rows[i], table, k)
        if horizon:
            shares = reached_within(evidence, pool, *_distance(own, horizon))
            due += [_due(result[i], share) for i, share in zip(places, shares.tolist(), strict=True)]
    listed = sorted((row for row in due if row.probability == row.probability), key=lambda row: -row.probability)
    return FleetForecast(result, types, _replacements(rows, by_month, common), tuple(listed))


def _due(row: VehicleRow, probability: float) -> DueVehicle:
    return DueVehicle(row.name, row.type, probability, row.left_km, row.left_days)


def _distance(rows: Sequence[VehicleRow], horizon: Horizon) -> tuple[int, FloatArray]:
    """A horizon as place of the use and days or km of each vehicle; NaN for a day where its last one is not known."""
    if horizon.km is not None:
        return 1, np.full(len(rows), horizon.km)
    if horizon.days is not None:
        return 0, np.full(len(rows), horizon.days)
    ahead = [(horizon.day - row.last.date()).days if horizon.day and row.last else np.nan for row in rows]
    return 0, np.maximum(np.array(ahead, dtype=np.float64), 0.0)


def _with_forecast(row: VehicleRow, table: Forecast, k: int) -> VehicleRow:
    low, median, high = (LIFE[row.axis] * table.left[k]).tolist()
    days, km = (Interval(band[k, 1], band[k, 0], band[k, 2]) for band in (table.left_days, table.left_km))
    shares = (*table.within_km[k].tolist(), *table.within_days[k].tolist())
    return row._replace(
        left=Interval(median, low, high), left_days=days, left_km=km, within=shares,
        by_month=tuple(table.by_month[k].tolist()),
    )  # fmt: skip


def _type_row(first: VehicleRow, pool: TypePool) -> TypeRow:
    """A type in the units of its axis."""
    life, per_life = LIFE[first.axis], GROWTH[first.quantity].rate
    node, (day, km) = WEAR_NODES[pool.rate.best], (_spread(use, life) for use in pool.use)
    return TypeRow(
        first.pool, pool.vehicles, not pool.is_guess, first.axis, _spread(pool.rate, per_life / life),
        day, km, float(np.sqrt(node.noise)), node.walk,
    )  # fmt: skip


def _spread(spread: TypeSpread, factor: float) -> Interval:
    mean, std = spread.mean[spread.best], spread.of_new[spread.best]
    return Interval(*(factor * float(np.exp(mean + z * std)) for z in (0.0, -_NINETY, _NINETY)))


def _replacements(rows: Sequence[VehicleRow], by_month: FloatArray, common: FloatArray) -> list[ReplacementRow]:
    """Replacements by month of all vehicles, then by each value of their tags."""
    groups: dict[tuple[str, str], list[int]] = defaultdict(list)
    for i, row in enumerate(rows):
        for tag in row.tags:
            groups[tag].append(i)
    table = []
    for (name, value), places in [(("", ""), list(range(len(by_month)))), *sorted(groups.items())]:
        counts = replacements(by_month[places], common[places])
        columns = zip(*(side.tolist() for side in counts), strict=True)
        table += [ReplacementRow(name, value, month, *numbers) for month, numbers in enumerate(columns, start=1)]
    return table

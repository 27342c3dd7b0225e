"""What the page of a fleet is made from: a row a vehicle, and why recordings have no result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np

from clutchid.wear.history import Axis
from clutchid.wear.settings import LIFE


class VehicleRow(NamedTuple):
    """A vehicle: its recordings, and its clutch at the last one, each with its 95 % band; NaN is unknown.

    `counted` are the recordings that count in the trend, without a trend those with a load; `statuses` their number by
    status. `shift` of the half-load position [m] and relative `load` are changes since the calibration; `wear` [m] is
    known with a table of it. `rate` is that of wear, or else of shift, a stroke, km, day or recording, as `axis` says,
    and so is what is `left` to the limit: median and 90 % interval, infinite beyond five lives. `alarms` are
    sentences. `page` is the file of its own page relative to that of the fleet. `limit` [m] of wear, or else of shift,
    ends its life, NaN without one.
    """

    name: str
    type: str
    recordings: int
    counted: int
    statuses: Mapping[str, int]
    last: datetime | None
    shift: float
    shift_low: float
    shift_high: float
    load: float
    load_low: float
    load_high: float
    wear: float
    wear_low: float
    wear_high: float
    rate: float
    left_low: float
    left: float
    left_high: float
    axis: Axis
    alarms: tuple[str, ...] = ()
    page: str = ""
    limit: float = float("nan")


class Reason(NamedTuple):
    """Why recordings have no result: their status, a sentence without names or numbers, how many, and one of them."""

    status: str
    sentence: str
    recordings: int
    example: str


class Spans(NamedTuple):
    """What rates and what is left are given in: by axis how many strokes, km and so on, and in words."""

    rate: Mapping[str, float]
    rate_words: str
    left: Mapping[str, float]
    left_words: str


_SPANS = {
    "strokes": (1e5, "100,000 strokes", 1e3, "thousand strokes"),
    "km": (1e4, "10,000 km", 1e3, "thousand km"),
    "days": (100.0, "100 days", 1.0, "days"),
    "recordings": (10.0, "10 recordings", 1.0, "recordings"),
}


def spans_of(vehicles: Sequence[VehicleRow]) -> Spans:
    """The unit of the fleet's only axis; shares of a life where vehicles have different ones."""
    axes = {one.axis for one in vehicles if np.isfinite(one.rate) or not np.isnan(one.left)}
    if len(axes) > 1:
        return Spans(LIFE, "life", {axis: life / 100 for axis, life in LIFE.items()}, "% of a life")
    axis = axes.pop() if axes else "strokes"
    rate, rate_words, left, left_words = _SPANS[axis]
    return Spans({axis: rate}, rate_words, {axis: left}, left_words)


def rate_shown(one: VehicleRow, spans: Spans) -> float:
    """The rate over the span of the page, in m."""
    return one.rate * spans.rate.get(one.axis, np.nan)


def left_shown(one: VehicleRow, spans: Spans) -> tuple[float, float, float]:
    """What is left in the unit of the page: 5 %, 50 %, 95 %."""
    span = spans.left.get(one.axis, np.nan)
    return one.left_low / span, one.left / span, one.left_high / span


def quantiles(values: Sequence[float], shares: Sequence[float]) -> list[float | None]:
    """Quantiles of the known values, which may be infinite: each is one of the values."""
    known = np.sort([value for value in values if not np.isnan(value)])
    return [float(np.quantile(known, share, method="nearest")) if known.size else None for share in shares]


def quantity_of(vehicles: Sequence[VehicleRow]) -> str:
    """What ends the life: wear where that of a vehicle is known, else shift."""
    return "wear" if any(np.isfinite(one.wear) for one in vehicles) else "shift"


def has_reading(one: VehicleRow) -> bool:
    """Whether anything is known of its clutch."""
    return bool(np.isfinite(one.shift) or np.isfinite(one.wear))

"""The life of a clutch: its recordings, the trend through them, alarms, and the remaining life."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import special

from clutchid.log import FloatArray
from clutchid.numerics.interval import QUANTILE
from clutchid.wear.alarms import Alarm, RestMove, alarms, replaced, rest_moves
from clutchid.wear.history import Axis, Dated, History, WearReading
from clutchid.wear.trend import LIFE, Band, Function, TrendModel, WearTable, follow, growth_noise, smoothed, trend_model

#: Quantiles of a forecast: its 90 % interval and its median.
QUANTILES = (0.05, 0.5, 0.95)

#: Horizon of a forecast in lives.
HORIZON = 5.0


class Remaining(NamedTuple):
    """Remaining life until a limit; infinite beyond five lives.

    Attributes
    ----------
    low, high : strokes, km or days
        90 % interval.
    median : strokes, km or days
        Reached with a probability of one half.
    """

    low: float
    median: float
    high: float


def remaining(name: str, mean: FloatArray, covariance: FloatArray, limit: float, life: float) -> Remaining:
    """Remaining life until a quantity reaches `limit`, from its value and rate now.

    The probability to have reached it by then is that the trend is beyond it, which must not decrease.

    Parameters
    ----------
    name
        A row of `clutchid.wear.trend.GROWTH`.
    mean, covariance
        Of value and rate, (2,) and (2, 2).
    limit
        Value that ends the life; below 0 if the quantity falls.
    life
        How much of s a life has.
    """
    sign = 1.0 if limit >= 0 else -1.0
    ahead = np.concatenate([[0.0], np.geomspace(1e-4, HORIZON, 600)]) * life
    value = mean[0] + mean[1] * ahead
    noise = np.array([growth_noise(name, life, float(ds))[0, 0] for ds in ahead])
    variance = covariance[0, 0] + 2 * ahead * covariance[0, 1] + ahead**2 * covariance[1, 1] + noise
    reached = np.maximum.accumulate(special.ndtr(sign * (value - limit) / np.sqrt(variance)))
    return Remaining(*(_first(reached, ahead, quantile) for quantile in QUANTILES))


def _first(reached: FloatArray, ahead: FloatArray, quantile: float) -> float:
    """Distance ahead at which the probability first reaches a quantile."""
    if reached[0] >= quantile:
        return 0.0
    if reached[-1] < quantile:
        return float("inf")
    k = int(np.argmax(reached >= quantile))
    share = (quantile - reached[k - 1]) / (reached[k] - reached[k - 1])
    return float(ahead[k - 1] + share * (ahead[k] - ahead[k - 1]))


#: Outcomes of the measurements that count in the trend.
COUNTED = ("used", "jump")

#: Why an outlier does not count: of the last recording, and of any other.
_WAITS = "outlier: the trend does not expect it, and the next recording will say whether the clutch has changed."
_ALONE = "outlier: the trend does not expect it, and the next recording fits the trend without it."


@dataclass(frozen=True, slots=True, eq=False)
class Wear:
    """The wear of one clutch over its recordings, in order.

    Quantities are shift [m], relative load and, with a table, wear [m].

    Attributes
    ----------
    vehicle
        Its name.
    axis
        'strokes', 'km', 'days' or 'recordings': the unit of `s`.
    s : axis, (n,)
        Where the recordings are in the life of the clutch.
    dated
        Name, time, distance and strokes of each recording.
    readings
        What was measured in each recording.
    outcomes
        What became of each measurement, one text each: 'used' and 'jump' count in the trend.
    then
        Quantities by name, with 95 % bands, as known at each recording.
    now
        The same, given all recordings.
    rate
        Rates of `now` per unit of `s`.
    alarms
        Replaced clutches, leaks, moved sensors and other events.
    limit : m
        Shift or wear that ends the life; None without one.
    left : axis
        Remaining life; None without a limit, and after a sudden change.
    warnings
        What contradicts in the recordings and the table, one sentence each.
    rests
        Moves of the vented rest, a row a recording.
    end_of_table : m
        Wear beyond which the table says nothing, and where it is cut off; None without a table.

    Examples
    --------
    See `clutchid.track`. A life of 200,000 strokes that is half over leaves, with 90 % probability, within a tenth:

    >>> left = Remaining(9.0e4, 1.0e5, 1.1e5)
    >>> f"{left.median:.0f} strokes, {left.low:.0f} to {left.high:.0f}"
    '100000 strokes, 90000 to 110000'
    """

    vehicle: str
    axis: Axis
    s: FloatArray
    dated: tuple[Dated, ...]
    readings: tuple[WearReading, ...]
    outcomes: tuple[str, ...]
    then: dict[str, Band]
    now: dict[str, Band]
    rate: dict[str, Band]
    alarms: tuple[Alarm, ...]
    limit: float | None
    left: Remaining | None
    warnings: tuple[str, ...]
    rests: tuple[RestMove, ...] = ()
    end_of_table: float | None = None

    @property
    def sudden(self) -> Alarm | None:
        """A sudden change of the load after which nothing replaced the clutch: what is left is not known after it."""
        jumps = [alarm for alarm in self.alarms if alarm.kind in ("replaced", "sudden")]
        return jumps[-1] if jumps and jumps[-1].kind == "sudden" else None

    @property
    def counted(self) -> tuple[bool, ...]:
        """Whether each recording counts in the trend."""
        return tuple(outcome in COUNTED for outcome in self.outcomes)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reason why each recording does not count in the trend, in a sentence; empty for one that does."""
        measured = [k for k, one in enumerate(self.readings) if one.measurement is not None]
        return tuple(
            "" if counts else one.unmeasured or (_WAITS if k == measured[-1] else _ALONE)
            for k, (one, counts) in enumerate(zip(self.readings, self.counted, strict=True))
        )


def wear_of(
    vehicle: str,
    history: History,
    readings: Sequence[WearReading],
    table: WearTable | None = None,
    limit: float | None = None,
) -> Wear:
    """The wear of a clutch.

    Parameters
    ----------
    history
        Order of the recordings; `readings` are in the order of its `dated`.
    table
        Load against wear of the facing, which then is a quantity too.
    limit : m
        Shift that ends the life; with a table, and by default, the wear at its end.
    """
    ordered = [readings[i] for i in history.order]
    dated = tuple(history.dated[i] for i in history.order)
    life = LIFE[history.axis]
    model = trend_model(life, table)
    steps = follow(model, history.s, [one.measurement for one in ordered])
    later = smoothed(steps)
    then = _bands(model, [(step.mean, step.covariance) for step in steps], table)
    name, end = _limit(table, limit)
    q = 2 * model.quantities.index(name) if name in model.quantities else 0
    last = steps[-1]
    any_used = any(step.outcome in COUNTED for step in steps)
    moves = rest_moves(
        history.s, life, [one.rest for one in ordered], [one.measurement for one in ordered],
        replaced(dated, steps, then),
    )  # fmt: skip
    found = alarms(dated, ordered, steps, then, moves)
    wear = Wear(
        vehicle, history.axis, history.s, dated, tuple(ordered), tuple(step.outcome for step in steps),
        then, _bands(model, later, table), _state_bands(model, later, 1), found,
        limit if table is None else end, None, history.warnings, tuple(moves),
        None if table is None else float(table.wear[-1]),
    )  # fmt: skip
    if end is None or not any_used or wear.sudden:
        return wear
    left = remaining(name, last.mean[q : q + 2], last.covariance[q : q + 2, q : q + 2], end, life)
    return replace(wear, left=left)


def _limit(table: WearTable | None, limit: float | None) -> tuple[str, float | None]:
    """Quantity and value that end the life."""
    if table is None:
        return "shift", limit
    if limit is None:
        return "wear", float(table.wear[-1])
    beyond = np.flatnonzero(table.shift * np.sign(limit) >= abs(limit))
    return "wear", float(table.wear[beyond[0] if beyond.size else -1])


def _bands(
    model: TrendModel, states: Sequence[tuple[FloatArray, FloatArray]], table: WearTable | None
) -> dict[str, Band]:
    """Quantities with their bands; with a table also the shift and the load that belong to the wear, up to its end."""
    found = _state_bands(model, states, 0)
    if table is None:
        return found
    channels = zip(("shift", "load"), model.channels, strict=True)
    mapped = {name: _mapped(function, found["wear"]) for name, (_, function) in channels}
    return {"wear": Band(*(np.minimum(side, table.wear[-1]) for side in found["wear"])), **mapped}


def _mapped(function: Function, band: Band) -> Band:
    """A function of a quantity over its band, which need not be monotone."""
    shares = np.linspace(0.0, 1.0, 21)[:, None]
    over = function(band.low + shares * (band.high - band.low))
    return Band(function(band.value), over.min(axis=0), over.max(axis=0))


def _state_bands(model: TrendModel, states: Sequence[tuple[FloatArray, FloatArray]], rate: int) -> dict[str, Band]:
    """The quantities with their bands, or with `rate` 1 their rates."""
    values = np.array([mean for mean, _ in states])
    half = QUANTILE * np.sqrt(np.array([np.diag(P) for _, P in states]))
    columns = {name: 2 * q + rate for q, name in enumerate(model.quantities)}
    return {
        name: Band(values[:, i], values[:, i] - half[:, i], values[:, i] + half[:, i]) for name, i in columns.items()
    }

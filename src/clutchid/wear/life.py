"""The life of a clutch: its recordings, the trend through them, alarms, and the remaining life."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy import special

from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.log import FloatArray
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.quadrature import normal_nodes
from clutchid.wear.alarms import CHANGED, Alarm, RestMove, alarms, rest_moves, suspects
from clutchid.wear.due import forecast
from clutchid.wear.evidence import LifeEvidence, life_evidence
from clutchid.wear.history import Axis, RecordingJob, WearReading, arranged
from clutchid.wear.pooling import pooled
from clutchid.wear.trend import (
    AGED,
    CHANNELS,
    GROWTH,
    LEAKING,
    LEAKS,
    LIFE,
    SURE,
    Band,
    Interval,
    LaterCalibration,
    TrendModel,
    WearTable,
    smoothed_states,
    traced,
    trend_model,
    verdicts,
)

#: An unknown interval.
UNKNOWN_INTERVAL = Interval(*[float("nan")] * 3)


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


#: Least limit in standard deviations of the error that the readings of a calibration share. A guess.
_ERRORS = 3.0

#: Why a limit says nothing of what is left.
_WITHIN_ERROR = (
    "the limit of {:.3f} mm is within the error of the calibration, {:.3f} mm, so what is left is not known; a table "
    "of wear (TYPE.wear.csv) also uses the load."
)

#: Outcomes of the measurements that count in the trend.
COUNTED_OUTCOMES = ("used", "jump")

#: A rate is known where its standard deviation is below this share of that before any reading. A guess.
_KNOWN = 0.5

#: Share of the table of wear that a band of the wear may hold; beyond, the wear is unknown. 0.95 of it is no knowledge.
_ANYTHING = 0.9

#: Why an outlier does not count: where it may be the first recording of a change, and where it is not.
_WAITS = "outlier: far from the trend; the next recordings will show whether the clutch has changed."
_ALONE = "outlier: far from the trend, and the next recordings fit the trend without it."


class LifeRow(NamedTuple):
    """A file of a vehicle, its reading, its outcome in the trend, and the reason in a sentence why it does not count.

    The reason is empty where it counts.
    """

    job: RecordingJob
    reading: WearReading
    outcome: str
    reason: str


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
        Outcome of each measurement; 'used' and 'jump' count in the trend.
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
        Remaining life; None without a limit, and after a change that no new clutch explains.
    warnings
        Contradictions in the recordings and the table, one sentence each.
    rests
        Moves of the vented rest, a row a recording.
    apart
        Files that are not part of this life, each with the reason: it could not be read, or is a copy.
    end_of_table : m
        Largest wear in the table, at which the result is cut off; None without a table.
    waiting
        Numbers of the outliers that may be the first recording of a change.
    suspects
        Possible changes and wrong files, which are in the list of a fleet only.
    evidence
        What the recordings say of wear and use, for a forecast with others of its type; None where `left` is.

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
    dated: tuple[RecordingJob, ...]
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
    apart: tuple[tuple[RecordingJob, WearReading], ...] = ()
    end_of_table: float | None = None
    waiting: frozenset[int] = frozenset()
    suspects: tuple[Alarm, ...] = ()
    evidence: LifeEvidence | None = None

    @property
    def recordings(self) -> int:
        """Number of recordings of the vehicle, with those that could not be read, without copies and other files."""
        return len(self.dated) + sum(not reading.apart for _, reading in self.apart)

    @property
    def sudden(self) -> Alarm | None:
        """A change of the load that no new clutch is known to explain: rate and what is left are unknown after it."""
        changes = [alarm for alarm in self.alarms if alarm.kind in CHANGED]
        return changes[-1] if changes and changes[-1].kind != "replaced" else None

    @property
    def aged(self) -> float:
        """Leak [m³/(Pa·s)] of the last recordings, certain and too small for an alarm; else 0."""
        leaks = [reading.leak for reading in self.readings[-LEAKS:]]
        certain = len(leaks) == LEAKS and all(leak and leak.probability > LEAKING for leak in leaks)
        return leaks[-1].conductance if certain and leaks[-1] and leaks[-1].conductance <= AGED else 0.0

    @property
    def present(self) -> dict[str, Interval]:
        """Quantities at the last recording; NaN for wear whose band says no more than its table."""
        last = {name: band.last for name, band in self.then.items()}
        if "wear" in last and last["wear"].high - last["wear"].low > _ANYTHING * (self.end_of_table or np.inf):
            last["wear"] = UNKNOWN_INTERVAL
        return last

    @property
    def present_rate(self) -> Interval:
        """Rate of wear, or without a table of shift, in m per unit of `s`; NaN where unknown.

        It is not after a sudden change, nor where readings determine it little better than the prior does.
        """
        name = "wear" if "wear" in self.rate else "shift"
        rate = self.rate[name].last
        prior = GROWTH[name].rate / LIFE[self.axis]
        determined = any(self.counted) and self.sudden is None and rate.high - rate.low < 2 * QUANTILE * _KNOWN * prior
        return rate if determined else UNKNOWN_INTERVAL

    @property
    def counted(self) -> tuple[bool, ...]:
        """Whether each recording counts in the trend."""
        return tuple(outcome in COUNTED_OUTCOMES for outcome in self.outcomes)

    @property
    def curves(self) -> list[tuple[str, LoadCurve]]:
        """The loads of the recordings that count in the trend, by name."""
        rows = zip(self.dated, self.readings, self.counted, strict=True)
        return [(job.recording, reading.curve) for job, reading, counts in rows if reading.curve and counts]

    @property
    def rows(self) -> list[LifeRow]:
        """The recordings in their order, and behind them the files without a place in it."""
        reasons = (
            "" if counts else reading.unmeasured or (_WAITS if k in self.waiting else _ALONE)
            for k, (reading, counts) in enumerate(zip(self.readings, self.counted, strict=True))
        )
        placed = map(LifeRow, self.dated, self.readings, self.outcomes, reasons)
        return [*placed, *(LifeRow(job, reading, "missing", reading.unmeasured) for job, reading in self.apart)]


class LifeLimits(NamedTuple):
    """Limits of a life.

    Attributes
    ----------
    shift : m
        Shift that ends it; with a table, and by default, the wear at its end.
    table
        Load against wear of the facing, which then is a quantity too.
    """

    shift: float | None = None
    table: WearTable | None = None


def wear_of(
    vehicle: str,
    jobs: Sequence[RecordingJob],
    readings: Sequence[WearReading],
    limits: LifeLimits,
    warnings: Sequence[str] = (),
    later: Mapping[Path, LaterCalibration] = MappingProxyType({}),
) -> Wear:
    """The wear of a clutch through recordings that were read, in any order.

    `warnings` come before those of the order. `later` are the calibrations of the vehicle after its first one, by their
    files, in order; changes since them become changes since the first.
    """
    history, (limit, table) = arranged(jobs, readings), limits
    ordered = [readings[i] for i in history.order]
    dated = tuple(history.dated[i] for i in history.order)
    apart = tuple((history.dated[i], readings[i]) for i in history.apart)
    life = LIFE[history.axis]
    numbers = {path: number for number, path in enumerate(later, start=1)}
    measurements = [
        later[job.start].since_first(now, numbers[job.start]) if now and job.start and job.start in later else now
        for job, now in zip(dated, (reading.measurement for reading in ordered), strict=True)
    ]
    readers = tuple(sorted({now.by for now in measurements if now})) or ("estimate",)
    model = trend_model(life, table, readers, tuple(later.values()))
    paths = traced(model, history.s, measurements)
    filtered = [[(step.mean, step.covariance) for step in path.steps] for path in paths]
    smoothed = [smoothed_states(path.steps) for path in paths]
    shares = np.array([path.probability for path in paths])
    then = _bands(model, shares, filtered, table)
    name, end = _limit(table, limit)
    results = verdicts(paths)
    new = {k for k, verdict in enumerate(results) if verdict.outcome == "replaced"}
    moves = rest_moves(history.s, life, [reading.rest for reading in ordered], measurements, new)
    outcomes = tuple("jump" if verdict.outcome in CHANGED else verdict.outcome for verdict in results)
    waiting = (k for k, verdict in enumerate(results) if verdict.outcome == "left out" and verdict.probability < SURE)
    wear = Wear(
        vehicle, history.axis, history.s, dated, tuple(ordered), outcomes, then,
        _bands(model, shares, smoothed, table), _rates(model, shares, smoothed),
        alarms(dated, ordered, results, then, moves), limit if table is None else end, None,
        (*warnings, *history.warnings), tuple(moves), apart,
        None if table is None else float(table.wear[-1]), frozenset(waiting),
        suspects(dated, ordered, measurements, results, then),
    )  # fmt: skip
    if end is None or not any(wear.counted) or wear.sudden:
        return wear
    evidence = life_evidence(model, history, measurements, paths[0].steps, smoothed[0], (name, end))
    if evidence is None:
        return wear
    if not evidence.limit > _ERRORS * evidence.constant:
        error = 1e3 * evidence.constant * GROWTH[name].rate
        return replace(wear, warnings=(*wear.warnings, _WITHIN_ERROR.format(1e3 * end, error)))
    return replace(wear, evidence=evidence, left=_left(evidence, life))


def _left(evidence: LifeEvidence, life: float) -> Remaining:
    """Remaining life of a clutch by its own recordings alone."""
    alone = evidence.at(None)
    return Remaining(*(life * forecast(alone, pooled(alone)).left[0]).tolist())


def to_estimate(wear: Wear) -> tuple[RecordingJob, ...]:
    """The observed recordings that are to be estimated, in the order of the life.

    These are the ones that the trend does not expect, and those before and after an alarm.
    """
    named = {name for alarm in wear.alarms for name in (alarm.after, alarm.before)}
    rows = zip(wear.dated, wear.readings, wear.outcomes, strict=True)
    return tuple(
        job for job, reading, outcome in rows
        if reading.by == "observe" and (outcome in ("left out", "jump") or job.recording in named)
    )  # fmt: skip


def _limit(table: WearTable | None, limit: float | None) -> tuple[str, float | None]:
    """Quantity and value that end the life."""
    if table is None:
        return "shift", limit
    if limit is None:
        return "wear", float(table.wear[-1])
    beyond = np.flatnonzero(table.shift * np.sign(limit) >= abs(limit))
    return "wear", float(table.wear[beyond[0] if beyond.size else -1])


#: Mean and covariance of a state.
Moments = tuple[FloatArray, FloatArray]

_NODES, _WEIGHTS = normal_nodes(15)


def _mixed(shares: FloatArray, states: Sequence[Moments]) -> Moments:
    """Mean and covariance of a mixture."""
    mean = np.asarray(sum(share * x for share, (x, _) in zip(shares, states, strict=True)))
    spread = (share * (P + np.outer(x - mean, x - mean)) for share, (x, P) in zip(shares, states, strict=True))
    return mean, np.asarray(sum(spread))


def _bands(
    model: TrendModel, shares: FloatArray, paths: Sequence[Sequence[Moments]], table: WearTable | None
) -> dict[str, Band]:
    """Shift and load, and with a table the wear up to its end, over the recordings of all paths."""
    names = (*(("wear",) if table is not None else ()), *CHANNELS)
    over = [_mixed(shares, [_quantities(model, *state) for state in states]) for states in zip(*paths, strict=True)]
    bands = _band_of(over, names)
    if table is not None:
        bands["wear"] = Band(*(np.minimum(side, table.wear[-1]) for side in _worn(bands["wear"])))
    return bands


def _worn(band: Band) -> Band:
    """Median and 95 % interval of a wear, given that a facing does not grow."""
    std = (band.high - band.low) / (2 * QUANTILE)
    positive, tail = special.ndtr(band.value / std), special.ndtr(-QUANTILE)
    return Band(*(band.value - std * special.ndtri(above * positive) for above in (0.5, 1.0 - tail, tail)))


def _rates(model: TrendModel, shares: FloatArray, paths: Sequence[Sequence[Moments]]) -> dict[str, Band]:
    """Rates of the quantities."""
    rates = slice(1, model.errors, 2)
    over = [
        _mixed(shares, [(mean[rates], P[rates, rates]) for mean, P in states]) for states in zip(*paths, strict=True)
    ]
    return _band_of(over, model.quantities)


def _band_of(states: Sequence[Moments], names: Sequence[str]) -> dict[str, Band]:
    """A band for each element of the states, by its name."""
    values = np.array([mean for mean, _ in states]).reshape(-1, len(names)).T
    half = QUANTILE * np.sqrt(np.array([np.diag(P) for _, P in states])).reshape(-1, len(names)).T
    return {n: Band(value, value - side, value + side) for n, value, side in zip(names, values, half, strict=True)}


def _quantities(model: TrendModel, mean: FloatArray, P: FloatArray) -> Moments:
    """Wear, where there is a table, and each channel without its errors, f(u) + a, with their variances."""
    values, variances = ([mean[0]], [P[0, 0]]) if model.quantities == ("wear",) else ([], [])
    for c, (q, function) in enumerate(model.channels):
        i, width = model.changes + c, np.sqrt(P[2 * q, 2 * q])
        slope = P[i, 2 * q] / width
        at = function(mean[2 * q] + width * _NODES) + mean[i] + slope * _NODES
        value = np.average(at, weights=_WEIGHTS)
        values.append(value)
        variances.append(np.average((at - value) ** 2, weights=_WEIGHTS) + P[i, i] - slope**2)
    return np.array(values), np.diag(variances)

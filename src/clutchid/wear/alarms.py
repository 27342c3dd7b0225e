"""Alarms: the load jumps, chamber A begins to leak, or the calibration no longer holds."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Literal, NamedTuple

import numpy as np
from scipy import special

from clutchid.estimation.assess.comparison import SHARES_BY, Measurement
from clutchid.log import FloatArray
from clutchid.numerics.interval import QUANTILE
from clutchid.strokes.vented_rest import RestShift
from clutchid.wear.history import Leak, RecordingJob, WearReading
from clutchid.wear.trend import (
    AGED,
    CHANNELS,
    DEPARTED,
    FALL,
    FALL_FACTOR,
    FALSE_ALARMS,
    LEAKING,
    LEAKS,
    SURE,
    Band,
    Interval,
    TrendOutcome,
)

#: Kinds of alarms of a change of the load.
CHANGED = ("replaced", "sudden", "unknown")

#: Probability from which a change that the next recordings decide is a possible one. A guess.
POSSIBLE = 0.5

#: Distance of an outlier from the trend, in standard deviations of its reading, beyond which it is taken for that of
#: another truck. A guess.
_FOREIGN = 5.0

#: Least and largest factor from the leak that a reading estimates to the truck's, whose slit has another temperature:
#: 1 / 3.3 to 1 / 1.6 in "Alarms as a list" of benchmarks/results/wear.md; and a reading may be right.
LEAK_FACTORS = 0.3, 1.2

RestCause = Literal["", "sensor", "wear", "new clutch"]


class RestMove(NamedTuple):
    """Vented rest at a recording.

    Attributes
    ----------
    move : m
        Its shift since the recording before.
    cause
        'sensor' where the sensor moved, or the rest has risen slowly; 'wear' where it has fallen slowly; 'new clutch'
        where it is back after a clutch was replaced; empty where it has not moved, or is not known.
    sudden
        Whether the sensor moved from one recording to the next, not slowly.
    std : m
        Standard deviation of the shift.
    """

    move: float
    cause: RestCause
    sudden: bool = False
    std: float = float("nan")


#: Move of a rest that is not known.
_NOT_KNOWN = RestMove(float("nan"), "")


def rest_moves(
    s: FloatArray,
    life: float,
    rests: Sequence[RestShift | None],
    measurements: Sequence[Measurement | None],
    replaced: Collection[int],
) -> list[RestMove]:
    """The moves of the vented rest from recording to recording.

    Upwards, or downwards by more than the clutch can wear from one recording to the next, it is the sensor; unless the
    clutch was replaced, which lifts the rest by what it had fallen. Slowly downwards it is wear.

    Parameters
    ----------
    s, life
        Where the recordings are on the axis of the trend, and how much of it a life has.
    rests
        Shift of the rest since the calibration, by recording.
    measurements
        What each recording measures of the wear, from which a new clutch is known.
    replaced
        Numbers of the recordings before which the load became that of a new clutch.
    """
    z = float(special.ndtri(1.0 - FALSE_ALARMS / 2.0))
    moves: list[RestMove] = []
    base = before = None
    for k, rest in enumerate(rests):
        if rest is None:
            moves.append(_NOT_KNOWN)
            continue
        if base is None or before is None:
            moves.append(RestMove(0.0, ""))
            base = before = k, rest
            continue
        move, std = rest.value - before[1].value, float(np.hypot(rest.std, before[1].std))
        noise = z * std
        fallen = base[1].value - before[1].value
        allowed = _allowed_fall(float(s[k] - s[before[0]]), float(s[before[0]] - s[base[0]]), fallen, noise, life)
        if move > noise or -move > allowed + noise:
            back = abs(move - fallen) <= noise
            new = k in replaced or (back and _as_new(measurements[k]))
            moves.append(RestMove(move, "new clutch" if new else "sensor", not new, std))
            base = k, rest
        else:
            drift = rest.value - base[1].value
            moved = abs(drift) > z * np.hypot(rest.std, base[1].std)
            moves.append(RestMove(move, ("wear" if drift < 0.0 else "sensor") if moved else ""))
        before = k, rest
    return moves


def _allowed_fall(ds: float, since: float, fallen: float, noise: float, life: float) -> float:
    """Largest fall in m that wear explains over `ds`: by a clutch without an adjuster, and by the pace so far."""
    most = FALL * ds / life
    return min(most, FALL_FACTOR * (max(fallen, 0.0) + noise) * ds / since) if since > 0.0 else most


def _as_new(now: Measurement | None) -> bool:
    """Whether a load is that of the calibration."""
    return now is not None and abs(now.shift) <= 2 * now.shift_std and abs(now.load) <= 2 * now.load_std


class Alarm(NamedTuple):
    """Event between two recordings.

    Attributes
    ----------
    after, before
        Recordings between which it happened; `after` is empty where it was before the first one.
    begin
        Time of the recording that shows it; None if unknown.
    kind
        'replaced' where the load became that of a new clutch, 'sudden' where it changed else, 'unknown' where it
        changed and the readings do not say which; 'leak' where chamber A begins to leak; 'departed' from where the
        calibration does not hold; 'sensor moved' where the vented rest moved as wear does not move it.
    shift : m
        Change of the half-load position there.
    load : 1
        Relative change of the load.
    leak : m³/(Pa·s)
        Conductance of a leak.
    rest : m
        Move of the vented rest.
    probability : 1
        Of a change of the load, given all recordings: that of its kind, or if that is unknown of any change; of an
        outlier, that it is one; of a leak, by the readings that begin it. NaN where there is none.
    shift_std, load_std, leak_std, rest_std
        Standard deviations of the sizes; NaN where unknown.
    """

    after: str
    before: str
    begin: datetime | None
    kind: str
    shift: float
    load: float
    leak: float = 0.0
    rest: float = 0.0
    probability: float = float("nan")
    shift_std: float = float("nan")
    load_std: float = float("nan")
    leak_std: float = float("nan")
    rest_std: float = float("nan")

    @property
    def leak_interval(self) -> Interval:
        """Leak as it is read [m³/(Pa·s)], with the 95 % interval of the truck's, which differs by `LEAK_FACTORS`."""
        least, largest = LEAK_FACTORS
        half = QUANTILE * self.leak_std
        return Interval(self.leak, least * max(self.leak - half, 0.0), largest * (self.leak + half))


def size_interval(value: float, std: float) -> Interval:
    """A size of an alarm with its 95 % interval."""
    return Interval(value, value - QUANTILE * std, value + QUANTILE * std)


def alarms(
    dated: Sequence[RecordingJob],
    readings: Sequence[WearReading],
    verdicts: Sequence[TrendOutcome],
    then: dict[str, Band],
    rests: Sequence[RestMove],
) -> tuple[Alarm, ...]:
    """All alarms in the order of the recordings; `then` is the trend as known at each, `rests` how the rest moved."""
    leaks = [reading.leak is not None and _is_fault(reading.leak) for reading in readings]
    changed = [k for k, verdict in enumerate(verdicts) if verdict.outcome in CHANGED]
    numbered = [(k, _change(dated, readings, verdicts, then, k)) for k in changed]
    for kind, flags, least in (
        ("leak", leaks, LEAKS),
        ("departed", [reading.departs for reading in readings], DEPARTED),
    ):
        for k in _begins(flags, least):
            after = dated[k - 1].recording if k else ""
            alarm, leak = Alarm(after, dated[k].recording, dated[k].begin, kind, 0.0, 0.0), readings[k].leak
            if kind == "leak" and leak:
                sure = 1.0 - (1.0 - leak.probability) ** LEAKS
                alarm = alarm._replace(leak=leak.conductance, leak_std=leak.std, probability=sure)
            numbered.append((k, alarm))
    for k, (job, rest) in enumerate(zip(dated, rests, strict=True)):
        if rest.sudden:
            after = next((dated[j].recording for j in range(k - 1, -1, -1) if readings[j].rest is not None), "")
            moved = Alarm(after, job.recording, job.begin, "sensor moved", 0.0, 0.0, rest=rest.move, rest_std=rest.std)
            numbered.append((k, moved))
    return tuple(alarm for _, alarm in sorted(numbered, key=lambda pair: pair[0]))


def _is_fault(leak: Leak) -> bool:
    """Whether a leak is certain, and larger than that of seals that age."""
    return leak.probability > LEAKING and leak.conductance > AGED


def suspects(
    dated: Sequence[RecordingJob],
    readings: Sequence[WearReading],
    measurements: Sequence[Measurement | None],
    verdicts: Sequence[TrendOutcome],
    then: dict[str, Band],
) -> tuple[Alarm, ...]:
    """Candidates that are no alarm of the trend: 'unknown' changes that the next recordings decide, and wrong files.

    A wrong file is an outlier or a departure that is far from the readings before and after it, which agree.
    """
    rows, agree = [], [k for k, verdict in enumerate(verdicts) if verdict.outcome == "used"]
    for k, (job, now, verdict) in enumerate(zip(dated, measurements, verdicts, strict=True)):
        after = max((j for j in agree if j < k), default=None)
        alarm = Alarm("" if after is None else dated[after].recording, job.recording, job.begin, "", np.nan, np.nan)
        if verdict.outcome not in CHANGED and verdict.change >= POSSIBLE:
            rows.append(alarm._replace(kind="unknown", probability=verdict.change))
        if after is None or agree[-1] < k:
            continue
        if now is None:
            if [readings[j].departs for j in (k - 1, k, k + 1)] == [False, True, False]:
                rows.append(alarm._replace(kind="wrong file"))
        elif verdict.outcome == "left out" and verdict.probability >= SURE:
            shift, load = now.shift - float(then["shift"].value[k]), now.load - float(then["load"].value[k])
            if max(abs(shift) / now.shift_std, abs(load) / now.load_std) > _FOREIGN:
                rows.append(Alarm(*alarm[:3], "wrong file", shift, load, 0.0, 0.0, verdict.probability, *now[1:4:2]))
    return tuple(rows)


def _change(
    dated: Sequence[RecordingJob],
    readings: Sequence[WearReading],
    verdicts: Sequence[TrendOutcome],
    then: dict[str, Band],
    k: int,
) -> Alarm:
    """The alarm of a change before recording `k`."""
    earlier = max((j for j in range(k) if verdicts[j].outcome in ("used", *CHANGED)), default=0)
    shift, load = (float(then[name].value[k] - then[name].value[earlier]) for name in ("shift", "load"))
    kind, share, _ = verdicts[k]
    alarm = Alarm(dated[earlier].recording, dated[k].recording, dated[k].begin, kind, shift, load, probability=share)
    first, second = readings[earlier].measurement, readings[k].measurement
    if first is None or second is None or first.by != second.by or dated[earlier].start != dated[k].start:
        return alarm
    shift_std, load_std = (float(np.hypot(_own_std(first, name), _own_std(second, name))) for name in CHANNELS)
    return alarm._replace(shift_std=shift_std, load_std=load_std)


def _own_std(now: Measurement, channel: str) -> float:
    """Standard deviation of what a reading does not share with others of its reader: by itself, and by 10 K."""
    shares, std = SHARES_BY[now.by][channel], getattr(now, f"{channel}_std")
    return float(std * np.hypot(shares.independent, shares.by_temperature))


def _begins(flags: Sequence[bool], least: int) -> list[int]:
    """Starts of `least` successive recordings with the flag, after as many without it or from the first."""
    starts, candidate, count, active = [], 0, 0, False
    for k, flag in enumerate(flags):
        if flag == active:
            count = 0
            continue
        candidate = k if count == 0 else candidate
        count += 1
        if count == least:
            active, count = flag, 0
            if flag:
                starts.append(candidate)
    return starts

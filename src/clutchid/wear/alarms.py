"""Alarms: the load jumps, chamber A begins to leak, or the calibration no longer holds."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Literal, NamedTuple

import numpy as np
from scipy import special

from clutchid.estimation.assess.comparison import Measurement
from clutchid.log import FloatArray
from clutchid.strokes.vented_rest import RestShift
from clutchid.wear.history import Leak, RecordingJob, WearReading
from clutchid.wear.trend import AGED, DEPARTED, FALL, FALL_FACTOR, FALSE_ALARMS, LEAKING, LEAKS, Band, TrendOutcome

#: Kinds of alarms of a change of the load.
CHANGED = ("replaced", "sudden", "unknown")

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
    """

    move: float
    cause: RestCause
    sudden: bool = False


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
        move, noise = rest.value - before[1].value, z * float(np.hypot(rest.std, before[1].std))
        fallen = base[1].value - before[1].value
        allowed = _allowed_fall(float(s[k] - s[before[0]]), float(s[before[0]] - s[base[0]]), fallen, noise, life)
        if move > noise or -move > allowed + noise:
            back = abs(move - fallen) <= noise
            new = k in replaced or (back and _as_new(measurements[k]))
            moves.append(RestMove(move, "new clutch" if new else "sensor", not new))
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
        Of a change of the load, given all recordings: that of its kind, or if that is unknown of any change.
    """

    after: str
    before: str
    begin: datetime | None
    kind: str
    shift: float
    load: float
    leak: float = 0.0
    rest: float = 0.0
    probability: float = 1.0


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
    numbered = [(k, _change(dated, verdicts, then, k)) for k in changed]
    for kind, flags, least in (
        ("leak", leaks, LEAKS),
        ("departed", [reading.departs for reading in readings], DEPARTED),
    ):
        for k in _begins(flags, least):
            leak = readings[k].leak
            size = leak.conductance if kind == "leak" and leak else 0.0
            after = dated[k - 1].recording if k else ""
            numbered.append((k, Alarm(after, dated[k].recording, dated[k].begin, kind, 0.0, 0.0, size)))
    for k, (job, rest) in enumerate(zip(dated, rests, strict=True)):
        if rest.sudden:
            after = next((dated[j].recording for j in range(k - 1, -1, -1) if readings[j].rest is not None), "")
            numbered.append((k, Alarm(after, job.recording, job.begin, "sensor moved", 0.0, 0.0, rest=rest.move)))
    return tuple(alarm for _, alarm in sorted(numbered, key=lambda pair: pair[0]))


def _is_fault(leak: Leak) -> bool:
    """Whether a leak is certain, and larger than that of seals that age."""
    return leak.probability > LEAKING and leak.conductance > AGED


def _change(dated: Sequence[RecordingJob], verdicts: Sequence[TrendOutcome], then: dict[str, Band], k: int) -> Alarm:
    """The alarm of a change before recording `k`."""
    earlier = max((j for j in range(k) if verdicts[j].outcome in ("used", *CHANGED)), default=0)
    shift, load = (float(then[name].value[k] - then[name].value[earlier]) for name in ("shift", "load"))
    kind, share = verdicts[k]
    return Alarm(dated[earlier].recording, dated[k].recording, dated[k].begin, kind, shift, load, probability=share)


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

"""The vented rest over the life of a clutch: what of its moves is wear, and what the position sensor."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy import stats

from clutchid.log import FloatArray
from clutchid.recordings.strokes.vented_rest import RestShift
from clutchid.wear.history import Measurement
from clutchid.wear.trend import FALL, FALSE_ALARMS, FASTER

Cause = Literal["", "sensor", "wear", "new clutch"]


class RestMove(NamedTuple):
    """Vented rest at a recording: its shift in m since the one before, and the cause of its position.

    `cause` is "sensor" where the sensor moved, or the rest has risen slowly; "wear" where it has fallen slowly; "new
    clutch" where it is back after a clutch was replaced; empty where it has not moved, or is not known.
    """

    move: float
    cause: Cause
    sudden: bool = False


#: Where a recording has no known rest.
NOT_KNOWN = RestMove(float("nan"), "")


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
    z = float(stats.norm.ppf(1.0 - FALSE_ALARMS / 2.0))
    found: list[RestMove] = []
    base = before = None
    for k, rest in enumerate(rests):
        if rest is None:
            found.append(NOT_KNOWN)
            continue
        if base is None or before is None:
            found.append(RestMove(0.0, ""))
            base = before = k, rest
            continue
        move, noise = rest.value - before[1].value, z * float(np.hypot(rest.std, before[1].std))
        fallen = base[1].value - before[1].value
        allowed = _allowed_fall(float(s[k] - s[before[0]]), float(s[before[0]] - s[base[0]]), fallen, noise, life)
        if move > noise or -move > allowed + noise:
            back = abs(move - fallen) <= noise
            new = k in replaced or (back and _as_new(measurements[k]))
            found.append(RestMove(move, "new clutch" if new else "sensor", not new))
            base = k, rest
        else:
            drift = rest.value - base[1].value
            moved = abs(drift) > z * np.hypot(rest.std, base[1].std)
            found.append(RestMove(move, ("wear" if drift < 0.0 else "sensor") if moved else ""))
        before = k, rest
    return found


def _allowed_fall(ds: float, since: float, fallen: float, noise: float, life: float) -> float:
    """Largest fall in m that wear explains over `ds`: by a clutch without an adjuster, and by the pace so far."""
    most = FALL * ds / life
    return min(most, FASTER * (max(fallen, 0.0) + noise) * ds / since) if since > 0.0 else most


def _as_new(one: Measurement | None) -> bool:
    """Whether a load is that of the calibration."""
    return one is not None and abs(one.shift) <= 2 * one.shift_std and abs(one.load) <= 2 * one.load_std

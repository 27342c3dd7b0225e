"""Travel of the piston: how far it goes in a recording, and the far stop where a valve presses it there.

With the far stop in two recordings the gains of their positions are compared; without, only the travel is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from clutchid.log import INPUTS, Log
from clutchid.strokes.excitation import HOLD_SPEED
from clutchid.strokes.rest_level import CLOSED
from clutchid.strokes.sampled import runs

#: Pressed to the far stop: from this duty cycle on, for this time in s, the last `_LEVEL` s of which give its position.
_OPEN, _PRESSED, _LEVEL = 0.9, 0.15, 0.05

#: A piston that is pressed nearer to the rest than this share of the travel is stuck, not at the stop.
_FAR = 0.6

#: Changes of the travel to the stop, and of the travel without one, as shares of it, from which they are said: a
#: facing of 1.5 mm wear lets the rest of the virtual trucks fall by up to 0.8 mm, 3.5 % of their stroke. Provenance:
#: benchmarks/results/causes.md.
GAIN, MORE = 0.03, 0.08


class Travel(NamedTuple):
    """Travel in a recording, in m.

    Attributes
    ----------
    reach
        That all but a thousandth of the samples stay within.
    stop
        Position of the far stop; NaN where it was not reached.
    """

    reach: float
    stop: float = math.nan


def travel_of(log: Log) -> Travel:
    """Travel of a recording, and its far stop where the supply valve presses the piston to it.

    Examples
    --------
    >>> t = np.arange(0.0, 1.0, 1e-3)
    >>> y = np.minimum(0.1 * t, 0.025)
    >>> travel_of(Log(t, {"position": y, "duty_supply": np.ones(1000), "duty_exhaust": np.zeros(1000)}))
    Travel(reach=0.025, stop=0.025)
    """
    reach, levels = log.reach(), []
    if all(name in log for name in ("position", *INPUTS)):
        supply, exhaust = (log[name] for name in INPUTS)
        for a, b in runs((supply >= _OPEN) & (exhaust <= CLOSED)):
            begin = int(np.searchsorted(log.time, log.time[b - 1] - _LEVEL))
            level = log["position"][begin:b]
            if log.time[b - 1] - log.time[a] < _PRESSED or not np.isfinite(level).all():
                continue
            slope = np.polyfit(log.time[begin:b] - log.time[begin], level, 1)[0]
            if abs(slope) < HOLD_SPEED and level.mean() > _FAR * reach:
                levels.append(float(np.median(level)))
    return Travel(reach, float(np.median(levels)) if levels else math.nan)


def merged_travels(travels: Iterable[Travel]) -> Travel:
    """Travel of several recordings together; an empty one without any."""
    several = list(travels)
    stops = [travel.stop for travel in several if math.isfinite(travel.stop)]
    return Travel(
        max((travel.reach for travel in several), default=math.nan), float(np.median(stops)) if stops else math.nan
    )


def suspect_from(before: Travel | None) -> float:
    """Recorded position in m beyond which the travel is suspect; infinite where that of a calibration is not known.

    Examples
    --------
    >>> f"{suspect_from(Travel(0.0234)):.4f}"
    '0.0253'
    """
    limits = [] if before is None else [before.stop * (1.0 + GAIN), before.reach * (1.0 + MORE)]
    return next(filter(math.isfinite, limits), math.inf)


class TravelChange(NamedTuple):
    """Change of a travel since the calibration.

    The `ratio` of the two, whether it is `suspect`, whether the gain is `checked` by the far stop, and a `sentence`.
    """

    ratio: float
    suspect: bool
    checked: bool
    sentence: str


def travel_change(before: Travel, now: Travel, subtracted: float = 0.0) -> TravelChange:
    """Compare the travel of a recording with that of a calibration.

    Parameters
    ----------
    before, now : m
        Of the calibration, and of the recording as its position counts.
    subtracted : m
        What was subtracted from the recorded position because the vented rest has moved: the far stop moves with it.

    Examples
    --------
    >>> travel_change(Travel(0.0234), Travel(0.0261)).suspect
    True
    """
    if math.isfinite(before.stop) and math.isfinite(now.stop):
        present, ratio = now.stop + subtracted, (now.stop + subtracted) / before.stop
        text = f"the far stop is at {present * 1e3:.1f} mm, {before.stop * 1e3:.1f} mm in the calibration"
        if abs(ratio - 1.0) < GAIN:
            return TravelChange(ratio, False, True, f"{text}: the gain of the position is as calibrated.")
        wear = f", or the clutch has worn so that its rest fell by {(present - before.stop) * 1e3:.1f} mm"
        cause = (
            f"the gain of the position seems to be {ratio:.2f} times that of the "
            f"calibration{wear if ratio > 1.0 else ''}"
        )
        return TravelChange(ratio, True, True, f"{text}: {cause}; check the range and the scaling of its channel.")
    present, furthest = now.reach + subtracted, before.reach
    ratio, text = present / furthest, f"the piston travels {present * 1e3:.1f} mm, {furthest * 1e3:.1f} mm in the"
    if ratio > 1.0 + MORE:
        return TravelChange(
            ratio, True, False,
            f"{text} calibration: the gain of the position may be too large, or the calibration did not reach as far; "
            "check its scaling, and calibrate to the far stop.",
        )  # fmt: skip
    return TravelChange(
        ratio, False, False,
        f"{text} calibration, without the far stop in both: the gain of the position cannot be checked here; press the "
        "piston to the far stop in both to check it.",
    )  # fmt: skip

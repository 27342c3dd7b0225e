"""Position of the vented piston at rest, as its sensor reads it, and its shift between two recordings."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.log import BoolArray, Log, sample_interval
from clutchid.numerics.interval import QUANTILE
from clutchid.strokes.rest_level import (
    CALM,
    CLOSED,
    CREEP,
    LOW_END,
    STILL,
    RawBins,
    quantum_of,
    ranges,
    raw_bins,
    samples_in_bin,
    windows_of,
)
from clutchid.strokes.rest_shift import CLEARLY, NOTHING, RETURNS, level_interval
from clutchid.strokes.sampled import runs
from clutchid.strokes.stream import StrokeSamples
from clutchid.strokes.values import Values

#: Time in s for which the exhaust valve is open at a vented rest, after the piston has come to a standstill or within
#: `STILL` s before; and the beginning of a rest that gives its level: seals that relax let the piston creep later.
VENTS, _EARLY = 0.05, 0.3

#: Whether a rest that has moved is subtracted from the position, or the position is taken as it was recorded.
Zero = Literal["subtract", "keep"]


class VentedRest(NamedTuple):
    """Levels of the vented rests of a recording.

    Attributes
    ----------
    lowest : m
        The lowest one.
    returned : m
        Median of those after a stroke, NaN where there is none: friction holds the piston above its stop there.
    quantum : m
        Step of the sensor.
    """

    lowest: float
    returned: float
    quantum: float

    @property
    def held(self) -> float:
        """Distance in m at which friction holds the piston above the lowest rest after a stroke."""
        return self.returned - self.lowest

    @property
    def at_stop(self) -> bool:
        """Whether the piston touches its stop at the lowest rest: it lies clearly below those after a stroke."""
        return bool(self.held > CLEARLY)


class RestShift(NamedTuple):
    """Shift of the vented rest since a calibration.

    Attributes
    ----------
    value : m
        The shift; above 0 where the sensor reads more than then.
    low, high : m
        95 % interval.

    Examples
    --------
    >>> f"{RestShift(3e-4, 2.8e-4, 3.2e-4)}"
    '+0.30 mm (+0.28 to +0.32)'
    """

    value: float
    low: float
    high: float

    @property
    def moved(self) -> bool:
        """Whether it has moved, by its interval."""
        return self.low > 0.0 or self.high < 0.0

    @property
    def std(self) -> float:
        """Standard deviation in m."""
        return (self.high - self.low) / (2.0 * QUANTILE)

    def __str__(self) -> str:
        return f"{1e3 * self.value:+.2f} mm ({1e3 * self.low:+z.2f} to {1e3 * self.high:+z.2f})"


def vented_rest(log: Log) -> VentedRest | None:
    """Levels of the vented rests of a recording; None without one.

    A rest is vented where the exhaust valve is open at it; the one at the beginning may have been vented before.

    Parameters
    ----------
    log : Log
        With a position in m, and the duty cycles of the valves where there are any.

    Examples
    --------
    Strokes from a rest at 0.3 mm, to which the piston returns with the exhaust valve open:

    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> y = 3e-4 + np.interp(t, [1.0, 1.1, 1.5, 1.8], [0.0, 0.02, 0.02, 0.0])
    >>> found = vented_rest(Log(t, {"position": y, "duty_exhaust": 1.0 * (t > 1.5) * (t < 2.2)}))
    >>> f"{found.lowest * 1e3:.2f} mm, {found.returned * 1e3:.2f} mm"
    '0.30 mm, 0.30 mm'
    """
    if "position" not in log or len(log) < 2 or not np.isfinite(log["position"]).any():
        return None
    samples = StrokeSamples(0, log.time, log.columns)
    interval = sample_interval(samples.time, 0.0)
    if not interval > 0.0:
        return None
    width = samples_in_bin(interval)
    raw, seconds = raw_bins(samples, width, np.nan), width * interval
    exhaust = log.columns.get("duty_exhaust")
    opened = None if exhaust is None else np.maximum.reduceat(np.nan_to_num(exhaust), raw.first) > CLOSED
    rests = _rests(raw, opened, seconds)
    if not rests:
        return None
    returned = [level for level, after_stroke in rests if after_stroke]
    return VentedRest(
        min(level for level, _ in rests),
        float(np.median(returned)) if returned else float("nan"),
        quantum_of(log["position"]),
    )


def _rests(raw: RawBins, opened: BoolArray | None, seconds: float) -> list[tuple[float, bool]]:
    """Level in m of each vented rest, and whether a stroke came before it; bins are `seconds` long."""
    position = raw.filled
    spread = ranges(position, windows_of(seconds))
    span, low = float(np.ptp(position)), float(position.min())
    calm = float(np.quantile(spread, CALM))
    still = (spread <= max(CREEP * span / 2, 2.0 * calm)) & raw.closed & (position <= low + LOW_END * span)
    rests: list[tuple[float, bool]] = []
    shortest, early, before = (round(time / seconds) for time in (STILL, _EARLY, STILL))
    for a, b in runs(still):
        if b - a < max(shortest, 1):
            continue
        at_start = a == 0 or not np.any(position[:a] > low + LOW_END * span)
        vents = opened is None or np.sum(opened[max(a - before, 0) : b]) * seconds >= VENTS
        if at_start or vents:
            rests.append((float(np.median(position[a : a + max(early, 1)])), not at_start))
    return rests


def merged_levels(rests: Sequence[VentedRest | None]) -> VentedRest | None:
    """The levels of several recordings of one actuator together; None without any."""
    readings = [rest for rest in rests if rest is not None]
    if not readings:
        return None
    returned = [rest.returned for rest in readings if np.isfinite(rest.returned)]
    return VentedRest(
        float(np.median([rest.lowest for rest in readings])),
        float(np.median(returned)) if returned else float("nan"),
        max(rest.quantum for rest in readings),
    )


def rest_shift(before: VentedRest, now: VentedRest) -> RestShift | None:
    """Shift of the vented rest from one recording to another; None where they cannot be compared: `compared_rests`."""
    level = level_interval(max(before.quantum, now.quantum))
    levels = before.lowest, before.returned, now.lowest, now.returned
    rule = kernels_in("clutchid.strokes.rest_shift_rule")
    compared = rule.compared_rests(*levels, level)
    if compared == NOTHING:
        return None
    value = now.returned - before.returned if compared == RETURNS else now.lowest - before.lowest
    half = rule.half_interval(compared, level, rule.held_above(*levels))
    return RestShift(value, value - half, value + half)


def other_zeros(values: Values) -> list[str]:
    """Why a recording cannot be read as one where its position jumps and stays: a zero for each part, in sentences.

    Where the vented rest is the same before and after, two recordings of one truck may be joined, and only a segment
    ends there.
    """
    log, problems = values.log, []
    ends = [int(np.searchsorted(log.time, fault.first)) for fault in values.faults if fault.moves_zero]
    rests = [vented_rest(log.slice(a, b)) for a, b in pairwise([0, *ends, len(log)])] if ends else []
    for end, (before, now) in zip(ends, pairwise(rests), strict=True):
        shift = rest_shift(before, now) if before and now else None
        if shift is not None and not shift.moved:
            continue
        reason = f"its vented rest moves by {shift}" if shift else "no vented rest shows whether the zero is the same"
        problems.append(
            f"{log.name}: the position jumps at {log.time[end]:.3f} s and stays there, and {reason}: the sensor was "
            "zeroed again, or two recordings were joined; cut the recording there, and estimate its parts one by one."
        )
    return problems


class ZeroedLog(NamedTuple):
    """A recording whose position counts from the vented rest, the shift of that, and the length subtracted in m.

    `shift` is None where it is not known.
    """

    log: Log
    shift: RestShift | None = None
    subtracted: float = 0.0


def from_rest(log: Log, rest: VentedRest | None, zero: Zero = "subtract") -> ZeroedLog:
    """A recording with its position as travel from the vented rest, so that this is where it was at a calibration.

    A shift within its interval of 0 is not subtracted: the same zero gives the same numbers.

    Parameters
    ----------
    log : Log
        With a position in m.
    rest : VentedRest or None
        Of the calibration recordings; None where it is not known.
    zero : 'subtract' or 'keep'
        Whether to subtract a shift.
    """
    now = None if rest is None else vented_rest(log)
    shift = rest_shift(rest, now) if rest and now else None
    if shift is None or not shift.moved or zero == "keep":
        return ZeroedLog(log, shift)
    return ZeroedLog(log.with_columns(position=log["position"] - shift.value), shift, shift.value)

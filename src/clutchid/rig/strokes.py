"""Strokes at constant speed, extracted from a recording and paired to cycles, the statistical units."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from clutchid.log import HOLE, FloatArray, Log
from clutchid.recordings.signals.sampled import runs, velocity

#: Fractions of the reach between which a stroke is averaged: without pre-sliding and the reversals at its ends.
BAND = (0.3, 0.8)

#: Half window in s over which the speed is computed.
_WINDOW = 0.05

#: Least fraction of the band that a stroke passes, and largest relative difference of its speed between thirds.
_PASSED, _UNEVEN = 0.9, 0.25

#: Least number of samples of a stroke.
_FEWEST = 6

#: Least speed of a stroke, as a fraction of the highest speeds.
_SLOW = 0.1


@dataclass(frozen=True, slots=True)
class Stroke:
    """A stroke at constant speed: start in s, mean speed (m/s, signed), force (N), absolute pressure (Pa, or NaN)."""

    start: float
    speed: float
    force: float
    pressure: float


@dataclass(frozen=True, slots=True)
class Cycle:
    """Two consecutive strokes in opposite directions: `out` towards larger positions, and `back`."""

    out: Stroke
    back: Stroke

    @property
    def half_difference(self) -> float:
        """Half the difference of the forces in N: friction, plus half the difference of the pressure forces."""
        return (self.out.force - self.back.force) / 2

    @property
    def middle(self) -> float:
        """Mean of the forces in N: pressure force and zero of the load cell."""
        return (self.out.force + self.back.force) / 2

    @property
    def half_pressure(self) -> float:
        """Half the difference of the pressures in Pa."""
        return (self.out.pressure - self.back.pressure) / 2

    @property
    def pressure(self) -> float:
        """Mean absolute pressure in Pa."""
        return (self.out.pressure + self.back.pressure) / 2


def strokes(log: Log, band: tuple[float, float] = BAND) -> list[Stroke]:
    """Strokes at constant speed in order of time, each averaged within `band` of the reach.

    Parameters
    ----------
    log : Log
        Position in m, force in N and, where measured, pressure_a in Pa.
    band : (1, 1)
        Fractions of the reach, in [0, 1]; both directions are averaged over the same positions, so that forces that
        depend on the position cancel in their difference.

    Returns
    -------
    strokes : list of Stroke
        Strokes with a hole, uneven speed, or half of their forces missing are left out.

    Examples
    --------
    A triangle of 40 mm in 4 s against 5 N of friction:

    >>> t = np.arange(0.0, 8.0, 0.01)
    >>> y = 0.04 * np.abs((t / 4 + 1) % 2 - 1)
    >>> force = np.where(t < 4.0, 5.0, -5.0)
    >>> [f"{s.speed * 1e3:+.0f} mm/s, {s.force:+.0f} N" for s in strokes(Log(t, {"position": y, "force": force}))]
    ['+10 mm/s, +5 N', '-10 mm/s, -5 N']
    """
    position, known = log["position"], np.isfinite(log["position"])
    if known.sum() < 3:
        return []
    low, high = np.quantile(position[known], [0.02, 0.98])
    ends = low + np.array(band) * (high - low)
    speed = velocity(log.time, position, _WINDOW)
    slow = _SLOW * float(np.nanquantile(np.abs(speed), 0.9))
    inside = known & (position >= ends[0]) & (position <= ends[1])
    found = []
    for way in (1.0, -1.0):
        for first, last in runs(inside & (way * speed > slow)):
            if last - first < _FEWEST:
                continue
            steps = np.diff(log.time[first:last])
            whole = abs(position[last - 1] - position[first]) >= _PASSED * (ends[1] - ends[0])
            if whole and steps.max() <= HOLE * np.median(steps):
                found.append((first, last))
    candidates = [_stroke(log, speed, *ends_of) for ends_of in sorted(found)]
    return [stroke for stroke in candidates if stroke is not None]


def _stroke(log: Log, speed: FloatArray, first: int, last: int) -> Stroke | None:
    v, force = speed[first:last], log["force"][first:last]
    known = np.isfinite(force)
    thirds = [float(third.mean()) for third in np.array_split(v, 3)]  # noise of the position averages out
    if known.mean() <= 0.5 or max(thirds) - min(thirds) > _UNEVEN * abs(float(v.mean())):
        return None
    pressure = log["pressure_a"][first:last][known] if "pressure_a" in log else np.full(1, np.nan)
    pressure = pressure[np.isfinite(pressure)]
    return Stroke(
        float(log.time[first]),
        float(v.mean()),
        float(force[known].mean()),
        float(pressure.mean()) if pressure.size else float("nan"),
    )


def cycles(found: list[Stroke]) -> list[Cycle]:
    """Pair strokes to cycles; each stroke is in at most one cycle."""
    pairs, taken = [], False
    for one, other in pairwise(found):
        if taken or (one.speed > 0) == (other.speed > 0):
            taken = False
            continue
        pairs.append(Cycle(one, other) if one.speed > 0 else Cycle(other, one))
        taken = True
    return pairs

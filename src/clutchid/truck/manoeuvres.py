"""Manoeuvres: set point of the position at every millisecond, from a seeded random generator."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from clutchid.log import FloatArray
from clutchid.names import check_names
from clutchid.truck.settings import SAMPLE


@dataclass(frozen=True, slots=True)
class ClutchPoints:
    """Touch point and fully open position of the clutch in m, relative to the sensor's zero."""

    touch: float
    full: float


def set_point(name: str, seconds: float, points: ClutchPoints, rng: np.random.Generator) -> FloatArray:
    """Set point in m at every millisecond of `seconds`; a manoeuvre is repeated with new random values.

    Every course starts with 0.3 s of rest with the clutch engaged.

    Raises
    ------
    ParameterError
        If the manoeuvre is unknown; the text names the nearest one.

    Examples
    --------
    >>> course = set_point("strokes", 3.0, ClutchPoints(6e-3, 22e-3), np.random.default_rng(0))
    >>> course.size, round(course.max() * 1e3)
    (3000, 22)
    """
    check_names([name], MANOEUVRES, "manoeuvre")
    n, parts = round(seconds / SAMPLE), [hold(0.0, 0.3)]
    while sum(part.size for part in parts) < n:
        parts += MANOEUVRES[name](points, rng)
    return np.concatenate(parts)[:n]


def hold(level: float, seconds: float) -> FloatArray:
    """Stay at `level`."""
    return np.full(max(round(seconds / SAMPLE), 1), level)


def ramp(start: float, stop: float, seconds: float) -> FloatArray:
    """Go straight from `start` to `stop`."""
    return np.linspace(start, stop, max(round(seconds / SAMPLE), 2))


def gear_shift(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:
    """Open fully for the gear change, return quickly to the touch point, and engage with slip."""
    open_at, above, below = points.full - rng.uniform(0, 2e-3), points.touch + 2.5e-3, max(points.touch - 3e-3, 1e-3)
    slipping = rng.uniform(0.25, 0.8)
    return [
        hold(open_at, rng.uniform(0.4, 0.9)), ramp(open_at, above, 0.12), ramp(above, below, slipping),
        hold(0.0, rng.uniform(0.5, 1.4)),
    ]  # fmt: skip


def pull_away(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:
    """Pull away on a hill: open, go to the touch point, slip against the slope, engage."""
    above, hill = points.touch + rng.uniform(0.5e-3, 1.5e-3), points.touch - rng.uniform(0.5e-3, 1.5e-3)
    seconds = rng.uniform(1.2, 2.5)
    wave = 0.25e-3 * np.sin(2 * np.pi * rng.uniform(0.5, 1.5) * np.arange(round(seconds / SAMPLE)) * SAMPLE)
    slip = ramp(above, hill, seconds)
    return [
        hold(points.full - rng.uniform(0, 2e-3), rng.uniform(0.7, 1.5)),
        ramp(points.full, above, rng.uniform(0.3, 0.6)), slip + wave[: slip.size],
        ramp(hill, max(hill - 3e-3, 1e-3), 0.5), hold(0.0, rng.uniform(0.7, 1.5)),
    ]  # fmt: skip


def creep(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:
    """Creep in a queue: open, then modulate around the touch point."""
    seconds = rng.uniform(3.0, 5.0)
    t = np.arange(round(seconds / SAMPLE)) * SAMPLE
    swing = rng.uniform(0.7e-3, 1.6e-3) * np.sin(2 * np.pi * rng.uniform(0.25, 0.9) * t)
    pushes = np.repeat(rng.uniform(-0.8e-3, 0.8e-3, t.size // 700 + 1), 700)[: t.size]
    level = points.touch + rng.uniform(-0.5e-3, 1.5e-3)
    return [
        hold(points.full - rng.uniform(0, 3e-3), rng.uniform(0.5, 1.0)),
        ramp(points.full, level, rng.uniform(0.3, 0.6)), np.maximum(level + swing + pushes, 0.5e-3),
        hold(0.0, rng.uniform(0.6, 1.2)),
    ]  # fmt: skip


def staircase(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:
    """Levels over the whole stroke in random order, half a second each."""
    levels = rng.permutation(np.linspace(0.06, 0.94, 8)) * points.full
    steps = [hold(float(level + rng.uniform(-0.4e-3, 0.4e-3)), 0.5) for level in levels]
    return [*steps, hold(0.0, 0.8)]


def strokes(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:
    """Full strokes."""
    return [hold(points.full, rng.uniform(0.6, 1.0)), hold(0.0, rng.uniform(0.8, 1.2))]


def ramps(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:
    """Slowly over the whole stroke and back."""
    up, down = rng.uniform(2.0, 3.5, 2)
    return [ramp(0.0, points.full, up), hold(points.full, 0.3), ramp(points.full, 0.5e-3, down), hold(0.0, 0.6)]


def validation(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:  # noqa: ARG001
    """The published protocol: two full strokes, then from full to 70 ... 20 %, each followed by a 2 s ramp by 20 %."""
    full = points.full
    parts = [part for _ in range(2) for part in (hold(full, 1.0), hold(0.0, 1.2))]
    for share in (0.7, 0.6, 0.5, 0.4, 0.3, 0.2):
        low = max(share - 0.2, 0.01) * full
        parts += [hold(full, 1.0), hold(share * full, 0.7), ramp(share * full, low, 2.0)]
    return [*parts, hold(0.0, 1.0)]


def mix(points: ClutchPoints, rng: np.random.Generator) -> list[FloatArray]:
    """All manoeuvres in random order after a gear shift, with gear shifts more often than the others."""
    others = (gear_shift, gear_shift, pull_away, creep, staircase, strokes, ramps)
    order = rng.permutation(len(others))
    return [course for manoeuvre in (gear_shift, *(others[i] for i in order)) for course in manoeuvre(points, rng)]


#: Manoeuvres by name.
MANOEUVRES = MappingProxyType(
    {
        manoeuvre.__name__.replace("_", "-"): manoeuvre
        for manoeuvre in (mix, gear_shift, pull_away, creep, staircase, strokes, ramps, validation)
    }
)

"""Manoeuvres: the position that the transmission's controller wants, at every millisecond, from a seeded generator."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.parameters import unknown_name
from clutchid.truck.law import SAMPLE


@dataclass(frozen=True, slots=True)
class Feel:
    """What the transmission knows of its clutch: where it takes hold and where it is fully open [m], sensor's zero."""

    touch: float
    full: float


def wanted_position(name: str, seconds: float, feel: Feel, rng: np.random.Generator) -> FloatArray:
    """Wanted position in m at every millisecond of `seconds`; a manoeuvre is repeated with new numbers until then.

    Every course starts with a rest of 0.3 s in the engaged clutch.

    Raises
    ------
    ParameterError
        If there is no such manoeuvre; the text names the nearest one.

    Examples
    --------
    >>> course = wanted_position("strokes", 3.0, Feel(6e-3, 22e-3), np.random.default_rng(0))
    >>> course.size, round(course.max() * 1e3)
    (3000, 22)
    """
    if name not in MANOEUVRES:
        raise ParameterError(unknown_name(name, MANOEUVRES, "manoeuvre"))
    n, parts = round(seconds / SAMPLE), [hold(0.0, 0.3)]
    while sum(part.size for part in parts) < n:
        parts += MANOEUVRES[name](feel, rng)
    return np.concatenate(parts)[:n]


def hold(level: float, seconds: float) -> FloatArray:
    """Stay at `level`."""
    return np.full(max(round(seconds / SAMPLE), 1), level)


def ramp(start: float, stop: float, seconds: float) -> FloatArray:
    """Go straight from `start` to `stop`."""
    return np.linspace(start, stop, max(round(seconds / SAMPLE), 2))


def gear_shift(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:
    """Open fully, change the gear, come back quickly to where the clutch takes hold, and slip it in."""
    open_at, above, below = feel.full - rng.uniform(0, 2e-3), feel.touch + 2.5e-3, max(feel.touch - 3e-3, 1e-3)
    slipping = rng.uniform(0.25, 0.8)
    return [
        hold(open_at, rng.uniform(0.4, 0.9)),
        ramp(open_at, above, 0.12),
        ramp(above, below, slipping),
        hold(0.0, rng.uniform(0.5, 1.4)),
    ]


def pull_away(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:
    """Pull away on a hill: open, come to where the clutch takes hold, slip it against the slope, let it in."""
    above, hill = feel.touch + rng.uniform(0.5e-3, 1.5e-3), feel.touch - rng.uniform(0.5e-3, 1.5e-3)
    seconds = rng.uniform(1.2, 2.5)
    wave = 0.25e-3 * np.sin(2 * np.pi * rng.uniform(0.5, 1.5) * np.arange(round(seconds / SAMPLE)) * SAMPLE)
    slip = ramp(above, hill, seconds)
    return [
        hold(feel.full - rng.uniform(0, 2e-3), rng.uniform(0.7, 1.5)),
        ramp(feel.full, above, rng.uniform(0.3, 0.6)),
        slip + wave[: slip.size],
        ramp(hill, max(hill - 3e-3, 1e-3), 0.5),
        hold(0.0, rng.uniform(0.7, 1.5)),
    ]


def creep(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:
    """Creep in a queue: open, then push and give way around the point where the clutch takes hold."""
    seconds = rng.uniform(3.0, 5.0)
    t = np.arange(round(seconds / SAMPLE)) * SAMPLE
    swing = rng.uniform(0.7e-3, 1.6e-3) * np.sin(2 * np.pi * rng.uniform(0.25, 0.9) * t)
    pushes = np.repeat(rng.uniform(-0.8e-3, 0.8e-3, t.size // 700 + 1), 700)[: t.size]
    level = feel.touch + rng.uniform(-0.5e-3, 1.5e-3)
    return [
        hold(feel.full - rng.uniform(0, 3e-3), rng.uniform(0.5, 1.0)),
        ramp(feel.full, level, rng.uniform(0.3, 0.6)),
        np.maximum(level + swing + pushes, 0.5e-3),
        hold(0.0, rng.uniform(0.6, 1.2)),
    ]


def staircase(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:
    """Levels over the whole stroke in random order, half a second each."""
    levels = rng.permutation(np.linspace(0.06, 0.94, 8)) * feel.full
    steps = [hold(float(level + rng.uniform(-0.4e-3, 0.4e-3)), 0.5) for level in levels]
    return [*steps, hold(0.0, 0.8)]


def strokes(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:
    """Full strokes."""
    return [hold(feel.full, rng.uniform(0.6, 1.0)), hold(0.0, rng.uniform(0.8, 1.2))]


def ramps(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:
    """Slowly over the whole stroke and back."""
    up, down = rng.uniform(2.0, 3.5, 2)
    return [ramp(0.0, feel.full, up), hold(feel.full, 0.3), ramp(feel.full, 0.5e-3, down), hold(0.0, 0.6)]


def validation(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:  # noqa: ARG001
    """The published protocol: two full strokes, then from full drops to 70 ... 20 %, each with 2 s down by 20 %."""
    full = feel.full
    parts = [part for _ in range(2) for part in (hold(full, 1.0), hold(0.0, 1.2))]
    for share in (0.7, 0.6, 0.5, 0.4, 0.3, 0.2):
        low = max(share - 0.2, 0.01) * full
        parts += [hold(full, 1.0), hold(share * full, 0.7), ramp(share * full, low, 2.0)]
    return [*parts, hold(0.0, 1.0)]


def mix(feel: Feel, rng: np.random.Generator) -> list[FloatArray]:
    """A stretch of a day: a shift first, then all manoeuvres in random order, shifts more often than the rest."""
    others = (gear_shift, gear_shift, pull_away, creep, staircase, strokes, ramps)
    order = rng.permutation(len(others))
    return _joined([gear_shift, *(others[i] for i in order)], feel, rng)


def _joined(
    parts: Iterable[Callable[[Feel, np.random.Generator], list[FloatArray]]], feel: Feel, rng: np.random.Generator
) -> list[FloatArray]:
    return [piece for part in parts for piece in part(feel, rng)]


#: Manoeuvres by name.
MANOEUVRES = MappingProxyType(
    {
        "mix": mix,
        "gear-shift": gear_shift,
        "pull-away": pull_away,
        "creep": creep,
        "staircase": staircase,
        "strokes": strokes,
        "ramps": ramps,
        "validation": validation,
    }
)

"""Duty cycles with edges between the samples, as averaged valves take them: their means over each interval."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchid.log import INPUTS, FloatArray, Log


def mean_duties(log: Log, opening: Mapping[str, tuple[float, float]]) -> list[FloatArray]:
    """Both duty cycles, those with `Log.edges` as means over the interval behind each sample.

    The mean is that of the opening: a valve opens from the first duty cycle of `opening` to the second one.
    """
    return [_mean(log, name, *opening[name]) if name in log.edges else log[name] for name in INPUTS]


def _mean(log: Log, name: str, shut: float, wide: float) -> FloatArray:
    column, (stamps, values) = log[name], log.edges[name]
    inside = (stamps > log.time[0]) & (stamps < log.time[-1]) & np.isfinite(values)
    stamps, values = stamps[inside], values[inside]
    at = np.searchsorted(log.time, stamps, side="right") - 1
    first = np.diff(at, prepend=-1) > 0
    before = np.where(first, column[at], np.roll(values, 1))
    remaining = (log.time[at + 1] - stamps) / (log.time[at + 1] - log.time[at])
    opened = (np.clip(values, shut, wide) - np.clip(before, shut, wide)) * remaining
    gain = np.bincount(at, opened, minlength=len(log))
    # without an edge the duty cycle stays exactly as it is, also below `shut`
    return np.where(gain == 0.0, column, np.clip(column, shut, wide) + gain)

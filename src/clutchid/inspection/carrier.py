"""The grid on which the duty cycles change: it tells the carrier of the valves."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.reading import Reading
from clutchid.log import INPUTS, FloatArray

#: Longest period in s that is looked for, 20 Hz, and how many changes tell a grid.
LONGEST, CHANGES = 0.05, 30

#: Mean length of the changes as phasors on a grid: 1 where all lie on it, 0.95 with one of twenty anywhere.
ON_GRID = 0.95


def on_grid(reading: Reading) -> bool:
    """Whether the duty cycles change on a grid: a valve takes such a change at once.

    One that changes anywhere waits for the carrier of the valve, up to one period.
    """
    return _grid(reading) > 0


def period(reading: Reading, usual: float) -> float:
    """Period in s of the carrier where the duty cycles show it, else the `usual` one.

    Valves that are only opened and closed change on the grid of the control unit, which is no carrier.
    """
    parts = sum(int(((reading.log[name] > 0) & (reading.log[name] < 1)).sum()) for name in INPUTS)
    return (_grid(reading) if parts > CHANGES else 0.0) or usual


def _grid(reading: Reading) -> float:
    """Period in s of the grid on which the duty cycles change; 0 where they change anywhere, or with every sample."""
    log, step = reading.log, reading.step
    changed = np.zeros(len(log), dtype=bool)
    for name in INPUTS:
        changed[1:] |= np.abs(np.diff(log[name])) > 0
    at: FloatArray = log.time[changed][:5000]
    if at.size < CHANGES:
        return 0.0
    periods = step * np.arange(2, int(LONGEST / step * (1 + 1e-9)) + 1)
    lengths = np.array([abs(np.exp(2j * np.pi * at / period).mean()) for period in periods])
    fitting = periods[lengths > ON_GRID]
    return float(fitting[-1]) if fitting.size else 0.0

"""Period of the valves' carrier (PWM), estimated from the time grid on which the duty cycles change."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.reading import Reading
from clutchid.log import INPUTS, FloatArray

#: Longest period in s that is searched for, 20 Hz, and least number of changes that define a time grid.
LONGEST, CHANGES = 0.05, 30

#: Least magnitude of the mean phasor of the changes on a time grid: 1 if all lie on it, 0.95 if one in twenty does not.
ON_GRID = 0.95


def on_grid(reading: Reading) -> bool:
    """Whether the duty cycles change on a time grid, so that the valve responds at once.

    Other changes take effect with the next period of the carrier, after up to one period.
    """
    return _grid(reading) > 0


def period(reading: Reading, usual: float) -> float:
    """Period in s of the carrier as estimated from the duty cycles, else the `usual` one.

    Valves that are only opened and closed change on the time grid of the control unit, which is not a carrier.
    """
    parts = sum(int(((reading.log[name] > 0) & (reading.log[name] < 1)).sum()) for name in INPUTS)
    return (_grid(reading) if parts > CHANGES else 0.0) or usual


def _grid(reading: Reading) -> float:
    """Period in s of the time grid on which the duty cycles change; 0 if there is none above the sampling interval."""
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

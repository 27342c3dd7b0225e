"""Intervals in which a pressure estimated from the position alone is reliable."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchid.log import Log
from clutchid.parameters import Parameters
from clutchid.recordings.signals.excitation import HOLD_SPEED, SHORTEST_REST, SLOW_WINDOW, VENTED_POSITION
from clutchid.recordings.signals.sampled import runs, velocity


def vented_rests(measured: Log, p: Parameters) -> list[tuple[int, int]]:
    """Sample ranges (start, stop) of rests with the clutch engaged and the supply valve closed, at ambient pressure.

    Examples
    --------
    >>> t = np.arange(0.0, 2.0, 1e-3)
    >>> y = np.interp(t, [0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 0.0, 0.01, 0.0, 0.0])
    >>> rests = vented_rests(Log(t, {"position": y}), Parameters())
    >>> [(round(float(t[a]), 1), round(float(t[b - 1]), 1)) for a, b in rests]
    [(0.0, 0.5), (1.5, 2.0)]
    """
    time, position = measured.time, measured["position"]
    known = np.flatnonzero(np.isfinite(position))
    if known.size == 0:
        return []
    position = np.interp(time, time[known], position[known])
    still = np.abs(velocity(time, position, SLOW_WINDOW)) < HOLD_SPEED
    closed = measured["duty_supply"] <= p.R_0vs if "duty_supply" in measured else np.ones(len(measured), dtype=bool)
    spans = runs(still & closed & (np.abs(position) <= VENTED_POSITION))
    return [(a, b) for a, b in spans if time[b - 1] - time[a] >= SHORTEST_REST]


def reliable(measured: Log, p: Parameters, reach: float) -> NDArray[np.bool_]:
    """Samples between the first and the last vented rest and within `reach` in m, where the load is known.

    At a vented rest the pressure is known without a sensor. Before the first and after the last one the pressure is
    constrained from one side only, and beyond the reach the load is not estimated from data.
    """
    rests = vented_rests(measured, p)
    number = np.arange(len(measured))
    if not rests:
        return np.zeros(len(measured), dtype=bool)
    position = measured["position"]
    within = ~(position > reach)
    result: NDArray[np.bool_] = (number >= rests[0][0]) & (number < rests[-1][1]) & within
    return result

"""Carrier of the valves in a recording, from its duty cycles, the pressure or the position.

A control unit applies a new duty cycle at the start of a period. If the recorded duty cycles change on a time grid,
the grid gives the phase exactly; otherwise it is estimated from pressure or position.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.log import FloatArray, Log, sample_interval
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.numerics.threads import map_pairs
from clutchid.recordings.signals.duty_cycle import duty_grid, on_off, resolves_carrier
from clutchid.simulation.inputs import carrier

#: Periods in s that are tried: 200 to 20 Hz, as solenoid valves are driven.
PERIODS = (0.005, 0.008, 0.01, 0.0125, 0.016, 0.02, 0.025, 0.0333, 0.04, 0.05)

#: Number of phases that are tried, and the least contrast: explained variance of the fast part of the pressure rate by
#: the best phase beyond that by the median one, which is due to the changing duty cycle and not to the carrier.
PHASES, CONTRAST = 20, 0.01

#: Least contrast for a period that is known from the duty cycles, with a single trial.
CONTRAST_ON_GRID = 0.001

#: Another period must explain the variance of that of the grid by this factor: with the same duty cycles, half or twice
#: the true period explains up to the same variance.
GRID_ADVANTAGE = 2.0

#: Assumed travel time of a valve in carrier periods.
SHORT_TRAVEL = 0.01

#: Longest part of a recording that is used for the phase, in s.
MAX_DURATION = 15.0


def find_carrier(log: Log, actuator: Actuator, periods: Sequence[float] = PERIODS) -> tuple[float, float]:
    """Carrier period in s and phase at which the valves open, from a recording with pressure; (0, 0) without a carrier.

    An open valve changes the pressure immediately, so that the pressure rate within a period shows when it is open. For
    every period and phase, the rate is regressed on the predicted opening, both without their moving average. Detected
    periods are compared by the variance that they explain of the same part of the rate, because a longer period
    contains more of it. The period of the grid of the duty cycles needs less evidence, and is chosen unless another
    explains `GRID_ADVANTAGE` times its variance. An on/off unit has no carrier: its edges are those of its commands.

    Raises
    ------
    DataError
        If the recording has no pressure.
    """
    step = sample_interval(log.time)
    log = log.slice(0, min(len(log), round(MAX_DURATION / step)))
    if on_off(log):
        return 0.0, 0.0
    grid = duty_grid(log).period
    common = max(1, round(max(periods) / step))
    candidates: dict[float, tuple[float, float]] = {}
    for period in (*periods, grid) if periods is PERIODS and grid not in PERIODS else periods:
        if not resolves_carrier(log, period):
            continue
        contrast, phase = _contrast(log, actuator, period, max(1, round(period / step)))
        if contrast > (CONTRAST_ON_GRID if _same(period, grid) else CONTRAST):
            candidates[period] = (contrast if len(periods) == 1 else _contrast(log, actuator, period, common)[0], phase)
    if not candidates:
        return 0.0, 0.0
    best = max(candidates, key=lambda period: candidates[period][0])
    on_grid = next((period for period in candidates if _same(period, grid)), best)
    chosen = best if candidates[best][0] > GRID_ADVANTAGE * candidates[on_grid][0] else on_grid
    return chosen, candidates[chosen][1]


def _same(period: float, grid: float) -> bool:
    return abs(period - grid) < 1e-3 * period


def _contrast(log: Log, actuator: Actuator, period: float, length: int) -> tuple[float, float]:
    """Explained variance by the best phase of a period beyond that by the median phase, and the best phase.

    Moving averages over `length` samples are removed from the pressure rate.
    """
    rate = np.diff(log["pressure_a"])
    fast = rate - _smooth(rate, length)
    phases = np.arange(PHASES) / PHASES
    actuators = [actuator.replace({"T_pwm": period, "s_pwm": centred(float(phase))}) for phase in phases]
    shares = np.array(map_pairs(lambda one, _: _explained_variance(log, one, fast, length), actuators, phases))
    return float(shares.max() - np.median(shares)), float(phases[np.argmax(shares)])


def _smooth(values: FloatArray, length: int) -> FloatArray:
    return np.convolve(np.nan_to_num(values), np.ones(length) / length, "same")


def _explained_variance(log: Log, actuator: Actuator, fast: FloatArray, length: int) -> float:
    """Fraction of the variance of the fast part of the pressure rate that the switching of both valves explains."""
    p = actuator.parameters
    text, clock = kernels(actuator.model), carrier(log.time, p)
    pressure = np.nan_to_num(log["pressure_a"][:-1], nan=p.P_0)
    columns = []
    for duty, low, high, drive in (
        ("duty_supply", p.R_0vs, p.R_1vs, np.ones_like(pressure)),
        ("duty_exhaust", p.R_0ve, p.R_1ve, pressure / p.P_S),
    ):
        share = text.opening(log[duty], low, high)
        # the search for the phase of a valve starts at the duty cycle where it starts to open
        opened = text.passed_pulses(share, share, *clock, (p.s_pwm + low) % 1.0, SHORT_TRAVEL)
        switched = np.where(np.isfinite(share), opened, np.nan)[:-1] * drive
        columns.append(switched - _smooth(switched, length))
    A = np.nan_to_num(np.column_stack(columns))
    known = np.isfinite(fast) & (np.abs(A).sum(axis=1) > 0)
    total = float(np.sum(fast[known] ** 2))
    if known.sum() < 100 or total == 0.0:
        return 0.0
    weights, *_ = np.linalg.lstsq(A[known], fast[known], rcond=None)
    return 1.0 - float(np.sum((fast[known] - A[known] @ weights) ** 2)) / total


def centred(phase: float) -> float:
    """The same phase in [-0.5, 0.5)."""
    return (phase + 0.5) % 1.0 - 0.5

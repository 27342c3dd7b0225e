"""Result of a workflow for a worn recording, and its score against the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clutchid.estimation.assess.half_load import half_load
from clutchid.log import FloatArray, Log
from clutchid.truck import GRID, Truth

#: Range of the grid around the touch point, in m.
TOUCH = (5e-3, 8e-3)


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """A load curve in N over positions in m with its 95 % band, and the chamber pressure in Pa at every sample.

    `kept` has further results as plain values.
    """

    position: FloatArray
    force: FloatArray
    low: FloatArray
    high: FloatArray
    pressure_a: FloatArray
    kept: Mapping[str, Any] = field(default_factory=dict)


#: Function of a calibration recording with pressure and worn recordings with position only; one answer for each.
Workflow = Callable[[Log, Sequence[Log]], Sequence[Answer]]


@dataclass(frozen=True, slots=True)
class Score:
    """Errors of one answer.

    `load` is rms over 0.5 to 20 mm and `load_touch` over 5 to 8 mm, in % of the true peak; `half_load` the error of the
    position where the rising load reaches half its peak [mm]; `pressure` the rms error of the chamber pressure [kPa];
    `coverage` the fraction of the grid where the band contains the true load.
    """

    load: float
    load_touch: float
    half_load: float
    pressure: float
    coverage: float


def score(answer: Answer, truth: Truth, time: FloatArray) -> Score:
    """Score `answer` against the truth of its recording, whose samples are at `time` in s.

    Raises
    ------
    ValueError
        If the curve does not cover the grid or is not finite there.
    """
    force, low, high = (np.interp(GRID, answer.position, c) for c in (answer.force, answer.low, answer.high))
    if answer.position[0] > GRID[0] or answer.position[-1] < GRID[-1] or not np.isfinite(force).all():
        raise ValueError("the load curve must be finite from 0.5 to 20 mm")
    true = truth.load(GRID)
    error = (force - true) / true.max() * 100
    near = (TOUCH[0] - 1e-9 < GRID) & (TOUCH[1] + 1e-9 > GRID)
    fine = np.linspace(0.0, GRID[-1], 4001)
    halves = [half_load(fine, np.interp(fine, answer.position, answer.force)), half_load(fine, truth.load(fine))]
    pressure = answer.pressure_a - np.interp(time, truth.time, truth.states["pressure_a"])
    return Score(
        load=_rms(error),
        load_touch=_rms(error[near]),
        half_load=(halves[0] - halves[1]) * 1e3,
        pressure=_rms(pressure[np.isfinite(pressure)]) * 1e-3,
        coverage=float(np.mean((low <= true) & (true <= high))),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")

"""Departure of a recording from the calibration that its load is read with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.estimation.result import Departure
from clutchid.inference.problem import Problem, with_hypothesis
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log
from clutchid.parameters import GROUPS
from clutchid.recordings.signals.excitation import HOLD_SPEED, SLOW_WINDOW
from clutchid.recordings.signals.sampled import velocity


def departure(problem: Problem, x: FloatArray, cost: float, logs: Sequence[Log], calibration: Calibration) -> Departure:
    """Departure of a reading with parameters x, shape (k,), and a cost.

    Parameters
    ----------
    problem : Problem
        With the parameters that may have changed.
    logs : several
        The recordings.
    calibration : Calibration
        That the reading started from.
    """
    root = with_hypothesis(problem, tuple(GROUPS)).prior_root
    changing = [i for i, c in enumerate(problem.coordinates) if c.name in problem.changing]
    moved = np.zeros_like(x)
    moved[changing] = x[changing]
    whitened = moved if root is None else root @ moved
    return Departure(float(whitened @ whitened), len(changing), relative_misfit(cost, logs, calibration))


def relative_misfit(cost: float, logs: Sequence[Log], calibration: Calibration) -> float:
    """Cost for each second in motion over that of the calibration recordings; NaN where that is not known."""
    usual = calibration.position_only.misfit if calibration.position_only else np.nan
    return misfit(cost, logs) / usual


def misfit(cost: float, logs: Sequence[Log]) -> float:
    """Cost for each second in motion in 1/s; NaN if nothing moves."""
    moving = 0.0
    for log in logs:
        speed = velocity(log.time, log["position"], SLOW_WINDOW)
        moving += float(np.sum(np.diff(log.time)[np.abs(speed[:-1]) > HOLD_SPEED]))
    return cost / moving if moving > 0.0 else float("nan")

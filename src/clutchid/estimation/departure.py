"""Departure of a recording from the calibration that its load is read with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.estimation.hypotheses import Explanation
from clutchid.estimation.result import Departure, Moved
from clutchid.inference.problem import Problem, with_hypothesis
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import FAULT
from clutchid.log import FloatArray, Log
from clutchid.parameters import GROUPS
from clutchid.strokes.excitation import HOLD_SPEED, SLOW_WINDOW
from clutchid.strokes.sampled import velocity

#: How many parameters a departure names.
NAMED = 3


def departure(
    best: Explanation, x: FloatArray, cost: float, logs: Sequence[Log], calibration: Calibration
) -> Departure:
    """Departure of a reading with parameters x, shape (k,), and a cost.

    Parameters
    ----------
    best : Explanation
        The most probable one, with the parameters that may have changed.
    logs : several
        The recordings.
    calibration : Calibration
        That the reading started from.

    Notes
    -----
    With the root W of the prior of the counted parameters and the covariance P of their posterior, the squared distance
    is tr(I - W P W') in the mean over trucks drawn from the prior: a direction that the data do not determine stays
    where it was calibrated.
    """
    problem, everything = best.result.problem, tuple(GROUPS)
    root, posterior = with_hypothesis(problem, everything).prior_root, best.under(everything)
    at = [i for i, c in enumerate(problem.coordinates) if c.name in problem.changing and not _is_fault(problem, c.base)]
    W = np.eye(len(at)) if root is None else root[np.ix_(at, at)]
    whitened = W @ x[at]
    expected = len(at) - float(np.trace(W @ posterior.covariance[np.ix_(at, at)] @ W.T))
    std = np.linalg.norm(np.linalg.inv(W), axis=1)
    farthest = np.argsort(-np.abs(x[at]) / std)[:NAMED]
    moved = tuple(_moved(problem, at[i], x) for i in farthest.tolist())
    return Departure(float(whitened @ whitened), expected, relative_misfit(cost, logs, calibration), moved)


def _is_fault(problem: Problem, name: str) -> bool:
    return any(change.group == FAULT for change in problem.actuator.rows[name].changes)


def _moved(problem: Problem, at: int, x: FloatArray) -> Moved:
    c = problem.coordinates[at]
    return Moved(c.base, problem.actuator.value(c.base), c.si(float(x[at])))


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

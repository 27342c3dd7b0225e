"""Profile-likelihood intervals: how far one free number can go when all others, and the states, follow as they like.

The covariance takes the cost for a parabola. Where stick-slip or a stop bends it, an interval should end where the cost
says so, and need not be symmetric.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from clutchid.errors import ParameterError
from clutchid.estimate.posterior import QUANTILE
from clutchid.estimate.shooting.uncertainty import Spread
from clutchid.numerics.failure import Failure
from clutchid.smoother.problem import FitProblem, condense
from clutchid.smoother.projection import SETTLED, ShootingSolution, project

#: Most evaluations a side, how near to `QUANTILE` as a share is near enough, and how many half widths of the covariance
#: an end may lie away.
EVALUATIONS, NEAR, WIDEST = 5, 0.03, 4.0

#: A step outwards is at most this many times the last distance, and one in a bracket keeps this share off its ends.
LONGER, INSIDE = 2.0, 0.1

#: Most searches at the estimate, before the cost there is taken for the least.
AGAIN = 3

#: By what share of its half width an end of the quadratic interval may be off.
BENT = 0.2


def profile_interval(task: FitProblem, found: ShootingSolution, of: Spread, name: str) -> tuple[float, float] | Failure:
    """95 % interval of one free number: where the cost with it fixed, and all others free, has grown too much.

    Parameters
    ----------
    task : FitProblem
        The problem.
    found : ShootingSolution
        Where its search ended, with `task`'s own noise.
    of : Spread
        How uncertain the free numbers are there.
    name : str
        Which one, NAME or NAME@STEM of ``task.names``.

    Returns
    -------
    low, high : SI
        Where the cost has grown by ``(QUANTILE sigma_total / sigma_search)²``: sigma_search is the standard deviation
        that the curvature of the cost means, sigma_total that of the covariance, which counts coloured residuals and
        what is only considered known. So where the cost is quadratic these are the ends of the covariance. Where a
        bound of ``task.bounds()``, or `WIDEST` half widths of the covariance, is reached with less, that is the
        end. Where nothing on one side can be simulated the covariance stands there. A `Failure` where nothing can on
        either side.

    Raises
    ------
    ParameterError
        If the number is not free in `task`.

    Notes
    -----
    Where data rule, ``sigma_known = sqrt(COLOUR) sigma_search``; a prior is not coloured, so where it rules they are
    the same. A search with the number fixed that stalls finds too high a cost, so the interval is too narrow then.

    A load weight's ends are those of the fit's own load, before the calibration's bias is taken off.

    References
    ----------
    Venzon and Moolgavkar 1988.
    """
    if name not in task.names:
        raise ParameterError(f"{name} is not a free number of this fit; take one of {', '.join(task.names)}.")
    i = task.names.index(name)
    total = float(np.sqrt(of.matrix[i, i]))
    profile = _Profile(task, i, found, _deviation(task, found, i) / total)
    at, ends, failures = float(found.x[i]), [], []
    for sign, bounds in zip((-1.0, 1.0), task.bounds(), strict=True):
        bound = float(bounds[i])
        room = max(sign * (bound - at), 0.0)
        first, limit = min(QUANTILE * total, room), min(WIDEST * QUANTILE * total, room)
        end = _end(partial(profile.root, at, sign), first, limit)
        if isinstance(end, Failure):
            failures.append(end)
            end = first
        # the bound itself, not what rounding makes of it
        ends.append(task.coordinates[i].si(bound if end == room else at + sign * end))
    return failures[0] if len(failures) == len(ends) else (ends[0], ends[1])


def bent(quadratic: tuple[float, float], profiled: tuple[float, float]) -> bool:
    """Whether the covariance misleads: an end is off by more than `BENT` of the half width.

    Parameters
    ----------
    quadratic, profiled : SI
        95 % intervals of one number, of the covariance and of the cost itself.

    Returns
    -------
    bent : bool
        True where the interval of the cost should be shown.

    Examples
    --------
    A dry friction of 200 ± 50 N that a stuck piston does not let fall below 185 N:

    >>> bent((150.0, 250.0), (185.0, 252.0))
    True
    """
    most = BENT * (quadratic[1] - quadratic[0]) / 2
    return any(abs(one - other) > most for one, other in zip(quadratic, profiled, strict=True))


def _deviation(task: FitProblem, found: ShootingSolution, i: int) -> float:
    """Standard deviation of x_i that the curvature of the cost means: as far away the cost is 1 higher."""
    factor, _ = condense(task, found.at)
    return float(np.linalg.norm(np.linalg.pinv(factor[:-1, :-1])[i]))


class _Profile:
    """The least cost over all numbers but x_i, and the solutions so far: from the nearest one the next search starts.

    A search ends a little above its minimum. Where a prior rules that is as much as an end of the interval costs, so
    the estimate itself is searched again first, with x_i held.
    """

    def __init__(self, task: FitProblem, i: int, found: ShootingSolution, scale: float) -> None:
        self.task, self.i, self.scale = task, i, scale
        self.seen, self.least = [found], found.at.cost
        for _ in range(AGAIN):
            before, there = self.least, self.search(float(found.x[i]))
            self.least = before if isinstance(there, Failure) else min(before, there.at.cost)
            # of solutions at one place the last one; their values differ by rounding
            self.seen = self.seen[-1:]
            if before - self.least < SETTLED:
                break

    def search(self, value: float) -> ShootingSolution | Failure:
        """Where the cost is least with x_i at `value`."""
        near = min(self.seen, key=lambda one: abs(float(one.x[self.i]) - value))
        x = near.x.copy()
        x[self.i] = value
        task = _fixed(self.task, self.i, value)
        there = project(task, np.clip(x, *task.bounds()), near.X, lambda _: None)
        if isinstance(there, ShootingSolution):
            self.seen.append(there)
        return there

    def root(self, at: float, sign: float, distance: float) -> float | Failure:
        """Root of how much the cost has grown at a distance from x_i = `at`, in standard deviations of the covariance.

        Zero where the cost is lower than at the estimate: the search that ended there had missed something.
        """
        there = self.search(at + sign * distance)
        if isinstance(there, Failure):
            return there
        return self.scale * float(np.sqrt(max(0.0, there.at.cost - self.least)))


def _fixed(task: FitProblem, i: int, value: float) -> FitProblem:
    """`task` with the number x_i held at `value`, which its prior still judges."""
    coordinates = list(task.coordinates)
    si = coordinates[i].si(value)
    coordinates[i] = replace(coordinates[i], low=si, high=si)
    return replace(task, coordinates=tuple(coordinates))


def _end(root: Callable[[float], float | Failure], first: float, limit: float) -> float | Failure:
    """The distance, at most `limit`, at which `root` has grown to `QUANTILE`; a `Failure` where none can be tried.

    A point that fails counts as too far away.
    """
    if limit == 0.0:
        return limit
    at, answers = first, []
    earlier, inside, outside = (0.0, 0.0), (0.0, 0.0), (np.inf, np.inf)
    for _ in range(EVALUATIONS):
        answers.append(root(at))
        z = answers[-1] if isinstance(answers[-1], float) else np.inf
        if abs(z - QUANTILE) <= NEAR * QUANTILE or (z < QUANTILE and at == limit):
            return at
        if z < QUANTILE:
            earlier, inside = inside, (at, z)
        else:
            outside = (at, z)
        at = _nearer(inside, outside) if np.isfinite(outside[0]) else min(_further(earlier, inside), limit)
    failures = [answer for answer in answers if isinstance(answer, Failure)]
    return failures[0] if len(failures) == len(answers) else at


def _nearer(inside: tuple[float, float], outside: tuple[float, float]) -> float:
    """Between two points where the line through them is `QUANTILE`; in the middle where the outer one has no value."""
    share = (QUANTILE - inside[1]) / (outside[1] - inside[1]) if np.isfinite(outside[1]) else 0.5
    return inside[0] + min(max(share, INSIDE), 1.0 - INSIDE) * (outside[0] - inside[0])


def _further(earlier: tuple[float, float], last: tuple[float, float]) -> float:
    """Beyond two points where the line through them is `QUANTILE`, but not too far at once."""
    rise = last[1] - earlier[1]
    step = (QUANTILE - last[1]) * (last[0] - earlier[0]) / rise if rise > 0.0 else np.inf
    return float(min(last[0] + step, LONGER * last[0]))

"""From the end of a search by multiple shooting to the result that the user sees."""

from __future__ import annotations

import numpy as np

from clutchid.estimate.outcome import Compared, compare, position_and_pressure
from clutchid.estimate.posterior import QUANTILE, posterior
from clutchid.estimate.result import Fit
from clutchid.estimate.search_result import SearchResult
from clutchid.estimate.shooting.uncertainty import Spread, pressure_spread, spread
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.smoother.problem import FitProblem
from clutchid.smoother.projection import ShootingSolution
from clutchid.smoother.trajectory import recorded, trajectory
from clutchid.uncertainty.calibration import Calibration


def result(done: SearchResult[ShootingSolution], calibration: Calibration | None) -> Fit | Failure:
    """The result of a search by multiple shooting."""
    solution = done.solution
    if isinstance(solution, Failure):
        return solution
    uncertain = spread(done.problem, solution, calibration)
    if isinstance(uncertain, Failure):
        return uncertain
    return posterior(done, solution, uncertain.matrix, calibration, _recordings(done, solution, uncertain))


def _recordings(done: SearchResult[ShootingSolution], solution: ShootingSolution, spread_: Spread) -> list[Compared]:
    """The simulated recordings, compared as their sensors would record the simulation."""
    task = done.problem
    deviations = pressure_spread(spread_)
    compared = []
    for number, plan in enumerate(done.plans):
        states = trajectory(task, solution, number)
        first = [X[0] for track, X in zip(task.tracks, solution.X, strict=True) if track.log == number]
        starts = [position_and_pressure(task.actuator, state) for state in first]
        half = _half_width(task, number, deviations, len(states))
        compared.append(compare(plan, states, starts, recorded(task, solution, number, states), half))
    return compared


def _half_width(task: FitProblem, log: int, deviations: list[FloatArray], samples: int) -> FloatArray:
    """Half the width of the 95 % band of the pressure, between window starts by interpolation."""
    half = np.full(samples, np.nan)
    for track, deviation in zip(task.tracks, deviations, strict=True):
        if track.log == log:
            at = [window.start for window in track.windows]
            inside = np.arange(track.segment.start, track.segment.stop)
            half[inside] = QUANTILE * np.interp(inside, at, deviation)
    return half

"""The `Fit` of a search by multiple shooting."""

from __future__ import annotations

import numpy as np

from clutchid.estimation.posterior import posterior
from clutchid.estimation.result import Compared, Fit, compare, position_and_pressure
from clutchid.estimation.search_result import SearchResult
from clutchid.estimation.shooting.uncertainty import ParameterUncertainty, parameter_uncertainty, pressure_deviations
from clutchid.inference.smoother.problem import FitProblem
from clutchid.inference.smoother.residuals import sensor_outputs, trajectory
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE


def result(search_result: SearchResult[ShootingSolution], calibration: Calibration | None) -> Fit | Failure:
    """The result of a search by multiple shooting."""
    solution = search_result.solution
    if isinstance(solution, Failure):
        return solution
    uncertain = parameter_uncertainty(search_result.problem, solution, calibration, search_result.covariance)
    if isinstance(uncertain, Failure):
        return uncertain
    return posterior(
        search_result, solution, uncertain.matrix, calibration, _recordings(search_result, solution, uncertain)
    )


def _recordings(
    search_result: SearchResult[ShootingSolution], solution: ShootingSolution, uncertain: ParameterUncertainty
) -> list[Compared]:
    """The simulated recordings, compared through the sensor models."""
    problem = search_result.problem
    deviations = pressure_deviations(uncertain)
    compared = []
    for number, plan in enumerate(search_result.plans):
        states = trajectory(problem, solution, number)
        first = [X[0] for track, X in zip(problem.tracks, solution.X, strict=True) if track.log == number]
        starts = [position_and_pressure(problem.actuator, state) for state in first]
        half = _half_width(problem, number, deviations, len(states))
        compared.append(compare(plan, states, starts, sensor_outputs(problem, solution, number, states), half))
    return compared


def _half_width(problem: FitProblem, log: int, deviations: list[FloatArray], samples: int) -> FloatArray:
    """Half width of the 95 % interval of the pressure, interpolated between window starts."""
    half = np.full(samples, np.nan)
    for track, deviation in zip(problem.tracks, deviations, strict=True):
        if track.log == log:
            at = [window.start for window in track.windows]
            inside = np.arange(track.segment.start, track.segment.stop)
            half[inside] = QUANTILE * np.interp(inside, at, deviation)
    return half

"""The method 'shooting': multiple shooting with soft continuity, its search and its result at the end of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.checks import with_checked_intervals
from clutchid.estimation.departure import misfit
from clutchid.estimation.method import ChangeFunctions, Method, MethodResult, ResidualRows, SearchResult
from clutchid.estimation.phase import phase_finder
from clutchid.estimation.posterior import Posterior, parameter_uncertainty, pressure_deviations
from clutchid.estimation.problem import fit_problem, start_point
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.result import Compared, compare_states, position_and_pressure
from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import LinearisedProblem, data_factor, linearise
from clutchid.inference.smoother.residuals import noise_scales, sensor_outputs, trajectory
from clutchid.inference.smoother.search import (
    FINE_STAGE,
    STAGES_FROM_CALIBRATION,
    STAGES_FROM_PRIOR,
    USUAL_EFFORT,
    Begin,
    Effort,
    ShootingSolution,
    search,
    settled,
)
from clutchid.inference.smoother.trial import States
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import INITIAL_VALUES, SearchStatus, Solution, Start
from clutchid.numerics.progress import Progress
from clutchid.preparation.pulses import FindPhase
from clutchid.simulation.windows import initial_states


def result(
    problem: Problem, solution: ShootingSolution, calibration: Calibration | None, mixture: Mixture | None
) -> MethodResult | Failure:
    """Uncertainty at the solution of a search by multiple shooting, and the recordings there."""
    uncertain = parameter_uncertainty(problem, solution, calibration, mixture)
    if isinstance(uncertain, Failure):
        return uncertain
    data = data_factor(problem, solution.at)[:, :-1]
    return MethodResult(uncertain.matrix, data, _recordings(problem, solution, uncertain))


def _recordings(problem: Problem, solution: ShootingSolution, uncertain: Posterior) -> list[Compared]:
    """The simulated recordings, compared through the sensor models."""
    deviations = pressure_deviations(uncertain)
    compared = []
    for number, plan in enumerate(problem.plans):
        states = trajectory(problem, solution, number)
        first = [X[0] for track, X in zip(problem.tracks, solution.at.X, strict=True) if track.log == number]
        starts = [position_and_pressure(problem.actuator, state) for state in first]
        half = _half_width(problem, number, deviations, len(states))
        compared.append(compare_states(plan, states, starts, sensor_outputs(problem, solution, number, states), half))
    return compared


def _half_width(problem: Problem, log: int, deviations: list[FloatArray], samples: int) -> FloatArray:
    """Half width of the 95 % interval of the pressure, interpolated between window starts."""
    half = np.full(samples, np.nan)
    for track, deviation in zip(problem.tracks, deviations, strict=True):
        if track.log == log:
            at = [window.start for window in track.windows]
            inside = np.arange(track.segment.start, track.segment.stop)
            half[inside] = QUANTILE * np.interp(inside, at, deviation)
    return half


#: Correlation time in s of what the model misses in a measurement, so that ten samples at 1 kHz are weighted as one.
#: A load from position alone comes closer to the truth, and calibrations converge, see docs/derivations.md.
MODEL_MEMORY = 0.01

#: Most restarts of a search that stalls, and the share of the cost within which two of them have arrived at the same.
_MAX_RESTARTS, _SAME_COST = 4, 3e-3

#: Most evaluations of each search of a reading, its restarts included, and of all of them: twice what trucks that had
#: changed have needed, 412 and 765 (`python benchmarks/pairs.py OUT --analyse`, benchmarks/results/changes.md). The
#: search without a change ends after `_PATIENCE` if its cost is above `HOPELESS` times that of the calibration
#: recordings; those with a change go on from there. No changed truck cost more than 3.2 times as much
#: (docs/derivations.md, "Changes since the calibration").
MOST_EVALUATIONS, MOST_TOGETHER, _PATIENCE, HOPELESS = 800, 1500, 100, 5.0


def shoot(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Fit the `free` parameters to recordings by multiple shooting.

    With a `calibration` the search starts from the calibrated values and needs fewer stages.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    problem = problem_of(logs, actuator, free, calibration)
    begin = start_values(problem, free)
    if isinstance(begin, Failure):
        return SearchResult(problem, begin)
    (x, X), effort = begin, _effort(problem, logs, calibration)
    if free.start is None:
        stages = STAGES_FROM_CALIBRATION if calibration else STAGES_FROM_PRIOR
        coarse = search(problem, x, X, stages[:-1], progress, effort=effort)
        if isinstance(coarse, Failure):
            return SearchResult(problem, coarse)
        problem = replace(problem, noise=replace(problem.noise, measured=noise_scales(problem, coarse)))
        fine = _fine(problem, coarse.x, coarse.at.X, effort.after(coarse.evaluations), progress, coarse.evaluations)
    else:
        fine = _fine(problem, x, X, effort, progress)
    return SearchResult(problem, _ended(problem, fine), effort=effort)


def problem_of(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    find: FindPhase | None = None,
) -> Problem:
    """The problem of `shoot`; `find` is the function that finds the phase of a carrier."""
    problem = fit_problem(logs, actuator, free, calibration, find or phase_finder(actuator, free, calibration))
    return replace(problem, noise=replace(problem.noise, memory=MODEL_MEMORY))


def start_values(problem: Problem, free: FreeParameters) -> tuple[FloatArray, States] | Failure:
    """x at the start of a search, and initial values of the states of all windows."""
    X = _states(problem, [plan.actuator for plan in problem.plans])
    return X if isinstance(X, Failure) else (start_point(problem, free), X)


def _ended(problem: Problem, solution: ShootingSolution | Failure) -> ShootingSolution | Failure:
    """The end of a search, linearised there: the search itself keeps derivatives from nearby points."""
    if isinstance(solution, Failure):
        return solution
    at = linearise(problem, solution.x, solution.at.X)
    return at if isinstance(at, Failure) else replace(solution, at=at)


def _effort(problem: Problem, logs: Sequence[Log], calibration: Calibration | None) -> Effort:
    """Limits of a search that does not converge: those of a load from position alone, or of any other fit."""
    if not problem.changing or calibration is None or calibration.position_only is None:
        return USUAL_EFFORT
    usual = calibration.position_only.misfit / misfit(1.0, logs)
    return Effort(MOST_EVALUATIONS, _PATIENCE, HOPELESS * usual if np.isfinite(usual) else np.inf, MOST_TOGETHER)


def _fine(
    problem: Problem, x: FloatArray, X: Begin, effort: Effort, progress: Progress | None, before: int = 0
) -> ShootingSolution | Failure:
    """The fine stage; where it stalls it goes on with new states, a few times, from the best parameters so far.

    A search stalls where a few windows with stiction lie in a poor local minimum of their states. It has
    converged if it arrives at the same cost with new states: the cost has a kink there, and no vanishing gradient.
    """
    best = search(problem, x, X, FINE_STAGE, progress, before, effort)
    if isinstance(best, Solution):
        best = replace(best, starts=(Start(INITIAL_VALUES, best.at.cost, best.status),))
    for number in range(1, _MAX_RESTARTS + 1):
        if isinstance(best, Failure) or best.status != "stalled" or effort.is_spent(best.evaluations, best.at.cost):
            return best
        left = effort._replace(most=effort.most + before - best.evaluations)
        again = _states(problem, [problem.actuator_of(best.x, stem) for stem in problem.stems])
        further = again if isinstance(again, Failure) else search(
            problem, best.x, again, FINE_STAGE, progress, best.evaluations, left
        )  # fmt: skip
        if isinstance(further, Failure):
            return replace(best, starts=(*best.starts, Start(f"new states {number}", np.inf, "failed")))
        starts = *best.starts, Start(f"new states {number}", further.at.cost, further.status)
        gain, better = best.at.cost - further.at.cost, min(best, further, key=lambda solution: solution.at.cost)
        same = abs(gain) <= _SAME_COST * best.at.cost
        status: SearchStatus = "converged" if same else better.status
        best = replace(better, evaluations=further.evaluations, status=status, starts=starts)
        if gain <= 0.0:
            return best
    return best


def _states(problem: Problem, actuators: Sequence[Actuator]) -> States | Failure:
    """Initial values of the states of all windows, with the actuator of every recording."""
    X = []
    for track in problem.tracks:
        guess = initial_states(track, actuators[track.log], "pressure_a" in problem.measure)
        if isinstance(guess, Failure):
            return guess
        X.append(guess)
    return tuple(X)


def refine(
    search_result: SearchResult, problem: Problem, x: FloatArray, progress: Progress | None = None
) -> SearchResult:
    """The search of a result continued from x with the prior of `problem`."""
    near = () if isinstance(search_result.solution, Failure) else search_result.solution.at
    fine = _fine(problem, x, near, search_result.effort._replace(patience=np.inf), progress)
    return replace(search_result, problem=problem, solution=_ended(problem, fine))


def rows(problem: Problem, x: FloatArray, near: LinearisedProblem) -> ResidualRows | Failure:
    """The cost at x with the states that cost least there, whose rows are eliminated: those of the data are k + 1.

    Compressed by an orthogonal matrix that differs from x to x, so a single row means nothing. The states end where a
    step gains nothing; so the cost scatters by one or two from x to x.
    """
    moved = settled(problem, Solution(near.x, near, "converged", 0), x)
    at = moved if isinstance(moved, Failure) else linearise(problem, x, moved.at.X)
    if isinstance(at, Failure):
        return at
    return ResidualRows(at.prior, data_factor(problem, at), 0.5 * at.cost)


def _settled(problem: Problem, solution: ShootingSolution, x: FloatArray) -> ShootingSolution | Failure:
    return _ended(problem, settled(problem, solution, x))


#: Multiple shooting with soft continuity.
SHOOTING = Method(
    "shooting",
    problem_of,
    shoot,
    linearise,
    rows,
    start_values,
    result,
    check=with_checked_intervals,
    changes=ChangeFunctions(refine, _settled),
    partition="multiple shooting uses its own windows",
)

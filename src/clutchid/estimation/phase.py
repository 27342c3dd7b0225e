"""Phase of the carrier in a recording with position alone, by a filter that adapts load and friction."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from clutchid.estimation.free import FreeParameters
from clutchid.estimation.one_pass import with_window_steps
from clutchid.estimation.prediction_error.problem import predict_errors
from clutchid.estimation.problem import fit_problem
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.threads import map_pairs
from clutchid.preparation.carrier import centred
from clutchid.preparation.pulses import Duties, FindPhase, duties_in, find_phase
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration

#: Phases that are tried, Gauss-Newton steps at each, and the length in s of the part of a recording that they are tried
#: on. Provenance: docs/derivations.md.
PHASES, STEPS, DURATION = 10, 2, 10.0

#: Length in s for a slow recording: over 10 s of 100 Hz another phase costs as little (truck A3). Phases around the
#: best one, in tenths: where a sample falls into another period the cost jumps, and no parabola fits (truck B2).
DURATION_SLOW, NEAR = 30.0, (-0.7, -0.35, 0.35, 0.7)

#: Largest step of a parameter in standard deviations of its prior.
LARGEST_STEP = 2.0


def phase_finder(actuator: Actuator, free: FreeParameters, calibration: Calibration | None) -> FindPhase:
    """How the phase of the carrier is estimated for a fit: with a calibration by `filtered_phase`."""
    if calibration is None or not free.reads_load(actuator):
        return find_phase
    return partial(filtered_phase, calibration=calibration)


def filtered_phase(log: Log, actuator: Actuator, calibration: Calibration) -> float:
    """Phase of a carrier of known period for which a Kalman filter predicts the position best, in [-0.5, 0.5).

    At each of ten phases load and viscous friction take two Gauss-Newton steps towards smaller prediction errors: wear
    or cold grease would otherwise be taken for another phase. The costs that are predicted after the second step are
    compared; the phase is refined by a parabola, in a slow recording by four phases more.

    Parameters
    ----------
    log : Log
        Both duty cycles and the position.
    actuator : Actuator
        As calibrated.
    calibration : Calibration
        Its covariance.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    step = float(np.median(np.diff(log.time)))
    slow = duties_in(log, actuator) is not Duties.RECORDED
    part = log.slice(0, min(len(log), round((DURATION_SLOW if slow else DURATION) / step)))
    problems = _problems(part, actuator, calibration, slow)
    costs = np.array(map_pairs(_least_cost, problems, range(PHASES), smallest=1))
    best = int(np.argmin(costs))
    if not slow:
        return centred((best + _vertex(costs)) / PHASES)
    near = [centred((best + part) / PHASES) for part in NEAR]
    finer = map_pairs(_least_cost, [_problem(part, actuator, calibration, one) for one in near], near, smallest=1)
    return near[int(np.argmin(finer))] if min(finer) < costs[best] else centred(best / PHASES)


def _vertex(costs: FloatArray) -> float:
    """Place of the least cost between phases, by a parabola through the best and its neighbours, from the best."""
    best = int(np.argmin(costs))
    before, after = costs[best - 1] - costs[best], costs[(best + 1) % costs.size] - costs[best]
    return 0.5 * float((before - after) / (before + after)) if 0.0 < before + after < np.inf else 0.0


def _problems(part: Log, actuator: Actuator, calibration: Calibration, slow: bool) -> list[FitProblem]:
    """The problem of each phase; the recording is prepared once, unless its time grid depends on the phase."""
    phases = [centred(at / PHASES) for at in range(PHASES)]
    if slow:
        return [_problem(part, actuator, calibration, phase) for phase in phases]
    once = _problem(part, actuator, calibration, phases[0])
    return [_at_phase(once, phase) for phase in phases]


def _problem(part: Log, actuator: Actuator, calibration: Calibration, phase: float) -> FitProblem:
    """The problem of load and viscous friction for one phase."""
    free = FreeParameters((*actuator.load.names, "D_v"), ("position",))
    problem, _ = fit_problem([part], actuator, free, calibration, lambda _log, _actuator: phase)
    return replace(problem, tracks=tuple(map(with_window_steps, problem.tracks)))


def _at_phase(problem: FitProblem, phase: float) -> FitProblem:
    """`problem` with another phase of the carrier as prior mean."""
    coordinates = tuple(replace(c, mean=phase) if c.base == "s_pwm" else c for c in problem.coordinates)
    return replace(problem, actuator=problem.actuator.replace({"s_pwm": phase}), coordinates=coordinates)


def _least_cost(problem: FitProblem, _phase: float) -> float:
    """Cost of the prediction errors as predicted after the last Gauss-Newton step, infinite if the first pass fails."""
    low, high = problem.bounds()
    x, least = np.zeros(len(problem.coordinates)), np.inf
    for _ in range(STEPS):
        prediction = predict_errors(problem, x)
        if isinstance(prediction, Failure):
            break
        at = prediction.linearisation()
        step = np.clip(np.linalg.lstsq(at.R, -at.q, rcond=None)[0], -LARGEST_STEP, LARGEST_STEP)
        after = at.R @ step + at.q
        least = prediction.cost - float(at.q @ at.q - after @ after)
        x = np.clip(x + step, low, high)
    return least

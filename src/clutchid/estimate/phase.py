"""Phase of the carrier in a recording with position alone, by a filter that adapts load and friction."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from clutchid.estimate.free import FreeParameters
from clutchid.estimate.prediction_error.problem import predict_errors
from clutchid.estimate.problem import fit_problem
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.preparation.carrier import centred
from clutchid.preparation.pulses import FindPhase, find_phase
from clutchid.simulation.windows import Track
from clutchid.uncertainty.calibration import Calibration

#: Phases that are tried, Gauss-Newton steps at each, and the length in s of the part of a recording that they are tried
#: on. With one step cold recordings of two of the trucks 12 to 15 were 0.3 to 0.5 of a period off, with two up to 0.25.
PHASES, STEPS, DURATION = 10, 2, 10.0

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
    or cold grease would otherwise be taken for another phase. The phase is refined by a parabola.

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
    part = log.slice(0, min(len(log), round(DURATION / step)))
    costs = np.array([_cost(part, actuator, calibration, at / PHASES) for at in range(PHASES)])
    return centred((int(np.argmin(costs)) + _vertex(costs)) / PHASES)


def _vertex(costs: FloatArray) -> float:
    """Place of the least cost between phases, by a parabola through the best and its neighbours, from the best."""
    best = int(np.argmin(costs))
    before, after = costs[best - 1] - costs[best], costs[(best + 1) % costs.size] - costs[best]
    return 0.5 * float((before - after) / (before + after)) if 0.0 < before + after < np.inf else 0.0


def _cost(part: Log, actuator: Actuator, calibration: Calibration, phase: float) -> float:
    """Least cost of the prediction errors at a phase, over the Gauss-Newton steps; infinite if the first pass fails."""
    free = FreeParameters((*actuator.load.names, "D_v"), ("position",))
    problem, _ = fit_problem([part], actuator, free, calibration, lambda _log, _actuator: centred(phase))
    problem = replace(problem, tracks=tuple(map(_with_few_steps, problem.tracks)))
    low, high = problem.bounds()
    x, least = np.zeros(len(problem.coordinates)), np.inf
    for _ in range(1 + STEPS):
        prediction = predict_errors(problem, x)
        if isinstance(prediction, Failure):
            break
        least = min(least, prediction.cost)
        at = prediction.linearisation()
        step = np.linalg.lstsq(at.R, -at.q, rcond=None)[0]
        x = np.clip(x + np.clip(step, -LARGEST_STEP, LARGEST_STEP), low, high)
    return least


def _with_few_steps(track: Track) -> Track:
    """`track` with the integration steps of its windows, which are fewer than those of the plan."""
    substeps = track.segment.substeps.copy()
    for window in track.windows:
        begin = window.start - track.segment.start
        substeps[begin : begin + len(window.substeps)] = window.substeps
    return replace(track, segment=replace(track.segment, substeps=substeps))

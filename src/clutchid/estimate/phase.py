"""Phase of the carrier in a recording with position alone, by a filter that adapts load and friction."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration

#: Phases that are tried, those to either side of the most promising one whose steps are taken, and the length of the
#: part of a recording that they are tried on in s. Chosen by `benchmarks/phase.py` on trucks 0 to 5.
PHASES, NEAR, DURATION = 10, 2, 10.0

#: Largest step of a parameter in standard deviations of its prior.
LARGEST_STEP = 2.0


def phase_finder(actuator: Actuator, free: FreeParameters, calibration: Calibration | None) -> FindPhase:
    """How the phase of the carrier is estimated for a fit: with a calibration by `filtered_phase`."""
    if calibration is None or not free.reads_load(actuator):
        return find_phase
    return partial(filtered_phase, calibration=calibration)


def filtered_phase(log: Log, actuator: Actuator, calibration: Calibration) -> float:
    """Phase of a carrier of known period for which a Kalman filter predicts the position best, in [-0.5, 0.5).

    Load and viscous friction take one Gauss-Newton step towards smaller prediction errors: a worn clutch or cold grease
    would otherwise be taken for another phase. The phase is refined by a parabola.

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
    tried = [_Trial.of(part, actuator, calibration, at / PHASES) for at in range(PHASES)]
    first = int(np.argmin([trial.expected for trial in tried]))
    costs = np.full(PHASES, np.inf)
    for at in range(first - NEAR, first + NEAR + 1):
        costs[at % PHASES] = tried[at % PHASES].stepped_cost()
    return centred((int(np.argmin(costs)) + _vertex(costs)) / PHASES)


def _vertex(costs: FloatArray) -> float:
    """Place of the least cost between phases, by a parabola through the best and its neighbours, from the best."""
    best = int(np.argmin(costs))
    before, after = costs[best - 1] - costs[best], costs[(best + 1) % costs.size] - costs[best]
    return 0.5 * float((before - after) / (before + after)) if 0.0 < before + after < np.inf else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A phase: its problem, the Gauss-Newton step, the cost at the start, and the cost expected after the step."""

    problem: FitProblem
    step: FloatArray
    cost: float
    expected: float

    @classmethod
    def of(cls, part: Log, actuator: Actuator, calibration: Calibration, phase: float) -> _Trial:
        free = FreeParameters((*actuator.load.names, "D_v"), ("position",))
        problem, _ = fit_problem([part], actuator, free, calibration, lambda _log, _actuator: centred(phase))
        problem = replace(problem, tracks=tuple(map(_with_few_steps, problem.tracks)))
        nothing = np.zeros(len(problem.coordinates))
        start = predict_errors(problem, nothing)
        if isinstance(start, Failure):
            return cls(problem, nothing, np.inf, np.inf)
        at = start.linearisation()
        step: FloatArray = np.linalg.lstsq(at.R, -at.q, rcond=None)[0].astype(np.float64)
        return cls(problem, step, start.cost, start.cost - float(at.q @ at.q))

    def stepped_cost(self) -> float:
        """The cost after the step within its bounds, or that at the start if it is lower or the step fails."""
        low, high = self.problem.bounds()
        x = np.clip(np.clip(self.step, -LARGEST_STEP, LARGEST_STEP), low, high)
        stepped = predict_errors(self.problem, x)
        return self.cost if isinstance(stepped, Failure) else min(self.cost, stepped.cost)


def _with_few_steps(track: Track) -> Track:
    """`track` with the integration steps of its windows, which are fewer than those of the plan."""
    substeps = track.segment.substeps.copy()
    for window in track.windows:
        begin = window.start - track.segment.start
        substeps[begin : begin + len(window.substeps)] = window.substeps
    return replace(track, segment=replace(track.segment, substeps=substeps))

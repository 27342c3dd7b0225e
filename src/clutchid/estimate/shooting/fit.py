"""The method 'shooting': search, result and checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimate.change import score
from clutchid.estimate.free import FreeParameters
from clutchid.estimate.problem import fit_problem
from clutchid.estimate.search_result import SearchMethod, SearchResult
from clutchid.estimate.shooting.checks import checked
from clutchid.estimate.shooting.result import result
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.simulation.windows import initial_states
from clutchid.smoother.projection import ShootingSolution
from clutchid.smoother.search import STAGES_FROM_CALIBRATION, STAGES_FROM_PRIOR, search
from clutchid.smoother.trajectory import noise_scales
from clutchid.uncertainty.calibration import Calibration

#: Correlation time in s of the model error in position. A load from position alone was closer to the truth if ten
#: samples at 1 kHz were weighted as one, see docs/derivations.md.
MEMORY = 0.01

_METHOD = "shooting"


def shoot(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> SearchResult[ShootingSolution]:
    """Fit the `free` parameters to recordings by multiple shooting.

    With a `calibration` the search starts from the calibrated values and needs fewer stages.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    problem, plans = fit_problem(logs, actuator, free, calibration)
    if calibration and free.reads_load(actuator):
        problem = replace(problem, noise=replace(problem.noise, memory=MEMORY))
    X: list[FloatArray] = []
    for track in problem.tracks:
        guess = initial_states(track, plans[track.log].actuator, "pressure_a" in free.measure)
        if isinstance(guess, Failure):
            return SearchResult(_METHOD, problem, plans, guess)
        X.append(guess)
    # start at the prior means: bounded steps cannot return from a start far outside a narrow prior
    x = np.zeros(len(problem.coordinates))
    stages = STAGES_FROM_CALIBRATION if calibration else STAGES_FROM_PRIOR
    coarse = search(problem, x, X, stages[:-1], progress)
    if isinstance(coarse, Failure):
        return SearchResult(_METHOD, problem, plans, coarse)
    problem = replace(problem, noise=replace(problem.noise, measured=noise_scales(problem, coarse)))
    fine = search(problem, coarse.x, coarse.X, stages[-1:], progress)
    if isinstance(fine, ShootingSolution):
        fine = replace(fine, evaluations=fine.evaluations + coarse.evaluations)
    return SearchResult(_METHOD, problem, plans, fine)


#: Multiple shooting with soft continuity.
SHOOTING = SearchMethod(shoot, result, checked, score)

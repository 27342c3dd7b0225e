"""Errors of fits to position alone of the calibration recordings, which later fits subtract."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from clutchid.estimation.departure import misfit
from clutchid.estimation.hypotheses import explanation
from clutchid.estimation.method import Method, SearchResult
from clutchid.estimation.request import FreeParameters, SearchStart
from clutchid.inference.smoother.residuals import dispersion
from clutchid.inference.uncertainty.calibration import Calibration, PositionOnlyErrors
from clutchid.inference.uncertainty.change_prior import HYPOTHESES, Hypothesis
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.numerics.progress import Progress, within_stage


def position_only_errors(
    method: Method,
    logs: Sequence[Log],
    actuator: Actuator,
    calibration: Calibration,
    start: SearchStart | None = None,
    progress: Progress | None = None,
) -> PositionOnlyErrors | None:
    """Errors of a fit to position alone under every hypothesis, as means over the calibration recordings.

    With a `start`, as after the calibration itself, a search needs no coarse stage. A recording whose search fails is
    left out; None if all fail.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    free = FreeParameters(actuator.load.names, ("position",), start=start)
    errors = []
    for log in logs:
        search_result = method.search(
            [log.without("pressure_a")], actuator, free, calibration, within_stage(progress, "position alone")
        )
        if not isinstance(search_result.solution, Failure):
            errors.append(_errors(search_result, search_result.solution, log, weighed=method.changes is not None))
    if not errors:
        return None
    names = tuple(name for name in errors[0].names if all(name in of_log.names for of_log in errors))
    hypotheses = errors[0].hypotheses
    return PositionOnlyErrors(
        hypotheses,
        names,
        np.mean([[of_log.shift(h, names) for h in hypotheses] for of_log in errors], axis=0),
        np.mean([of_log.log_evidence for of_log in errors], axis=0),
        float(np.mean([of_log.dispersion for of_log in errors])),
        float(np.mean([of_log.misfit for of_log in errors])),
    )


def _errors(search_result: SearchResult, solution: Solution[Any], log: Log, *, weighed: bool) -> PositionOnlyErrors:
    """Errors in one recording, all `weighed` hypotheses by the linearisation at the solution without a change.

    The phase of the carrier and the far stop are of this recording alone.
    """
    repeated = {*search_result.problem.actuator.load.names, *search_result.problem.changing}
    at = [i for i, c in enumerate(search_result.problem.coordinates) if c.name in repeated]
    widths = np.array([search_result.problem.coordinates[i].width for i in at])
    names = tuple(search_result.problem.coordinates[i].base for i in at)
    if not (weighed and search_result.problem.changing):
        none: Hypothesis = ()
        return PositionOnlyErrors((none,), names, (solution.x[at] * widths)[None], np.zeros(1))
    excess = dispersion(search_result.problem, solution.at)
    without_change = explanation(search_result, excess)
    posteriors = [without_change.under(hypothesis) for hypothesis in HYPOTHESES]
    shifts: FloatArray = np.array([(solution.x + posterior.step)[at] * widths for posterior in posteriors])
    evidence = np.array([posterior.log_evidence for posterior in posteriors])
    usual = misfit(solution.at.cost, [log])
    return PositionOnlyErrors(HYPOTHESES, names, shifts, evidence, excess, usual)

"""From the solution of a search to the result that the user sees: intervals, load band, errors, warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from clutchid.estimate.outcome import Compared, compare, load_curve, plan_warnings
from clutchid.estimate.result import Estimate, Fit, Recording, errors_over
from clutchid.estimate.simulation_error.problem import Problem, residuals, simulated_states
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.uncertainty.covariance import Covariance, sandwich
from clutchid.uncertainty.identifiability import identifiability_warnings, identifiable, listed


def result(task: Problem, solution: Solution, scales: Mapping[str, float]) -> Fit:
    """The result of a search that ended at `solution`."""
    x, k = solution.x, len(task.names)
    covariance = _covariance(task, solution, scales)
    shared = covariance.matrix[:k, :k] * np.outer(task.unit[:k], task.unit[:k])
    fitted = task.actuator_at(x)
    compared = _recordings(task, x, fitted)
    recordings = {one.recording.measured.name: one.recording for one in compared}
    warnings = plan_warnings(task.plans)
    if task.moves:
        reach = furthest([recording.measured for recording in recordings.values()])
        warnings += identifiability_warnings(solution.at.R, task.names, fitted, reach, "pressure_a" in task.measure)
        warnings += _does_not_move(recordings)
    else:
        warnings.append(_resting(task.names))
    warnings += _at_bounds(task, x)
    settled = solution.status != "limit"
    if not settled:
        warnings.append(f"the search stopped after {solution.evaluations} evaluations without settling.")
    return Fit(
        status="warning" if warnings else "ok",
        message=f"{solution.status} after {solution.evaluations} evaluations",
        actuator=fitted,
        parameters=_estimates(task, x, covariance),
        covariance=shared,
        load_curve=load_curve(fitted, task.names, shared, covariance.quantile()),
        recordings=recordings,
        errors=errors_over(one.shown for one in compared),
        scales=dict(scales),
        bounds=bounds_in_si(task),
        evaluations=solution.evaluations,
        warnings=tuple(warnings),
        settled=settled,
    )


def furthest(logs: Sequence[Log]) -> float:
    """Furthest finite position in m; 0 where there is none."""
    positions = [log["position"][np.isfinite(log["position"])] for log in logs]
    return max((float(position.max()) for position in positions if position.size), default=0.0)


def _resting(names: Sequence[str]) -> str:
    return (
        "the recording does not move, so it says nothing about "
        f"{listed(names) or 'the actuator'}; the start values are kept, the intervals are infinite."
    )


def _does_not_move(recordings: Mapping[str, Recording]) -> list[str]:
    """A warning where the measured piston strokes and the simulated one hardly moves."""
    stuck = [
        name
        for name, recording in recordings.items()
        if furthest([recording.simulated]) < 0.1 * furthest([recording.measured])
    ]
    return [
        f"{name}: the piston moves in the recording, not in the simulation; check that supply and exhaust are not "
        "swapped, and the supply pressure P_S."
        for name in stuck
    ]


def _recordings(task: Problem, x: FloatArray, fitted: Actuator) -> list[Compared]:
    return [
        compare(plan, simulated_states(task, x, number), task.starts_at(x, number, fitted))
        for number, plan in enumerate(task.plans)
    ]


def _covariance(task: Problem, solution: Solution, scales: Mapping[str, float]) -> Covariance:
    scores = []
    for answer in residuals(task, solution.x, scales):
        assert not isinstance(answer, Failure)
        part, r, J, at = answer
        # all that is measured at one sample is one score, so that what they have in common is counted
        local = np.zeros((len(part.segment), J.shape[1]))
        np.add.at(local, at, J * r[:, None])
        rows = np.zeros((len(part.segment), solution.x.size))
        rows[:, [*range(len(task.names)), *part.start]] = local
        scores.append(rows)
    known = identifiable(solution.at.R) & ~_held(task, solution) & task.moves
    return sandwich(solution.at.R, scores, known, len(task.names))


def _held(task: Problem, solution: Solution) -> NDArray[np.bool_]:
    """Parameters held by a bound against the data, load weights excepted: they are as if fixed there.

    A weight at its bound stays uncertain in the load band: it may be larger.
    """
    x, gradient = solution.x, solution.at.R.T @ solution.at.q
    held = ((x <= task.low) & (gradient > 0)) | ((x >= task.high) & (gradient < 0))
    held[[i for i, name in enumerate(task.names) if name in task.actuator.load.names]] = False
    held[len(task.names) :] = False
    return held


def _estimates(task: Problem, x: FloatArray, covariance: Covariance) -> dict[str, Estimate]:
    quantile = covariance.quantile()
    estimates = {}
    for i, name in enumerate(task.names):
        std, unit = float(np.sqrt(covariance.matrix[i, i])), float(task.unit[i])
        low, high = x[i] - quantile * std, x[i] + quantile * std
        if np.isfinite(std):
            low, high = max(task.low[i], low), min(task.high[i], high)
        estimates[name] = Estimate(
            float(x[i]) * unit, task.actuator.unit(name), std * unit, float(low) * unit, float(high) * unit
        )
    return estimates


def _at_bounds(task: Problem, x: FloatArray) -> list[str]:
    warnings = []
    for i, name in enumerate(task.names):
        for bound, word in ((task.low[i], "lower"), (task.high[i], "upper")):
            if x[i] == bound:
                shown = f"{bound * task.unit[i]:g}{task.actuator.unit_behind(name)}"
                fixed = "" if name in task.actuator.load.names else "; the others' intervals take it as fixed there"
                warnings.append(f"{name} lies at its {word} bound {shown}{fixed}.")
    return warnings


def bounds_in_si(task: Problem) -> dict[str, tuple[float, float]]:
    """Bounds of the free parameters by name, in SI."""
    low, high = task.si(task.low).tolist(), task.si(task.high).tolist()
    return {name: (low[i], high[i]) for i, name in enumerate(task.names)}

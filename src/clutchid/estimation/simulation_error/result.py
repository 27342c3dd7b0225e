"""The `Fit` of a search by simulation error: intervals, load curve, errors, warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from clutchid.estimation.request import ended
from clutchid.estimation.result import (
    Compared,
    Estimate,
    Fit,
    Recording,
    compare,
    errors_over,
    load_curve,
    plan_warnings,
)
from clutchid.estimation.simulation_error.problem import Problem, residuals, simulated_states
from clutchid.inference.uncertainty.gaussian import Covariance, sandwich
from clutchid.inference.uncertainty.identifiability import identifiability_warnings, identifiable, listed
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.simulation.run import PRESSURE_START


def result(problem: Problem, solution: Solution, scales: Mapping[str, float]) -> Fit:
    """The `Fit` at the solution of a search."""
    x, k = solution.x, len(problem.names)
    covariance = _covariance(problem, solution, scales)
    shared = covariance.matrix[:k, :k] * np.outer(problem.unit[:k], problem.unit[:k])
    fitted = problem.actuator_at(x)
    compared = _recordings(problem, x, fitted)
    recordings = {one.recording.measured.name: one.recording for one in compared}
    warnings = plan_warnings(problem.plans)
    if problem.has_motion:
        reach = furthest([recording.measured for recording in recordings.values()])
        with_pressure = "pressure_a" in problem.measure
        warnings += identifiability_warnings(solution.at.R, problem.names, fitted, reach, with_pressure)
        warnings += _does_not_move(recordings)
    else:
        warnings.append(_resting(problem.names))
    warnings += _at_bounds(problem, x)
    converged = solution.status != "limit"
    if not converged:
        warnings.append(f"the search {ended(solution.status, solution.evaluations)}.")
    return Fit(
        status="warning" if warnings else "ok",
        message=ended("converged" if converged else "limit", solution.evaluations),
        actuator=fitted,
        parameters=_estimates(problem, x, covariance),
        covariance=shared,
        load_curve=load_curve(fitted, problem.names, shared, covariance.quantile()),
        recordings=recordings,
        errors=errors_over(one.shown for one in compared),
        scales=dict(scales),
        bounds=bounds_in_si(problem),
        evaluations=solution.evaluations,
        warnings=tuple(warnings),
        notes=_estimated_starts(problem, recordings),
        converged=converged,
    )


def _estimated_starts(problem: Problem, recordings: Mapping[str, Recording]) -> tuple[str, ...]:
    """A note for each recording whose start was estimated: a simulation needs the same start for the same errors."""
    notes = []
    for number, prepared in enumerate(problem.plans):
        first = next(part for part in problem.segments if part.log == number)
        if not first.start:
            continue
        name = prepared.log.name
        position, pressure = recordings[name].starts[0]
        estimated = f"position {position * 1e3:.3g} mm"
        estimated += f" and pressure {pressure / 1e5:.4g} bar" if PRESSURE_START in first.start_names else ""
        notes.append(
            f"{name}: does not start vented and at rest, so that its start was estimated: {estimated}. A saved result "
            f"has it for clutchid simulate; in Python pass starts=fit.recordings['{name}'].starts."
        )
    return tuple(notes)


def furthest(logs: Sequence[Log]) -> float:
    """Largest finite position in m; 0 if there is none."""
    positions = [log["position"][np.isfinite(log["position"])] for log in logs]
    return max((float(position.max()) for position in positions if position.size), default=0.0)


def _resting(names: Sequence[str]) -> str:
    return (
        f"the recording has no motion, so it cannot determine {listed(names) or 'the actuator'}; the start values are "
        "kept, the intervals are infinite."
    )


def _does_not_move(recordings: Mapping[str, Recording]) -> list[str]:
    """A warning if the measured piston strokes and the simulated one hardly moves."""
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


def _recordings(problem: Problem, x: FloatArray, fitted: Actuator) -> list[Compared]:
    return [
        compare(plan, simulated_states(problem, x, number), problem.starts_at(x, number, fitted))
        for number, plan in enumerate(problem.plans)
    ]


def _covariance(problem: Problem, solution: Solution, scales: Mapping[str, float]) -> Covariance:
    scores = []
    for evaluated in residuals(problem, solution.x, scales):
        assert not isinstance(evaluated, Failure)
        part, r, J, at = evaluated
        # all columns of a sample share one score, which includes their correlation
        local = np.zeros((len(part.segment), J.shape[1]))
        np.add.at(local, at, J * r[:, None])
        rows = np.zeros((len(part.segment), solution.x.size))
        rows[:, [*range(len(problem.names)), *part.start]] = local
        scores.append(rows)
    known = identifiable(solution.at.R) & ~_at_active_bound(problem, solution) & problem.has_motion
    return sandwich(solution.at.R, scores, known, len(problem.names))


def _at_active_bound(problem: Problem, solution: Solution) -> NDArray[np.bool_]:
    """Parameters at an active bound, except load weights: their covariance is that of fixed parameters.

    A weight at its bound stays uncertain in the interval of the load, because it may be larger.
    """
    x, gradient = solution.x, solution.at.R.T @ solution.at.q
    active = ((x <= problem.low) & (gradient > 0)) | ((x >= problem.high) & (gradient < 0))
    active[[i for i, name in enumerate(problem.names) if name in problem.actuator.load.names]] = False
    active[len(problem.names) :] = False
    return active


def _estimates(problem: Problem, x: FloatArray, covariance: Covariance) -> dict[str, Estimate]:
    quantile = covariance.quantile()
    estimates = {}
    for i, name in enumerate(problem.names):
        std, unit = float(np.sqrt(covariance.matrix[i, i])), float(problem.unit[i])
        low, high = x[i] - quantile * std, x[i] + quantile * std
        if np.isfinite(std):
            low, high = max(problem.low[i], low), min(problem.high[i], high)
        estimates[name] = Estimate(
            float(x[i]) * unit, problem.actuator.unit(name), std * unit, float(low) * unit, float(high) * unit
        )
    return estimates


def _at_bounds(problem: Problem, x: FloatArray) -> list[str]:
    warnings = []
    for i, name in enumerate(problem.names):
        for bound, word in ((problem.low[i], "lower"), (problem.high[i], "upper")):
            if x[i] == bound:
                shown = f"{bound * problem.unit[i]:g}{problem.actuator.unit_behind(name)}"
                others = "; the intervals of the others assume that it is fixed there"
                fixed = "" if name in problem.actuator.load.names else others
                warnings.append(f"{name} lies at its {word} bound {shown}{fixed}.")
    return warnings


def bounds_in_si(problem: Problem) -> dict[str, tuple[float, float]]:
    """Bounds of the free parameters by name, in SI."""
    low, high = problem.si(problem.low).tolist(), problem.si(problem.high).tolist()
    return {name: (low[i], high[i]) for i, name in enumerate(problem.names)}

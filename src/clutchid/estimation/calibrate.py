"""Fits with priors: free parameters, search, changes since a calibration, and the new calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.assess.evidence import diagnosed, has_position, reach
from clutchid.estimation.automatic import automatic
from clutchid.estimation.departure import departure, relative_misfit
from clutchid.estimation.filtered_load import with_filtered_load
from clutchid.estimation.hypotheses import changes, explained, mixture, most_probable
from clutchid.estimation.method import Method, SearchResult, fit_at
from clutchid.estimation.position_only import position_only_errors
from clutchid.estimation.request import Continuation, FitRequest, FreeParameters, SearchStart, bounds_of, free_names
from clutchid.estimation.result import Fit
from clutchid.estimation.verification import on_samples, with_slow_logs
from clutchid.inference.problem import Problem
from clutchid.inference.uncertainty.calibration import MODEL_MISSES, Calibration, calibrated_deviation
from clutchid.inference.uncertainty.conditions import (
    CONDITIONS,
    RecordedConditions,
    assumed_conditions,
    condition_warnings,
    conditions_of,
    unlike_conditions,
    with_estimated_supply,
)
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import ParameterName, base_of
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.progress import Progress, report_stage
from clutchid.preparation.prepare import FROM_POSITION_ALONE
from clutchid.strokes.travel import merged_travels, travel_of
from clutchid.strokes.vented_pressure import vented_pressure
from clutchid.strokes.vented_rest import merged_levels, vented_rest


def fit_with(
    method: Method,
    logs: Sequence[Log],
    actuator: Actuator,
    request: FitRequest,
    progress: Progress | None = None,
    before_checks: Callable[[Fit], None] = lambda _: None,
) -> Fit:
    """Fit as requested by `method`; with priors, pressure in use and a free load the result is also a calibration.

    `before_checks` gets the result before profile likelihood and bootstrap begin, so that it can be saved. Status
    "failed" if the search cannot start.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    report_stage(progress, "preparation")
    actuator, free, request = prepared(logs, actuator, request)
    if not method.priors:
        return fit_at(method, method.search(logs, actuator, free, None, progress))
    request = replace(request, profile=actuator.expanded(request.profile))
    _check_size(logs, free)
    _check_profiled(request, free)
    conditions = conditions_of(logs, actuator)
    search_result = _searched(method, logs, actuator, free, request.calibration, progress)
    report_stage(progress, "evidence")
    result = fit_at(method, search_result, request.calibration)
    if result.status == "failed":
        return result
    recordings = {log.name: on_samples(result.recordings[log.name], log) for log in logs}
    result = replace(result, recordings=recordings, search=result.search and replace(result.search, free=free.names))
    calibrates = "pressure_a" in free.measure and set(free.names) >= set(actuator.load.names)
    if calibrates:
        result = _with_calibration(method, result, logs, actuator, conditions, progress)
    if method.check and request.checks:
        before_checks(result if calibrates else _as_reading(result, search_result.problem, logs, free))
        result = method.check(result, search_result, request.calibration, request.profile, request.bootstrap)
    return result if calibrates else _as_reading(result, search_result.problem, logs, free)


def prepared(
    logs: Sequence[Log], actuator: Actuator, request: FitRequest
) -> tuple[Actuator, FreeParameters, FitRequest]:
    """The actuator to start from, the free parameters, and the request, which may continue an earlier search.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    actuator, free = free_parameters(logs, actuator, request)
    if request.continues and request.continues.applies(free.names, free.measure, _data_of(logs)):
        request, free = continued(request, request.continues, free)
    return actuator, free, request


def _with_calibration(
    method: Method,
    result: Fit,
    logs: Sequence[Log],
    actuator: Actuator,
    conditions: RecordedConditions,
    progress: Progress | None,
) -> Fit:
    """`result` as a calibration made under `conditions`, with the errors and innovations of position alone."""
    from clutchid.observer.run import usual_nis  # on use: readings do without an observer

    calibration = replace(calibration_of(result, actuator), missed=missed_load(result))
    simulated = [result.recordings[log.name].simulated for log in logs]
    conditions = with_estimated_supply(conditions, logs, simulated)
    # without the conditions, so that the errors hold for readings of recordings that lack them
    start = SearchStart({}, result.scales)
    errors = position_only_errors(method, logs, result.actuator, calibration, start, progress)
    calibration = replace(calibration, position_only=errors, conditions=conditions)
    report_stage(progress, "innovations")
    calibration = replace(calibration, nis=usual_nis(result.actuator, calibration, logs))
    warnings = (*result.warnings, *unlike_conditions(logs))
    return _with_missed(replace(result, calibration=calibration, warnings=warnings))


def missed_load(result: Fit) -> float:
    """Standard deviation in N of what the model misses of the load of a calibration, see `ModelMisses`."""
    residuals = [diagnosed(result, name).columns for name, r in result.recordings.items() if has_position(r)]
    parts = [columns["pressure_a"].autocorrelated for columns in residuals if "pressure_a" in columns] or [0.0]
    force = result.actuator.parameters.A_A * np.sqrt(np.mean(np.square(parts)))
    return float(np.hypot(MODEL_MISSES.peak * _peak(result), MODEL_MISSES.pressure * force))


def _peak(result: Fit) -> float:
    """Greatest load within the reach in N."""
    return float(result.load_curve.force[result.load_curve.peak(reach(result))])


def _with_missed(result: Fit) -> Fit:
    """A calibration with what the model misses in the band of its load, and a note of it."""
    assert result.calibration is not None, "only the band of a calibration has it"
    half = QUANTILE * result.calibration.missed
    share = 100 * half / max(_peak(result), 1.0)
    note = (
        f"± of the load includes {half:.0f} N ({share:.1f} % of the peak) for errors of the model, as measured on "
        "virtual trucks "
    )
    note += (
        "and by the residual of the pressure; the ± of the load weights and of later estimates does not include them."
    )
    return replace(result, load_curve=result.load_curve.widened(half), notes=(*result.notes, note))


def _as_reading(result: Fit, problem: Problem, logs: Sequence[Log], free: FreeParameters) -> Fit:
    """`result`; where it is a load read with a calibration, with what slow recordings lack and what is assumed.

    It has warnings about recorded conditions that the calibration lacks.
    """
    if result.calibration is None or not free.reads_load(result.actuator):
        return result
    lacking = condition_warnings(logs, result.calibration.conditions, free.conditions)
    assumed = assumed_conditions(logs, (*free.names, *problem.measured), problem.actuator)
    return with_slow_logs(replace(result, warnings=(*result.warnings, *lacking), assumed=assumed), logs)


def _searched(
    method: Method,
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None,
    progress: Progress | None,
) -> SearchResult:
    """Search; for a load from position alone over all hypotheses, with the changes and the departure."""
    search_result = method.search(logs, actuator, free, calibration, progress)
    if method.changes is None or calibration is None or not search_result.problem.changing:
        return search_result
    if isinstance(search_result.solution, Failure):
        return search_result
    report_stage(progress, "changes")
    explanations = explained(search_result, method.changes, calibration, progress)
    cost = min(explanation.solution.at.cost for explanation in explanations.values())
    best = explanations[most_probable(explanations, calibration)]
    problem = best.result.problem
    weighed = mixture(explanations, calibration, relative_misfit(cost, logs, calibration))
    posterior = with_filtered_load(weighed, problem, logs, actuator, calibration)
    settled = method.changes.settle(problem, best.solution, posterior.x)
    if isinstance(settled, Failure):
        settled, posterior = best.solution, posterior.moved(best.solution.x - posterior.x)
    return replace(
        best.result, solution=settled, posterior=posterior, changes=changes(problem, posterior),
        departure=departure(best, posterior.x, cost, logs, calibration),
    )  # fmt: skip


def free_parameters(logs: Sequence[Log], actuator: Actuator, request: FitRequest) -> tuple[Actuator, FreeParameters]:
    """The actuator to start from, and the free parameters with their priors.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    stems = [log.name for log in logs]
    free, priors = request.free, dict(request.priors)
    if request.automatic:
        if "pressure_a" not in request.measure:
            raise DataError(
                f"'auto' needs a recording with pressure, and --measure position,pressure_a. {FROM_POSITION_ALONE}"
            )
        shared = "P_0" in {*request.priors, *request.bounds}
        actuator, automatically, result = automatic(logs, actuator, shared=shared)
        free = tuple(name for item in free for name in (automatically if item == "auto" else (item,)))
        priors = {**result, **priors}
    names = _without_shared(free_names(free, actuator, stems))
    of_conditions = {name: prior for name, prior in priors.items() if name in CONDITIONS and name not in names}
    conditions = of_conditions if request.calibration and "pressure_a" not in request.measure else {}
    priors = {name: prior for name, prior in priors.items() if name not in conditions}
    unknown = [name for name in priors if name not in names]
    if unknown:
        listed_names = ", ".join(names) or "none"
        raise ParameterError(f"prior for {', '.join(unknown)}, which is not free; free are {listed_names}.")
    all_bounds = bounds_of(names, actuator, request.bounds) if request.bounds else {}
    bounds = {name: all_bounds[name] for name in request.bounds}
    if request.calibration:
        priors = {**_calibrated(names, actuator, request.calibration), **priors}
    return actuator, FreeParameters(
        names, request.measure, bounds, priors, conditions=conditions, partition=request.partition
    )


def _without_shared(names: Sequence[str]) -> tuple[str, ...]:
    """Names without a shared parameter if every recording has its own: NAME is dropped if there is a NAME@STEM."""
    parsed = [ParameterName.parse(name) for name in names]
    own = {name.base for name in parsed if name.recording}
    return tuple(str(name) for name in parsed if name.recording or name.base not in own)


def _calibrated(names: Sequence[str], actuator: Actuator, calibration: Calibration) -> dict[str, Prior]:
    """Priors of calibrated parameters that are free again: covariance of the calibration, and drift."""
    bases = {name: base_of(name) for name in names}
    return {
        name: Prior(actuator.value(base), calibrated_deviation(actuator, base, calibration))
        for name, base in bases.items()
        if base in calibration.names
    }


def _check_profiled(request: FitRequest, free: FreeParameters) -> None:
    """Refuse, before any work, a profile of a fixed parameter; NAME@STEM may become free with a load from position."""
    alien = [name for name in request.profile if name not in free.names and base_of(name) == name]
    if alien:
        listed_names = ", ".join(free.names)
        raise ParameterError(
            f"profile of {', '.join(alien)}, which is not free; free are {listed_names}, or NAME@STEM."
        )


def _check_size(logs: Sequence[Log], free: FreeParameters) -> None:
    """Refuse a request without free parameters, and recordings that are too short for it.

    Raises
    ------
    ParameterError
        If nothing is free.
    DataError
        If there are fewer than ten measured samples per free parameter.
    """
    samples = sum(int(np.isfinite(log[name]).sum()) for log in logs for name in free.measure)
    if not free.names:
        raise ParameterError("no parameter is free; name parameters, for example load.")
    if samples < 10 * len(free.names):
        raise DataError(
            f"{logs[0].name}: {samples} measured samples for {len(free.names)} free parameters; at least ten for each "
            "are needed. Record at least a full stroke, or free fewer parameters."
        )


def calibration_of(result: Fit, actuator: Actuator) -> Calibration:
    """Covariance of the shared parameters of a fit, without the load weights."""
    at = [i for i, name in enumerate(result.parameters) if name not in actuator.load.names and base_of(name) == name]
    names = tuple(name for i, name in enumerate(result.parameters) if i in at)
    weights = [list(result.parameters).index(name) for name in actuator.load.names]
    return Calibration(
        names,
        result.covariance[np.ix_(at, at)],
        data=_data_of([recording.measured for recording in result.recordings.values()]),
        method=result.method,
        theta=result.actuator.load.theta,
        theta_covariance=result.covariance[np.ix_(weights, weights)],
        converged=result.converged,
        rest=merged_levels([vented_rest(recording.measured) for recording in result.recordings.values()]),
        vented=any(vented_pressure(recording.measured) for recording in result.recordings.values()),
        travel=merged_travels(travel_of(recording.measured) for recording in result.recordings.values()),
    )


def _data_of(logs: Sequence[Log]) -> dict[str, str]:
    """SHA-256 of the files of recordings by name; "unknown" where a recording is not from a file."""
    return {log.name: log.metadata.get("sha256", "unknown") for log in logs}


def continued(request: FitRequest, earlier: Continuation, free: FreeParameters) -> tuple[FitRequest, FreeParameters]:
    """The request and its free parameters with the priors of an `earlier` search, started from its result.

    The result of the earlier search is no prior: it has been estimated from the same data. If pressure is in use, its
    calibration is not used either.
    """
    if "pressure_a" in free.measure:
        request = replace(request, calibration=None)
    start = SearchStart(earlier.values, earlier.scales)
    return request, replace(free, priors={**earlier.state.priors, **request.priors}, start=start)

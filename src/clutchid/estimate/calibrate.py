"""A whole fit: what is free, the search by a method, and what a calibration leaves to later fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.estimate.automatic import automatic
from clutchid.estimate.calibration import Calibration, Score
from clutchid.estimate.change import changes_told, mean_score, score, with_changes
from clutchid.estimate.doubt import doubted
from clutchid.estimate.free import bounds_of, free_names
from clutchid.estimate.result import Fit
from clutchid.estimate.shooting.checks import checked
from clutchid.estimate.shooting.fit import FreeParameters, SearchResult, SolutionT, reads_load, shoot
from clutchid.estimate.shooting.summary import failed, position_only, summary
from clutchid.estimate.shooting.uncertainty import deviation
from clutchid.estimate.verification import on_samples
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.uncertainty.coordinates import Prior


@dataclass(frozen=True, slots=True)
class Request:
    """What the user asks of a fit: measured columns, free names, bounds, priors, and a calibration to build on.

    And how it is to be checked: numbers whose intervals come from profile likelihood, and draws of a bootstrap.
    """

    measure: tuple[str, ...]
    free: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)
    calibration: Calibration | None = None
    profile: tuple[str, ...] = ()
    bootstrap: int = 0


@dataclass(frozen=True, slots=True)
class SearchMethod(Generic[SolutionT]):
    """A way to fit: its name, the search for the wanted numbers, what its end means to the user, and its checks.

    `score` says where numbers that are held would go, for a method that looks for what has changed since a calibration.
    """

    name: str
    search: Callable[
        [Sequence[Log], Actuator, FreeParameters, Calibration | None, Progress | None], SearchResult[SolutionT]
    ]
    summary: Callable[[SearchResult[SolutionT], Calibration | None], Fit | Failure]
    check: Callable[[Fit, SearchResult[SolutionT], Calibration | None, Sequence[str], int], Fit] | None = None
    score: Callable[[SearchResult[SolutionT]], Score | Failure] | None = None


def fit_by(
    estimator: SearchMethod[SolutionT],
    logs: Sequence[Log],
    actuator: Actuator,
    request: Request,
    progress: Progress | None = None,
) -> Fit:
    """Fit what is asked for; where the pressure is in use and the load is free, also calibrate.

    Parameters
    ----------
    estimator : SearchMethod
        `SHOOTING`, or that of `clutchid.estimate.prediction_error`.
    logs : several
        Recordings with the measured columns of the request.
    actuator : Actuator
        Model and start values.
    request : Request
        What is free, and what is known of it.
    progress : function(stage, evaluations), optional
        Called at each evaluation.

    Returns
    -------
    fit : Fit

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`; a failed search is a result of status "failed".
    """
    actuator, wanted = wanted_of(logs, actuator, request)
    check_size(logs, wanted)
    _check_profiled(request, wanted)
    shot, wider, here = _adapted(estimator, logs, actuator, wanted, request.calibration, progress)
    released = wider.names[len(wanted.names) :]
    known, doubts = request.calibration, tuple[str, ...]()
    if known and here:
        free = {log.name: wider.free_in(log.name) for log in logs}
        slow = any(len(plan.log) > len(log) for plan, log in zip(shot.plans, logs, strict=True))
        known, doubts = doubted(known, here, free, {name.partition("@")[0] for name in released}, actuator, slow)
    result = estimator.summary(shot, known)
    if isinstance(result, Failure):
        return failed(shot, estimator.name, result.message)
    result = replace(result, recordings={log.name: on_samples(result.recordings[log.name], log) for log in logs})
    result = replace(result, notes=(*changes_told(released, actuator, result), *doubts, *result.notes))
    if estimator.check and (request.profile or request.bootstrap):
        result = estimator.check(result, shot, known, request.profile, request.bootstrap)
    free_load = set(wanted.names) >= set(actuator.load.names)
    if "pressure_a" not in wanted.measure or not free_load:
        return replace(result, calibration=request.calibration)
    kept = calibration_of(result, actuator)
    return replace(result, calibration=with_missed(estimator, logs, result.actuator, kept, progress))


def _adapted(
    estimator: SearchMethod[SolutionT],
    logs: Sequence[Log],
    actuator: Actuator,
    wanted: FreeParameters,
    calibration: Calibration | None,
    progress: Progress | None,
) -> tuple[SearchResult[SolutionT], FreeParameters, Score | None]:
    """The search; where a load is read from position alone and more has changed, again with that free; its score."""
    shot = estimator.search(logs, actuator, wanted, calibration, progress)
    if not (estimator.score and calibration and calibration.score and reads_load(wanted, actuator)):
        return shot, wanted, None
    here = estimator.score(shot)
    for _ in logs:
        wider = wanted if isinstance(here, Failure) else with_changes(wanted, here, calibration.score, actuator)
        if wider is wanted:
            break
        again = estimator.search(logs, actuator, wider, calibration, progress)
        if isinstance(again.found, Failure):
            break
        shot, wanted, here = again, wider, estimator.score(again)
    return shot, wanted, None if isinstance(here, Failure) else here


def wanted_of(logs: Sequence[Log], actuator: Actuator, request: Request) -> tuple[Actuator, FreeParameters]:
    """The actuator to start from, and the free numbers with their priors.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    stems = [log.name for log in logs]
    free, priors = request.free, dict(request.priors)
    if "auto" in free:
        if "pressure_a" not in request.measure:
            raise DataError(
                "'auto' needs a recording with pressure, and --measure position,pressure_a. From position alone free "
                "the load: --start CALIBRATION.toml --free load."
            )
        actuator, automatically, found = automatic(logs, actuator)
        free = tuple(name for item in free for name in (automatically if item == "auto" else (item,)))
        priors = {**found, **priors}
    names = _without_shared(free_names(free, actuator, stems))
    unknown = [name for name in priors if name not in names]
    if unknown:
        known = ", ".join(names) or "none"
        raise ParameterError(f"prior for {', '.join(unknown)}, which is not free; free are {known}.")
    given = bounds_of(names, actuator, request.bounds) if request.bounds else {}
    bounds = {name: given[name] for name in request.bounds}
    if request.calibration:
        priors = {**_calibrated(names, actuator, request.calibration), **priors}
    return actuator, FreeParameters(names, request.measure, bounds, priors)


def _without_shared(names: Sequence[str]) -> tuple[str, ...]:
    """Names without the shared number where every recording has its own: NAME goes where NAME@STEM stands."""
    own = {name.partition("@")[0] for name in names if "@" in name}
    return tuple(name for name in names if "@" in name or name not in own)


def _calibrated(names: Sequence[str], actuator: Actuator, calibration: Calibration) -> dict[str, Prior]:
    """Priors of calibrated parameters that are freed again: as uncertain as calibrated, and as far as they drift."""
    bases = {name: name.partition("@")[0] for name in names}
    return {
        name: Prior(actuator.value(base), deviation(actuator, base, calibration))
        for name, base in bases.items()
        if base in calibration.names
    }


def _check_profiled(request: Request, wanted: FreeParameters) -> None:
    """Refuse, before any work, to profile what is not free; numbers that only wear are free where a load is read."""
    alien = [name for name in request.profile if name not in wanted.names and "@" not in name]
    if alien:
        free = ", ".join(wanted.names)
        raise ParameterError(f"profile of {', '.join(alien)}, which is not free; free are {free}, or NAME@STEM.")


def check_size(logs: Sequence[Log], wanted: FreeParameters) -> None:
    """Refuse a request with nothing free, and recordings that are too short for it.

    Raises
    ------
    ParameterError
        If nothing is free.
    DataError
        If there are fewer than ten measured samples for each free number.
    """
    samples = sum(int(np.isfinite(log[name]).sum()) for log in logs for name in wanted.measure)
    if not wanted.names:
        raise ParameterError("nothing is free; name parameters, for example load.")
    if samples < 10 * len(wanted.names):
        raise DataError(
            f"{logs[0].name}: {samples} measured samples for {len(wanted.names)} free numbers; at least ten for each "
            "are needed. Record at least a full stroke, or free less."
        )


def calibration_of(result: Fit, actuator: Actuator) -> Calibration:
    """Covariance of the shared parameters of a fit, the load weights left out."""
    at = [i for i, name in enumerate(result.parameters) if name not in actuator.load.names and "@" not in name]
    names = tuple(name for i, name in enumerate(result.parameters) if i in at)
    data = {name: r.measured.metadata.get("sha256", "unknown") for name, r in result.recordings.items()}
    return Calibration(names, result.covariance[np.ix_(at, at)], data=data, method=result.method)


def with_missed(
    estimator: SearchMethod[SolutionT],
    logs: Sequence[Log],
    actuator: Actuator,
    kept: Calibration,
    progress: Progress | None = None,
) -> Calibration:
    """`kept` with what a fit to position alone misses of a calibrated actuator: bias and score over its recordings.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`; a recording whose search fails is left out.
    """
    theta = np.asarray(actuator.load.theta)
    missed, scores = [], []
    for log in logs:
        shot = estimator.search(
            [position_only(log)], actuator, FreeParameters(actuator.load.names, ("position",)), kept, progress
        )
        if isinstance(shot.found, Failure):
            continue
        missed.append(np.asarray(shot.task.actuator_of(shot.found.x, log.name).load.theta) - theta)
        scored = estimator.score(shot) if estimator.score else None
        if isinstance(scored, Score):
            scores.append(scored)
    bias = tuple(np.mean(missed, axis=0).tolist()) if missed else (0.0,) * theta.size
    return replace(kept, bias=bias, score=mean_score(scores) if scores else None)


#: Multiple shooting with soft continuity.
SHOOTING = SearchMethod("shooting", shoot, summary, checked, score)

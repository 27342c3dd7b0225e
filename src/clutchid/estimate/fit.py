"""`fit`: from recordings of an actuator to its load and parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, get_args

import numpy as np

from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.estimate.automatic import AUTOMATIC
from clutchid.estimate.calibrate import SHOOTING, Request, fit_by
from clutchid.estimate.calibration import Calibration
from clutchid.estimate.free import bounds_of, free_names
from clutchid.estimate.prediction_error.fit import PREDICTION_ERROR
from clutchid.estimate.result import Fit, Recording
from clutchid.estimate.simulation_error.problem import Problem, problem
from clutchid.estimate.simulation_error.search import two_stages
from clutchid.estimate.simulation_error.summary import failed, plan_warnings, summary
from clutchid.estimate.verification import as_sensed
from clutchid.log import Log
from clutchid.measured import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.model.equipment import Equipment
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.parameters import unknown_name
from clutchid.preparation.pulses import Pulsed, unsensed
from clutchid.simulation.partition import Partition
from clutchid.simulation.plan import outside_stroke, plan
from clutchid.simulation.stiffness import stiffness, stiffness_over, top_speed
from clutchid.uncertainty.coordinates import Prior

#: Methods by name: the paper's simulation error, ballistic or partitioned, multiple shooting, and prediction error.
Method = Literal["simulation", "shooting", "prediction-error"]
METHODS: tuple[str, ...] = get_args(Method)

#: Of fewer draws a bootstrap tells no spread.
FEWEST_DRAWS = 10


def fit(
    logs: Log | Sequence[Log],
    actuator: Actuator | None = None,
    *,
    measure: Sequence[str] = ("position",),
    free: Sequence[str] = ("load",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: Sequence[Log] = (),
    method: Method | None = None,
    priors: Mapping[str, Prior] | None = None,
    calibration: Calibration | None = None,
    profile: Sequence[str] = (),
    bootstrap: int = 0,
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Fit the free parameters of `actuator` to recordings.

    'simulation' is the paper's method, in two stages: the coarse one tries factors on the load and stops early; the
    fine one goes on from the best with the noise scales found. 'shooting' lets many short simulations meet softly; it
    knows priors, numbers of single recordings, and calibration. So does 'prediction-error', where a Kalman filter
    predicts every sample. All are bounded Levenberg-Marquardt searches on exact sensitivities. docs/methods.md helps to
    choose.

    Parameters
    ----------
    logs : Log or several
        Recordings with the duty cycles of the valves and the columns in `measure`; all share the free parameters.
    actuator : Actuator, optional
        Model and start values; by default the paper's Appendix A with theta = (9e5, 0, 0) N/m, and for 'auto' the
        energy balance with Stribeck friction and a load on B-splines.
    measure : 'position', 'pressure_a'
        Measured columns to compare with.
    free : names
        Free parameters; 'load' stands for all load weights, NAME@EACH for an own number of every recording, 'auto' for
        all that a recording with pressure may tell. Empty: only unknown starts are estimated.
    bounds : {name: (low, high)}, optional
        In SI. By default theta_1 and theta_3 are at least 0, theta_2 is free (it changes sign on a worn clutch), and
        every other parameter stays within a factor of three of its start, or in its range where that is finite.
    partition : Partition, optional
        Partitioned ballistic simulation; ballistic without.
    verify : logs
        Recordings that are simulated with the result, not fitted.
    method : 'simulation', 'shooting' or 'prediction-error', optional
        By default the calibration's; without one shooting where 'auto', priors or numbers of single recordings ask for
        it, else simulation.
    priors : {name: Prior}, optional
        What is known before the data, in SI; by default `clutchid.uncertainty.coordinates` says.
    calibration : Calibration, optional
        ``fit.calibration`` of a fit with pressure, by the same method, whose actuator this one is.
    profile : names
        Free numbers whose intervals come from profile likelihood; shooting only, seconds each.
    bootstrap : int
        Draws of a bootstrap over strokes that checks the bands of the load; shooting only, 0 for none.
    on_failure : 'raise' or 'return'
        What to do when the start values cannot be simulated.
    progress : function(stage, evaluations), optional
        Called at each evaluation.

    Returns
    -------
    fit : Fit

    Raises
    ------
    DataError
        If a recording lacks a column, has fewer samples than there are free numbers, or nothing can be fitted.
    ParameterError
        For an unknown name, or bounds that cross or are not admissible.
    SolveError
        If the start values cannot be simulated and `on_failure` is 'raise'.

    References
    ----------
    Section 3.1; rules for missing samples, starts and resets: docs/formats.md.
    """
    recordings, verify = _driven([logs] if isinstance(logs, Log) else logs, actuator), _driven(verify, actuator)
    request = Request(tuple(measure), tuple(free), bounds or {}, priors or {}, calibration, tuple(profile), bootstrap)
    chosen = _chosen(method, request, partition)
    if chosen != "simulation":
        search = partial(fit_by, SHOOTING) if chosen == "shooting" else partial(fit_by, PREDICTION_ERROR)
        return _followed(search, (recordings, actuator, request, progress), verify, on_failure)
    actuator = actuator or Actuator()
    names = free_names(free, actuator)
    _check([*recordings, *verify], measure, len(recordings), actuator.parameters.y_max)
    limits = bounds_of(names, actuator, bounds or {})
    start = actuator.replace({name: float(np.clip(actuator.value(name), *limits[name])) for name in names})
    rate = stiffness_over(start, limits, top_speed(partition))
    plans = [plan(log, start, rate, partition, "pressure_a" in measure) for log in recordings]
    task = problem(start, plans, names, measure, limits)
    _check_size(task)
    solution, scales = two_stages(task, progress)
    if isinstance(solution, Failure):
        message = " ".join([f"the start values cannot be simulated. {solution.message}", *plan_warnings(plans)])
        if on_failure == "raise":
            raise SolveError(message)
        return failed(task, message)
    return _verified(summary(task, solution, scales), verify, partition, measure)


def _followed(
    search: Callable[[Sequence[Log], Actuator, Request, Progress | None], Fit],
    task: tuple[Sequence[Log], Actuator | None, Request, Progress | None],
    verify: Sequence[Log],
    on_failure: Literal["raise", "return"],
) -> Fit:
    """A fit by multiple shooting or prediction error, verified."""
    recordings, actuator, request, progress = task
    actuator = actuator or Actuator(model=AUTOMATIC if "auto" in request.free else "isothermal")
    _check([*recordings, *verify], request.measure, len(recordings), actuator.parameters.y_max)
    result = search(recordings, actuator, request, progress)
    if result.status == "failed":
        if on_failure == "raise":
            raise SolveError(result.message)
        return result
    return _verified(result, verify, None, request.measure)


def _chosen(method: str | None, request: Request, partition: Partition | None) -> str:
    """The method of a fit: that of the calibration, or shooting, where something is asked for that it knows."""
    automatic = "auto" in request.free or any("@" in name for name in request.free)
    checks = bool(request.profile or request.bootstrap)
    asked = automatic or checks or bool(request.calibration or request.priors)
    needed = request.calibration.method if request.calibration else "shooting"
    chosen = method or (needed if asked else "simulation")
    if chosen not in METHODS:
        raise ParameterError(unknown_name(chosen, METHODS, "method"))
    if checks and chosen != "shooting":
        raise ParameterError(f"a profile and a bootstrap belong to the method 'shooting', not to '{chosen}'.")
    if request.bootstrap < 0 or 0 < request.bootstrap < FEWEST_DRAWS:
        raise ParameterError(
            f"bootstrap = {request.bootstrap}: 0 for none, or at least {FEWEST_DRAWS} draws; 200 are usual."
        )
    if chosen != "simulation" and partition is not None:
        why = "shooting has windows of its own" if chosen == "shooting" else "a filter goes on from sample to sample"
        raise ParameterError(f"a partition belongs to the method 'simulation'; {why}.")
    if chosen == "simulation" and asked:
        raise ParameterError(
            "'auto', priors, numbers of single recordings and a calibration need the method 'shooting' or "
            "'prediction-error'."
        )
    return chosen


def _verified(result: Fit, logs: Sequence[Log], partition: Partition | None, measure: Sequence[str]) -> Fit:
    """`result` with the simulations of other recordings, and what is to be said of them."""
    done, warnings = verification(result.actuator, logs, partition, measure, result.follows)
    told = (*result.warnings, *(f"verification: {warning}" for warning in warnings))
    status = "warning" if told and result.status == "ok" else result.status
    return replace(result, verification=done, warnings=told, status=status)


def _check(recordings: Sequence[Log], measure: Sequence[str], fitted: int, y_max: float) -> None:
    """Refuse, before any work, recordings that lack a column; only the first `fitted` need all of `measure`."""
    unknown = [unknown_name(name, MEASURED, "measured column") for name in measure if name not in MEASURED]
    if unknown or not measure:
        raise ParameterError(
            "\n".join(unknown) or "measure: nothing to compare with; give position, pressure_a or both."
        )
    if fitted == 0:
        raise DataError("no recording given; a fit needs at least one.")
    problems = []
    for number, log in enumerate(recordings):
        compared = measure if number < fitted else ("position",)
        needed = dict.fromkeys(("duty_supply", "duty_exhaust", "position", *compared))
        absent = [name for name in needed if name not in log]
        empty = [name for name in compared if name in log and not np.isfinite(log[name]).any()]
        sentences, alien = outside_stroke(log, y_max)
        problems += sentences if alien else []
        problems += [f"{log.name}: no column '{name}'; it has {', '.join(log.columns)}." for name in absent]
        problems += [f"{log.name}: column '{name}' has no finite sample; nothing can be compared." for name in empty]
    if problems:
        raise DataError("\n".join(problems))


def _check_size(task: Problem) -> None:
    samples = sum(
        int(np.isfinite(p.log[name][s.start : s.stop]).sum())
        for p in task.plans
        for s in p.segments
        for name in task.measure
    )
    if samples <= task.x0.size:
        raise DataError(
            f"{task.plans[0].log.name}: {samples} measured samples for {task.x0.size} free numbers "
            f"({len(task.names)} parameters and the unknown starts); record at least a full stroke."
        )


def verification(
    actuator: Actuator,
    logs: Sequence[Log],
    partition: Partition | None,
    measure: Sequence[str] = ("position",),
    through_sensors: bool = False,
) -> tuple[dict[str, Recording], list[str]]:
    """Recordings simulated with `actuator`, nothing fitted but unknown starts, with their errors; and warnings.

    A recording that cannot be simulated is left out and is a warning. `through_sensors` for an actuator whose sensors
    and carrier are part of the model: each recording is simulated with the phase that its carrier has, and its errors
    are those of the simulation as the sensors would record it.

    Raises
    ------
    DataError
        If a recording lacks a column.
    """
    done: dict[str, Recording] = {}
    warnings: list[str] = []
    for log in _uniquely_named(list(logs)):
        used = [name for name in measure if name in log] or ["position"]
        own = unsensed(log, actuator) if through_sensors else Pulsed(log, actuator)
        result = fit([own.log], own.actuator, free=(), measure=used, partition=partition, on_failure="return")
        for name, one in result.recordings.items():
            done[name] = as_sensed(one, log, own.actuator.parameters) if through_sensors else one
        warnings += [own.warning] if own.warning else []
        warnings += result.warnings if result.status != "failed" else [result.message]
    return done, warnings


def _driven(logs: Sequence[Log], actuator: Actuator | None) -> list[Log]:
    """Logs with different names, and with duty cycles for both valves of the model."""
    equipment = actuator.equipment if actuator else Equipment()
    return [equipment.driven(log) for log in _uniquely_named(list(logs))]


def _uniquely_named(logs: list[Log]) -> list[Log]:
    """Logs with different names: a number is added where two files have the same stem."""
    taken = {log.name for log in logs}
    seen: set[str] = set()
    named = []
    for log in logs:
        name, number = log.name, 2
        while name in seen or (name != log.name and name in taken):
            name, number = f"{log.name} ({number})", number + 1
        seen.add(name)
        named.append(log if name == log.name else replace(log, name=name))
    return named


def starts_of(log: Log, actuator: Actuator, partition: Partition | None = None) -> tuple[tuple[float, float], ...]:
    """Position in m and pressure in Pa at the start of every segment, estimated where they are not known.

    Raises
    ------
    DataError
        If a start is unknown and the recording has no position to estimate it from.
    """
    driven = actuator.equipment.driven(log)
    prepared = plan(driven, actuator, stiffness(actuator, top_speed(partition)), partition)
    if all(segment.vented for segment in prepared.segments):
        return tuple((s.position_start, actuator.parameters.P_0) for s in prepared.segments)
    return fit(log, actuator, free=(), partition=partition).recordings[log.name].starts

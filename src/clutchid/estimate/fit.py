"""`fit`: from recordings of an actuator to its load and parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.estimate.covariance import Covariance, sandwich
from clutchid.estimate.identifiability import cannot_tell
from clutchid.estimate.least_squares import Failure, Linearisation, Solution, minimise
from clutchid.estimate.problem import MEASURED, Problem, linearise, problem, residuals, simulated_states
from clutchid.estimate.result import Estimate, Fit, LoadCurve, Recording, combined_errors, errors_between
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.parameters import Parameters, unknown_name
from clutchid.simulate.partition import Partition
from clutchid.simulate.plan import plan
from clutchid.simulate.simulation import simulated_log
from clutchid.simulate.stiffness import stiffness_over

FloatArray = NDArray[np.float64]

#: Scales of the first stage, in SI; the second stage takes the rms residuals of the first.
FIRST_SCALES = {"position": 1e-4, "pressure_a": 1e4}

#: Factors on the load weights that the coarse stage tries from the start values.
COARSE_FACTORS = (1.0, 0.6, 0.8, 1.25, 1.6)

Progress = Callable[[str, int], None]


def fit(
    logs: Log | Sequence[Log],
    actuator: Actuator | None = None,
    *,
    measure: Sequence[str] = ("position",),
    free: Sequence[str] = ("load",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: Sequence[Log] = (),
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Fit the free parameters of `actuator` to recordings, by simulation, as the paper does.

    Two stages: the coarse one tries factors on the load and stops early; the fine one goes on from the best with the
    noise scales found. Both are bounded Levenberg-Marquardt searches on exact sensitivities.

    Parameters
    ----------
    logs : Log or several
        Recordings with both duty cycles and the columns in `measure`; all share the free parameters.
    actuator : Actuator, optional
        Model and start values; by default the paper's Appendix A with theta = (9e5, 0, 0) N/m.
    measure : 'position', 'pressure_a'
        Measured columns to compare with.
    free : names
        Free parameters; 'load' stands for all load weights. Empty: only unknown starts are estimated.
    bounds : {name: (low, high)}, optional
        In SI. By default theta_1 and theta_3 are at least 0, theta_2 is free (it changes sign on a worn clutch), and
        every other parameter stays in its admissible range.
    partition : Partition, optional
        Partitioned ballistic simulation; ballistic without.
    verify : logs
        Recordings that are simulated with the result, not fitted.
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
        If a recording lacks a column, or nothing can be fitted.
    ParameterError
        For an unknown name, crossed bounds, or more free parameters than samples.
    SolveError
        If the start values cannot be simulated and `on_failure` is 'raise'.

    References
    ----------
    Section 3.1; rules for missing samples, starts and resets: CONTRACT.
    """
    actuator = actuator or Actuator()
    recordings = _uniquely_named([logs] if isinstance(logs, Log) else list(logs))
    names = free_names(free, actuator)
    _check(recordings, names, measure)
    limits = _bounds(names, actuator, bounds or {})
    start = actuator.replace({name: float(np.clip(actuator.value(name), *limits[name])) for name in names})
    rate = stiffness_over(start, limits)
    plans = [plan(log, start, rate, partition, "pressure_a" in measure) for log in recordings]
    task = problem(start, plans, names, measure, limits)
    _check_size(task)
    solution, scales = _two_stages(task, progress)
    if isinstance(solution, Failure):
        if on_failure == "raise":
            raise SolveError(f"the start values cannot be simulated. {solution.message}")
        return _failed(task, solution.message)
    return _result(task, solution, scales, partition, verify)


def free_names(free: Sequence[str], actuator: Actuator) -> tuple[str, ...]:
    """Names of the free parameters, with 'load' replaced by all load weights.

    Raises
    ------
    ParameterError
        For an unknown name; the text has the nearest known one.
    """
    expanded = [name for item in free for name in (actuator.load.names if item == "load" else (item,))]
    unknown = [unknown_name(name, ("load", *actuator.names)) for name in expanded if name not in actuator.names]
    if unknown:
        raise ParameterError("\n".join(unknown))
    return tuple(dict.fromkeys(expanded))


def _check(recordings: Sequence[Log], names: Sequence[str], measure: Sequence[str]) -> None:
    unknown = [unknown_name(name, MEASURED, "measured column") for name in measure if name not in MEASURED]
    if unknown or not measure:
        raise ParameterError("\n".join(unknown) or "measure: nothing to compare with; give position, pressure_a or both.")
    if not recordings:
        raise DataError("no recording given; a fit needs at least one.")
    problems = []
    for log in recordings:
        needed = dict.fromkeys(("duty_supply", "duty_exhaust", "position", *measure))
        absent = [name for name in needed if name not in log]
        empty = [name for name in measure if name in log and not np.isfinite(log[name]).any()]
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
            f"({len(task.names)} parameters and the unknown starts); record at least a full stroke, some hundred samples."
        )


def _bounds(
    names: Sequence[str], actuator: Actuator, given: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    foreign = [f"bounds for {name}, which is not free; free are {', '.join(names) or 'none'}." for name in given if name not in names]
    crossed = [f"{name}: lower bound {low:g} is not below upper bound {high:g}." for name, (low, high) in given.items() if not low < high]
    if foreign or crossed:
        raise ParameterError("\n".join(foreign + crossed))
    return {name: given.get(name, _default_bounds(name, actuator)) for name in names}


def _default_bounds(name: str, actuator: Actuator) -> tuple[float, float]:
    if name in actuator.load.names:
        return (-np.inf, np.inf) if name == "theta_2" else (0.0, np.inf)
    row = Parameters.row(name)
    low = row.low if row.low_included or not np.isfinite(row.low) else row.low + 1e-3 * abs(actuator.value(name) - row.low)
    return low, row.high


def _two_stages(task: Problem, progress: Progress | None) -> tuple[Solution | Failure, Mapping[str, float]]:
    """Coarse from afar, then fine: the paper conducts the optimisation twice."""
    scales = {name: FIRST_SCALES[name] for name in task.measure}
    count = 0

    def evaluate(x: FloatArray, stage: str) -> Linearisation | Failure:
        nonlocal count
        count += 1
        if progress:
            progress(stage, count)
        return linearise(task, x, scales)

    begin = _best_start(task, lambda x: evaluate(x, "coarse"))
    if isinstance(begin, Failure):
        return begin, scales
    coarse = minimise(lambda x: evaluate(x, "coarse"), begin, task.low, task.high, tolerance=1e-3)
    scales = _noise_scales(task, coarse.x, scales)
    again = evaluate(coarse.x, "fine")
    assert isinstance(again, Linearisation)
    fine = minimise(lambda x: evaluate(x, "fine"), (coarse.x, again), task.low, task.high, tolerance=1e-9)
    return replace(fine, evaluations=count), scales


def _best_start(
    task: Problem, evaluate: Callable[[FloatArray], Linearisation | Failure]
) -> tuple[FloatArray, Linearisation] | Failure:
    """The best of some multiples of the load at the start values, where any load weight is free."""
    weights = [i for i, name in enumerate(task.names) if name in task.actuator.load.names]
    best: tuple[FloatArray, Linearisation] | None = None
    first: Failure | None = None
    for factor in COARSE_FACTORS if weights else (1.0,):
        x = task.x0.copy()
        x[weights] *= factor
        x = np.clip(x, task.low, task.high)
        answer = evaluate(x)
        if isinstance(answer, Failure):
            if factor == 1.0:
                return answer
            first = first or answer
        elif best is None or answer.cost < best[1].cost:
            best = x, answer
    assert best is not None
    return best


def _noise_scales(task: Problem, x: FloatArray, scales: Mapping[str, float]) -> dict[str, float]:
    """Rms residual of every measured column, but not below a thousandth of the first scale."""
    sums = {name: [0.0, 0] for name in task.measure}
    for answer in residuals(task, x, scales):
        if isinstance(answer, Failure):
            return dict(scales)
        part, r, _ = answer
        log, at = task.plans[part.log].log, slice(part.segment.start, part.segment.stop)
        sizes = [int(np.isfinite(log[name][at]).sum()) for name in task.measure]
        for name, piece in zip(task.measure, np.split(r, np.cumsum(sizes)[:-1]), strict=True):
            sums[name][0] += float(piece @ piece) * scales[name] ** 2
            sums[name][1] += piece.size
    return {
        name: max(float(np.sqrt(total / max(1, count))), 1e-3 * FIRST_SCALES[name]) for name, (total, count) in sums.items()
    }


def _result(
    task: Problem, solution: Solution, scales: Mapping[str, float], partition: Partition | None, verify: Sequence[Log]
) -> Fit:
    x, k = solution.x, len(task.names)
    covariance = _covariance(task, solution, scales)
    fitted = task.actuator_at(x)
    reach = max(float(np.nanmax(p.log["position"])) for p in task.plans)
    parameters = _estimates(task, x, covariance)
    recordings = {}
    for number, prepared in enumerate(task.plans):
        simulated = simulated_log(prepared, simulated_states(task, x, number))
        starts = tuple(task.starts_at(x, number, fitted))
        errors = errors_between(prepared.log, simulated)
        recordings[prepared.log.name] = Recording(prepared.log, simulated, errors, starts)
    warnings = [w for p in task.plans for w in (*p.log.warnings, *p.warnings)]
    warnings += cannot_tell(solution.at.R, task.names, fitted, reach)
    warnings += _at_bounds(task, x)
    if solution.status == "limit":
        warnings.append(f"the search stopped after {solution.evaluations} evaluations without settling.")
    verified = verification(fitted, verify, partition, task.measure)
    return Fit(
        status="warning" if warnings else "ok",
        message=f"{solution.status} after {solution.evaluations} evaluations",
        actuator=fitted,
        parameters=parameters,
        covariance=covariance.matrix[:k, :k],
        load_curve=_load_curve(fitted, task.names, covariance),
        recordings=recordings,
        errors=combined_errors(recordings),
        scales=dict(scales),
        evaluations=solution.evaluations,
        warnings=tuple(warnings),
        verification=verified,
    )


def verification(
    actuator: Actuator, logs: Sequence[Log], partition: Partition | None, measure: Sequence[str] = ("position",)
) -> dict[str, Recording]:
    """Recordings simulated with `actuator`, nothing fitted but unknown starts, and their errors.

    Raises
    ------
    DataError
        If a recording lacks a column.
    """
    used = [name for name in measure if all(name in log for log in logs)] or ["position"]
    done: dict[str, Recording] = {}
    for log in _uniquely_named(list(logs)):
        done |= fit([log], actuator, free=(), measure=used, partition=partition).recordings
    return done


def _covariance(task: Problem, solution: Solution, scales: Mapping[str, float]) -> Covariance:
    scores = []
    for answer in residuals(task, solution.x, scales):
        assert not isinstance(answer, Failure)
        part, r, J = answer
        rows = np.zeros((r.size, solution.x.size))
        rows[:, [*range(len(task.names)), *part.start]] = J * r[:, None]
        scores.append(rows)
    return sandwich(solution.at.R, scores)


def _estimates(task: Problem, x: FloatArray, covariance: Covariance) -> dict[str, Estimate]:
    quantile = covariance.quantile()
    estimates = {}
    for i, name in enumerate(task.names):
        std = float(np.sqrt(covariance.matrix[i, i]))
        low, high = max(task.low[i], x[i] - quantile * std), min(task.high[i], x[i] + quantile * std)
        estimates[name] = Estimate(float(x[i]), task.actuator.unit(name), std, float(low), float(high))
    return estimates


def _load_curve(actuator: Actuator, names: Sequence[str], covariance: Covariance) -> LoadCurve:
    y = np.linspace(0.0, actuator.parameters.y_max, 101)
    phi, force = actuator.load.phi(y), actuator.load.force(y)
    weights = [(i, actuator.load.names.index(name)) for i, name in enumerate(names) if name in actuator.load.names]
    rows, cols = [i for i, _ in weights], [j for _, j in weights]
    P = covariance.matrix[np.ix_(rows, rows)]
    unknown = ~np.isfinite(np.diag(P)) if rows else np.zeros(0, dtype=bool)
    P = np.where(np.isfinite(P), P, 0.0)
    half = covariance.quantile() * np.sqrt(np.maximum(0.0, np.einsum("ni,ij,nj->n", phi[:, cols], P, phi[:, cols])))
    half[np.any(phi[:, cols][:, unknown] != 0.0, axis=1)] = np.inf
    return LoadCurve(y, force, force - half, force + half)


def _at_bounds(task: Problem, x: FloatArray) -> list[str]:
    warnings = []
    for i, name in enumerate(task.names):
        for bound, word in ((task.low[i], "lower"), (task.high[i], "upper")):
            if x[i] == bound:
                unit = task.actuator.unit(name)
                warnings.append(f"{name} lies at its {word} bound {bound:g}{'' if unit == '1' else ' ' + unit}.")
    return warnings


def _failed(task: Problem, message: str) -> Fit:
    nan = float("nan")
    parameters = {name: Estimate(nan, task.actuator.unit(name), nan, nan, nan) for name in task.names}
    y = np.linspace(0.0, task.actuator.parameters.y_max, 101)
    unknown = np.full(y.shape, np.nan)
    return Fit(
        status="failed",
        message=message,
        actuator=task.actuator,
        parameters=parameters,
        covariance=np.full((len(task.names),) * 2, np.nan),
        load_curve=LoadCurve(y, unknown, unknown, unknown),
        recordings={},
        errors=combined_errors({}),
        scales={},
        evaluations=0,
    )


def _uniquely_named(logs: list[Log]) -> list[Log]:
    """Logs with different names: a number is added where two files have the same stem."""
    seen: dict[str, int] = {}
    named = []
    for log in logs:
        seen[log.name] = seen.get(log.name, 0) + 1
        named.append(log if seen[log.name] == 1 else replace(log, name=f"{log.name} ({seen[log.name]})"))
    return named

"""From the end of a search by multiple shooting to the result that the user sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from clutchid.estimate.calibration import Calibration
from clutchid.estimate.result import Estimate, Fit, LoadCurve, Recording, errors_over
from clutchid.estimate.shooting.fit import SearchResult, SolutionT
from clutchid.estimate.shooting.uncertainty import Spread, pressure_spread, scale, spread
from clutchid.estimate.simulation_error.summary import plan_warnings
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.simulation.simulation import simulated_log
from clutchid.smoother.problem import FitProblem
from clutchid.smoother.projection import ShootingSolution
from clutchid.smoother.trajectory import recorded, trajectory
from clutchid.uncertainty.identifiability import listed

#: Standard deviations of a 95 % interval.
QUANTILE = 1.96

#: A number whose standard deviation is more than this share of what it was before the data is not told by them.
NOT_TOLD = 0.9


def summary(shot: SearchResult[ShootingSolution], calibration: Calibration | None) -> Fit | Failure:
    """The result of a search by multiple shooting."""
    found = shot.found
    if isinstance(found, Failure):
        return found
    uncertain = spread(shot.task, found, calibration)
    if isinstance(uncertain, Failure):
        return uncertain
    recordings, compared = _recordings(shot, found, uncertain)
    result = described(shot, found, uncertain.matrix, calibration, "shooting")
    return replace(result, recordings=recordings, errors=errors_over(compared))


def described(
    shot: SearchResult[SolutionT], found: SolutionT, matrix: FloatArray, calibration: Calibration | None, method: str
) -> Fit:
    """What the end of a search says of numbers and load, with the covariance `matrix` of x; no recordings yet."""
    task = shot.task
    bias = np.array(calibration.bias) if calibration and calibration.bias else np.zeros(len(task.actuator.load.theta))
    fitted = corrected(task.actuator_of(found.x, task.stems[0]), bias)
    warnings = (*plan_warnings(shot.plans), *at_bounds(task, found.x), *unsettled(found.status, found.evaluations))
    slopes = task.slopes(found.x)
    return Fit(
        status="warning" if warnings else "ok",
        message=f"{found.status} after {found.evaluations} evaluations",
        actuator=fitted,
        parameters=estimates_of(task, found.x, matrix, fitted),
        covariance=matrix * np.outer(slopes, slopes),
        load_curve=load_curve(task, fitted, matrix, slopes, bias),
        recordings={},
        errors=errors_over([]),
        scales=dict(task.noise.measured),
        bounds={c.name: (c.low, c.high) for c in task.coordinates},
        evaluations=found.evaluations,
        warnings=warnings,
        method=method,
        notes=not_told(task, matrix),
        settled=found.status == "converged",
    )


def corrected(actuator: Actuator, bias: FloatArray) -> Actuator:
    """`actuator` with the bias of its load weights taken off."""
    load = actuator.load
    return replace(actuator, load=replace(load, theta=tuple((np.asarray(load.theta) - bias).tolist())))


def _recordings(
    shot: SearchResult[ShootingSolution], found: ShootingSolution, uncertain: Spread
) -> tuple[dict[str, Recording], list[tuple[Log, Log]]]:
    """The recordings by name, and each as measured and as its sensors would record the simulation."""
    task = shot.task
    deviations = pressure_spread(uncertain)
    recordings, pairs = {}, []
    for number, prepared in enumerate(shot.plans):
        states = trajectory(task, found, number)
        seen = recorded(task, found, number, states)
        simulated = simulated_log(prepared, states, task.actuator.states)
        band = _band(task, number, deviations, simulated["pressure_a"])
        simulated = simulated.with_columns(**band)
        pairs.append((prepared.log, simulated.with_columns(**seen)))
        starts = tuple(
            (float(X[0, 0]), float(X[0, 2]))
            for track, X in zip(task.tracks, found.X, strict=True)
            if track.log == number
        )
        errors = errors_over(pairs[-1:])
        recordings[prepared.log.name] = Recording(prepared.log, simulated, errors, starts)
    return recordings, pairs


def _band(task: FitProblem, log: int, deviations: list[FloatArray], pressure: FloatArray) -> Mapping[str, FloatArray]:
    """Lower and upper end of the 95 % band of the pressure, between window starts by interpolation."""
    half = np.full(pressure.size, np.nan)
    for track, deviation in zip(task.tracks, deviations, strict=True):
        if track.log == log:
            at = [window.start for window in track.windows]
            inside = np.arange(track.segment.start, track.segment.stop)
            half[inside] = QUANTILE * np.interp(inside, at, deviation)
    return {"pressure_a low": pressure - half, "pressure_a high": pressure + half}


def estimates_of(task: FitProblem, x: FloatArray, matrix: FloatArray, fitted: Actuator) -> dict[str, Estimate]:
    """The free numbers in SI with their 95 % intervals, from x and its covariance `matrix`."""
    estimates = {}
    for i, c in enumerate(task.coordinates):
        deviation = float(np.sqrt(matrix[i, i]))
        shift = fitted.value(c.base) - c.si(float(x[i])) if c.base in fitted.load.names else 0.0
        value, low, high = (c.si(float(x[i]) + k * QUANTILE * deviation) + shift for k in (0.0, -1.0, 1.0))
        std = deviation * c.slope(float(x[i]))
        estimates[c.name] = Estimate(value, task.actuator.unit(c.base), std, low, high)
    return estimates


def load_curve(
    task: FitProblem, fitted: Actuator, matrix: FloatArray, slopes: FloatArray, bias: FloatArray
) -> LoadCurve:
    """The load with its band; the bias that was taken off is as uncertain as it is large."""
    y = np.linspace(0.0, fitted.parameters.y_max, 101)
    load, force = fitted.load, fitted.load.force(y)
    places = [(i, load.names.index(c.base)) for i, c in enumerate(task.coordinates) if c.base in load.names]
    rows, columns = [i for i, _ in places], [j for _, j in places]
    phi = load.phi(y)
    P = (matrix * np.outer(slopes, slopes))[np.ix_(rows, rows)]
    variance = np.einsum("ni,ij,nj->n", phi[:, columns], P, phi[:, columns]) + (scale(task.noise) * (phi @ bias)) ** 2
    half = QUANTILE * np.sqrt(np.maximum(variance, 0.0))
    return LoadCurve(y, force, force - half, force + half)


def at_bounds(task: FitProblem, x: FloatArray) -> list[str]:
    """Which free numbers lie at a bound, in words."""
    low, high = task.bounds()
    warnings = []
    for i, c in enumerate(task.coordinates):
        for bound, word in ((low[i], "lower"), (high[i], "upper")):
            if np.isfinite(bound) and abs(x[i] - bound) < 1e-9:
                shown = f"{c.si(float(x[i])):g}{task.actuator.unit_behind(c.base)}"
                warnings.append(f"{c.name} lies at its {word} bound {shown}.")
    return warnings


def unsettled(status: str, evaluations: int) -> list[str]:
    """That a search did not come to its end, in words."""
    if status == "converged":
        return []
    return [f"the search stopped after {evaluations} evaluations without settling."]


def not_told(task: FitProblem, matrix: FloatArray) -> tuple[str, ...]:
    """In words, from the information matrix: for which numbers what was known before the data still stands."""
    weights = task.actuator.load.names
    stands = [
        c.name
        for i, c in enumerate(task.coordinates)
        if c.base not in weights and np.sqrt(matrix[i, i]) > NOT_TOLD * scale(task.noise)
    ]
    told = [c.name for c in task.coordinates if c.base not in weights and c.name not in stands]
    notes = []
    if told:
        notes.append(f"told by the recordings: {listed(told)}.")
    if stands:
        notes.append(f"not told by the recordings, so what was known before stands: {listed(stands)}.")
    return tuple(notes)


def failed(shot: SearchResult[SolutionT], method: str, message: str) -> Fit:
    """The result of a search whose start cannot be simulated."""
    task, nan = shot.task, float("nan")
    y = np.linspace(0.0, task.actuator.parameters.y_max, 101)
    unknown = np.full(y.shape, nan)
    return Fit(
        status="failed",
        message=f"the start values cannot be simulated. {message}",
        actuator=task.actuator,
        parameters={c.name: Estimate(nan, task.actuator.unit(c.base), nan, nan, nan) for c in task.coordinates},
        covariance=np.full((len(task.coordinates),) * 2, nan),
        load_curve=LoadCurve(y, unknown, unknown, unknown),
        recordings={},
        errors=errors_over([]),
        scales={},
        bounds={c.name: (c.low, c.high) for c in task.coordinates},
        evaluations=0,
        warnings=tuple(plan_warnings(shot.plans)),
        method=method,
        settled=False,
    )


def position_only(log: Log) -> Log:
    """`log` without its pressure."""
    return replace(log, columns={name: v for name, v in log.columns.items() if name != "pressure_a"})

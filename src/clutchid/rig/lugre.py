"""`fit_lugre`: fit of the paper's friction model to position and force of a test rig, by free-run simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from clutchid.assess.diagnostics import fit_percent
from clutchid.errors import DataError, ParameterError
from clutchid.estimate.result import Estimate
from clutchid.log import FloatArray, Log
from clutchid.names import unknown_name
from clutchid.numerics.least_squares import Solution, minimise
from clutchid.parameters import Parameters
from clutchid.rig.compiled import NAMES
from clutchid.rig.free_run import Segment, free_run, segments
from clutchid.rig.lugre_problem import FREE, LugreProblem, linearised, lugre_problem, residuals, starts
from clutchid.signals.residual_colour import effective_samples
from clutchid.uncertainty.covariance import Covariance, sandwich

#: Half window in s over which the velocity is computed; averages quantisation and noise of the position sensor.
WINDOW = 0.02

#: Units of the parameters of a fit.
UNITS_OF = {"F_C": "N", "K_z": "N/m", "D_v": "N·s/m", "D_zdot": "N·s/m", "force_zero": "N"}


@dataclass(frozen=True, slots=True, eq=False)
class LugreFit:
    """Friction of one recording; values in SI, 95 % intervals that account for coloured residuals.

    `parameters` are the free ones of F_C, K_z, D_v, D_zdot and force_zero (N), `values` all of them. `starts` are the
    deflections in m at the start of each segment without a hole. `force` is the simulated force, NaN outside the
    segments; `fit_percent` is that of MATLAB's `compare`, `rms` in N; `effective_samples` is the number of independent
    samples.
    """

    name: str
    status: Literal["ok", "warning"]
    message: str
    parameters: Mapping[str, Estimate]
    values: Mapping[str, float]
    starts: tuple[float, ...]
    force: FloatArray
    fit_percent: float
    rms: float
    effective_samples: float
    warnings: tuple[str, ...]


def fit_lugre(log: Log, *, fixed: Mapping[str, float] | None = None, window: float = WINDOW) -> LugreFit:
    r"""Fit LuGre friction, Eqs. (2) and (3), to a recording of a test rig.

    .. math:: f = f_0 + D_v v + K_z z + D_{\dot z} \dot z

    The force is simulated from the measured position alone (free run) and compared with the measured force.

    Parameters
    ----------
    log : Log
        Position in m and force in N (applied by the rig, positive towards larger positions), without a pressure
        difference over the piston, or with a constant one, which is then part of force_zero.
    fixed : {name: value}, optional
        Parameters that are not estimated: F_C, K_z, D_v, D_zdot, force_zero. With the first four fixed, the fit
        validates them.
    window : s
        Half window of the velocity: difference of the mean positions after and before a sample. It should be short
        compared with F_C / (K_z v).

    Returns
    -------
    fit : LugreFit

    Raises
    ------
    DataError
        If position or force is missing, nothing moves, or the force drives the motion, so that its sign is wrong.
    ParameterError
        If a fixed name is unknown, its value not admissible, or `window` not above 0.

    Notes
    -----
    The initial deflection of every segment and the zero of the load cell are estimated too. A damping at its bound 0
    gives a warning, and the other intervals treat it as fixed there.

    Examples
    --------
    A block with 2 N of friction whose contact deflects by 0.1 mm before it slides:

    >>> t = np.arange(0.0, 8.0, 0.005)
    >>> block = Log(t, {"position": 5e-4 * np.sin(2 * np.pi * t / 4), "force": np.zeros(t.size)}, "block")
    >>> known = {"F_C": 2.0, "K_z": 2e4, "D_v": 100.0, "D_zdot": 0.0, "force_zero": 0.0}
    >>> force = simulated_force(block, known)
    >>> found = fit_lugre(block.with_columns(force=force))
    >>> f"{found.values['F_C']:.2f} N, {found.values['K_z'] / 1e3:.1f} N/mm, {found.fit_percent:.0f} %"
    '2.00 N, 20.0 N/mm, 100 %'
    """
    known = _checked(log, {} if fixed is None else fixed, window)
    problem = lugre_problem(log, known, window)
    low, high = problem.low[problem.free], problem.high[problem.free]
    found = [
        minimise(lambda x: linearised(problem, x), (start, linearised(problem, start)), low, high, tolerance=1e-10)
        for start in starts(problem)
    ]
    return _result(problem, min(found, key=lambda solution: solution.at.cost))


def simulated_force(
    log: Log, values: Mapping[str, float], starts: Sequence[float] = (), window: float = WINDOW
) -> FloatArray:
    """Force in N that overcomes friction with these `values` along the position of `log`; NaN in holes.

    Parameters
    ----------
    values : {name: value}
        All of F_C, K_z, D_v, D_zdot and force_zero.
    starts : Sequence[float]
        Initial deflection in m of every segment, 0 by default.
    """
    parts = segments(log, window, values["F_C"] / values["K_z"])
    return _simulated(log, parts, values, [*starts, *[0.0] * len(parts)][: len(parts)])


def _simulated(log: Log, parts: Sequence[Segment], values: Mapping[str, float], starts: Sequence[float]) -> FloatArray:
    force, friction = np.full(len(log), np.nan), [values[name] for name in NAMES]
    for segment, z_start in zip(parts, starts, strict=True):
        force[segment.start : segment.stop] = values["force_zero"] + free_run(segment, friction, z_start)[0]
    return force


def _checked(log: Log, fixed: Mapping[str, float], window: float) -> dict[str, float]:
    if not window > 0.0:
        raise ParameterError(f"window = {window:g} s: must be above 0 s; the default is {WINDOW:g} s.")
    for name in fixed:
        if name not in FREE:
            raise ParameterError(unknown_name(name, FREE, "friction parameter"))
    Parameters(**{name: value for name, value in fixed.items() if name in NAMES})
    missing = [name for name in ("position", "force") if name not in log or not np.isfinite(log[name]).any()]
    if missing:
        raise DataError(
            f"{log.name}: no {' and no '.join(missing)} with finite values; friction needs the position of the rig and "
            f"its force. The recording has {', '.join(log.columns) or 'no column'}."
        )
    return dict(fixed)


def _result(problem: LugreProblem, solution: Solution) -> LugreFit:
    x, shared = solution.x, int(problem.free[: len(FREE)].sum())
    parameters = problem.all(x)
    values = {name: float(value) for name, value in zip(FREE, parameters[: len(FREE)], strict=True)}
    names = [name for name, free in zip(FREE, problem.free[: len(FREE)], strict=True) if free]
    low, high = problem.low[problem.free], problem.high[problem.free]
    gradient = solution.at.R.T @ solution.at.q
    at_bound = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
    scores = [J * r[:, None] for r, J in residuals(problem, x)]
    covariance = sandwich(solution.at.R, scores, ~at_bound, max(1, shared))
    force = _simulated(problem.log, problem.parts, values, parameters[len(FREE) :].tolist())
    error = problem.log["force"] - force
    warnings = [*problem.log.warnings, *_at_bounds(names, at_bound, values)]
    if solution.status == "limit":
        warnings.append(f"the search stopped after {solution.evaluations} evaluations without converging.")
    block = max(1, round(WINDOW / float(np.median(np.diff(problem.log.time)))))
    return LugreFit(
        name=problem.log.name,
        status="warning" if warnings else "ok",
        message=f"{solution.status} after {solution.evaluations} evaluations",
        parameters=_estimates(names, values, covariance, problem),
        values=values,
        starts=tuple(parameters[len(FREE) :].tolist()),
        force=force,
        fit_percent=fit_percent(problem.log["force"], force),
        rms=float(np.sqrt(np.nanmean(error**2))),
        effective_samples=effective_samples(error, block),
        warnings=tuple(warnings),
    )


def _estimates(
    names: Sequence[str], values: Mapping[str, float], covariance: Covariance, problem: LugreProblem
) -> dict[str, Estimate]:
    quantile, estimates = covariance.quantile(), {}
    for i, name in enumerate(names):
        at = FREE.index(name)
        std = float(np.sqrt(covariance.matrix[i, i])) * float(problem.unit[at])
        low, high = values[name] - quantile * std, values[name] + quantile * std
        if np.isfinite(std):
            low = max(low, 0.0 if name in NAMES else low)
        estimates[name] = Estimate(values[name], UNITS_OF[name], std, low, high)
    return estimates


def _at_bounds(names: Sequence[str], at_bound: NDArray[np.bool_], values: Mapping[str, float]) -> list[str]:
    return [
        f"{name} lies at a bound of the search, {values[name]:.3g} {UNITS_OF[name]}, and the cost decreases beyond it: "
        "this recording does not determine it, and the intervals of the others treat it as fixed there."
        for i, name in enumerate(names)
        if at_bound[i]
    ]

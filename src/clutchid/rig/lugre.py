"""`fit_lugre`: the paper's friction fitted to position and force of a test rig, in free run."""

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
from clutchid.numerics.least_squares import Solution, minimise
from clutchid.parameters import Parameters, unknown_name
from clutchid.rig.compiled import NAMES
from clutchid.rig.free_run import Piece, free_run, pieces
from clutchid.rig.lugre_task import FREE, Task, linearised, residuals, starts, task_of
from clutchid.signals.residual_colour import effective_samples
from clutchid.uncertainty.covariance import Covariance, sandwich

#: Half window in s over which the velocity is taken; quantisation and noise of a position sensor average out.
WINDOW = 0.02

#: Units of the numbers of a fit.
UNITS_OF = {"F_C": "N", "K_z": "N/m", "D_v": "N·s/m", "D_zdot": "N·s/m", "force_zero": "N"}


@dataclass(frozen=True, slots=True, eq=False)
class LugreFit:
    """Friction of one recording; numbers in SI, intervals 95 % with coloured residuals.

    `parameters` are the free ones of F_C, K_z, D_v, D_zdot and force_zero (N), `values` all of them. `starts` are the
    deflections in m at the start of each piece without a hole. `force` is the simulated force, NaN outside the pieces;
    `fit_percent` is that of MATLAB's `compare`, `rms` in N; the samples are worth `effective_samples` independent ones.
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
    r"""LuGre friction, Eqs. (2) and (3), of a part that a rig moves.

    .. math:: f = f_0 + D_v v + K_z z + D_{\dot z} \dot z

    The force is simulated from the position alone (free run) and compared with the measured one.

    Parameters
    ----------
    log : Log
        Position in m and force in N: what the rig applies, positive towards larger positions. No pressure over the
        piston, or a constant one: it then stands in force_zero.
    fixed : {name: value}, optional
        Numbers that are known: F_C, K_z, D_v, D_zdot, force_zero. With the first four fixed, the fit is a check of
        them.
    window : s
        The velocity is the difference of the mean positions over this time after and before a sample. It should be
        short against F_C / (K_z v).

    Returns
    -------
    fit : LugreFit

    Raises
    ------
    DataError
        If position or force is missing, nothing moves, or the force helps the motion: its sign is wrong.
    ParameterError
        If a fixed name is not known, its value not admissible, or `window` not above 0.

    Notes
    -----
    Free are also the deflection at the start of every piece without a hole, and the zero of the load cell. A damping
    that ends at its bound 0 is told, and the other intervals take it as fixed there.

    Examples
    --------
    A block with 2 N of friction whose contact yields by 0.1 mm before it slides:

    >>> t = np.arange(0.0, 8.0, 0.005)
    >>> block = Log(t, {"position": 5e-4 * np.sin(2 * np.pi * t / 4), "force": np.zeros(t.size)}, "block")
    >>> known = {"F_C": 2.0, "K_z": 2e4, "D_v": 100.0, "D_zdot": 0.0, "force_zero": 0.0}
    >>> force = simulated_force(block, known)
    >>> found = fit_lugre(block.with_columns(force=force))
    >>> f"{found.values['F_C']:.2f} N, {found.values['K_z'] / 1e3:.1f} N/mm, {found.fit_percent:.0f} %"
    '2.00 N, 20.0 N/mm, 100 %'
    """
    held = _checked(log, {} if fixed is None else fixed, window)
    task = task_of(log, held, window)
    low, high = task.low[task.free], task.high[task.free]
    found = [
        minimise(lambda x: linearised(task, x), (start, linearised(task, start)), low, high, tolerance=1e-10)
        for start in starts(task)
    ]
    return _result(task, min(found, key=lambda solution: solution.at.cost))


def simulated_force(
    log: Log, values: Mapping[str, float], starts: Sequence[float] = (), window: float = WINDOW
) -> FloatArray:
    """Force in N that friction with these `values` asks for along the position of `log`; NaN in holes.

    Parameters
    ----------
    values : {name: value}
        All of F_C, K_z, D_v, D_zdot and force_zero.
    starts : Sequence[float]
        Deflection in m at the start of every piece without a hole, 0 where not given.
    """
    parts = pieces(log, window, values["F_C"] / values["K_z"])
    return _simulated(log, parts, values, [*starts, *[0.0] * len(parts)][: len(parts)])


def _simulated(log: Log, parts: Sequence[Piece], values: Mapping[str, float], starts: Sequence[float]) -> FloatArray:
    force, numbers = np.full(len(log), np.nan), [values[name] for name in NAMES]
    for piece, z_start in zip(parts, starts, strict=True):
        force[piece.start : piece.stop] = values["force_zero"] + free_run(piece, numbers, z_start)[0]
    return force


def _checked(log: Log, fixed: Mapping[str, float], window: float) -> dict[str, float]:
    if not window > 0.0:
        raise ParameterError(f"window = {window:g} s: a time above 0 is needed, {WINDOW:g} s by default.")
    for name in fixed:
        if name not in FREE:
            raise ParameterError(unknown_name(name, FREE, "friction parameter"))
    Parameters(**{name: value for name, value in fixed.items() if name in NAMES})
    missing = [name for name in ("position", "force") if name not in log or not np.isfinite(log[name]).any()]
    if missing:
        raise DataError(
            f"{log.name}: no {' and no '.join(missing)} with a finite number; friction needs the position that the rig "
            f"gives and the force that it takes. The recording has {', '.join(log.columns) or 'no column'}."
        )
    return dict(fixed)


def _result(task: Task, solution: Solution) -> LugreFit:
    x, shared = solution.x, int(task.free[: len(FREE)].sum())
    numbers = task.all(x)
    values = {name: float(number) for name, number in zip(FREE, numbers[: len(FREE)], strict=True)}
    names = [name for name, free in zip(FREE, task.free[: len(FREE)], strict=True) if free]
    low, high = task.low[task.free], task.high[task.free]
    gradient = solution.at.R.T @ solution.at.q
    held = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
    scores = [J * r[:, None] for r, J in residuals(task, x)]
    covariance = sandwich(solution.at.R, scores, ~held, max(1, shared))
    force = _simulated(task.log, task.parts, values, numbers[len(FREE) :].tolist())
    error = task.log["force"] - force
    warnings = [*task.log.warnings, *_at_bounds(names, held, values)]
    if solution.status == "limit":
        warnings.append(f"the search stopped after {solution.evaluations} evaluations without settling.")
    block = max(1, round(WINDOW / float(np.median(np.diff(task.log.time)))))
    return LugreFit(
        name=task.log.name,
        status="warning" if warnings else "ok",
        message=f"{solution.status} after {solution.evaluations} evaluations",
        parameters=_estimates(names, values, covariance, task),
        values=values,
        starts=tuple(numbers[len(FREE) :].tolist()),
        force=force,
        fit_percent=fit_percent(task.log["force"], force),
        rms=float(np.sqrt(np.nanmean(error**2))),
        effective_samples=effective_samples(error, block),
        warnings=tuple(warnings),
    )


def _estimates(
    names: Sequence[str], values: Mapping[str, float], covariance: Covariance, task: Task
) -> dict[str, Estimate]:
    quantile, estimates = covariance.quantile(), {}
    for i, name in enumerate(names):
        at = FREE.index(name)
        std = float(np.sqrt(covariance.matrix[i, i])) * float(task.unit[at])
        low, high = values[name] - quantile * std, values[name] + quantile * std
        if np.isfinite(std):
            low = max(low, 0.0 if name in NAMES else low)
        estimates[name] = Estimate(values[name], UNITS_OF[name], std, low, high)
    return estimates


def _at_bounds(names: Sequence[str], held: NDArray[np.bool_], values: Mapping[str, float]) -> list[str]:
    return [
        f"{name} lies at a bound of the search, {values[name]:.3g} {UNITS_OF[name]}, and the data would go "
        "beyond: this recording does not tell it, and the others' intervals take it as fixed there."
        for i, name in enumerate(names)
        if held[i]
    ]

"""Parts of a `Fit` that all methods share: load curve, simulated recordings, and a failed fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clutchid.estimation.result import Estimate, Fit, LoadCurve, Recording, errors_over
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.names import base_of
from clutchid.numerics.interval import QUANTILE
from clutchid.simulation.plan import Plan
from clutchid.simulation.simulation import simulated_log

#: Points of a load curve, from 0 to the full stroke.
POINTS = 101


class Compared(NamedTuple):
    """A simulated recording, and the pair (measured, simulated sensor output) that its errors are computed from."""

    recording: Recording
    shown: tuple[Log, Log]


def compare(
    plan: Plan,
    states: FloatArray,
    starts: Sequence[tuple[float, float]],
    shown: Mapping[str, FloatArray] | None = None,
    half: FloatArray | None = None,
) -> Compared:
    """Compare a recording with its simulated `states`, shape (n, n_states).

    Parameters
    ----------
    plan : Plan
        The recording and its actuator.
    starts : (m, Pa)
        Position and pressure in chamber A at the start of every segment.
    shown : {column: values}, optional
        Simulated sensor outputs in SI; the states by default.
    half : Pa, optional
        Half width of the 95 % interval of the pressure at every sample.
    """
    simulated = simulated_log(plan, states, plan.actuator)
    pair = plan.log, simulated.with_columns(**shown) if shown else simulated
    if half is not None:
        pressure = simulated["pressure_a"]
        simulated = simulated.with_columns(**{"pressure_a low": pressure - half, "pressure_a high": pressure + half})
    return Compared(Recording(plan.log, simulated, errors_over([pair]), tuple(starts)), pair)


def position_and_pressure(actuator: Actuator, state: FloatArray) -> tuple[float, float]:
    """Position in m and pressure in chamber A in Pa of a state."""
    return float(state[actuator.states.index("y")]), float(state[actuator.states.index("p_A")])


def load_curve(
    actuator: Actuator, names: Sequence[str], covariance: FloatArray, quantile: float, bias: FloatArray | None = None
) -> LoadCurve:
    """The load with its pointwise 95 % interval.

    Parameters
    ----------
    actuator : Actuator
        As fitted.
    names : names
        Of the rows and columns of `covariance`; only load weights are used.
    covariance : SI
        Of the estimates.
    quantile : 1
        Half width of a 95 % interval in standard deviations.
    bias : N or N/m, optional
        Bias of every weight that has been subtracted; its standard deviation is taken equal to its size.

    Returns
    -------
    curve : LoadCurve
        With an infinite interval wherever a weight of infinite variance acts.
    """
    load = actuator.load
    y = np.linspace(0.0, actuator.parameters.y_max, POINTS)
    phi, force = load.phi(y), load.force(y)
    weights = [(i, load.names.index(name)) for i, name in enumerate(names) if name in load.names]
    rows, columns = [i for i, _ in weights], [j for _, j in weights]
    P = covariance[np.ix_(rows, rows)]
    unknown = ~np.isfinite(np.diag(P)) if rows else np.zeros(0, dtype=bool)
    P = np.where(np.isfinite(P), P, 0.0)
    variance = np.einsum("ni,ij,nj->n", phi[:, columns], P, phi[:, columns])
    if bias is not None:
        variance = variance + (phi @ bias) ** 2
    half = quantile * np.sqrt(np.maximum(variance, 0.0))
    half[np.any(phi[:, columns][:, unknown] != 0.0, axis=1)] = np.inf
    return LoadCurve(y, force, force - half, force + half)


def calibrated_curve(actuator: Actuator, calibration: Calibration) -> LoadCurve | None:
    """The load of a calibration with its 95 % interval, on the basis of `actuator`; None if it has none."""
    load = actuator.load
    if len(calibration.theta) != len(load.theta):
        return None
    calibrated = replace(actuator, load=replace(load, theta=calibration.theta))
    return load_curve(calibrated, load.names, calibration.theta_covariance, QUANTILE)


def physical_limits(actuator: Actuator, name: str) -> tuple[float, ...]:
    """The ends of a parameter's physical range in SI; none of a load weight."""
    if name in actuator.load.names:
        return ()
    row = actuator.row(name)
    return row.low, row.high


def failed_fit(
    actuator: Actuator,
    bounds: Mapping[str, tuple[float, float]],
    method: str,
    message: str,
    plans: Sequence[Plan],
) -> Fit:
    """The result of a search with start values that cannot be simulated; `bounds` of the free parameters in SI."""
    nan = float("nan")
    unknown = np.full(POINTS, nan)
    y = np.linspace(0.0, actuator.parameters.y_max, POINTS)
    return Fit(
        status="failed",
        message=f"the start values cannot be simulated. {message}",
        actuator=actuator,
        parameters={name: Estimate(nan, actuator.unit(base_of(name)), nan, nan, nan) for name in bounds},
        covariance=np.full((len(bounds),) * 2, nan),
        load_curve=LoadCurve(y, unknown, unknown, unknown),
        recordings={},
        errors=errors_over([]),
        scales={},
        bounds=dict(bounds),
        evaluations=0,
        warnings=tuple(plan_warnings(plans)),
        method=method,
        converged=False,
    )


def plan_warnings(plans: Sequence[Plan]) -> list[str]:
    """Warnings about the recordings and their plans."""
    warnings = [warning for plan in plans for warning in (*plan.log.warnings, *plan.warnings)]
    return list(dict.fromkeys(warnings))

"""Residuals that correlate with a valve, as the load that they correspond to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.estimation.assess.diagnostics import BEYOND, LEAST_CORRELATION, MOST_OUTSIDE, ColumnDiagnosis
from clutchid.estimation.assess.evidence import Evidence, reach
from clutchid.estimation.assess.reason import Reason
from clutchid.estimation.result import Fit


class _Residual(NamedTuple):
    """A residual and the load in N that it corresponds to, 0 if it is white or the position follows the measurement."""

    recording: str
    column: str
    load: float


def valve_reasons(fit: Fit, found: Evidence) -> list[Reason]:
    """Residuals that correspond to a load larger than the width of the interval."""
    width = _width(fit)
    return [
        Reason(
            f"{one.recording}: the residual of {one.column} is autocorrelated, correlates with a valve and corresponds "
            f"to a load of {one.load:.0f} N, more than the width of the interval, {width:.0f} N: the interval is too "
            "narrow."
        )
        for one in _residuals(fit, found, 0.0)
        if one.load > width
    ]


def valve_notes(fit: Fit, found: Evidence) -> list[str]:
    """The others that `clutchid.estimation.assess.diagnostics.remarks` names: the load does not suffer."""
    width, notes = _width(fit), []
    for one in _residuals(fit, found, LEAST_CORRELATION):
        what = f"{one.recording}: the residual of {one.column} correlates with a valve"
        if one.column == "position" and fit.follows:
            notes.append(f"{what}: no reason against the load, because the position follows the measurement.")
        elif one.load <= width:
            notes.append(
                f"{what} and corresponds to a load of {one.load:.0f} N, within the width of the interval, "
                f"{width:.0f} N: no reason against the load."
            )
    return notes


def _inside(fit: Fit) -> NDArray[np.bool_]:
    """Points of a fitted load with an interval, within the reach."""
    curve = fit.load_curve
    inside: NDArray[np.bool_] = np.isfinite(curve.high - curve.low) & (curve.position <= reach(fit))
    return inside & fit.load_is_fitted


def _width(fit: Fit) -> float:
    """Median width of the interval of the load in N; NaN without one."""
    width = (fit.load_curve.high - fit.load_curve.low)[_inside(fit)]
    return float(np.median(width)) if width.size > 1 else float("nan")


def _residuals(fit: Fit, found: Evidence, least: float) -> list[_Residual]:
    """Residuals with a certain correlation of at least `least` with a valve; none without a load with an interval."""
    curve, inside = fit.load_curve, _inside(fit)
    if inside.sum() < 2:
        return []
    slope = float(np.median(np.abs(np.gradient(curve.force, curve.position)[inside])))
    force = {"position": 0.0 if fit.follows else slope, "pressure_a": fit.actuator.parameters.A_A}
    return [
        _Residual(name, column, force[column] * _autocorrelated(residual))
        for name, diagnosis in found.diagnoses.items()
        for column, residual in diagnosis.columns.items()
        if _correlates_with_valve(residual, least)
    ]


def _autocorrelated(residual: ColumnDiagnosis) -> float:
    """Rms of the autocorrelated part of a residual in SI; 0 if it looks white."""
    share = max(np.nan_to_num(rate.share_outside) for rate in (residual.fast, residual.slow))
    first = max(np.nan_to_num(residual.fast.first), 0.0) if share > MOST_OUTSIDE else 0.0
    return residual.rms * float(np.sqrt(first))


def _correlates_with_valve(residual: ColumnDiagnosis, least: float) -> bool:
    correlations = [c for rate in (residual.fast, residual.slow) for c in rate.inputs.values()]
    return any(abs(c.strongest) > max(BEYOND * c.strongest_bound, least) for c in correlations)

"""A load compared with that of the calibration: new against worn, above all where the clutch engages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from clutchid.estimation.assess.evidence import once_a_fit, reach
from clutchid.estimation.result import Fit, calibrated_curve
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.interval import QUANTILE


class HalfLoad(NamedTuple):
    """Position where the rising load reaches half its peak; NaN where it does not.

    Attributes
    ----------
    position : m
        The estimate.
    low, high : m
        95 % interval, from the band of the load.
    """

    position: float
    low: float
    high: float


def half_load(position: FloatArray, force: FloatArray) -> float:
    """Position in m where the rising load first reaches half its peak, by linear interpolation; else NaN.

    Examples
    --------
    >>> half_load(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 2.0, 4.0, 1.0]))
    1.0
    """
    return _passes(position, force, _half(force))


def half_load_band(curve: LoadCurve, reach: float) -> HalfLoad:
    """Position where the rising load first reaches half its peak within `reach` in m, and those of its band limits.

    Parameters
    ----------
    curve : LoadCurve
        Load curve with its band.
    reach : m
        Largest recorded position.

    Returns
    -------
    half : HalfLoad
        A limit is NaN if that limit of the band does not reach half the peak within the reach.

    Notes
    -----
    Half the peak is treated as fixed, because errors shift the load curve more than they tilt it.

    Examples
    --------
    >>> y = np.array([0.0, 1e-3, 2e-3, 3e-3])
    >>> f = np.array([0.0, 2e3, 4e3, 1e3])
    >>> [f"{at * 1e3:.2f}" for at in half_load_band(LoadCurve(y, f, f - 100.0, f + 100.0), 3e-3)]
    ['1.00', '0.95', '1.05']
    """
    inside = curve.position <= reach
    y, half = curve.position[inside], _half(curve.force[inside])
    # the upper limit of the band reaches it first
    return HalfLoad(*(_passes(y, force[inside], half) for force in (curve.force, curve.high, curve.low)))


def _half(force: FloatArray) -> float:
    """Half the peak; NaN if no force is known."""
    return 0.5 * float(np.nanmax(force)) if np.isfinite(force).any() else float("nan")


def _passes(position: FloatArray, force: FloatArray, level: float) -> float:
    """First position where the force passes `level` from below, by linear interpolation; else NaN."""
    above = int(np.argmax(force >= level)) if np.isfinite(level) else 0
    if above == 0 or not np.isfinite(force[above - 1 : above + 1]).all():
        return float("nan")
    y0, y1, f0, f1 = position[above - 1], position[above], force[above - 1], force[above]
    return float(y0 + (level - f0) / (f1 - f0) * (y1 - y0))


class LoadDifference(NamedTuple):
    """Change of a load in N with its 95 % interval, and as a share of the calibrated load, which is NaN near 0."""

    force: FloatArray
    low: FloatArray
    high: FloatArray
    share: FloatArray


class LoadChange(NamedTuple):
    """Change of the load in N at one position with its 95 % interval, and as a share of the calibrated load."""

    force: float
    low: float
    high: float
    share: float


class Comparison(NamedTuple):
    """The load of a fit against the calibrated one.

    `calibrated` and `present` are the curves, `difference` present less calibrated at their positions; `half_before`
    and `half_now` the positions at half the peak, `shift` that of the latter from the former, each in m with its 95 %
    interval. `reach` is the largest recorded position in m: beyond, the present load is not determined.
    """

    calibrated: LoadCurve
    present: LoadCurve
    difference: LoadDifference
    half_before: HalfLoad
    half_now: HalfLoad
    shift: HalfLoad
    reach: float

    def at(self, position: float) -> LoadChange:
        """The difference at a position in m, by linear interpolation."""
        return LoadChange(*(float(np.interp(position, self.present.position, values)) for values in self.difference))


#: A share of the calibrated load is given where that exceeds this fraction of its peak.
SMALLEST_SHARE = 0.02


@once_a_fit
def comparison(fit: Fit) -> Comparison | None:
    """The load of a fit against that of its baseline; None without one, or if the load has not been fitted.

    Notes
    -----
    The intervals of both loads are treated as independent, which makes that of the difference too wide rather than too
    narrow: an error of the calibrated parameters changes both in the same direction. What the model misses of a
    calibration is in the band of `calibrated`, and not in that of the difference, because both loads have that error.
    """
    if fit.status == "failed" or not fit.load_is_fitted:
        return None
    return compared(fit.actuator, fit.baseline, fit.load_curve, reach(fit))


def compared(
    actuator: Actuator, calibration: Calibration | None, present: LoadCurve, furthest: float
) -> Comparison | None:
    """A load against that of a calibration of its actuator, up to a position in m; None if the calibration has none."""
    by_data = calibrated_curve(actuator, calibration) if calibration else None
    if calibration is None or by_data is None:
        return None
    calibrated, now = by_data.widened(QUANTILE * calibration.missed), half_load_band(present, furthest)
    shift = _shift(half_load_band(by_data, furthest), now)
    before = half_load_band(calibrated, furthest)
    return Comparison(calibrated, present, _difference(by_data, present), before, now, shift, furthest)


def _difference(calibrated: LoadCurve, present: LoadCurve) -> LoadDifference:
    force = present.force - calibrated.force
    half = np.hypot(*((curve.high - curve.low) / 2 for curve in (calibrated, present)))
    smallest = SMALLEST_SHARE * max(float(np.nanmax(calibrated.force)), 0.0)
    loaded = calibrated.force > smallest
    share = np.where(loaded, force / np.where(loaded, calibrated.force, 1.0), np.nan)
    return LoadDifference(force, force - half, force + half, share)


def _shift(before: HalfLoad, now: HalfLoad) -> HalfLoad:
    shift = now.position - before.position
    below = np.hypot(now.position - now.low, before.high - before.position)
    above = np.hypot(now.high - now.position, before.position - before.low)
    return HalfLoad(shift, shift - float(below), shift + float(above))


#: Positions in m at which the clutch engages, where the load matters most, Section 3.1.
ENGAGING = (5e-3, 8e-3)


class Shares(NamedTuple):
    """Shares of a reading's standard deviation: differing between recordings, common to all, due to 10 K."""

    independent: float
    common: float
    by_temperature: float


#: What reads a recording.
By = Literal["estimate", "observe"]

#: By channel. Five months of eight vehicles of both families: docs/derivations_online.md, "The wear of a clutch".
SHARES = {"shift": Shares(0.2, 0.4, 0.15), "load": Shares(0.6, 1.0, 0.4)}

#: By what reads the recordings, and channel. Observed ones: benchmarks/results/wear.md, "By observe".
SHARES_BY: Mapping[By, Mapping[str, Shares]] = {
    "estimate": SHARES,
    "observe": {"shift": Shares(0.25, 0.6, 0.1), "load": Shares(0.5, 1.4, 0.3)},
}

#: Recordings that the prior of the noise is worth: what these shares are known from.
WORTH = 10.0


class Measurement(NamedTuple):
    """Change since the calibration in one recording, with standard deviations as the band of the load has them.

    Attributes
    ----------
    shift, shift_std : m
        Shift of the half-load position.
    load, load_std : 1
        Relative change of the mean load over 5 to 8 mm.
    temperature : K
        Of the air; NaN where it was not recorded.
    by
        What read the recording: the errors that its readings share are its own.
    calibration
        Number of the calibration among those of the vehicle, of which each has an offset in the trend but the first.
    """

    shift: float
    shift_std: float
    load: float
    load_std: float
    temperature: float
    by: By = "estimate"
    calibration: int = 0


def measured(change: Comparison | None, log: Log, by: By = "estimate") -> Measurement | None:
    """The measurement of a recording whose load is compared with the calibration; None if it does not determine one."""
    values = change_of(change) if change else None
    if values is None:
        return None
    ambient = log.columns.get("temperature_ambient")
    recorded = ambient is not None and bool(np.isfinite(ambient).any())
    return Measurement(*values, float(np.nanmean(ambient)) if recorded and ambient is not None else float("nan"), by)


def change_of(compared: Comparison) -> tuple[float, float, float, float] | None:
    """Shift and relative change of the load with their standard deviations; None if they are not determined."""
    y, (first, last) = compared.present.position, ENGAGING
    inside = (y >= first) & (y <= last)
    new = float(np.mean(compared.calibrated.force[inside]))
    load = float(np.mean(compared.difference.force[inside])) / new
    load_std = float(np.mean((compared.present.high - compared.present.low)[inside])) / (2 * QUANTILE * new)
    shift_std = (compared.half_now.high - compared.half_now.low) / (2 * QUANTILE)
    values = (compared.shift.position, shift_std, load, load_std)
    return values if np.all(np.isfinite(values)) and min(shift_std, load_std) > 0.0 else None

"""A load compared with that of the calibration: new against worn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.assess.half_load import HalfLoad, half_load_band
from clutchid.estimation.assess.once import once_a_fit
from clutchid.estimation.outcome import calibrated_curve
from clutchid.estimation.result import Fit, LoadCurve
from clutchid.log import FloatArray


class Difference(NamedTuple):
    """Change of a load in N with its 95 % interval, and as a share of the calibrated load, which is NaN near 0."""

    force: FloatArray
    low: FloatArray
    high: FloatArray
    share: FloatArray


class Change(NamedTuple):
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
    difference: Difference
    half_before: HalfLoad
    half_now: HalfLoad
    shift: HalfLoad
    reach: float

    def at(self, position: float) -> Change:
        """The difference at a position in m, by linear interpolation."""
        return Change(*(float(np.interp(position, self.present.position, values)) for values in self.difference))


#: A share of the calibrated load is given where that exceeds this fraction of its peak.
SMALLEST_SHARE = 0.02


@once_a_fit
def comparison(fit: Fit) -> Comparison | None:
    """The load of a fit against that of its baseline; None without one, or if the load has not been fitted.

    Notes
    -----
    The intervals of both loads are treated as independent, which makes that of the difference too wide rather than too
    narrow: an error of the calibrated parameters changes both in the same direction.
    """
    if fit.baseline is None or fit.status == "failed" or not fit.load_is_fitted:
        return None
    calibrated, present, furthest = calibrated_curve(fit.actuator, fit.baseline), fit.load_curve, reach(fit)
    if calibrated is None:
        return None
    before, now = half_load_band(calibrated, furthest), half_load_band(present, furthest)
    return Comparison(calibrated, present, _difference(calibrated, present), before, now, _shift(before, now), furthest)


def _difference(calibrated: LoadCurve, present: LoadCurve) -> Difference:
    force = present.force - calibrated.force
    half = np.hypot(*((curve.high - curve.low) / 2 for curve in (calibrated, present)))
    smallest = SMALLEST_SHARE * max(float(np.nanmax(calibrated.force)), 0.0)
    known = calibrated.force > smallest
    share = np.where(known, force / np.where(known, calibrated.force, 1.0), np.nan)
    return Difference(force, force - half, force + half, share)


def _shift(before: HalfLoad, now: HalfLoad) -> HalfLoad:
    shift = now.position - before.position
    below = np.hypot(now.position - now.low, before.high - before.position)
    above = np.hypot(now.high - now.position, before.position - before.low)
    return HalfLoad(shift, shift - float(below), shift + float(above))

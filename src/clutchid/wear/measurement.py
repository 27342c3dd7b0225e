"""What a recording measures of the wear of a clutch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.assess.comparison import Comparison
from clutchid.assess.verdict import ENGAGING
from clutchid.estimate.result import Fit
from clutchid.log import Log
from clutchid.strokes.vented_rest import QUANTILE, RestShift

#: Width of a 95 % interval in standard deviations.
WIDTH = 2 * QUANTILE


class Measurement(NamedTuple):
    """Change since the calibration in one recording, with standard deviations as the band of the load has them.

    `shift` of the half-load position in m, `load` is the relative change of the mean load over 5 to 8 mm, and
    `temperature` that of the air in K, NaN where it was not recorded.
    """

    shift: float
    shift_std: float
    load: float
    load_std: float
    temperature: float


class Leak(NamedTuple):
    """A leak of chamber A since its calibration.

    Its conductance in m³/(Pa·s) with the standard deviation, and the probability that it has changed.
    """

    conductance: float
    std: float
    probability: float


class Reading(NamedTuple):
    """What became of one recording: status and sentence as in every result, trust, and its measurement, if any.

    `leak` is that of chamber A, if one is probable; `departs` says that the truck is farther from its calibration than
    a change explains; `rest` how far the vented rest has moved since, if that is known; `reason` is why a recording
    that was read gives no measurement, empty where it gives one.
    """

    status: str
    message: str
    trust: str
    measurement: Measurement | None
    leak: Leak | None = None
    departs: bool = False
    rest: RestShift | None = None
    reason: str = ""

    @property
    def has_result(self) -> bool:
        """Whether the recording was read."""
        return self.status in ("ok", "warning")

    @property
    def unmeasured(self) -> str:
        """Why it gives no measurement, in a sentence; empty where it gives one."""
        return "" if self.measurement is not None else self.reason or self.message


def leak_of(fit: Fit) -> Leak | None:
    """The leak that a reading finds; None if it finds none, or its model has no leak."""
    found = next((change for change in fit.changes if change.name == "C_A0"), None)
    return Leak(found.after - found.before, found.std, found.probability) if found else None


def unmeasured(fit: Fit) -> str:
    """Why a recording that was fitted from a calibration gives no measurement, in a sentence; empty if it gives one.

    A load that is only uncertain gives one with its band.
    """
    if fit.status == "failed" or not fit.converged:
        return f"its search did not converge: {fit.message}".rstrip(".") + "."
    if fit.verdict.flawed:
        return " ".join(fit.verdict.reasons)
    if fit.comparison is None:
        return "the calibration has no load in its file, so that there is nothing to compare with; save it again."
    if _change(fit.comparison) is None:
        furthest = 1e3 * fit.comparison.reach
        return (
            f"the position of half load, or its interval, is not determined within the {furthest:.1f} mm that were "
            "reached; record longer strokes."
        )
    return ""


def measured(fit: Fit, log: Log) -> Measurement | None:
    """The measurement of a recording that was fitted from a calibration; None if its load does not determine one."""
    values = _change(fit.comparison) if fit.comparison else None
    if values is None:
        return None
    ambient = log.columns.get("temperature_ambient")
    known = ambient is not None and bool(np.isfinite(ambient).any())
    return Measurement(*values, float(np.nanmean(ambient)) if known and ambient is not None else float("nan"))


def _change(found: Comparison) -> tuple[float, float, float, float] | None:
    """Shift and relative change of the load with their standard deviations; None if they are not determined."""
    y, (first, last) = found.present.position, ENGAGING
    engaging = (y >= first) & (y <= last)
    new = float(np.mean(found.calibrated.force[engaging]))
    load = float(np.mean(found.difference.force[engaging])) / new
    load_std = float(np.mean((found.present.high - found.present.low)[engaging])) / (WIDTH * new)
    shift_std = (found.half_now.high - found.half_now.low) / WIDTH
    values = (found.shift.position, shift_std, load, load_std)
    return values if np.all(np.isfinite(values)) and min(shift_std, load_std) > 0.0 else None

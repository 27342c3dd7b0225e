"""What a recording measures of the wear of a clutch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
    a change explains; `rest` how far the vented rest has moved since, if that is known.
    """

    status: str
    message: str
    trust: str
    measurement: Measurement | None
    leak: Leak | None = None
    departs: bool = False
    rest: RestShift | None = None

    @property
    def has_result(self) -> bool:
        """Whether the recording was read."""
        return self.status in ("ok", "warning")


def leak_of(fit: Fit) -> Leak | None:
    """The leak that a reading finds; None if it finds none, or its model has no leak."""
    found = next((change for change in fit.changes if change.name == "C_A0"), None)
    return Leak(found.after - found.before, found.std, found.probability) if found else None


def measured(fit: Fit, log: Log) -> Measurement | None:
    """The measurement of a recording that was fitted from a calibration; None if its load does not determine one."""
    found = fit.comparison
    if found is None:
        return None
    y, (first, last) = found.present.position, ENGAGING
    engaging = (y >= first) & (y <= last)
    new = float(np.mean(found.calibrated.force[engaging]))
    load = float(np.mean(found.difference.force[engaging])) / new
    load_std = float(np.mean((found.present.high - found.present.low)[engaging])) / (WIDTH * new)
    shift_std = (found.half_now.high - found.half_now.low) / WIDTH
    values = (found.shift.position, shift_std, load, load_std)
    if not np.all(np.isfinite(values)) or min(shift_std, load_std) <= 0.0:
        return None
    ambient = log.columns.get("temperature_ambient")
    known = ambient is not None and bool(np.isfinite(ambient).any())
    return Measurement(*values, float(np.nanmean(ambient)) if known and ambient is not None else float("nan"))

"""What a reading measures of a clutch where it engages, and how its errors are shared with other readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.estimation.assess.comparison import Comparison, comparison
from clutchid.estimation.result import Fit
from clutchid.log import Log
from clutchid.numerics.interval import QUANTILE

#: Positions in m at which the clutch engages, where the load matters most, Section 3.1.
ENGAGING = (5e-3, 8e-3)


class Shares(NamedTuple):
    """What of the standard deviation of a reading differs between recordings, is common to all, changes with 10 K."""

    independent: float
    common: float
    by_temperature: float


#: By channel. Five months of eight vehicles of both families: docs/derivations_online.md, "The wear of a clutch".
SHARES = {"shift": Shares(0.2, 0.4, 0.15), "load": Shares(0.6, 1.0, 0.4)}

#: Recordings that the prior of the noise is worth: what these shares are known from.
WORTH = 10.0


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


def measured(fit: Fit, log: Log) -> Measurement | None:
    """The measurement of a recording that was fitted from a calibration; None if its load does not determine one."""
    compared = comparison(fit)
    values = change_of(compared) if compared else None
    if values is None:
        return None
    ambient = log.columns.get("temperature_ambient")
    known = ambient is not None and bool(np.isfinite(ambient).any())
    return Measurement(*values, float(np.nanmean(ambient)) if known and ambient is not None else float("nan"))


def change_of(found: Comparison) -> tuple[float, float, float, float] | None:
    """Shift and relative change of the load with their standard deviations; None if they are not determined."""
    y, (first, last) = found.present.position, ENGAGING
    inside = (y >= first) & (y <= last)
    new = float(np.mean(found.calibrated.force[inside]))
    load = float(np.mean(found.difference.force[inside])) / new
    load_std = float(np.mean((found.present.high - found.present.low)[inside])) / (2 * QUANTILE * new)
    shift_std = (found.half_now.high - found.half_now.low) / (2 * QUANTILE)
    values = (found.shift.position, shift_std, load, load_std)
    return values if np.all(np.isfinite(values)) and min(shift_std, load_std) > 0.0 else None

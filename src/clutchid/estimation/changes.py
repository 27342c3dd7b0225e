"""Changes of an actuator since its calibration, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Change:
    """A parameter that has changed, or may have changed, since the calibration, in one recording.

    Parameters
    ----------
    recording, name
        Stem of the recording, and the parameter.
    before, after, std : unit
        Calibrated value, estimate of the present one, and its standard deviation.
    probability : 1
        That its group has changed.
    group : str
        Parameters that change together, see `clutchid.inference.uncertainty.change_prior`.
    """

    recording: str
    name: str
    before: float
    after: float
    std: float
    unit: str
    probability: float
    group: str


class Departure(NamedTuple):
    """Departure of recordings from a calibration.

    `distance` is the squared Mahalanobis distance of the `parameters` that may change from their calibrated values,
    under the prior that all groups have changed: about their number where the truck has. `misfit` is the cost for each
    second in motion over that of the calibration recordings read from position alone; NaN if that is not known.
    """

    distance: float
    parameters: int
    misfit: float

"""The recorded supply pressure: how an observer's model is related to it by the calibration, and how far that is known.

Less supply and a smaller load look alike from position alone, and the pressure that a governor keeps swings by some
percent. Where the vehicle records the supply, the filter corrects its state p_S by it.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import ACCURACY, NOT_RECORDED, by_supply
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import Load

#: Standard deviation of a supply that is not recorded from that of the calibration, as a share of it: what its governor
#: leaves after minutes. Provenance: docs/derivations_online.md.
ASSUMED = 0.006


class Supply(NamedTuple):
    """Estimated over recorded supply pressure in the calibration, and its standard deviation as a share of it."""

    ratio: float
    share: float


def load_deviation(share: float, actuator: Actuator, load: Load, position: FloatArray) -> FloatArray:
    """Standard deviation in N that a supply known to a `share` of it leaves to the load at positions in m."""
    return share * by_supply(actuator, load.force(position))


def supply_of(actuator: Actuator, calibration: Calibration | None) -> Supply | None:
    """How a calibration relates the supply pressure to a recorded one; None if it does not."""
    found = calibration.conditions if calibration else NOT_RECORDED
    if found.supply is None or found.supply_estimated is None or "p_S" not in actuator.states:
        return None
    return Supply(found.supply_estimated / found.supply, sqrt(2.0) * ACCURACY["P_S"] / found.supply)


def unused_supply(log: Log, actuator: Actuator, calibration: Calibration | None) -> str:
    """Why the supply pressure that a recording has is not used, in a sentence; else nothing."""
    recorded = log.columns.get("pressure_supply", np.zeros(0))
    if not np.isfinite(recorded).any() or "p_S" not in actuator.states or supply_of(actuator, calibration):
        return ""
    known = calibration is not None and calibration.conditions.supply is not None
    why = "was saved before observers used it" if known else "does not have it; record it there too"
    return (
        f"{log.name}: pressure_supply is not used, because the calibration {why}. Save the calibration again: less "
        "supply is taken for a larger load."
    )

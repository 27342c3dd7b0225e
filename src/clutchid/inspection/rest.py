"""Vented rest: where the sensor reads it now, compared with the calibration."""

from __future__ import annotations

from clutchid.inspection.check import Check
from clutchid.strokes.vented_rest import Rested

CHECK = "vented rest"


def rest_check(rested: Rested) -> Check:
    """Whether the vented rest is where it was at the calibration."""
    shift = rested.shift
    if shift is None:
        sentence = "the vented rest cannot be compared with that of the calibration: one has none."
        return Check(CHECK, "-", "undetermined", sentence)
    value = str(shift)
    if not shift.moved:
        return Check(CHECK, value, "good", f"it is where it was at the calibration, {value}.")
    causes = "the position sensor or its bracket" if shift.value > 0.0 else "wear or the position sensor"
    sentence = (
        f"it has moved by {value} since the calibration, by {causes}; a reading subtracts that "
        "unless --zero keep is given."
    )
    return Check(CHECK, value, "suspect", sentence)

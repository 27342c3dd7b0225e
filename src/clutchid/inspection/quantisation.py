"""Quantisation: the step of a measured column compared with its noise and with the resolution of the model."""

from __future__ import annotations

import math

import numpy as np

from clutchid.inspection.check import Check, Grade
from clutchid.inspection.reading import Reading

#: Noise of half a step randomises the rounding error (dither): its mean is then below 1 % of the step.
DITHER = 2.0

#: A step below this fraction of the friction does not matter, with or without noise.
SMALL = 0.1

#: Least number of steps in the narrowest knot interval of the load curve, and from ambient to supply pressure.
PER_INTERVAL, PER_RANGE = 4, 40


def quantisation(reading: Reading, name: str) -> Check:
    """Whether the step of the column `name` is too coarse for a fit.

    A step is harmless if noise dithers it, or if it is small compared with the friction: for the position with the seal
    deflection before sliding, F_C / K_z, for the pressure with F_C / A_A.

    A knot interval of the load curve with fewer than `PER_INTERVAL` steps cannot be fitted.
    """
    title, p = f"quantisation of {name}", reading.actuator.parameters
    step, noise = reading.quanta[name], reading.noises[name]
    if step == 0.0 or step < 1e-3 * noise:
        return Check(title, "none", "good", f"{name} has no visible quantisation step.")
    narrowest = float(np.diff(reading.actuator.load.knots).min())
    of_position = name == "position"
    friction = p.F_C / (p.K_z if of_position else p.A_A)
    most = narrowest / PER_INTERVAL if of_position else (p.P_S - p.P_0) / PER_RANGE
    undithered = not (math.isfinite(noise) and step <= DITHER * noise)
    grade: Grade = "good"
    if undithered and step > SMALL * friction:
        grade = "bad" if step > most else "suspect"
    value = f"{_fine(step, name)}, noise {_fine(noise, name)}"
    if grade == "good":
        return Check(title, value, grade, f"{name} has a quantisation step of {_fine(step, name)}, which is harmless.")
    sentence = (
        f"{name} has a quantisation step of {_fine(step, name)}, noise of {_fine(noise, name)}, and friction in the "
        f"model is worth {_fine(friction, name)}: the rounding error is not random, so a fit distorts the load and its "
        "intervals are too narrow; record with more digits or bits."
    )
    return Check(title, value, grade, sentence)


def _fine(value: float, name: str) -> str:
    """A small value with its unit, um or mbar."""
    if not math.isfinite(value):
        return "unknown"
    return f"{value * 1e6:.3g} um" if name == "position" else f"{value * 1e-2:.3g} mbar"

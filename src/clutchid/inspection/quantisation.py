"""Quantisation: the step of a measured column against its noise and against what the model resolves."""

from __future__ import annotations

import math

import numpy as np

from clutchid.inspection.finding import Finding, Verdict
from clutchid.inspection.reading import Reading

#: A noise of half a step makes the rounding as good as random: what it leaves in the mean is below 1 % of the step.
DITHER = 2.0

#: A step below this part of the friction does not matter, noise or not.
SMALL = 0.1

#: Steps that the narrowest piece of the load curve has at least, and those from ambient to supply pressure.
A_PIECE, A_RANGE = 4, 40


def quantisation(reading: Reading, name: str) -> Finding:
    """Whether the step of the column `name` hides what a fit needs.

    A step is harmless where noise smears it, or where it is small against the friction: for the position the seals'
    deflection before they slide, F_C / K_z, for the pressure F_C / A_A.

    Where a piece of the load curve has fewer than `A_PIECE` steps, it cannot be fitted at all.
    """
    check, p = f"quantisation of {name}", reading.actuator.parameters
    step, noise = reading.quanta[name], reading.noises[name]
    if step == 0.0 or step < 1e-3 * noise:
        return Finding(check, "none seen", "good", f"{name} has no step that shows.")
    narrowest = float(np.diff(reading.actuator.load.knots).min())
    of_position = name == "position"
    friction = p.F_C / (p.K_z if of_position else p.A_A)
    most = narrowest / A_PIECE if of_position else (p.P_S - p.P_0) / A_RANGE
    hidden = not (math.isfinite(noise) and step <= DITHER * noise)
    verdict: Verdict = "good"
    if hidden and step > SMALL * friction:
        verdict = "bad" if step > most else "look"
    value = f"{_fine(step, name)}, noise {_fine(noise, name)}"
    if verdict == "good":
        return Finding(check, value, verdict, f"{name} changes in steps of {_fine(step, name)}, which do no harm.")
    sentence = (
        f"{name} is recorded in steps of {_fine(step, name)}, with a noise of {_fine(noise, name)} and "
        f"{_fine(friction, name)} of friction in the model: rounding is no random noise here, so a fit bends the load "
        "and its intervals come out too narrow; record with more digits or bits."
    )
    return Finding(check, value, verdict, sentence)


def _fine(value: float, name: str) -> str:
    """Small numbers: um and mbar."""
    if not math.isfinite(value):
        return "not known"
    return f"{value * 1e6:.3g} um" if name == "position" else f"{value * 1e-2:.3g} mbar"

"""Unit of the pressure: bar, kPa or gauge where Pa absolute is claimed."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.finding import Finding, Verdict
from clutchid.inspection.reading import Reading
from clutchid.units import UNITS, known_units

CHECK = "unit of pressure_a"

#: Parts of the ambient pressure between which the lowest pressure of a recording lies: on a mountain of 5000 m it is
#: half; a piston whose chamber is never vented stays above.
LOWEST = 0.5

#: Times the supply pressure of the actuator that no pressure in it exceeds: air supplies of vehicles end at 13 bar.
HIGHEST = 2.0

#: Part of the supply pressure over ambient that a stroke takes at least: without a stroke no unit can be guessed.
STROKE = 0.125


def pressure_unit(reading: Reading) -> Finding:
    """Whether the range of the pressure is that of an absolute pressure in Pa."""
    p, pressure = reading.actuator.parameters, reading.log["pressure_a"]
    low, high = (float(q) for q in np.nanquantile(pressure, (0.01, 0.99)))
    value = f"{low:.4g} to {high:.4g}"
    if _possible(low, high, p.P_0, p.P_S):
        return Finding(CHECK, f"{value} Pa", "good", f"pressure_a runs from {value} Pa, as an absolute pressure does.")
    fitting = _fitting(low, high, p.P_0, p.P_S)
    verdict: Verdict = "bad" if high < p.P_0 or high > HIGHEST * p.P_S or fitting else "look"
    guess = f"it looks like {' or '.join(fitting)}: name that unit" if fitting else "check its unit and its zero"
    sentence = (
        f"pressure_a runs from {value} Pa, which is no absolute pressure between ambient ({p.P_0:.4g} Pa) and supply "
        f"({p.P_S:.4g} Pa); a fit that uses it is wrong; {guess} in the heading of the column or in the channel map."
    )
    return Finding(CHECK, f"{value} Pa", verdict, sentence)


def _fitting(low: float, high: float, ambient: float, supply: float) -> list[str]:
    """Units in which the range would be one of an absolute pressure, those whose lowest pressure is nearest ambient."""
    lowest = {}
    for name in known_units("Pa"):
        offset = ambient if UNITS[name].gauge else 0.0
        in_pascal = UNITS[name].scale * low + offset, UNITS[name].scale * high + offset
        if _possible(*in_pascal, ambient, supply) and in_pascal[1] - in_pascal[0] > STROKE * (supply - ambient):
            lowest[name] = abs(in_pascal[0] - ambient)
    return [name for name, distance in lowest.items() if distance <= min(lowest.values()) + 1.0]


def _possible(low: float, high: float, ambient: float, supply: float) -> bool:
    return LOWEST * ambient < low and ambient < 1.5 * high and high < HIGHEST * supply

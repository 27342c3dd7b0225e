"""Unit of the pressure: bar, kPa or gauge pressure given as absolute pressure in Pa."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.check import Check, Grade
from clutchid.inspection.reading import Reading
from clutchid.io.source import UNIT_KEY
from clutchid.units import UNITS, known_units

CHECK = "unit of pressure_a"

#: Lower bound of the lowest pressure as a fraction of the ambient pressure: at 5000 m altitude it is one half; in a
#: chamber that is never vented it is higher.
LOWEST = 0.5

#: Upper bound of the pressure as a multiple of the supply pressure: air supplies of vehicles reach at most 13 bar.
HIGHEST = 2.0

#: Least pressure range of a stroke as a fraction of the supply gauge pressure: without a stroke no unit is proposed.
STROKE = 0.125


def pressure_unit(reading: Reading) -> Check:
    """Whether the range of the pressure is that of an absolute pressure in Pa."""
    p, pressure = reading.actuator.parameters, reading.log["pressure_a"]
    low, high = (float(q) for q in np.nanquantile(pressure, (0.01, 0.99)))
    value = f"{low:.4g} to {high:.4g}"
    if reading.ends["pressure_a"][0] == reading.ends["pressure_a"][1]:
        sentence = (
            f"pressure_a is {low:.4g} Pa in every sample, so its sensor was not connected or the channel is another "
            "one; leave the column out, or take the right channel."
        )
        return Check(CHECK, f"{low:.4g} Pa throughout", "bad", sentence)
    if _plausible(low, high, p.P_0, p.P_S):
        return Check(
            CHECK, f"{value} Pa", "good", f"pressure_a ranges from {value} Pa, plausible for an absolute pressure."
        )
    written = UNITS.get(reading.log.metadata.get(UNIT_KEY, "Pa"), UNITS["Pa"])
    base = float(reading.log.metadata.get("ambient_Pa", p.P_0)) if written.gauge else 0.0
    fitting = _fitting((low - base) / written.scale, (high - base) / written.scale, p.P_0, p.P_S)
    grade: Grade = "bad" if high < p.P_0 or high > HIGHEST * p.P_S or fitting else "suspect"
    guess = f"it looks like {' or '.join(fitting)}: give that unit" if fitting else "check its unit and its zero"
    sentence = (
        f"pressure_a ranges from {value} Pa, which is not an absolute pressure between ambient ({p.P_0:.4g} Pa) and "
        f"supply ({p.P_S:.4g} Pa); a fit that uses it is wrong; {guess} in the column heading or in the channel map."
    )
    return Check(CHECK, f"{value} Pa", grade, sentence)


def _fitting(low: float, high: float, ambient: float, supply: float) -> list[str]:
    """Units in which the range would be plausible; of these, the ones whose lowest pressure is nearest to ambient.

    `low` and `high` are as written in the file.
    """
    lowest = {}
    for name in known_units("Pa"):
        offset = ambient if UNITS[name].gauge else 0.0
        in_pascal = UNITS[name].scale * low + offset, UNITS[name].scale * high + offset
        if _plausible(*in_pascal, ambient, supply) and in_pascal[1] - in_pascal[0] > STROKE * (supply - ambient):
            lowest[name] = abs(in_pascal[0] - ambient)
    return [name for name, distance in lowest.items() if distance <= min(lowest.values()) + 1.0]


def _plausible(low: float, high: float, ambient: float, supply: float) -> bool:
    return LOWEST * ambient < low and ambient < 1.5 * high and high < HIGHEST * supply

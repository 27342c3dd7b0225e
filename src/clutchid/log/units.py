"""Units of the columns of a recording, and their conversion to SI.

A unit library is not used because ``kPa(g)`` must mean gauge pressure, not kilopascal times gram.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError


@dataclass(frozen=True, slots=True)
class ScaledUnit:
    """A unit as an affine map to SI: ``si = scale * value + offset``, plus the ambient pressure where `gauge`."""

    si: str
    scale: float
    offset: float = 0.0
    gauge: bool = False


_PRESSURES = {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "bar": 1e5, "psi": 6894.757293168361}

UNITS: dict[str, ScaledUnit] = {
    "s": ScaledUnit("s", 1.0),
    "ms": ScaledUnit("s", 1e-3),
    "us": ScaledUnit("s", 1e-6),
    "µs": ScaledUnit("s", 1e-6),
    "ns": ScaledUnit("s", 1e-9),
    "100ns": ScaledUnit("s", 1e-7),
    "min": ScaledUnit("s", 60.0),
    "h": ScaledUnit("s", 3600.0),
    "d": ScaledUnit("s", 86400.0),
    "m": ScaledUnit("m", 1.0),
    "cm": ScaledUnit("m", 1e-2),
    "mm": ScaledUnit("m", 1e-3),
    "um": ScaledUnit("m", 1e-6),
    "µm": ScaledUnit("m", 1e-6),
    "1": ScaledUnit("1", 1.0),
    "%": ScaledUnit("1", 1e-2),
    "m/s": ScaledUnit("m/s", 1.0),
    "mm/s": ScaledUnit("m/s", 1e-3),
    "N": ScaledUnit("N", 1.0),
    "kN": ScaledUnit("N", 1e3),
    "mN": ScaledUnit("N", 1e-3),
    "uN": ScaledUnit("N", 1e-6),
    "µN": ScaledUnit("N", 1e-6),
    "K": ScaledUnit("K", 1.0),
    "degC": ScaledUnit("K", 1.0, 273.15),
    "°C": ScaledUnit("K", 1.0, 273.15),
    **{name: ScaledUnit("Pa", scale) for name, scale in _PRESSURES.items()},
    **{f"{name}(g)": ScaledUnit("Pa", scale, gauge=True) for name, scale in _PRESSURES.items()},
}

_ABSOLUTE_PRESSURES = {
    f"{name}{mark}".casefold(): name for name in _PRESSURES for mark in ("a", "(a)", "abs", "(abs)", "_a", "_abs")
}
_GAUGE_PRESSURES = {
    f"{name}{mark}".casefold(): f"{name}(g)"
    for name in _PRESSURES
    for mark in ("g", "(g)", "gauge", "_g", "rel", "(rel)", "_rel", "ü")
}


def _words(unit: str, spellings: str) -> dict[str, str]:
    return dict.fromkeys(spellings.casefold().split(), unit)


#: Other spellings of these units, in lower case and without blanks. ``MPa`` and ``mPa`` are not distinguished.
SPELLINGS: dict[str, str] = {
    **{name.casefold(): name for name in _PRESSURES},
    **_ABSOLUTE_PRESSURES,
    **_GAUGE_PRESSURES,
    **_words("1", "- [-] ratio fraction"),
    **_words("%", "percent percentage prozent pct"),
    **_words("s", "sec secs sek second seconds sekunde sekunden"),
    **_words("ms", "msec msecs millisec millisecs millisecond milliseconds millisekunde millisekunden"),
    **_words("us", "usec usecs µsec µsecs microsec microsecs microsecond microseconds mikrosekunde mikrosekunden"),
    **_words("ns", "nsec nsecs nanosec nanosecond nanoseconds nanosekunde nanosekunden"),
    **_words("d", "day days tag tage"),
    **_words("min", "mins minute minutes minuten"),
    **_words("h", "hr hrs hour hours stunde stunden"),
    **_words("°C", "°c deg.c celsius c gradc grdc \N{DEGREE CELSIUS}"),
    **_words("degC", "degc"),
    **_words("m", "meter meters metre metres"),
    **_words("cm", "centimeter centimeters centimetre centimetres"),
    **_words("mm", "millimeter millimeters millimetre millimetres"),
    **_words("um", "micrometer micrometers micrometre micrometres micron microns mikrometer"),
    **_words("N", "newton newtons"),
    **_words("kN", "kilonewton kilonewtons"),
    **_words("Pa", "pascal pascals"),
    **_words("kPa", "kilopascal kilopascals"),
    **_words("MPa", "megapascal megapascals"),
    **_words("mbar", "millibar millibars"),
}


def known_units(si: str) -> list[str]:
    """Names of all units of the quantity whose SI unit is `si`."""
    return [name for name, unit in UNITS.items() if unit.si == si]


def to_si(values: NDArray[np.float64], name: str, si: str, ambient: float) -> NDArray[np.float64]:
    """Convert `values` from the unit `name` to the SI unit `si`; `ambient` in Pa is added to gauge pressures.

    Values already in SI are returned without a copy.

    Raises
    ------
    DataError
        If `name` is not a unit of that quantity; the text lists the known ones.

    Examples
    --------
    >>> to_si(np.array([7.905]), "bar(g)", "Pa", 1.095e5)
    array([900000.])
    """
    unit = UNITS.get(name)
    if unit is None or unit.si != si:
        raise DataError(f"unit [{name}] is not known here; use one of {', '.join(known_units(si))}.")
    offset = unit.offset + (ambient if unit.gauge else 0.0)
    return values if (unit.scale, offset) == (1.0, 0.0) else values * unit.scale + offset

"""Ranges of channels, and the units that they suggest."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import islice
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from clutchid.log.units import UNITS
from clutchid.measurements.clock import usual_interval
from clutchid.measurements.columns import QUANTITIES
from clutchid.measurements.source import Source

#: Number of samples that determine the range of a channel; a constant one is read on for as many blocks.
_SAMPLED = 1 << 16
_BLOCKS = 64

#: An absolute pressure does not fall below this, in Pa; a gauge pressure is near 0 at rest.
_LOWEST_ABSOLUTE = 5e4


#: Range in SI of each condition of a recording: an air supply between its warning and its safety valve, and the air
#: temperatures that trucks are built for, with a margin: -60 to 90 degC.
PLAUSIBLE: Mapping[str, tuple[float, float]] = MappingProxyType(
    {"pressure_supply": (3e5, 1.6e6), "temperature_ambient": (213.15, 363.15)}
)


class Range(NamedTuple):
    """Lowest and highest of the first samples of a channel (NaN: none), and their usual increase.

    `constant` says whether they are all the same, `switched` whether they are 0 and 1 only.
    """

    low: float
    high: float
    step: float
    constant: bool
    switched: bool = False


def range_of(source: Source, raster: int, index: int, *, further: bool = True) -> Range:
    """Range of one channel of the time grid with the index `raster`; `further`: see whether it stays constant."""
    span = Range(math.nan, math.nan, math.inf, constant=False)
    for table in islice(source.tables(raster, [index], _SAMPLED), _BLOCKS if further else 1):
        values = table.numbers.get(index, np.empty(0))
        finite = values[np.isfinite(values)]
        if finite.size:
            low, high = np.fmin(span.low, finite.min()), np.fmax(span.high, finite.max())
            switched = (span.switched or math.isnan(span.low)) and bool(np.isin(finite, (0.0, 1.0)).all())
            constant = bool(low == high and finite.size > 1)
            span = Range(float(low), float(high), usual_interval(finite), constant, switched)
        if span.low < span.high:
            break
    return span


def guessed_unit(name: str, span: Range) -> str | None:
    """Unit of the quantity `name` that matches the range of a channel; None if unclear.

    Examples
    --------
    >>> guessed_unit("position", Range(0.0, 21.0, 0.1, False)), guessed_unit("pressure_a", Range(0.01, 7.9, 0.1, False))
    ('mm', 'bar(g)')
    """
    low, high, step = span[:3]
    if not (math.isfinite(low) and math.isfinite(high)):
        return None
    size = max(abs(low), abs(high))
    guess: dict[str, Callable[[], str | None]] = {
        "s": lambda: (
            "100ns"
            if _FILE_TIMES[0] < low < _FILE_TIMES[1]
            else next((unit for unit, least, most in _INTERVALS if least <= step < most), None)
        ),
        "m": lambda: "m" if size < 0.3 else "mm" if 1.0 < size < 500.0 else None,
        "1": lambda: "1" if low >= 0.0 and high <= 1.0 else "%" if low >= 0.0 and 1.0 < high <= 100.0 else None,
        "Pa": lambda: "Pa" if size > 5e4 else "kPa" if 50.0 < size < 2000.0 else "bar" if 0.5 < size < 20.0 else None,
        "K": lambda: "K" if low > 150.0 else "degC" if low >= -60.0 and high < 90.0 else None,
    }
    chosen = guess.get(QUANTITIES[name])
    unit = chosen() if chosen else None
    return gauge_unit(unit, low) or unit


#: Whole numbers of 100 ns since 1601, as Windows counts, from 1994 to 2058.
_FILE_TIMES = (1.24e17, 1.44e17)

#: Units of time, from the shortest to the longest interval of a recording in each.
_INTERVALS = (("d", 2e-9, 2.5e-6), ("s", 1e-5, 0.5), ("ms", 0.5, 200.0), ("us", 200.0, 2e5), ("ns", 2e5, 2e8))


def gauge_unit(unit: str | None, low: float) -> str | None:
    """The gauge unit of a pressure whose lowest value, in `unit`, is below every absolute pressure; else None."""
    pressure = UNITS.get(unit or "")
    if pressure is None or pressure.si != "Pa" or pressure.gauge or not abs(low) * pressure.scale < _LOWEST_ABSOLUTE:
        return None
    return f"{unit}(g)"

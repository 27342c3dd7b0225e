"""What can be measured, one row a column: the state behind it and its sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """The sensor of a measured column, in SI.

    Parameters
    ----------
    state
        Symbol of the state that it measures.
    lag, offset
        Parameters of a lag of first order and of an offset, see `clutchid.simulation.sensors`.
    noise
        Standard deviation of a sample, what is usual for the sensors of trucks (docs/truck.md).
    first_scale
        By what residuals are divided before their own size is known.
    shown
        Unit for people, and how many of it a unit in SI is.
    """

    state: str
    lag: str
    offset: str
    noise: float
    first_scale: float
    shown: tuple[str, float]


#: All columns that a fit can be compared with, in the order in which the kernels take them.
MEASURED: Mapping[str, Sensor] = MappingProxyType({
    "position": Sensor(state="y", lag="tau_y", offset="e_y", noise=5e-5, first_scale=1e-4, shown=("mm", 1e3)),
    "pressure_a": Sensor(state="p_A", lag="tau_p", offset="e_p", noise=3e3, first_scale=1e4, shown=("kPa", 1e-3)),
})  # fmt: skip

#: Parameters of sensors, which the equations of an actuator do not hold.
SENSOR_PARAMETERS = tuple(name for sensor in MEASURED.values() for name in (sensor.lag, sensor.offset))

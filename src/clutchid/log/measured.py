"""Columns that can be measured: one row each, with the state and its sensor."""

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
        Symbol of the measured state.
    lag, offset
        Parameters of its first-order lag and offset, see `clutchid.simulation.sensors`.
    noise
        Standard deviation of a sample, typical of truck sensors (docs/truck.md).
    first_scale
        Scale of the residuals before their size is known.
    shown
        Unit for the user, and its factor from SI.
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

#: All sensors: those, and that of the vehicle's air supply, which an observer corrects by while no valve is open; both
#: pressure sensors are taken to be as slow.
SENSORS: Mapping[str, Sensor] = MappingProxyType({
    **MEASURED,
    "pressure_supply": Sensor(
        state="p_S", lag="tau_p", offset="e_p", noise=3e3, first_scale=1e4, shown=("kPa", 1e-3)
    ),
})  # fmt: skip

#: Parameters of sensors, which are not in the equations of an actuator.
SENSOR_PARAMETERS = tuple(dict.fromkeys(name for sensor in SENSORS.values() for name in (sensor.lag, sensor.offset)))

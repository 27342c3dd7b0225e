"""States of the models and columns that can be measured: one row each, with all but the equation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Time in s over which the process noise accumulates to `State.noise`.
NOISE_SPAN = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """One state of a model, in SI.

    Parameters
    ----------
    unit, meaning
        For the user; `meaning` is a noun phrase.
    column
        Name of its column in a `Log`.
    scale
        Natural size, above 0; makes steps and derivatives of a search dimensionless.
    noise
        Standard deviation of the process noise over `NOISE_SPAN`: stick-slip, ripple and heat that the model lacks.
    start, unknown_start
        Prior standard deviation at the start of a recording that is vented and at rest, and of any other.
    starts_at
        Parameter that is its initial value; 0 without one.
    step
        Scale of the damping of window starts, in standard deviations.
    fast
        A large rate of change, in its unit per second.
    """

    unit: str
    meaning: str
    column: str
    scale: float
    noise: float
    start: float
    unknown_start: float
    starts_at: str | None = None
    step: float = 30.0
    fast: float

    @property
    def rate_unit(self) -> str:
        """Unit of its rate of change."""
        return "m/s²" if self.unit == "m/s" else f"{self.unit}/s"


#: All states by symbol. Natural sizes and standard deviations are those of a truck's clutch actuator: estimated from
#: its sensors and manoeuvres, and checked on the proving ground (docs/truck.md).
STATES: Mapping[str, State] = MappingProxyType({
    "y": State(
        unit="m", meaning="position of the piston", column="position",
        scale=1e-3, noise=2e-6, start=5e-5, unknown_start=1e-3, step=60.0, fast=0.25,
    ),
    "v": State(
        unit="m/s", meaning="velocity of the piston", column="velocity",
        scale=0.1, noise=2e-3, start=1e-3, unknown_start=0.05, step=15.0, fast=25.0,
    ),
    "p_A": State(
        unit="Pa", meaning="pressure in chamber A", column="pressure_a",
        scale=1e5, noise=300.0, start=500.0, unknown_start=1e5, starts_at="P_0", fast=9e6,
    ),
    "p_B": State(
        unit="Pa", meaning="pressure in chamber B", column="pressure_b",
        scale=1e4, noise=200.0, start=500.0, unknown_start=500.0, starts_at="P_0", fast=9e6,
    ),
    "z": State(
        unit="m", meaning="deflection of the seals", column="deflection",
        scale=1e-4, noise=5e-6, start=1e-4, unknown_start=3e-4, fast=0.25,
    ),
    "T_A": State(
        unit="K", meaning="temperature of the air in chamber A", column="temperature_a",
        scale=10.0, noise=0.5, start=3.0, unknown_start=3.0, starts_at="T_w", step=3.0, fast=1e3,
    ),
    "T_B": State(
        unit="K", meaning="temperature of the air in chamber B", column="temperature_b",
        scale=10.0, noise=0.5, start=3.0, unknown_start=3.0, starts_at="T_w", step=3.0, fast=1e3,
    ),
    "p_S": State(
        unit="Pa", meaning="pressure in the supply reservoir", column="pressure_supply",
        scale=1e5, noise=1500.0, start=2e4, unknown_start=2e4, starts_at="P_S", step=3.0, fast=9e6,
    ),
    "p_G": State(
        unit="Pa", meaning="pressure at the governor", column="pressure_governor",
        scale=1e5, noise=2000.0, start=2e4, unknown_start=2e4, starts_at="P_S", step=3.0, fast=9e6,
    ),
    "z_h": State(
        unit="m", meaning="deflection of release bearing and fork", column="deflection_bearing",
        scale=1e-4, noise=5e-6, start=1e-4, unknown_start=1e-4, fast=0.25,
    ),
    "x_vs": State(
        unit="1", meaning="position of the supply valve's spool", column="spool_supply",
        scale=0.1, noise=1e-3, start=1e-2, unknown_start=0.1, fast=1e3,
    ),
    "x_ve": State(
        unit="1", meaning="position of the exhaust valve's spool", column="spool_exhaust",
        scale=0.1, noise=1e-3, start=1e-2, unknown_start=0.1, fast=1e3,
    ),
})  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnSensor:
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
MEASURED: Mapping[str, ColumnSensor] = MappingProxyType({
    "position": ColumnSensor(state="y", lag="tau_y", offset="e_y", noise=5e-5, first_scale=1e-4, shown=("mm", 1e3)),
    "pressure_a": ColumnSensor(state="p_A", lag="tau_p", offset="e_p", noise=3e3, first_scale=1e4, shown=("kPa", 1e-3)),
})  # fmt: skip

#: All sensors: those, and that of the vehicle's air supply, which an observer corrects by while no valve is open; both
#: pressure sensors are taken to be as slow.
SENSORS: Mapping[str, ColumnSensor] = MappingProxyType({
    **MEASURED,
    "pressure_supply": ColumnSensor(
        state="p_S", lag="tau_p", offset="e_p", noise=3e3, first_scale=1e4, shown=("kPa", 1e-3)
    ),
})  # fmt: skip

#: Parameters of sensors, which are not in the equations of an actuator.
SENSOR_PARAMETERS = tuple(dict.fromkeys(name for sensor in SENSORS.values() for name in (sensor.lag, sensor.offset)))

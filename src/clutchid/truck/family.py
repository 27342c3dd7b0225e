"""`Family`: functions of a family of trucks, and the changes between calibration and use; everything else is shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.truck.compiled import Loop
from clutchid.truck.load_table import LoadTable
from clutchid.truck.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Family:
    """Functions of a family; trucks are of the type `kind`, and their ranges are in the file `ranges`.

    `prepared` completes drawn numbers before the shares are drawn, `finished` after them. `load_curve` gives the load
    of a truck. `states` names the states of its plant, `loop` are the parts of its compiled loop, whose
    arrays are filled by `at_rest` (truck, curve), `plant_parameters` (truck) and `settings` (truck, zero, working).
    `start` draws initial states and whether a compressor runs, `position_noise` and `measured_pressure` belong to the
    sensors. `true_states` are the columns of the truth, from a truck and the states of a run. `changes` are the changes
    between calibration and use, by name.
    """

    kind: type[Vehicle]
    ranges: Path
    prepared: Callable[[dict[str, Any]], dict[str, Any]]
    finished: Callable[[dict[str, Any]], dict[str, Any]]
    load_curve: Callable[[Any], LoadTable]
    states: tuple[str, ...]
    loop: Loop
    at_rest: Callable[[Any, LoadTable], FloatArray]
    plant_parameters: Callable[[Any], FloatArray]
    settings: Callable[[Any, float, bool], FloatArray]
    start: Callable[[Any, LoadTable, np.random.Generator], tuple[FloatArray, bool]]
    position_noise: Callable[[Any, int, np.random.Generator], FloatArray]
    measured_pressure: Callable[[Any, FloatArray, np.random.Generator], FloatArray]
    true_states: Callable[[Any, Mapping[str, FloatArray]], dict[str, FloatArray]]
    changes: Mapping[str, Callable[[Any], Vehicle]]


#: Named changes and what they are: those whose effect on a calibrated reading is to be known.
CHANGES: Mapping[str, str] = MappingProxyType(
    {
        "supply": "supply pressure 5 % lower",
        "cold": "30 K colder, viscous friction of the grease doubled",
        "warm": "30 K warmer, viscous friction of the grease 0.6 times as large",
        "valves": "valves pass 7 % less and are 20 % slower",
        "seals": "friction of the seals 40 % larger",
    }
)

#: Factors of the supply pressure, of the valves' flow and times, and of the friction of the seals.
_SUPPLY, _FLOW, _TIMES, _SEALS = 0.95, 0.93, 1.2, 1.4
#: Change of temperature in K, and factor of the viscous friction that belongs to it.
_COLD, _WARM = (-30.0, 2.0), (30.0, 0.6)


def changes_of(
    viscosity: Callable[[Any], float], *, passing: Sequence[str], times: Sequence[str], friction: Sequence[str]
) -> Mapping[str, Callable[[Any], Vehicle]]:
    """The changes as functions from a truck to the changed truck.

    Parameters
    ----------
    viscosity
        Viscous friction of a truck at its temperature, relative to a fixed one.
    passing, times, friction
        Names of the parameters that the flow of the valves, their times and the friction of the seals scale with.
    """
    return MappingProxyType(
        {
            "supply": lambda truck: scaled(truck, ("P_S",), _SUPPLY),
            "cold": lambda truck: at_temperature(truck, viscosity, *_COLD),
            "warm": lambda truck: at_temperature(truck, viscosity, *_WARM),
            "valves": lambda truck: scaled(scaled(truck, passing, _FLOW), times, _TIMES),
            "seals": lambda truck: scaled(truck, friction, _SEALS),
        }
    )


def scaled(truck: Vehicle, names: Sequence[str], factor: float) -> Vehicle:
    """`truck` with the parameters `names` multiplied by `factor`."""
    return truck.replace({name: getattr(truck, name) * factor for name in names})


def at_temperature(truck: Vehicle, viscosity: Callable[[Any], float], change: float, factor: float) -> Vehicle:
    """`truck` warmer by `change` in K, with `factor` times its viscous friction: the grease's own law and the rest."""
    other = truck.replace({"T_0": truck.T_0 + change})
    return scaled(other, ("D_v",), factor * viscosity(truck) / viscosity(other))
